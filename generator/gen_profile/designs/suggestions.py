"""What would do where a spec has no motion: changes of the spec, each by itself, that were tried and work.

A candidate is a changed spec. The least one is looked for from what the relaxation says will be needed at
least, on few even intervals first, and then tried as the next run will try it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache, partial
from typing import Any, TypeVar

import attrs

from gen_profile.designs import transient_sway
from gen_profile.designs.draft import Draft, drafted, suggested
from gen_profile.errors import CosimulationError, InfeasibleProblem, SpecError, Suggestion
from gen_profile.phrase import Phrase
from gen_profile.problem.limits import SWAY_TOLERANCE, rounded_up
from gen_profile.problem.problem import problem_of
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct.relaxation import Relaxation, least_duration, time_dependent_limits
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
# times the least value that works, up to which one is looked for that passes the check; likewise a duration
FARTHER, LATER = 1.7, 16.0
CLOSE_BY = 1.2  # times the least value that passes on few intervals, up to which one is looked for on many
AMPLE = math.log(1.3)  # step beyond a value that takes too much work: a smooth motion may do
FRACTION = 0.5  # of the work that is left, which one suggestion may take, and one duration tried
LONGEST = 0.8  # likewise a longer move, which nearly always works
WIDEST = 4.0  # times as wide as they are, all limits together are worth naming
NEAR = 1.05  # times the duration, from which on it is worth telling how long a move would take
AT_ONCE = 1.0  # s of work, in which a motion without limits is found, or is not worth the while
IN_VAIN = Phrase(
    "Longer moves, wider limits and less robustness were tried as far as the work allows, and none was found "
    "to do. Not tried: fewer limits, or fewer parameters in robustness.uncertain. See whether all numbers of "
    "the spec are in its units."
)

Found = TypeVar("Found")
Change = Callable[[float], Mapping[str, Any]]  # from a factor to values by their places in the spec


@attrs.frozen(kw_only=True)
class Remedy:
    """What was found to help: changes that were tried, and advice where none of the duration was."""

    suggestions: tuple[Suggestion, ...] = ()
    advice: str = ""


def solve(spec: Spec) -> Solution:
    """Solve a spec so that all machines keep its limits; where that fails, find out what would help."""
    try:
        with budget(*choice.ANSWER):
            return explained(spec, transient_sway.attempt(spec))
    except OutOfWork:
        return choice.given_up(problem_of(spec))


def explained(spec: Spec, solution: Solution) -> Solution:
    """Find out what would help where a solve failed, unless the indirect method knows."""
    known = solution.method == indirect.METHOD and not spec.limits.stated() and solution.advice != LONGER
    if solution.optimum is not None or known:
        return solution
    remedies = remedy(spec, solution.problem.sway_spread)
    advice = remedies.advice or ("" if remedies.suggestions else IN_VAIN)
    return attrs.evolve(solution, advice=advice, suggestions=remedies.suggestions)


def remedy(spec: Spec, spread: float = 1.0, *, in_time: bool = False) -> Remedy:
    """Find what to change so that there is a motion, each change by itself; those first that pass the check.

    Parameters
    ----------
    spec : Spec
        With a duration, without a solution.
    spread : float
        How many times as much as the nominal machine the worst one sways; 1 where unknown.
    in_time : bool
        Look for what would do in the duration asked for only.
    """
    if spec.solver.solver == "indirect" and spec.robustness.method != "range":
        method = {"solver.method": "auto"}
        with suppress(OutOfWork):
            if one := _tried(spec, method):
                return Remedy(suggestions=(one,))
            known = remedy(spec.changed(method), spread, in_time=in_time)
            return attrs.evolve(known, suggestions=beside(method, known.suggestions))
        return Remedy()
    relaxation = _relaxation(spec, spread)
    problem = relaxation.problem
    needed, longer, others = None, None, list[Suggestion | None]()
    stated = problem.limits.stated()
    wider = partial(_wider_limits, spec, relaxation)
    alone = [partial(wider, {place: value}) for place, value in stated.items()]
    time_limits = {place: stated[place] for place in time_dependent_limits(problem)}
    families = [
        limits
        for limits in ([time_limits] if time_limits == stated else [time_limits, stated])
        if len(limits) > 1
    ]
    together = [partial(wider, limits, WIDEST) for limits in families]
    with suppress(OutOfWork):  # of the budget for the whole answer: name what was found so far
        if not in_time:
            needed = _in_time(partial(least_duration, relaxation))
            if needed:
                longer = _in_time(partial(_longer, spec, relaxation, needed), LONGEST)
        others += map(_in_time, alone)
        for last_resort in (*together, partial(_less_robust, spec)):
            if not any(others):
                others.append(_in_time(last_resort))
    advice = ""
    if needed and needed > NEAR * problem.duration and not longer:
        template = "By an estimate that was not tried, it takes some {duration:g} s with these limits."
        advice = Phrase(template, duration=float(f"{needed:.2g}"))
    tried = [one for one in (longer, *others) if one]
    return Remedy(suggestions=tuple(sorted(tried, key=lambda one: not one.passes)), advice=advice)


def beside(values: Mapping[str, Any], suggestions: Iterable[Suggestion]) -> tuple[Suggestion, ...]:
    """Name further values with which suggestions were tried."""
    return tuple(one._replace(values={**values, **one.values}) for one in suggestions)


def sufficient_duration(spec: Spec) -> Suggestion | None:
    """Find the least duration in s, no less than a spec's, that works, in most of the work that is left."""
    relaxation = _relaxation(spec, 1.0)
    needed = _in_time(partial(least_duration, relaxation), LONGEST)
    return _in_time(partial(_longer, spec, relaxation, needed), LONGEST) if needed else None


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
    return choice.keeps_limits(solution) and transient_sway.keeps_sway(
        spec, solution, transient_sway.ACCEPTED
    )


