"""Damped Newton on a collocated boundary value problem, judged by the size of its steps.

The residual of a boundary value problem says little about the distance to its solution; the Newton step is
that distance, to first order, whatever the units. A damped step is taken if it shortens the next step, or at
least the simplified one, which the old Jacobian gives (the natural monotonicity test: Deuflhard, Newton
Methods for Nonlinear Problems, 2004, section 3.3).
"""

import attrs
import numpy as np

from gen_profile.methods.solvers.collocation import Trajectory
from gen_profile.methods.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.motion.profile import Array

ROUNDING_STEP = 1e-5  # step that is taken for rounding noise when it ceases to shrink
SLOWER_THAN_NEWTON = 0.5  # fraction of the step before that is no longer Newton's convergence
SMALLEST_DAMPING = 1.0 / 16.0  # below which the motion is not near enough for Newton's method


@attrs.frozen(kw_only=True, eq=False)
class NewtonOutcome:
    """Where the iteration ended; `solution` is None when it did not converge."""

    solution: Trajectory | None
    iterations: int
    residual: float


@attrs.frozen(kw_only=True, eq=False)
class _Iterate:
    """A trajectory, the canonical equations linearised about it, and where a full Newton step leads."""

    trajectory: Trajectory
    flow: Array
    following: Trajectory
    step: float


def solve_newton(problem: BoundaryValueProblem, guess: Trajectory) -> NewtonOutcome:
    """Iterate from a guess until the step is small, as `BoundaryValueProblem.distance` measures it.

    Parameters
    ----------
    problem : BoundaryValueProblem
    guess : Trajectory
    """
    current, damping, before = _iterate(problem, guess), 1.0, 1.0  # of the motion's size
    if current is None:
        return NewtonOutcome(solution=None, iterations=1, residual=float("inf"))
    for iteration in range(1, problem.options.max_iterations + 1):
        # to the solution, as the last steps let it be foreseen
        distance = current.step * min(current.step / before, 1.0)
        if distance < problem.options.tolerance:
            return NewtonOutcome(solution=current.following, iterations=iteration, residual=current.step)
        trial = _iterate(problem, current.trajectory.blend(current.following, damping))
        if trial is not None and _shortens(problem, current, trial, damping):
            stalled = trial.step < ROUNDING_STEP and trial.step > SLOWER_THAN_NEWTON * current.step
            current, damping, before = trial, min(1.0, 2.0 * damping), current.step
        else:
            stalled, damping = current.step < ROUNDING_STEP, damping / 2.0
        if stalled:
            return NewtonOutcome(solution=current.following, iterations=iteration, residual=current.step)
        if damping < SMALLEST_DAMPING:
            break
    return NewtonOutcome(solution=None, iterations=iteration, residual=current.step)


def _iterate(problem: BoundaryValueProblem, trajectory: Trajectory) -> _Iterate | None:
    """Take a full Newton step, if there is one."""
    try:
        flow = problem.flow(trajectory.points)
        following = problem.solve_linear(flow, trajectory)
    except np.linalg.LinAlgError:
        return None
    return _Iterate(
        trajectory=trajectory, flow=flow, following=following, step=problem.distance(trajectory, following)
    )


def _shortens(problem: BoundaryValueProblem, current: _Iterate, trial: _Iterate, damping: float) -> bool:
    """Apply the monotonicity tests to the damped step that led to `trial`."""
    upper = (1.0 - damping / 4.0) * current.step
    if trial.step <= upper:
        return True
    mixed = np.concatenate([trial.flow[..., :1], current.flow[..., 1:]], axis=-1)
    simplified = problem.solve_linear(mixed, trial.trajectory)
    return problem.distance(trial.trajectory, simplified) <= upper
