"""Which requirement makes a problem infeasible, and the nearest value with which it can be solved.

Values are solved for (see `solvers.relaxation`), rounded to the safe side, and tried: what is named works.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any, TypeVar

import attrs

from gen_profile.problem.limits import rounded_up
from gen_profile.problem.problem import Problem
from gen_profile.solvers.direct.relaxation import Relaxation, eased_by_time, least_duration
from gen_profile.solvers.solution import Solution, Status
from gen_profile.work import OutOfWork, budget, left, spend

FACTORS = (1.03, 1.1, 1.3, 1.7, 2.5, 4.0)  # times the least value, for which there is but one motion
NEAR = 1.05  # how many times a value that will not do the one that is named may be
SHARE = 0.5  # of the work that is left, which one cure may take, and one duration tried
MOST = 0.8  # likewise a longer move, which nearly always does
WIDEST = 4.0  # times as wide as they are, all limits together are worth naming
AMPLE = 1.3  # times the least value: where nearer ones take too much work, a smooth motion may do
FARTHER = 1.7  # times the least value with a solution, up to which one that is welcome is looked for

Found = TypeVar("Found")


@attrs.frozen
class CandidateTest:
    """How values are tried.

    Attributes
    ----------
    solve : Problem → Solution
    keeps : Solution → bool
        Whether it is one that will do.
    welcome : Solution → bool
        Whether it is one that is better named than others near by.
    roughly : Problem → Solution, optional
        Quicker, to look for what will then be tried.
    """

    solve: Callable[[Problem], Solution]
    keeps: Callable[[Solution], bool]
    welcome: Callable[[Solution], bool]
    roughly: Callable[[Problem], Solution] | None = None

    def pleases(self, problem: Problem) -> bool:
        """Whether a problem has a solution that will do and is welcome."""
        solution = self.solve(problem)
        return self.keeps(solution) and self.welcome(solution)

    def least(self, changed: Callable[[float], Problem], share: float = 1.0) -> float | None:
        """Find the least factor of a change that will do, as near as the work that is left allows.

        Parameters
        ----------
        changed : float → Problem
        share : float
            Of the work that is left, which one factor may take.
        """
        if self.roughly is None:
            return self._nearest(changed, share)
        with budget(SHARE * left()):
            nearest = attrs.evolve(self, solve=self.roughly)._nearest(changed, share)
        for factor in () if nearest is None else (nearest, *(more for more in FACTORS if more > nearest)):
            solution = _in_time(partial(self.solve, changed(factor)), share)
            if solution is not None and self.keeps(solution):
                return factor
        return None

    def _nearest(self, changed: Callable[[float], Problem], share: float) -> float | None:
        found: list[float] = []
        try:
            found.extend(self._ever_better(changed, share))
        except OutOfWork:
            if not found:
                raise
        return found[-1] if found else None

    def _ever_better(self, changed: Callable[[float], Problem], share: float) -> Iterator[float]:
        """Try factors, the first of which nearly always does: one that is welcome, then lesser ones."""
        least = 1.0

        @cache
        def kept(factor: float) -> Solution | None:
            nonlocal least
            problem = changed(factor)
            solution = _in_time(partial(self.solve, problem), share)
            if solution is not None and self.keeps(solution):
                return solution
            if solution is None or solution.status is Status.GIVEN_UP:
                least = max(least, AMPLE)
            if solution is not None:  # the spread may be to blame
                least = max(least, factor * solution.problem.sway_spread / problem.sway_spread)
            return None

        def does(factor: float) -> bool:
            return kept(factor) is not None

        def pleases(factor: float) -> bool:
            solution = kept(factor)
            return solution is not None and self.welcome(solution)

        first = next((factor for factor in FACTORS if factor >= least and does(factor)), None)
        if first is None:
            return
        yield first
        near = [factor for factor in FACTORS if first <= factor <= FARTHER * first]
        pleasing = next(filter(pleases, near), None)
        enough, will_do = (first, does) if pleasing is None else (pleasing, pleases)
        yield enough
        short = max((factor for factor in FACTORS if factor < enough), default=1.0)
        while enough > NEAR * short:
            middle = math.sqrt(enough * short)
            enough, short = (middle, short) if will_do(middle) else (enough, middle)
            yield enough


def cures(problem: Problem, trial: CandidateTest, *, in_time: bool = False) -> str:
    """Name what to change, each thing by itself, in one or two sentences; nothing where nothing was found.

    Parameters
    ----------
    problem : Problem
        Without a solution.
    trial : CandidateTest
    in_time : bool
        Look for what would do in the duration asked for only.
    """
    needed, duration, instead, sentences = None, None, list[str](), list[str]()
    stated, relaxation = problem.limits.stated(), Relaxation(problem)
    alone = (partial(_widened, relaxation, trial, {place: value}) for place, value in stated.items())
    eased = {place: stated[place] for place in eased_by_time(problem)}
    families = [limits for limits in ([eased] if eased == stated else [eased, stated]) if len(limits) > 1]
    together = [partial(_widened, relaxation, trial, limits, WIDEST) for limits in families]
    try:
        if not in_time:
            needed = _in_time(partial(least_duration, relaxation))
            duration = needed and _in_time(partial(_longer, relaxation, trial, needed), MOST)
        instead.extend(filter(None, map(_in_time, alone)))
        for last_resort in (*together, partial(_less_robust, problem, trial)):
            if not instead:
                instead.extend(filter(None, [_in_time(last_resort)]))
    except OutOfWork:  # of the budget for the whole answer: what was found so far is told
        pass
    if duration:
        some = "With these limits a" if stated else "A"
        sentences.append(f"{some} duration of {duration} s will do (move.duration).")
    elif needed and needed > NEAR * problem.duration:
        sentences.append(f"With these limits it would take some {float(f'{needed:.2g}'):g} s.")
    if instead:
        sentences.append(f"In {problem.duration:g} s it would do with {', or with '.join(instead)}.")
    return " ".join(sentences)


def longer(problem: Problem, trial: CandidateTest) -> str | None:
    """Find the least duration in s that will do, in most of the work that is left."""
    relaxation = Relaxation(problem)
    needed = _in_time(partial(least_duration, relaxation), MOST)
    return None if needed is None else _in_time(partial(_longer, relaxation, trial, needed), MOST)


def _longer(relaxation: Relaxation, trial: CandidateTest, enough: float) -> str:
    """Find the least duration that will do, in s, rounded up to three digits; empty where there is none.

    Parameters
    ----------
    relaxation : Relaxation
    trial : CandidateTest
    enough : float
        s, in which limits can just be kept by the relaxation.
    """

    def lasting(factor: float) -> Problem:
        return attrs.evolve(relaxation.problem, duration=float(rounded_up(factor * enough)))

    factor = trial.least(lasting, SHARE)
    return "" if factor is None else rounded_up(factor * enough)


def _widened(
    relaxation: Relaxation, trial: CandidateTest, limits: Mapping[str, Any], most: float = math.inf
) -> str:
    """Widen some limits as little as will do, the others as they are; nothing where nothing will."""
    problem, easiest = relaxation.problem, relaxation.least(tuple(limits))
    if easiest is None or easiest.share > most:
        return ""
    enough = max(easiest.share, 1.0)

    def wider(factor: float) -> dict[str, Any]:
        return {place: _times(value, factor * enough) for place, value in limits.items()}

    def widened(factor: float) -> Problem:
        return attrs.evolve(problem, limits=problem.limits.changed(wider(factor)))

    factor = trial.least(widened)
    if factor is None:
        return ""
    return " and ".join(f"{place} = {_written(value)}" for place, value in wider(factor).items())


def _less_robust(problem: Problem, trial: CandidateTest) -> str:
    """Ask for less robustness."""
    if problem.order > 1 and trial.pleases(attrs.evolve(problem, order=1)):
        return "robustness.order = 1"
    if problem.desensitized and trial.pleases(attrs.evolve(problem, desensitized=(), order=1)):
        return 'robustness.method = "none"'
    return ""


def _in_time(find: Callable[[], Found], share: float = SHARE) -> Found | None:
    """Find something in a share of the work that is left; nothing where that is not enough."""
    try:
        with budget(share * left()):
            return find()
    except OutOfWork:
        spend(0.0)
        return None


def _times(value: Any, share: float) -> Any:
    """Widen a limit so many times, travel by as much at either end; rounded outwards."""
    if not isinstance(value, tuple):
        return float(rounded_up(share * value))
    low, high = value
    more = float(rounded_up((share - 1.0) * (high - low)))
    return (float(f"{low - more:.9g}"), float(f"{high + more:.9g}"))


def _written(value: Any) -> str:
    return f"[{value[0]:.9g}, {value[1]:.9g}]" if isinstance(value, tuple) else f"{value:g}"
