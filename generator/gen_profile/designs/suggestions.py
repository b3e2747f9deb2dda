"""What would do where a spec has no motion: changes of the spec, each by itself, that were tried and work.

A candidate is a changed spec. The least one is looked for from what the relaxation says will be needed at
least, on few even intervals first, and then tried as the next run will try it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, partial
from typing import Any, TypeVar

import attrs

from gen_profile.designs import transient_sway
from gen_profile.designs.draft import drafted, lasting
from gen_profile.errors import SpecError
from gen_profile.problem.limits import SWAY_TOLERANCE, rounded_up
from gen_profile.problem.problem import problem_of
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct.relaxation import Relaxation, eased_by_time, least_duration
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.solvers.search import Search, least
from gen_profile.solvers.solution import LONGER, Solution, Status
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import refuse_implausible
from gen_profile.work import OutOfWork, afford, budget, left, spend

FIRST = 1.03  # times the least value, for which there is but one motion
# from there on by 1.07, 1.15, 1.3 …; a value that works may be 5 % greater than one that does not
COARSE = Search(precision=math.log(1.05), close=0.0, stride=math.log(1.07))
FINE = attrs.evolve(COARSE, close=math.inf)
MOST = 4.2  # times the least value, up to which one is tried
FAR = 64.0  # likewise a duration where the relaxation knows of no limit, so of no least one
FARTHER = 1.7  # times the least value that works, up to which one is looked for that is preferred
AMPLE = math.log(1.3)  # step beyond a value that takes too much work: a smooth motion may do
FRACTION = 0.5  # of the work that is left, which one suggestion may take, and one duration tried
LONGEST = 0.8  # likewise a longer move, which nearly always works
WIDEST = 4.0  # times as wide as they are, all limits together are worth naming
NEAR = 1.05  # times the duration, from which on it is worth telling how long a move would take
AT_ONCE = 1.0  # s of work, in which a motion without limits is found, or is not worth the while
OTHERWISE = 'Set solver.method = "auto"'
IN_VAIN = (
    "Longer moves, wider limits and less robustness were tried as far as the work allows, and none was found "
    "to do. Not tried: fewer limits, or fewer parameters in robustness.uncertain. See whether all numbers of "
    "the spec are in its units."
)

Found = TypeVar("Found")


def solve(spec: Spec) -> Solution:
    """Solve a spec so that all machines keep its limits; where that fails, find out what would help."""
    try:
        with budget(*choice.ANSWER):
            return explained(spec, transient_sway.attempt(spec))
    except OutOfWork:
        return choice.given_up(problem_of(spec))


def explained(spec: Spec, solution: Solution) -> Solution:
    """Find out what would help where a solve failed, unless the indirect method knows."""
    known = solution.method == indirect.METHOD and not spec.limits.stated() and solution.suggestion != LONGER
    if solution.optimum is not None or known:
        return solution
    return attrs.evolve(solution, suggestion=remedy(spec, solution.problem.sway_spread) or IN_VAIN)


def remedy(spec: Spec, spread: float = 1.0) -> str:
    """Say which other values would let a spec's method find a motion; nothing where none will."""
    if spec.solver.solver != "indirect" or spec.robustness.method == "range":
        return suggestions(spec, spread)
    with suppress(OutOfWork):
        if choice.keeps_limits(tried(spec)):
            return f"{OTHERWISE}, which finds a motion."
        found = suggestions(spec, spread)
        return found and f"{OTHERWISE}. {found}"
    return ""


