"""Sway on the way: how great it is, and how programs that see it at points keep it between them, too."""

from collections.abc import Callable

import attrs

from gen_profile.dynamics.evaluation.simulation import greatest_sway
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct.goals import WITHIN
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.solution import Solution, Status

SLACK = 1.001  # times what is left to the nominal machine
SWAY_ROUNDS = 4  # to account for what the sway does between collocation points


def sway_on_the_way(solution: Solution) -> float:
    """Greatest sway of the nominal machine's end load during the motion of a solution, in m."""
    problem = solution.problem
    motion = optimal_profile(solution)
    return float(greatest_sway(problem.plant, motion, [problem.parameters], problem.initial)[0])


def within_sway(problem: Problem, attempt: Callable[[float | None], Solution]) -> Solution:
    """Ask for less sway at the collocation points until that between them is within the limit, too.

    Parameters
    ----------
    problem : Problem
        With or without a limit of the sway.
    attempt : float or None → Solution
        Solves with a limit at the collocation points.
    """
    asked = problem.nominal_sway
    for _ in range(SWAY_ROUNDS):
        solution = attempt(asked)
        stricter = to_be_asked(problem, solution, asked)
        if stricter == asked:
            break
        if stricter == 0.0:  # it could not be followed
            return attrs.evolve(solution, status=Status.DIVERGED, optimum=None)
        asked = stricter
    return solution


def to_be_asked(problem: Problem, solution: Solution, asked: float | None) -> float | None:
    """Tell how much sway at the collocation points in m may be asked for: as much as was, or less.

    The nominal machine's limit need not be kept as exactly where it is for others, which sway more.
    """
    if asked is None or problem.limits.sway is None or solution.optimum is None:
        return asked
    sway, limit = sway_on_the_way(solution), problem.limits.sway / problem.sway_spread
    return asked if sway <= min(SLACK * limit, problem.limits.sway) else asked * WITHIN * limit / sway
