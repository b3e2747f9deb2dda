"""Which solver for which problem."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Protocol

import attrs
import numpy as np

from gen_profile.motion.actuator import lag_compensated
from gen_profile.problem.limits import breaches
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import Problem
from gen_profile.progress import Progress, untold
from gen_profile.solvers.direct import solver as direct
from gen_profile.solvers.direct import worst_case
from gen_profile.solvers.direct.relaxation import Relaxation, Relaxed, shortest
from gen_profile.solvers.direct.transient_sway import SLACK, sway_on_the_way
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.solvers.infeasibility import CandidateTest, cures, longer
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import WIDER, Solution, Status
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.values import SolverName
from gen_profile.work import OutOfWork, budget, spend

Judge = Callable[[Solution], bool]
ANSWER = 8.4, 12.0  # s of work for all that a spec asks for or would do instead, and of the processor
SOLVING = 2.0  # s of work for a method
LOOKING = 0.5  # likewise to see whether limits can be kept at all
DIRECTLY = 3.0  # likewise for the direct one
NEARLY = 1.1  # times the limits that the motion most easily within them may take, for it costs a little, too
OTHERWISE = 'Set solver.method = "auto"'
IN_VAIN = (
    "Longer moves, wider limits and less robustness were tried as far as the work allows, and none was found "
    "to do. Not tried: fewer limits, or fewer parameters in robustness.uncertain. See whether all numbers of "
    "the spec are in its units."
)
PERIODS = 1.5  # of the slowest mode, about as long as the shortest motions take
LEAST = {1: 1.0, 2: 4.0, 3: 32.0}  # derivative of a unit move from rest to rest in unit time, at least
BLEND = 4.0  # order of the norm by which these times and the period count together
RANGE = 2.0  # times the work for a whole range


class Trial(Protocol):
    """Solves a problem by the direct method, as the next run would, or on few intervals only."""

    def __call__(self, problem: Problem, /, *, coarse: bool = False) -> Solution:
        """Solve it."""


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


def attempt(
    problem: Problem, method: SolverName = "auto", *, coarse: bool = False, near: Relaxed | None = None
) -> Solution:
    """Solve a problem without finding out what would help where that fails.

    Parameters
    ----------
    problem : Problem
    method : str
    coarse : bool
        Where limits bind, on few intervals only; over a range, with whatever sway is left.
    near : Relaxed, optional
        A motion at which the direct method begins, in place of rest.
    """
    if problem.worst_case is not None:
        return _in_time(partial(_over_a_range, coarse=coarse), problem, DIRECTLY)
    solve = partial(_direct, coarse=coarse, near=near)
    if method == "direct":
        return _in_time(solve, problem, DIRECTLY)
    solution = _in_time(partial(indirect.solve, far=partial(_within_reach, problem)), problem, SOLVING)
    if method == "indirect" or keeps_limits(solution) or solution.status is Status.INFEASIBLE:
        return solution
    other = _in_time(solve, problem, DIRECTLY)
    return solution if other.optimum is None and solution.optimum is None else other


def directly(problem: Problem, *, coarse: bool = False) -> Solution:
    """Solve by the direct method: where it finds a motion, so does "auto", and it is the quicker to fail."""
    return attempt(problem, "direct", coarse=coarse)


def diagnosed(
    solution: Solution, method: SolverName, welcome: Judge = lambda _: True, tried: Trial = directly
) -> Solution:
    """Find out what would help where a solve failed.

    Parameters
    ----------
    solution : Solution
    method : str
        By which it was looked for.
    welcome : Solution → bool
        Whether a value is better named than others near by, by its solution.
    tried : Problem → Solution
        How a problem with another value is solved.
    """
    limited = bool(solution.problem.limits.stated())
    # the indirect method, which knows the linear angle, tells by itself what helps where there are no limits
    if solution.optimum is not None or (solution.method == indirect.METHOD and not limited):
        return solution
    return attrs.evolve(solution, cure=remedy(solution.problem, method, welcome, tried) or IN_VAIN)


def remedy(problem: Problem, method: SolverName, welcome: Judge, tried: Trial) -> str:
    """Say which other values would let a method find a motion within the limits; nothing where none will."""
    trial = _candidate_test(tried, welcome)
    if method != "indirect" or problem.worst_case is not None:
        return cures(problem, trial)
    try:
        if keeps_limits(tried(problem)):
            return f"{OTHERWISE}, which finds a motion."
    except OutOfWork:  # of the budget for the whole answer
        return ""
    found = cures(problem, trial)
    return found and f"{OTHERWISE}. {found}"


def _candidate_test(tried: Trial, welcome: Judge = lambda _: True) -> CandidateTest:
    return CandidateTest(tried, keeps_limits, welcome, partial(tried, coarse=True))


def patience(problem: Problem) -> float:
    """Tell how many times the usual work a problem may take."""
    return 1.0 if problem.worst_case is None else RANGE


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


def _direct(problem: Problem, *, coarse: bool, near: Relaxed | None) -> Solution:
    """Begin near by, or at rest; where that misleads, at the motion most easily within the limits."""
    cost, _ = direct.resolve_sway_cost(problem)  # once for all motions
    settled = attrs.evolve(problem, sway_weight=cost.beta, sway_scale=cost.gamma)
    solution = direct.solve(settled, None if near is None else near.start(problem), coarse=coarse)
    if problem.limits.stated() and not keeps_limits(solution):
        other = _from_the_easiest(settled, coarse=coarse)
        solution = solution if other.optimum is None else other
    return attrs.evolve(solution, problem=problem)


def _from_the_easiest(problem: Problem, *, coarse: bool) -> Solution:
    """Begin at the motion that is most easily within the limits, unless that breaks them."""
    easiest = _easiest(problem)
    if easiest is None:
        return given_up(problem)
    if easiest.share > NEARLY:
        return attrs.evolve(
            easiest.solution, problem=problem, status=Status.INFEASIBLE, optimum=None, cure=WIDER
        )
    return direct.solve(problem, easiest.start(problem), coarse=coarse)


def _easiest(problem: Problem) -> Relaxed | None:
    """Find the motion that is most easily within the limits; none without limits."""
    places = tuple(problem.limits.stated())
    return Relaxation(problem).least(places) if places else None


def _within_reach(problem: Problem) -> bool:
    """Whether a motion may keep the limits, for all that a few programs tell."""
    easiest = None
    with suppress(OutOfWork), budget(LOOKING):
        easiest = _easiest(problem)
    spend(0.0)
    return easiest is None or easiest.share <= NEARLY


def _over_a_range(problem: Problem, *, coarse: bool) -> Solution:
    """Look for the least worst case only where the nominal machine's motion can keep the limits."""
    easiest = _easiest(problem)
    if easiest is None or (easiest.share <= NEARLY and not coarse):
        return worst_case.solve(problem)
    if easiest.share <= NEARLY:
        return attrs.evolve(easiest.solution, problem=problem)
    return attrs.evolve(easiest.solution, problem=problem, status=Status.INFEASIBLE, optimum=None, cure=WIDER)