def suggestions(spec: Spec, spread: float = 1.0, *, in_time: bool = False) -> str:
    """Name what to change, each thing by itself, in one or two sentences; nothing where nothing was found.

    Parameters
    ----------
    spec : Spec
        With a duration, without a solution.
    spread : float
        How many times as much as the nominal machine the worst one sways; 1 where unknown.
    in_time : bool
        Look for what would do in the duration asked for only.
    """
    relaxation = _relaxation(spec, spread)
    problem = relaxation.problem
    needed, duration, instead, sentences = None, None, list[str](), list[str]()
    stated = problem.limits.stated()
    alone = [partial(_wider_limits, spec, relaxation, {place: value}) for place, value in stated.items()]
    eased = {place: stated[place] for place in eased_by_time(problem)}
    families = [limits for limits in ([eased] if eased == stated else [eased, stated]) if len(limits) > 1]
    together = [partial(_wider_limits, spec, relaxation, limits, WIDEST) for limits in families]
    with suppress(OutOfWork):  # of the budget for the whole answer: name what was found so far
        if not in_time:
            needed = _in_time(partial(least_duration, relaxation))
            duration = needed and _in_time(partial(_longer, spec, relaxation, needed), LONGEST)
        instead += filter(None, map(_in_time, alone))
        for last_resort in (*together, partial(_less_robust, spec)):
            if not instead:
                instead += filter(None, [_in_time(last_resort)])
    if duration:
        some = "With these limits a" if stated else "A"
        sentences.append(f"{some} duration of {duration} s will do (move.duration).")
    elif needed and needed > NEAR * problem.duration:
        sentences.append(f"With these limits it would take some {float(f'{needed:.2g}'):g} s.")
    if instead:
        sentences.append(f"In {problem.duration:g} s it would do with {', or with '.join(instead)}.")
    return " ".join(sentences)


def sufficient_duration(spec: Spec) -> str:
    """Find the least duration in s, no less than a spec's, that works, in most of the work that is left."""
    relaxation = _relaxation(spec, 1.0)
    needed = _in_time(partial(least_duration, relaxation), LONGEST)
    return (needed and _in_time(partial(_longer, spec, relaxation, needed), LONGEST)) or ""


def tried(spec: Spec, *, coarse: bool = False) -> Solution:
    """Solve a spec as the next run would, or on few intervals, to see whether there is a motion."""
    problem = problem_of(spec)
    try:
        refuse_implausible(spec)
    except SpecError:
        return choice.given_up(problem)
    if spec.solver.solver != "direct" and problem.worst_case is None:
        smooth = afford(partial(choice.attempt, problem, "indirect"), AT_ONCE)
        if smooth is not None and (smooth.status is Status.INFEASIBLE or _kept(spec, smooth)):
            return smooth
    if coarse:  # whether there is a motion does not depend on what it costs
        problem = attrs.evolve(problem, sway_weight=0.0)
    solution = transient_sway.kept_by_all(spec, problem, "direct", coarse=coarse)
    if solution.optimum is None or transient_sway.keeps_sway(spec, solution, SWAY_TOLERANCE):
        return solution
    return attrs.evolve(solution, status=Status.INFEASIBLE, optimum=None)


def _kept(spec: Spec, solution: Solution) -> bool:
    return choice.keeps_limits(solution) and transient_sway.keeps_sway(spec, solution, transient_sway.ENOUGH)


def _relaxation(spec: Spec, spread: float) -> Relaxation:
    known = spread if spread > 1.0 else usual_spread(spec)
    return Relaxation(attrs.evolve(problem_of(spec), sway_spread=known))


def usual_spread(spec: Spec) -> float:
    """Tell how many times as much the worst machine sways on the way in a motion with wider limits."""
    problem = problem_of(spec)
    nearest = choice.least_violation(problem) if transient_sway.limited(spec, problem) else None
    return 1.0 if nearest is None else transient_sway.spread(spec, nearest.solution)


