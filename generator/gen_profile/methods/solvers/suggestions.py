"""What would do where a spec has no motion: changes of the spec, each by itself, that were tried and work.

A candidate is a changed spec. The least one is looked for from what the relaxation says will be needed at
least, on few even intervals first, and then tried as the next run will try it.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache, partial
from typing import Any, TypeVar

import attrs

from gen_profile.dynamics.problem.held_axes import held_axes
from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE
from gen_profile.dynamics.problem.problem import Problem, problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers import transient_sway
from gen_profile.methods.solvers.direct.relaxation import Relaxation, least_duration, time_dependent_limits
from gen_profile.methods.solvers.draft import Plan, drafted, suggested
from gen_profile.methods.solvers.indirect.extremal import METHOD as INDIRECT
from gen_profile.methods.solvers.search import Search, least
from gen_profile.methods.solvers.solution import LONGER, Solution, Status
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import refuse_implausible
from gen_profile.spec.values import LONGEST_MOVE
from gen_profile.support.errors import CosimulationError, InfeasibleProblem, SpecError, Suggestion, rounded_up
from gen_profile.support.phrase import Phrase
from gen_profile.support.units import RATES
from gen_profile.support.work import OutOfWork, afford, budget, left, spend

COARSE_VALUE = Search(precision=math.log(1.05), close=0.0, stride=math.log(1.07))
AMPLE = math.log(1.3)  # step beyond a value that takes too much work: a smooth motion may do
# powers of the duration with which smooth motions take less of limits, and how often that is tried
SMOOTH_ORDERS, SMOOTH_TRIES = {**{name: n for n, name in enumerate(RATES, start=1)}, "sway": 2}, 3
SPREADING = 0.2  # of the work that is left, to measure how much more than the nominal machine others sway
NEAR = 1.05  # times the duration, from which on it is worth telling how long a move would take
IN_VAIN = Phrase(
    "Longer moves, wider limits and less robustness were tried as far as the work allows, and none was found "
    "to do. Not tried: fewer limits, or fewer parameters in robustness.uncertain. See whether all numbers of "
    "the spec are in its units."
)

Found = TypeVar("Found")
Change = Callable[[float], Mapping[str, Any]]  # from a factor to values by their places in the spec


@attrs.frozen(kw_only=True)
class SuggestionOptions:
    """How far and how long changes that help are looked for; see docs/solvers.md for the evidence.

    Attributes
    ----------
    search : Search
        For the least value that works, on few intervals: that may be 5 % greater than one that does not, and
        values are tried by 1.07, 1.15, 1.3 … of the first one.
    first : float
        Times the least value, for which there is but one motion: what is tried first.
    most, most_later : float
        Times the least value, up to which one is tried; and a duration where the relaxation knows of no
        limit, so of no least one.
    farther, farther_later : float
        Times the least value that works, up to which one is looked for that passes the check; and a duration.
    close_by : float
        Times the least value that passes on few intervals, up to which one is looked for on many.
    widest : float
        Times as wide as they are, all limits together are worth naming.
    fraction, fraction_later : float
        Of the work that is left, which one suggestion may take, and one value tried on few intervals; and a
        longer move in all, which nearly always works.
    at_once : float
        s of work, in which a motion without limits is found, or is not worth the while.
    """

    search: Search = COARSE_VALUE
    first: float = 1.03
    most: float = 8.0
    most_later: float = 64.0
    farther: float = 1.7
    farther_later: float = 16.0
    close_by: float = 1.2
    widest: float = 4.0
    fraction: float = 0.5
    fraction_later: float = 0.8
    at_once: float = 1.0


USUAL = SuggestionOptions()


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
    known = solution.method == INDIRECT and not spec.limits.stated() and solution.advice != LONGER
    if solution.optimum is not None:
        return solution
    if solution.status is Status.NOT_CONTROLLABLE and (freed := " ".join(held_axes(spec))):
        return attrs.evolve(solution, advice=freed)
    if known:
        gentler = _gentler(spec, solution) if solution.status is Status.DIVERGED else None
        return attrs.evolve(solution, suggestions=(gentler,) if gentler else ())
    remedies = remedy(spec, solution.problem.sway_spread)
    advice = remedies.advice or ("" if remedies.suggestions else IN_VAIN)
    return attrs.evolve(solution, advice=advice, suggestions=remedies.suggestions)


def remedy(
    spec: Spec, spread: float = 1.0, *, in_time: bool = False, options: SuggestionOptions = USUAL
) -> Remedy:
    """Find what to change so that there is a motion, each change by itself; those first that pass the check.

    Parameters
    ----------
    spec : Spec
        With a duration, without a solution.
    spread : float
        How many times as much as the nominal machine the worst one sways; 1 where unknown.
    in_time : bool
        Look for what would do in the duration asked for only.
    options : SuggestionOptions
    """
    if spec.solver.solver == "indirect" and spec.robustness.method != "range":
        method = {"solver.method": "auto"}
        with suppress(OutOfWork):
            if one := _tried(spec, method, options):
                return Remedy(suggestions=(one,))
            known = remedy(spec.changed(method), spread, in_time=in_time, options=options)
            return attrs.evolve(known, suggestions=beside(method, known.suggestions))
        return Remedy()
    relaxation = _relaxation(problem_of(spec), spread)
    problem = relaxation.problem
    needed, longer, others = None, None, list[Suggestion | None]()
    stated = problem.limits.stated()
    alone = [
        partial(_wider_limits, spec, relaxation, options, {place: value}) for place, value in stated.items()
    ]
    time_limits = {place: stated[place] for place in time_dependent_limits(problem)}
    families = [
        limits
        for limits in ([time_limits] if time_limits == stated else [time_limits, stated])
        if len(limits) > 1
    ]
    together = [
        partial(_wider_limits, spec, relaxation, options, limits, options.widest) for limits in families
    ]
    with suppress(OutOfWork):  # of the budget for the whole answer: name what was found so far
        if not in_time:
            needed = _in_time(partial(least_duration, relaxation), options.fraction)
            if needed:
                find = partial(_longer, spec, relaxation, options, needed)
                longer = _in_time(find, options.fraction_later)
            longer = longer or _in_time(partial(_smoother, spec, options), options.fraction)
        others += (_in_time(find, options.fraction) for find in alone)
        smoothly = partial(_smoother, spec, options, in_time=True)
        for last_resort in (smoothly, *together, partial(_less_robust, spec, options)):
            if not any(others):
                others.append(_in_time(last_resort, options.fraction))
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
    relaxation = _relaxation(problem_of(spec))
    needed = _in_time(partial(least_duration, relaxation), USUAL.fraction_later)
    if not needed:
        return None
    return _in_time(partial(_longer, spec, relaxation, USUAL, needed), USUAL.fraction_later)


def tried(spec: Spec, *, coarse: bool = False, options: SuggestionOptions = USUAL) -> Solution:
    """Solve a spec as the next run would, or on few intervals, to see whether there is a motion."""
    problem = problem_of(spec)
    try:
        refuse_implausible(spec)
    except SpecError:
        return choice.given_up(problem)
    if spec.solver.solver != "direct" and problem.worst_case is None:
        smooth = afford(partial(choice.attempt, problem, "indirect"), options.at_once)
        if smooth is not None and _kept(smooth):
            return smooth
    if coarse:  # whether there is a motion does not depend on what it costs
        problem = attrs.evolve(problem, sway_weight=0.0)
    solution = transient_sway.kept_by_all(problem, "direct", coarse=coarse)
    if solution.optimum is None or transient_sway.keeps_sway(solution, SWAY_TOLERANCE):
        return solution
    return attrs.evolve(solution, status=Status.DIVERGED, optimum=None)


def _kept(solution: Solution) -> bool:
    return (
        choice.keeps_limits(solution)
        and transient_sway.keeps_sway(solution, transient_sway.ACCEPTED)
        and transient_sway.keeps_behind(solution)
    )


def _relaxation(problem: Problem, spread: float = 1.0) -> Relaxation:
    known = spread if spread > 1.0 else usual_spread(problem)
    return Relaxation(attrs.evolve(problem, sway_spread=known))


def usual_spread(problem: Problem) -> float:
    """Tell how many times as much the worst machine sways on the way in a motion with wider limits."""
    nearest = choice.least_violation(problem) if transient_sway.limited(problem) else None
    if nearest is None:
        return 1.0
    # of a motion near singular, such as on no rope at all, it takes all there is
    return _in_time(partial(transient_sway.spread, nearest.solution), SPREADING) or 1.0


def least_change(
    spec: Spec,
    change: Change,
    known_spread: float = 1.0,
    options: SuggestionOptions = USUAL,
) -> Suggestion | None:
    """Find the least factor of a change that works, as near as the work that is left allows.

    Parameters
    ----------
    spec : Spec
    change : float → mapping of str to value
        What a factor makes of the spec's values.
    known_spread : float
        How many times as much as the nominal machine the worst one is supposed to sway.
    options : SuggestionOptions
    """
    coarsely, finely = options.search, attrs.evolve(options.search, close=math.inf)

    @cache
    def solved(factor: float, *, coarse: bool) -> Plan:
        changed = spec.changed(change(factor))
        share = options.fraction if coarse else 1.0
        solution = afford(partial(tried, changed, coarse=coarse, options=options), share * left())
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
    with suppress(OutOfWork), budget(options.fraction * left()):
        nearest = least(partial(excess, coarse=True), options.first, coarsely, options.most)
        passing = nearest  # over a range few intervals tell nothing of the sway that is left
        if nearest and spec.robustness.method != "range":
            passing = least(partial(unsafe, coarse=True), nearest, coarsely, options.farther * nearest)
    spend(0.0)
    with suppress(OutOfWork), budget(options.fraction * left()):
        if passing:
            most_fine = options.close_by * passing
            chosen = least(partial(unsafe, coarse=False), passing, finely, most_fine)
    spend(0.0)
    start = chosen or passing or nearest
    factor = start and least(partial(excess, coarse=False), start, finely, max(options.most, start))
    return suggested(change(factor), solved(factor, coarse=False)) if factor else None


def _stands(draft: Plan) -> bool:
    """Whether the motion, if there is one, would be judged to keep all limits."""
    try:
        return draft.found is not None and not draft.broken
    except (CosimulationError, InfeasibleProblem):
        return False


def _longer(
    spec: Spec, relaxation: Relaxation, options: SuggestionOptions, needed: float
) -> Suggestion | None:
    """Find the least duration that works, in s, rounded up to three digits."""

    def change(factor: float) -> Mapping[str, Any]:
        return {"move.duration": rounded_up(factor * needed)}

    most = options.most if time_dependent_limits(relaxation.problem) else options.most_later
    options = attrs.evolve(options, most=most, farther=options.farther_later)
    return least_change(spec, change, relaxation.problem.sway_spread, options)


def _wider_limits(
    spec: Spec,
    relaxation: Relaxation,
    options: SuggestionOptions,
    limits: Mapping[str, Any],
    most: float = math.inf,
) -> Suggestion | None:
    """Widen some limits as little as works, the others as they are."""
    nearest = relaxation.least(tuple(limits))
    if nearest is None or nearest.wider > most:
        return None
    needed = max(nearest.wider, 1.0)

    def change(factor: float) -> Mapping[str, Any]:
        way = max((abs(target.way) for target in relaxation.problem.targets), default=0.0)
        return {
            place: rounded_up(value + (factor * needed - 1.0) * way)
            if place == "limits.overshoot"
            else _times(value, factor * needed)
            for place, value in limits.items()
        }

    return least_change(spec, change, relaxation.problem.sway_spread, options)


def _smoother(spec: Spec, options: SuggestionOptions, *, in_time: bool = False) -> Suggestion | None:
    """Give the motion without limits so much more time that it keeps them, or widen those that it breaks.

    Where limits leave out what a machine can do, such as to hoist beyond its rope, the relaxation finds
    motions of which programs make nothing; what takes little of all limits is found at once.
    """
    asked = spec
    for _ in range(SMOOTH_TRIES):
        free = problem_of(asked).without_limits()
        draft = drafted(asked, choice.attempt(free, "indirect"))
        if draft.found is None:
            return None
        if not draft.broken:
            return _tried(spec, {"move.duration": asked.move.duration}, options)
        orders = [SMOOTH_ORDERS.get(broken.place.rpartition(".")[2]) for broken in draft.broken]
        if None in orders:
            return None
        if in_time:
            wider = {broken.place: rounded_up(options.first * broken.found) for broken in draft.broken}
            return _tried(spec, wider, options)
        shares = zip(draft.broken, filter(None, orders), strict=True)
        longer = max((broken.found / broken.allowed) ** (1.0 / order) for broken, order in shares)
        duration = rounded_up(options.first * longer * asked.move.duration)
        if duration > LONGEST_MOVE:
            return None
        asked = asked.changed({"move.duration": duration})
    return None


def _less_robust(spec: Spec, options: SuggestionOptions) -> Suggestion | None:
    """Ask for less robustness, but for no less than passes the check."""
    robustness = spec.robustness
    if robustness.method != "sensitivity":
        return None
    changes: list[dict[str, Any]] = [{"robustness.order": 1}] if robustness.order > 1 else []
    weakest = {"robustness.method": "none", **({"robustness.order": 1} if changes else {})}
    tries = (_tried(spec, change, options) for change in (*changes, weakest))
    return next((one for one in tries if one and one.passes), None)


def _gentler(spec: Spec, solution: Solution) -> Suggestion | None:
    """Ask for a cost of the sway that is less steep, by no more than it takes to pass the check."""
    weights = [float(f"{solution.problem.sway_weight / part:.2g}") for part in (2.0, 4.0, 16.0)]
    found = None
    with suppress(OutOfWork):
        for weight in (*weights, 0.0):
            found = _in_time(partial(_tried, spec, {"cost.sway_weight": weight}), USUAL.fraction) or found
            if found and found.passes:
                break
    return found


def _tried(spec: Spec, values: Mapping[str, Any], options: SuggestionOptions = USUAL) -> Suggestion | None:
    """Suggest values if they give a motion."""
    changed = spec.changed(values)
    solution = tried(changed, options=options)
    draft = drafted(changed, solution)
    return suggested(values, draft) if choice.keeps_limits(solution) and _stands(draft) else None


def _in_time(find: Callable[[], Found], fraction: float) -> Found | None:
    return afford(find, fraction * left())


def _times(value: Any, factor: float) -> Any:
    """Widen a limit so many times, travel by as much at either end; rounded outwards."""
    if not isinstance(value, tuple):
        return rounded_up(factor * value)
    low, high = value
    more = rounded_up((factor - 1.0) * (high - low))
    return (float(f"{low - more:.9g}"), float(f"{high + more:.9g}"))