def requirements(problem: Problem, tried: Trial) -> str:
    """Say which limits would have to be wider for a motion in the duration of a problem that has none."""
    return cures(problem, _candidate_test(tried), in_time=True)


def sufficient_duration(problem: Problem, tried: Trial) -> str:
    """Name a duration in s, no shorter than a problem's, that will do; empty where none is found."""
    return longer(problem, _candidate_test(tried)) or ""


def minimum_time(
    problem: Problem, progress: Progress = untold, near: Relaxed | None = None, *, roughly: bool = False
) -> Relaxed | None:
    """Find the shortest motion for a problem's limits and robustness; None where none was found.

    Parameters
    ----------
    problem : Problem
        Whose duration does not matter.
    progress : Progress
    near : Relaxed, optional
        A motion that is about as long.
    roughly : bool
        Whether a duration a few hundredths longer will do.
    """
    guess = near or usual_duration(problem)
    if problem.worst_case is None:
        return shortest(problem, guess, progress=progress, roughly=roughly)
    return worst_case.shortest_motion(problem, guess, progress)


def usual_duration(problem: Problem) -> float:
    """About how long in s the shortest motion takes, which no axis does in less time than by itself."""
    slowest = float(linearize(problem.plant, problem.parameters, problem.target).frequencies[0])
    times = [PERIODS * 2.0 * math.pi / slowest]
    if problem.limits.sway is not None:  # a pendulum's, under a constant acceleration
        times.append(math.sqrt(LEAST[2] * max(map(abs, problem.distance)) / problem.limits.sway) / slowest)
    for axis, way in enumerate(problem.distance):
        limits = problem.limits.of(axis)
        for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
            times += [] if limit is None else [(LEAST[order] * abs(way) / limit) ** (1.0 / order)]
    return float(np.linalg.norm(times, BLEND))


def keeps_limits(solution: Solution) -> bool:
    """Tell whether a solution is one and keeps its problem's limits."""
    if solution.optimum is None:
        return False
    problem = solution.problem
    if problem.limits == LimitsSpec():
        return True
    sway = 0.0 if problem.limits.sway is None else sway_on_the_way(solution)
    sway = max(sway, problem.sway_spread * sway / SLACK)
    command = lag_compensated(optimal_profile(solution), problem.tau)
    return not breaches(problem.limits, command, sway)