def least_factor(
    changed: Callable[[float], Spec], known_spread: float = 1.0, fraction: float = 1.0, most: float = MOST
) -> float | None:
    """Find the least factor of a change that works, as near as the work that is left allows.

    Parameters
    ----------
    changed : float → Spec
    known_spread : float
        How many times as much as the nominal machine the worst one is supposed to sway.
    fraction : float
        Of the work that is left, which one factor may take.
    most : float
        Factor, up to which one is tried.
    """

    @cache
    def solved(factor: float, *, coarse: bool) -> tuple[Spec, Solution | None]:
        spec = changed(factor)
        return spec, afford(partial(tried, spec, coarse=coarse), fraction * left())

    def excess(factor: float, *, coarse: bool) -> float:
        _, solution = solved(factor, coarse=coarse)
        if solution is None or solution.status is Status.GIVEN_UP:
            return AMPLE
        if choice.keeps_limits(solution):
            return -math.inf
        missing = math.log(solution.problem.sway_spread / known_spread)  # the spread may be to blame
        return missing if coarse and missing > 0.0 else math.inf

    def preferred(factor: float) -> float:
        """Prefer what leaves every machine little enough sway."""
        spec, solution = solved(factor, coarse=True)
        if solution is None or not choice.keeps_limits(solution):
            return math.inf
        return -math.inf if drafted(spec, solution).excess_sway <= 0.0 else math.inf

    nearest: float | None = None
    with suppress(OutOfWork), budget(FRACTION * left()):
        nearest = least(partial(excess, coarse=True), FIRST, COARSE, most)
        nearest = nearest and (least(preferred, nearest, COARSE, FARTHER * nearest) or nearest)
    spend(0.0)
    return nearest and least(partial(excess, coarse=False), nearest, FINE, most)


def _longer(spec: Spec, relaxation: Relaxation, needed: float) -> str:
    """Find the least duration that works, in s, rounded up to three digits; empty where there is none."""

    def changed(factor: float) -> Spec:
        return lasting(spec, float(rounded_up(factor * needed)))

    most = MOST if eased_by_time(relaxation.problem) else FAR
    factor = least_factor(changed, relaxation.problem.sway_spread, FRACTION, most)
    return "" if factor is None else rounded_up(factor * needed)


def _wider_limits(
    spec: Spec, relaxation: Relaxation, limits: Mapping[str, Any], most: float = math.inf
) -> str:
    """Widen some limits as little as works, the others as they are; nothing where nothing works."""
    nearest = relaxation.least(tuple(limits))
    if nearest is None or nearest.wider > most:
        return ""
    needed = max(nearest.wider, 1.0)

    def wider(factor: float) -> dict[str, Any]:
        return {place: _times(value, factor * needed) for place, value in limits.items()}

    def changed(factor: float) -> Spec:
        return attrs.evolve(spec, limits=spec.limits.changed(wider(factor)))

    factor = least_factor(changed, relaxation.problem.sway_spread)
    if factor is None:
        return ""
    return " and ".join(f"{place} = {_written(value)}" for place, value in wider(factor).items())


def _less_robust(spec: Spec) -> str:
    """Ask for less robustness."""
    robustness = spec.robustness
    if robustness.method != "sensitivity":
        return ""
    changes = {'robustness.method = "none"': attrs.evolve(robustness, method="none", order=1)}
    if robustness.order > 1:
        changes = {"robustness.order = 1": attrs.evolve(robustness, order=1), **changes}
    for words, less in changes.items():
        changed = attrs.evolve(spec, robustness=less)
        solution = tried(changed)
        if choice.keeps_limits(solution) and drafted(changed, solution).excess_sway <= 0.0:
            return words
    return ""


def _in_time(find: Callable[[], Found], fraction: float = FRACTION) -> Found | None:
    return afford(find, fraction * left())


def _times(value: Any, factor: float) -> Any:
    """Widen a limit so many times, travel by as much at either end; rounded outwards."""
    if not isinstance(value, tuple):
        return float(rounded_up(factor * value))
    low, high = value
    more = float(rounded_up((factor - 1.0) * (high - low)))
    return (float(f"{low - more:.9g}"), float(f"{high + more:.9g}"))


def _written(value: Any) -> str:
    return f"[{value[0]:.9g}, {value[1]:.9g}]" if isinstance(value, tuple) else f"{value:g}"
