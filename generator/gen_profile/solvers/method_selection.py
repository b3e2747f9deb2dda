"""Which solver for which problem."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import count

import attrs

from gen_profile.problem.actuator import lag_compensated
from gen_profile.problem.limits import breaches
from gen_profile.problem.problem import Problem
from gen_profile.progress import Progress, untold
from gen_profile.solvers.direct import solver as direct
from gen_profile.solvers.direct import worst_case
from gen_profile.solvers.direct.relaxation import Relaxation
from gen_profile.solvers.direct.transcription import Iterate
from gen_profile.solvers.direct.transient_sway import sway_on_the_way
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.solvers.infeasibility import CandidateTest, cures
from gen_profile.solvers.minimum_time import shortest_duration
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution, Status
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.values import SolverName
from gen_profile.work import OutOfWork, budget, spend

Judge = Callable[[Solution], bool]
SHORTEST = "looking for the shortest duration"
ANSWER = 24.0, 30.0  # s of work for all that a spec asks for or would do instead, and of the processor
SOLVING = 8.0  # s of work for one method; twice that where there is no other
RANGE = 2.0  # times the work for a whole range


def solve(problem: Problem, method: SolverName = "auto") -> Solution:
    """Solve a problem by the method that suits it; where that fails, find out what would help.

    Parameters
    ----------
    problem : Problem
    method : str
        ``"indirect"`` knows no limits; ``"auto"`` takes it where none binds, and the direct method elsewhere.
    """
    try:
        with budget(*ANSWER):
            return diagnosed(attempt(problem, method), method)
    except OutOfWork:
        return given_up(problem)


def diagnosed(solution: Solution, method: SolverName = "auto", welcome: Judge = lambda _: True) -> Solution:
    """Find out what would help where a solve failed.

    Parameters
    ----------
    solution : Solution
    method : str
        By which it was looked for.
    welcome : Solution → bool
        Whether a value is better named than others near by, by its solution.
    """
    # the indirect method, which knows the linear angle, tells by itself what helps where there are no limits
    told = solution.method == indirect.METHOD and (
        method == "indirect" or not solution.problem.limits.stated()
    )
    if solution.optimum is not None or told:
        return solution
    # where the direct method finds a motion, so does "auto", and the direct method is the quicker to fail
    return attrs.evolve(solution, cure=remedy(solution.problem, "direct", welcome) or solution.cure)


def remedy(problem: Problem, method: SolverName = "auto", welcome: Judge = lambda _: True) -> str:
    """Say which other values would let a method find a motion within the limits; nothing where none will."""
    trial = CandidateTest(
        solve=lambda other, easiest: attempt(other, method, easiest=easiest),
        keeps=keeps_limits,
        welcome=welcome,
    )
    found = cures(problem, trial)
    elsewhere = method == "indirect" and problem.worst_case is None
    try:
        if elsewhere and keeps_limits(_in_time(_direct, problem, SOLVING)):
            return f'With solver.method = "auto" the limits are kept. {found}'.strip()
    except OutOfWork:  # of the budget for the whole answer
        pass
    return found


def patience(problem: Problem) -> float:
    """Tell how many times the usual work a problem may take."""
    return 1.0 if problem.worst_case is None else RANGE


def attempt(problem: Problem, method: SolverName = "auto", easiest: Iterate | None = None) -> Solution:
    """Solve a problem without finding out what would help where that fails."""
    directly = partial(_direct, easiest=easiest)
    if problem.worst_case is not None:
        return _in_time(worst_case.solve, problem, 2.0 * SOLVING)
    if method == "direct":
        return _in_time(directly, problem, 2.0 * SOLVING)
    solution = _in_time(indirect.solve, problem, SOLVING)
    if method == "indirect" or keeps_limits(solution):
        return solution
    other = _in_time(directly, problem, SOLVING)
    return solution if other.optimum is None and solution.optimum is None else other


def _in_time(solve: Callable[[Problem], Solution], problem: Problem, seconds: float) -> Solution:
    """Solve a problem, or give it up."""
    try:
        with budget(seconds * patience(problem)):
            return solve(problem)
    except OutOfWork:
        spend(0.0)
        return given_up(problem)


def given_up(problem: Problem) -> Solution:
    """Tell that a problem takes too much work."""
    return Solution(
        status=Status.GIVEN_UP,
        method="none",
        problem=problem,
        optimum=None,
        iterations=0,
        residual=float("inf"),
        cure="See whether all numbers of the spec are in its units; else change the duration or limits.",
    )


def _direct(problem: Problem, easiest: Iterate | None = None) -> Solution:
    """Begin at rest, and where that misleads, at the motion that is most easily within the limits."""
    solution = direct.solve(problem)
    if keeps_limits(solution) or not problem.limits.stated():
        return solution
    if easiest is None:
        found = Relaxation(problem).least(tuple(problem.limits.stated()))
        easiest = None if found is None or found.share > 1.0 else found.iterate
    return solution if easiest is None else direct.solve(problem, easiest)


def requirements(problem: Problem) -> str:
    """Say which limits would have to be wider for a motion in the duration of a problem that has none."""
    trial = CandidateTest(
        solve=lambda other, easiest: attempt(other, "direct", easiest=easiest),
        keeps=keeps_limits,
        welcome=lambda _: True,
    )
    return cures(problem, trial, in_time=True)


def minimum_time(problem: Problem, progress: Progress = untold) -> float | None:
    """Find the shortest duration in s for a problem's limits and robustness; None where none was found."""
    solve = direct.solve if problem.worst_case is None else worst_case.solve_within_limits
    tries = count(1)

    def attempted(other: Problem) -> Solution:
        progress(SHORTEST, remark=f"trying {other.duration:.3g} s ({next(tries)})")
        return _in_time(solve, other, SOLVING)

    return shortest_duration(problem, attempted)


def keeps_limits(solution: Solution) -> bool:
    """Tell whether a solution is one and keeps its problem's limits."""
    if solution.optimum is None:
        return False
    problem = solution.problem
    if problem.limits == LimitsSpec():
        return True
    sway = 0.0 if problem.limits.sway is None else problem.sway_spread * sway_on_the_way(solution)
    command = lag_compensated(optimal_profile(solution), problem.tau)
    return not breaches(problem.limits, command, sway)