def _relaxation(spec: Spec, spread: float) -> Relaxation:
    known = spread if spread > 1.0 else usual_spread(spec)
    return Relaxation(attrs.evolve(problem_of(spec), sway_spread=known))


def usual_spread(spec: Spec) -> float:
    """Tell how many times as much the worst machine sways on the way in a motion with wider limits."""
    problem = problem_of(spec)
    nearest = choice.least_violation(problem) if transient_sway.limited(spec, problem) else None
    return 1.0 if nearest is None else transient_sway.spread(spec, nearest.solution)


def least_change(
    spec: Spec,
    change: Change,
    known_spread: float = 1.0,
    fraction: float = 1.0,
    reach: tuple[float, float] = (MOST, FARTHER),
) -> Suggestion | None:
    """Find the least factor of a change that works, as near as the work that is left allows.

    Parameters
    ----------
    spec : Spec
    change : float → mapping of str to value
        What a factor makes of the spec's values.
    known_spread : float
        How many times as much as the nominal machine the worst one is supposed to sway.
    fraction : float
        Of the work that is left, which one factor may take.
    reach : (float, float)
        Up to which factor one is tried; and up to how many times the least factor that works one is looked
        for that passes the check.
    """
    most, farther = reach

    @cache
    def solved(factor: float, *, coarse: bool) -> Draft:
        changed = spec.changed(change(factor))
        solution = afford(partial(tried, changed, coarse=coarse), fraction * left())
        return drafted(changed, solution or choice.given_up(problem_of(changed)))

    def excess(factor: float, *, coarse: bool) -> float:
        draft = solved(factor, coarse=coarse)
        solution = draft.solution
        assert solution is not None
        if solution.status is Status.GIVEN_UP:
            return AMPLE
        if choice.keeps_limits(solution) and (coarse or _stands(draft)):
            return -math.inf
        missing = math.log(solution.problem.sway_spread / known_spread)  # the spread may be to blame
        return missing if coarse and missing > 0.0 else math.inf

    def unsafe(factor: float, *, coarse: bool) -> float:
        """Prefer what leaves every machine little enough sway."""
        works = excess(factor, coarse=coarse) < 0.0
        return -math.inf if works and solved(factor, coarse=coarse).excess_sway <= 0.0 else math.inf

    nearest = passing = chosen = None
    with suppress(OutOfWork), budget(FRACTION * left()):
        nearest = least(partial(excess, coarse=True), FIRST, COARSE, most)
        passing = nearest  # over a range few intervals tell nothing of the sway that is left
        if nearest and spec.robustness.method != "range":
            passing = least(partial(unsafe, coarse=True), nearest, COARSE, farther * nearest)
    spend(0.0)
    with suppress(OutOfWork), budget(FRACTION * left()):
        chosen = passing and least(partial(unsafe, coarse=False), passing, FINE, CLOSE_BY * passing)
    spend(0.0)
    start = chosen or passing or nearest
    factor = start and least(partial(excess, coarse=False), start, FINE, max(most, start))
    return suggested(change(factor), solved(factor, coarse=False)) if factor else None


def _stands(draft: Draft) -> bool:
    """Whether the motion, if there is one, would be judged to keep all limits."""
    try:
        return draft.motion is not None and not draft.broken
    except (CosimulationError, InfeasibleProblem):
        return False


def _longer(spec: Spec, relaxation: Relaxation, needed: float) -> Suggestion | None:
    """Find the least duration that works, in s, rounded up to three digits."""

    def change(factor: float) -> Mapping[str, Any]:
        return {"move.duration": float(rounded_up(factor * needed))}

    most = MOST if time_dependent_limits(relaxation.problem) else FAR
    return least_change(spec, change, relaxation.problem.sway_spread, FRACTION, (most, LATER))


def _wider_limits(
    spec: Spec,
    relaxation: Relaxation,
    limits: Mapping[str, Any],
    most: float = math.inf,
) -> Suggestion | None:
    """Widen some limits as little as works, the others as they are."""
    nearest = relaxation.least(tuple(limits))
    if nearest is None or nearest.wider > most:
        return None
    needed = max(nearest.wider, 1.0)

    def change(factor: float) -> Mapping[str, Any]:
        return {place: _times(value, factor * needed) for place, value in limits.items()}

    return least_change(spec, change, relaxation.problem.sway_spread)


def _less_robust(spec: Spec) -> Suggestion | None:
    """Ask for less robustness, but for no less than passes the check."""
    robustness = spec.robustness
    if robustness.method != "sensitivity":
        return None
    changes: list[dict[str, Any]] = [{"robustness.order": 1}] if robustness.order > 1 else []
    weakest = {"robustness.method": "none", **({"robustness.order": 1} if changes else {})}
    tries = (_tried(spec, change) for change in (*changes, weakest))
    return next((one for one in tries if one and one.passes), None)


def _tried(spec: Spec, values: Mapping[str, Any]) -> Suggestion | None:
    """Suggest values if they give a motion."""
    changed = spec.changed(values)
    solution = tried(changed)
    draft = drafted(changed, solution)
    return suggested(values, draft) if choice.keeps_limits(solution) and _stands(draft) else None


def _in_time(find: Callable[[], Found], fraction: float = FRACTION) -> Found | None:
    return afford(find, fraction * left())


def _times(value: Any, factor: float) -> Any:
    """Widen a limit so many times, travel by as much at either end; rounded outwards."""
    if not isinstance(value, tuple):
        return float(rounded_up(factor * value))
    low, high = value
    more = float(rounded_up((factor - 1.0) * (high - low)))
    return (float(f"{low - more:.9g}"), float(f"{high + more:.9g}"))
