"""Which solver for which problem."""

from __future__ import annotations

import attrs

from gen_profile.problem.actuator import lag_compensated
from gen_profile.problem.limits import breaches, rounded_up
from gen_profile.problem.problem import Problem
from gen_profile.solvers import direct, indirect, worst_case
from gen_profile.solvers.collocation import Trajectory
from gen_profile.solvers.direct import sway_on_the_way
from gen_profile.solvers.minimum_time import shortest_duration
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution, Status
from gen_profile.spec import LimitsSpec, SolverName

COMFORT = 1.01  # of the shortest duration, in which there is but one motion


def solve(problem: Problem, method: SolverName = "auto", near: Trajectory | None = None) -> Solution:
    """Solve a problem by the method that suits it.

    Parameters
    ----------
    problem : Problem
    method : str
        ``"indirect"`` knows no limits; ``"auto"`` takes it where none binds, and the direct method elsewhere.
    near : Trajectory, optional
        Of the solution of a similar problem: the indirect method begins there.
    """
    if problem.worst_case is not None:
        return _explained(worst_case.solve(problem))
    if method == "direct":
        return _explained(direct.solve(problem))
    solution = indirect.solve(problem, near)
    if method == "indirect" or keeps_limits(solution):
        return solution
    other = direct.solve(problem)
    # where both fail, the indirect method, which knows the linear angle, has more to say
    return solution if other.optimum is None and solution.optimum is None else _explained(other)


def minimum_time(problem: Problem) -> float | None:
    """Find the shortest duration in s for a problem's limits and robustness; None where none was found."""
    if problem.worst_case is None:
        return shortest_duration(problem, direct.solve)
    return shortest_duration(problem, worst_case.solve_within_limits)


def keeps_limits(solution: Solution) -> bool:
    """Tell whether a solution is one and keeps its problem's limits."""
    if solution.optimum is None:
        return False
    problem = solution.problem
    if problem.limits == LimitsSpec():
        return True
    sway = sway_on_the_way(solution) if problem.limits.sway is not None else 0.0
    command = lag_compensated(optimal_profile(solution), problem.tau)
    return not breaches(problem.limits, command, sway)


def _explained(solution: Solution) -> Solution:
    """Say what would make an infeasible problem feasible."""
    if solution.status is not Status.INFEASIBLE:
        return solution
    problem = attrs.evolve(solution.problem, worst_case=None)
    cures = []
    # with a limit on the sway the search would take too long for an explanation
    shortest = shortest_duration(problem, direct.solve) if problem.limits.sway is None else None
    if shortest is not None:
        cures.append(
            f"With these limits it takes at least {rounded_up(COMFORT * shortest)} s (move.duration)"
        )
    for name in ("velocity", "acceleration", "jerk", "sway", "travel"):
        loosened = problem.limits.without(name)
        if loosened != problem.limits:
            without = attrs.evolve(problem, limits=loosened)
            if direct.solve(without).optimum is not None:
                cures.append(f"without limits.{name} it would do in {problem.duration:g} s")
    told = "; ".join(cures)
    return attrs.evolve(solution, cure=f"{told[0].upper()}{told[1:]}." if told else solution.cure)
