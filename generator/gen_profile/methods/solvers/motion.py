"""From an optimum to a `Profile`: its highest derivative, integrated exactly."""

import math

import attrs
import numpy as np
from numpy.polynomial import polynomial

from gen_profile.methods.solvers.solution import Solution
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec


def optimal_profile(solution: Solution) -> Profile:
    """Integrate the jerk (or snap) of an optimum to positions.

    Position, velocity, acceleration and jerk are derivatives of one another to the last bit that polynomials
    allow. What integration misses of the end conditions is taken off by one polynomial over the whole move.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        When the solution is none.
    """
    optimum, problem = solution.raise_for_status(), solution.problem
    start, target = np.array(problem.start), np.array(problem.target)
    coefficients, ends = optimum.top_derivative, []
    lengths = np.diff(optimum.knots)
    for order in reversed(range(optimum.top_order)):
        coefficients, end = _integrate(coefficients, lengths, start if order == 0 else np.zeros_like(start))
        ends.append(end)
    residual = np.array(ends[::-1])
    residual[0] -= target
    residual[1] -= problem.final_velocity
    return Profile(
        knots=optimum.knots,
        coefficients=coefficients - _closing(residual, optimum.knots, coefficients.shape[1]),
        target=target,
        method="optimal",
        final_velocity=np.array(problem.final_velocity),
    )


def whole_motion(spec: Spec, solution: Solution) -> Profile:
    """Write the motion of a spec's solution with all axes: those that are held stand still, exactly.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        When the solution is none.
    """
    motion, held = optimal_profile(solution), spec.held()
    if not held:
        return motion
    axes = len(spec.move.start)
    moving = [axis for axis in range(axes) if axis not in held]
    given = moving if motion.axes == axes else list(range(motion.axes))
    target, final_velocity = np.array(spec.move.start), np.zeros(axes)
    coefficients = np.zeros((*motion.coefficients.shape[:2], axes))
    coefficients[:, 0] = target
    coefficients[:, :, moving] = motion.coefficients[:, :, given]
    target[moving], final_velocity[moving] = motion.target[given], motion.final_velocity[given]
    return attrs.evolve(motion, coefficients=coefficients, target=target, final_velocity=final_velocity)


def _integrate(coefficients: Array, lengths: Array, initial: Array) -> tuple[Array, Array]:
    """Antiderivative, continuous over the knots, and its value at the end.

    Parameters
    ----------
    coefficients : (segments, order, axes) array
        Lowest power first, in each segment's own time.
    lengths : (segments,) array
    initial : (axes,) array
    """
    powers = np.arange(1, coefficients.shape[1] + 1)
    integral = coefficients / powers[:, None]
    gains = np.einsum("sp,spa->sa", lengths[:, None] ** powers, integral)
    values = initial + np.concatenate([np.zeros_like(gains[:1]), np.cumsum(gains, axis=0)])
    return np.concatenate([values[:-1, None], integral], axis=1), values[-1]


def _closing(residual: Array, knots: Array, size: int) -> Array:
    """Polynomial that rises from rest to the missed derivatives at the end, in each segment's own time.

    Parameters
    ----------
    residual : (orders, axes) array
        Value at the end of the derivatives 0, 1, …
    knots : (segments + 1,) array
    size : int
        Number of coefficients per segment.
    """
    orders, _ = residual.shape
    duration = knots[-1]
    powers = np.arange(orders, 2 * orders)
    falling = np.array([[math.perm(int(p), d) for p in powers] for d in range(orders)], dtype=np.float64)
    scaled = residual * duration ** np.arange(orders)[:, None]
    whole = np.zeros((2 * orders, residual.shape[1]))
    whole[orders:] = np.linalg.solve(falling, scaled)
    local = np.zeros((len(knots) - 1, size, residual.shape[1]))
    for d in range(min(size, 2 * orders)):
        values = polynomial.polyval(knots[:-1] / duration, polynomial.polyder(whole, d))
        local[:, d] = np.asarray(values).T / (math.factorial(d) * duration**d)
    return local
