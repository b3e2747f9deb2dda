"""Many machines integrated at once by Gauss collocation: all nodes of a step in one call.

Over a step the accelerations are a polynomial through Gauss's nodes, which is integrated twice exactly. They
are found by a Newton iteration with the stiffness and damping of the machines at rest, which small swings
need three or four times. (E. Hairer, S. Nørsett, G. Wanner, Solving ordinary differential equations I, II.7.)
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import attrs
import numpy as np
from numpy.polynomial import legendre

from gen_profile.errors import CosimulationError
from gen_profile.motion.profile import Array

NODES = 12
PHASE = 3.0  # rad of a machine's fastest mode that a step covers at first
MOST_ITERATIONS = 12  # after which a step is halved
SHORTEST = 1e-9  # of the whole time: a step that must be shorter fails
TAIL = 2  # highest coefficients of a step's polynomial, which tell how well it converges

Accelerations = Callable[[Array], Callable[[Array, Array], Array]]
Linear = Callable[[float], tuple[Array, Array]]


def _integrals(order: int) -> Array:
    """Matrix that integrates Legendre coefficients over [0, 1] from 0, shape (order + 1, order)."""
    return np.stack([0.5 * legendre.legint(unit, lbnd=-1) for unit in np.eye(order)], axis=1)


_POINTS = legendre.leggauss(NODES)[0]
TIMES: Array = 0.5 * (_POINTS + 1.0)  # of the nodes, in steps
_TO_COEFFICIENTS = np.linalg.inv(legendre.legvander(_POINTS, NODES - 1))
_ONCE = _integrals(NODES) @ _TO_COEFFICIENTS  # accelerations → coefficients of the velocity
_TWICE = _integrals(NODES + 1) @ _ONCE  # accelerations → coefficients of the position
_VELOCITY = legendre.legvander(_POINTS, NODES) @ _ONCE  # accelerations → velocities at the nodes
_POSITION = legendre.legvander(_POINTS, NODES + 1) @ _TWICE


@attrs.frozen(kw_only=True, eq=False)
class Trajectories:
    """Positions and velocities of many coordinates as polynomials of each step.

    Attributes
    ----------
    knots : (steps + 1,) array
        s, rising.
    position, velocity : (steps, powers, coordinates) arrays
        Legendre coefficients over each step.
    """

    knots: Array
    position: Array
    velocity: Array

    def __call__(self, times: Array) -> Array:
        """Evaluate at rising times in s, shape (2, times, coordinates): positions and velocities."""
        found = np.empty((2, len(times), self.position.shape[-1]))
        step = np.clip(np.searchsorted(self.knots, times, side="right") - 1, 0, len(self.knots) - 2)
        begin, end = self.knots[step], self.knots[step + 1]
        powers = legendre.legvander(2.0 * (times - begin) / (end - begin) - 1.0, NODES + 1)
        edges = np.searchsorted(step, np.arange(len(self.knots)))
        for number, (first, last) in enumerate(pairwise(edges)):
            here = slice(first, last)
            found[0, here] = powers[here] @ self.position[number]
            found[1, here] = powers[here, : NODES + 1] @ self.velocity[number]
        return found


def integrate(
    accelerations: Accelerations,
    linear: Linear,
    start: Array,
    stretches: Array,
    *,
    fastest: float,
    accuracy: float,
    least: float,
    what: str,
) -> Trajectories:
    """Integrate from time to time, in steps that are halved until they are accurate.

    Parameters
    ----------
    accelerations : (nodes,) array → two (nodes, machines n_u) arrays → (nodes, machines n_u) array
        Of times in s, then of coordinates and their rates at these.
    linear : float → two (machines, n_u, n_u) arrays
        Stiffness in 1/s² and damping in 1/s of every machine at rest, at a time in s.
    start : (2, machines n_u) array
        Coordinates and rates at the first time.
    stretches : (k,) array
        Rising times in s between which everything is smooth.
    fastest : float
        Greatest rate of change of any machine in 1/s.
    accuracy, least : float
        Error of a step that is allowed, relative to the coordinates and at least.
    what : str
        For errors.

    Raises
    ------
    CosimulationError
        It fails, as when a load is thrown over.
    """
    step = _CollocationStep(accelerations, linear, accuracy, least)
    waiting = [
        pair
        for first, last in pairwise(stretches.tolist())
        for pair in pairwise(np.linspace(first, last, 2 + int((last - first) * fastest / PHASE)).tolist())
    ]
    waiting.reverse()
    shortest = SHORTEST * float(stretches[-1] - stretches[0])
    knots, pieces, (q, v) = [float(stretches[0])], [], start
    while waiting:
        begin, end = waiting.pop()
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is halved
            found = step.take(begin, end - begin, q, v)
        if found is None:
            middle = 0.5 * (begin + end)
            if end - begin < shortest:
                raise CosimulationError(f"The {what} cannot be integrated beyond {begin:.4g} s.")
            waiting += [(middle, end), (begin, middle)]
            continue
        knots.append(end)
        pieces.append(found)
        q, v = (coefficients.sum(axis=0) for coefficients in found)  # Legendre polynomials end at 1
    position, velocity = map(np.array, zip(*pieces, strict=True))
    return Trajectories(knots=np.array(knots), position=position, velocity=velocity)


class _CollocationStep:
    """One step, tried; what a Newton step needs is kept for others of the same length."""

    def __init__(self, accelerations: Accelerations, linear: Linear, accuracy: float, least: float) -> None:
        self._accelerations, self._linear = accelerations, linear
        self._accuracy, self._least = accuracy, least
        self._asked: Array = np.empty(0)
        self._inverse: Array = np.empty(0)

    def take(self, begin: float, length: float, q: Array, v: Array) -> tuple[Array, Array] | None:
        """Find the coefficients of coordinates and rates, each (powers, machines n_u); None if in vain."""
        self._prepare(begin + 0.5 * length, length)
        accelerations = self._accelerations(begin + length * TIMES)
        drift = q + (length * TIMES)[:, None] * v
        allowed = self._least + self._accuracy * float(np.abs(q).max() + length * np.abs(v).max())
        twice, once = length**2 * _POSITION, length * _VELOCITY
        a = np.zeros((NODES, len(q)))
        for _ in range(MOST_ITERATIONS):
            change = self._solved(accelerations(drift + twice @ a, v + once @ a) - a)
            a += change
            moved = length**2 * float(np.abs(change).max())
            if not moved < np.inf:
                return None
            if moved <= 0.1 * allowed:
                break
        else:
            return None
        position, velocity = length**2 * _TWICE @ a, length * _ONCE @ a
        if float(np.abs(position[-TAIL:]).max()) > allowed:
            return None
        position[0] += q + 0.5 * length * v
        position[1] += 0.5 * length * v
        velocity[0] += v
        return position, velocity

    def _prepare(self, time: float, length: float) -> None:
        """Invert the Newton matrix I + h² A² K + h A C of every machine, unless that is known."""
        stiffness, damping = self._linear(time)
        length = float(np.float32(length))  # lengths of one stretch differ by rounding
        asked = np.concatenate([[length], stiffness.ravel(), damping.ravel()])
        if np.array_equal(asked, self._asked):
            return
        machines, n_u = stiffness.shape[:2]
        size = NODES * n_u
        matrix = np.einsum("ij,muv->miujv", length**2 * _POSITION, stiffness)
        matrix += np.einsum("ij,muv->miujv", length * _VELOCITY, damping)
        self._inverse = np.linalg.inv(np.eye(size) + matrix.reshape(machines, size, size))
        self._asked = asked

    def _solved(self, residual: Array) -> Array:
        """Solve for the change of all machines' accelerations."""
        machines = len(self._inverse)
        flat = residual.reshape(NODES, machines, -1).swapaxes(0, 1).reshape(machines, -1, 1)
        solved = (self._inverse @ flat).reshape(machines, NODES, -1)
        return np.asarray(solved.swapaxes(0, 1).reshape(residual.shape))
