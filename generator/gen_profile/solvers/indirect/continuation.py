"""Numerical continuation: from a problem that is easily solved to the one that was asked for.

The problem depends on a share from 0 to 1. Every solution found and the one before it predict the next; how
far to go is learned from Newton's success (Allgower and Georg, Numerical Continuation Methods, 1990,
chapter 6).
"""

from __future__ import annotations

from collections.abc import Callable

import attrs

from gen_profile.solvers.collocation import Trajectory
from gen_profile.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.solvers.indirect.newton import solve_newton

SMALLEST_ADVANCE = 1.0 / 32.0
QUICK = 5  # Newton iterations after which the next advance may be twice as long


@attrs.frozen(kw_only=True, eq=False)
class Advance:
    """How far a continuation came, and its solution there.

    Attributes
    ----------
    solution : Trajectory
    reached : float
        Share of the way, 1 at its end.
    iterations : int
        Newton iterations, failed attempts included.
    residual : float
        Last Newton step.
    """

    solution: Trajectory
    reached: float
    iterations: int
    residual: float


def advance(
    problem_at: Callable[[float], BoundaryValueProblem], guess: Trajectory, start: Trajectory | None = None
) -> Advance:
    """Solve the problem at share 1, through problems nearer to 0 where Newton needs them.

    Parameters
    ----------
    problem_at : share → BoundaryValueProblem
    guess : Trajectory
        For share 1.
    start : Trajectory, optional
        Solution at share 0 on the same mesh; the guess itself by default.
    """
    latest, before = (0.0, start or guess), (1.0, guess)  # the guess ahead predicts as well as one behind
    length, iterations, residual = 1.0, 0, float("inf")
    while latest[0] < 1.0 and length >= SMALLEST_ADVANCE:
        share = min(1.0, latest[0] + length)
        outcome = solve_newton(problem_at(share), _line(before, latest, share))
        iterations += outcome.iterations
        if outcome.solution is None:
            length /= 2.0
            continue
        before, latest, residual = latest, (share, outcome.solution), outcome.residual
        if outcome.iterations <= QUICK:
            length *= 2.0
    return Advance(solution=latest[1], reached=latest[0], iterations=iterations, residual=residual)


def _line(one: tuple[float, Trajectory], other: tuple[float, Trajectory], share: float) -> Trajectory:
    """Extend the line through two solutions."""
    return one[1].blend(other[1], (share - one[0]) / (other[0] - one[0]))
