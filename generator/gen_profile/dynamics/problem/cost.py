"""What a motion costs: the effort of its axes, and sway on the way.

Axes may move in metres and radians, or by very different distances. The cost weighs the effort of each
relative to its own move, in units of the first axis: ``½ Σ (uᵢ · reach₁ / reachᵢ)²``. One axis alone has
weight 1. Sway costs β exp((γ d)²) of eq. (26).
"""

import attrs
import numpy as np

from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.motion.profile import Array

HELD = 0.01  # of the longest move


def axis_reach(problem: Problem) -> Array:
    """Measure every axis by its move, shape (m,), in m or rad.

    An axis that ends where it began, but may be needed on the way, is measured by the move that would swing
    the load as much as the others' moves do, or as it swings at the start. Where it cannot swing the load, as
    a hoist cannot, it is all but held: free to move as far as the others, it would pull up the load rather
    than calm it.
    """
    speed = np.abs(np.array(problem.final_velocity))
    way = np.maximum(np.abs(np.array(problem.distance)), problem.duration * speed)
    middle = (np.array(problem.start) + np.array(problem.target)) / 2.0
    linear = linearize(problem.plant, problem.parameters, middle)
    gain = np.linalg.norm(linear.input, axis=0)
    q_u, dq_u = np.split(initial_state(problem.plant, problem.initial), 2)
    swing = max((gain * way).max(), np.linalg.norm(np.hypot(q_u, dq_u / linear.frequencies[0])))
    equivalent = np.where(gain > 0.0, swing / np.where(gain > 0.0, gain, 1.0), 0.0)
    equivalent = np.where(equivalent > 0.0, equivalent, HELD * (way.max() or equivalent.max()))
    return np.asarray(np.where(way > 0.0, way, equivalent))


def effort_weights(reach: Array) -> Array:
    """Weigh the square of every axis' effort, shape (m,)."""
    return np.asarray((reach[0] / reach) ** 2)


STEEPEST = 50.0  # exponent beyond which the cost is steep enough


@attrs.frozen(kw_only=True)
class SwayCost:
    """β and γ, resolved; sways are arrays (points, directions) in m."""

    beta: float
    gamma: float

    def exponents(self, sway: Array) -> Array:
        """(γ d)², shape (points,)."""
        with np.errstate(over="ignore"):  # of an iterate that diverges
            return np.asarray(self.gamma**2 * (sway**2).sum(axis=1))

    def values(self, sway: Array) -> Array:
        """Evaluate the cost, shape (points,)."""
        return np.asarray(self.beta * np.exp(np.minimum(self.exponents(sway), STEEPEST)))

    def derivatives(self, sway: Array) -> tuple[Array, Array]:
        """Differentiate it once and twice: (points, directions) and (points, directions, directions)."""
        steepness = 2.0 * self.gamma**2 * self.values(sway)[:, None]
        with np.errstate(over="ignore"):
            square = np.eye(sway.shape[1]) + 2.0 * self.gamma**2 * sway[:, :, None] * sway[:, None]
            return steepness * sway, steepness[..., None] * square
