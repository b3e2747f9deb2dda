"""Damped Newton on a collocated boundary value problem, judged by the size of its steps.

The residual of a boundary value problem says little about the distance to its solution; the Newton step is
that distance, to first order, whatever the units (Deuflhard, Newton Methods for Nonlinear Problems, 2004,
section 3).
"""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from gen_profile.profile import Array
from gen_profile.solvers.collocation import Trajectory

TOLERANCE = 1e-7  # relative step after which the next iterate's error is of the order of its square
STALLED = 1e-5  # relative step that is still taken for rounding noise when it ceases to shrink
SMALLEST_DAMPING = 1.0 / 256.0
MAX_ITERATIONS = 60


@attrs.frozen(kw_only=True, eq=False)
class NewtonOutcome:
    """Where the iteration ended; `solution` is None when it did not converge."""

    solution: Trajectory | None
    iterations: int
    residual: float


def solve_newton(iterate: Callable[[Trajectory], Trajectory], guess: Trajectory) -> NewtonOutcome:
    """Iterate from a guess until the step of the states is small.

    Parameters
    ----------
    iterate : Trajectory → Trajectory
        The full Newton iterate; raises `numpy.linalg.LinAlgError` where it does not exist.
    guess : Trajectory
    """
    try:
        current, following = guess, iterate(guess)
    except np.linalg.LinAlgError:
        return NewtonOutcome(solution=None, iterations=1, residual=float("inf"))
    step, damping = _step(current, following), 1.0
    for iteration in range(1, MAX_ITERATIONS + 1):
        if step < TOLERANCE:
            return NewtonOutcome(solution=following, iterations=iteration, residual=step)
        trial = current.blend(following, damping)
        try:
            beyond = iterate(trial)
            trial_step = _step(trial, beyond)
        except np.linalg.LinAlgError:
            trial_step = float("inf")
        if trial_step <= (1.0 - damping / 8.0) * step:
            current, following, step, damping = trial, beyond, trial_step, min(1.0, 2.0 * damping)
        elif step < STALLED:
            return NewtonOutcome(solution=following, iterations=iteration, residual=step)
        else:
            damping /= 2.0
            if damping < SMALLEST_DAMPING:
                break
    return NewtonOutcome(solution=None, iterations=iteration, residual=step)


def _step(current: Trajectory, following: Trajectory) -> float:
    """Root mean square step of the states, each relative to its own greatest value.

    Costates are left out: those of hardly excited modes carry rounding noise that no state feels.
    """
    states = current.size // 2
    before, after = current.nodes[:, :states], following.nodes[:, :states]
    size: Array = np.maximum(np.abs(before).max(axis=0), np.abs(after).max(axis=0))
    relative = (after - before) / np.where(size > 0.0, size, 1.0)
    return float(np.sqrt(np.mean(relative**2)))
