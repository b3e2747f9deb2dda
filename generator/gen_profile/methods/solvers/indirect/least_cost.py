"""The controls of a linear machine that cost least: a convex problem, solved by damped Newton's method."""

import attrs
import numpy as np

from gen_profile.dynamics.problem.cost import SwayCost
from gen_profile.motion.profile import Array

PARABOLIC = 0.1  # change of the logarithm of the sway's cost, which a parabola follows well
STEEP = 3.0  # growth of the same, beyond which it misleads
STEEP_ITERATIONS = 30  # of Newton's method, each within `STEEP`


@attrs.frozen(kw_only=True, eq=False)
class LinearMachine:
    """What controls do, and what they cost.

    Attributes
    ----------
    weights : (points,) array
        For integrals over time.
    effort : (points · m,) array
        Second derivative of the effort by every control, times the weights.
    gain : (points, outputs, points · m) array
        Change of what is costed by the controls: the end load's sway, then what costs half its square.
    conditions : (conditions, points · m) array
        Change of the end conditions by the controls.
    """

    weights: Array
    effort: Array
    gain: Array
    conditions: Array


def least_cost(
    machine: LinearMachine, cost: SwayCost, sway: Array, *, moved: Array, slope: Array, missing: Array
) -> tuple[Array, Array, Array]:
    """Minimise the cost under end conditions.

    Parameters
    ----------
    machine : LinearMachine
    cost : SwayCost
    sway : (points, sways) array
        Before anything changes, in m.
    moved : (points, outputs) array
        Change of what is costed that comes without controls.
    slope : (points · m,) array
        Of the rest of the cost by the controls, before they change.
    missing : (conditions,) array
        What the end conditions shall change by.

    Returns
    -------
    controls : (points · m,) array
        Changes of the controls.
    multipliers : (conditions,) array
        Of the end conditions.
    pull : (points, outputs) array
        Change of the cost's slope by what is costed, times the weights.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the conditions contradict one another.
    """
    sways, size, (before, _) = sway.shape[1], len(slope), cost.derivatives(sway)
    gain, weights = machine.gain.reshape(-1, size), machine.weights[:, None]
    controls, outputs = np.zeros(size), moved.copy()
    stiffness = np.broadcast_to(np.eye(moved.shape[1]), (*moved.shape, moved.shape[1])).copy()
    for _ in range(STEEP_ITERATIONS):
        reached = sway + outputs[:, :sways]
        pull, (slopes, stiffness[:, :sways, :sways]) = outputs.copy(), cost.derivatives(reached)
        pull[:, :sways] = slopes - before
        pulled = (weights[..., None] * stiffness) @ machine.gain
        hessian = gain.T @ pulled.reshape(gain.shape)
        hessian.flat[:: size + 1] += machine.effort
        change, multipliers = _newton_step(
            hessian,
            slope + machine.effort * controls + gain.T @ (weights * pull).ravel(),
            machine.conditions,
            missing - machine.conditions @ controls,
        )
        step = (gain @ change).reshape(outputs.shape)
        growth = cost.exponents(reached + step[:, :sways]) - cost.exponents(reached)
        fraction = min(1.0, STEEP / max(growth.max(), STEEP))
        controls += fraction * change
        outputs += fraction * step
        pull += (stiffness @ step[..., None])[..., 0]
        if np.abs(growth).max() <= PARABOLIC or cost.beta == 0.0:
            break
    return controls, multipliers, weights * pull


def _newton_step(hessian: Array, slope: Array, conditions: Array, missing: Array) -> tuple[Array, Array]:
    """Minimise ``½ vᵀ H v + sᵀ v`` where ``C v = c``: v and the multipliers."""
    size, count = len(hessian), len(conditions)
    matrix = np.zeros((size + count, size + count))
    matrix[:size, :size] = hessian
    matrix[size:, :size], matrix[:size, size:] = conditions, conditions.T
    solution = np.linalg.solve(matrix, np.concatenate([-slope, missing]))
    return solution[:size], solution[size:]
