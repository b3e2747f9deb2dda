"""The shortest duration within a spec's limits, after which no machine of its ranges sways too much."""

import math
from contextlib import suppress

import attrs

from gen_profile.dynamics.problem.held_axes import held_axes
from gen_profile.dynamics.problem.problem import Problem, problem_of
from gen_profile.methods.shapers.shaped_move import too_short
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers import transient_sway
from gen_profile.methods.solvers.direct.relaxation import ROUGHLY, SHORTEST_WITHIN, Relaxed, refined
from gen_profile.methods.solvers.draft import Plan, drafted, in_cycles, lasting, solved, suggested
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.search import Search, least, slope_of
from gen_profile.methods.solvers.shape import shaped_motion
from gen_profile.methods.solvers.suggestions import beside, remedy, sufficient_duration
from gen_profile.spec.model import Spec
from gen_profile.spec.values import LONGEST_MOVE
from gen_profile.support.errors import Code, InfeasibleProblem, Reason, SolverDiverged, rounded_up
from gen_profile.support.phrase import Phrase
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork, budget, left, spend

TIME_ENOUGH = 2.0  # times the usual duration, which is time enough where no duration keeps the limits
SEARCH_WORK = 8.0  # s of work to find the shortest duration
SPREADING = 0.6  # of the work that is left for it to find the shortest duration, all machines considered
SPREADS = 3  # times that it is measured how much more than the nominal machine others sway on the way
DURATION_ROUNDING = 1e-9  # of a duration
NEARLY_SUPPOSED = 2e-3  # relative, by which it may be another than was supposed
# residual sway falls steeply with the duration, as far as nothing more is known of it
COARSE_DURATION = Search(
    precision=5e-3, close=0.06, aim=-0.03, slope=15.0, believed=(1.0, math.inf), growth=8.0, longest=1.0
)
EXACT_DURATION = attrs.evolve(
    COARSE_DURATION, precision=1e-3, close=4e-3, aim=-1.5e-3, stride=1e-3, downward=True
)
LONGEST_CALMER = (
    10.0  # times the shortest duration within limits, after which a calmer motion is not looked for
)


def timed(spec: Spec, progress: Progress = no_progress) -> Spec:
    """Find the shortest duration where a spec asks for it.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        As `shortest` does.
    """
    return shortest(spec, progress).spec if spec.move.shortest else spec


def shortest(spec: Spec, progress: Progress = no_progress) -> Plan:
    """Find the shortest motion within the spec's bounds that ends on a cycle of the controller.

    An optimal one takes longer than its limits make it where it would otherwise leave more sway than the
    check allows on some machine.

    Raises
    ------
    InfeasibleProblem
        No duration was found to do.
    SolverDiverged
        None was found in the work that a search may take.
    """
    if spec.solver.shaper is not None:
        motion = shaped_motion(spec, spec.solver.shaper)
        return short_enough(spec, Plan(spec=lasting(spec, motion.duration), solution=None, found=motion))
    problem = problem_of(spec)
    try:
        with budget(SEARCH_WORK):
            least = _within_sway(spec, *_within_limits(spec, problem, progress), progress)
    except OutOfWork as error:
        spend(0.0)
        longer = sufficient_duration(_slow(spec, problem))
        raise SolverDiverged(
            Phrase("move.duration: the search for the shortest duration was given up, for it took too long."),
            Phrase("State a duration in s, or fewer limits."),
            reasons=[Reason(code=Code.GIVEN_UP, place="move.duration")],
            suggestions=filter(None, [longer]),
        ) from error
    if least is None:
        raise InfeasibleProblem(
            Phrase(
                "check.residual_sway: no duration leaves so little sway on every machine of "
                "robustness.uncertain; allow more, or narrow the ranges."
            ),
            *held_axes(spec),
            reasons=[Reason(code=Code.RESIDUAL_SWAY, place="check.residual_sway")],
        )
    return short_enough(spec, least)


def short_enough(spec: Spec, shortest_found: Plan) -> Plan:
    """Give the shortest motion, unless the spec allows less time.

    Raises
    ------
    InfeasibleProblem
    """
    most, duration = spec.move.bounds.most, shortest_found.motion.duration
    if most is None or duration <= most * (1.0 + DURATION_ROUNDING):
        return shortest_found
    raise InfeasibleProblem(
        Phrase(
            "move.duration: the shortest motion takes {duration:.6g} s, and at most {most:g} s are allowed.",
            duration=duration,
            most=most,
        ),
        reasons=[too_short(most, duration)],
        suggestions=[suggested({"move.duration": duration}, shortest_found)],
    )


def _within_limits(spec: Spec, problem: Problem, progress: Progress) -> tuple[Problem, Relaxed]:
    """Find the shortest motion within the limits, and the problem with the spread that machines have then."""
    _require_short(choice.usual_duration(problem))
    swayed = transient_sway.limited(problem) or bool(problem.targets and problem.ranges)
    least = choice.minimum_time(
        problem, progress, search=ROUGHLY if transient_sway.limited(problem) else SHORTEST_WITHIN
    )
    with suppress(OutOfWork), budget(SPREADING * left()):
        for _ in range(SPREADS):
            if least is None or not swayed:
                break
            more, solution = transient_sway.spread(least.solution), least.solution
            margin = problem.overshoot_margin
            if solution.optimum is not None:
                margin = transient_sway.overshoot_margin(problem, optimal_profile(solution))
            swayed = (
                abs(more - problem.sway_spread) > NEARLY_SUPPOSED * more or margin > problem.overshoot_margin
            )
            problem = attrs.evolve(problem, sway_spread=more, overshoot_margin=margin)
            least = choice.minimum_time(problem, progress, least)
    if least is None:
        slow = _slow(spec, problem)
        duration = {"move.duration": slow.move.duration}
        better = beside(duration, remedy(slow, in_time=True).suggestions)
        advice = Phrase("Widen the limits, or see whether all numbers of the spec are in its units.")
        raise InfeasibleProblem(
            Phrase("move.duration: no duration keeps the limits and brings the load to rest."),
            *([] if better else [advice]),
            reasons=[Reason(code=Code.INFEASIBLE, place="move.duration")],
            suggestions=better,
        )
    _require_short(least.duration)
    return problem, least


def _require_short(duration: float) -> None:
    """Refuse limits within which a move lasts longer than a spec may state.

    Raises
    ------
    InfeasibleProblem
    """
    if duration > LONGEST_MOVE:
        raise InfeasibleProblem(
            Phrase(
                "move.duration: by an estimate, the shortest move within the limits takes some "
                "{needed:.0f} s; it may last {most:.0f} s.",
                needed=float(f"{duration:.2g}"),
                most=LONGEST_MOVE,
            ),
            Phrase("Widen the limits, or see whether all numbers of the spec are in its units."),
            reasons=[
                Reason(code=Code.INFEASIBLE, place="move.duration", found=duration, allowed=LONGEST_MOVE)
            ],
        )


def _within_sway(spec: Spec, problem: Problem, shortest_kept: Relaxed, progress: Progress) -> Plan | None:
    """Find the shortest motion of least cost with little sway, no shorter than the one within the limits.

    Motions on few intervals lead near to it; where the work ends before one on many is found, one of those is
    taken.
    """
    first, bound = _drafted(spec, shortest_kept), spec.move.bounds.least or 0.0
    if first.spec.move.duration < bound:
        first = solved(lasting(spec, in_cycles(spec, bound)), spread=problem.sway_spread, near=shortest_kept)
        if _excess(first) <= 0.0:
            return first
    elif first.excess_sway <= 0.0:
        finer = refined(problem, shortest_kept, progress)
        shorter = _drafted(spec, finer)
        if shorter.excess_sway <= 0.0:
            first, shortest_kept = shorter, finer
    most, start = LONGEST_CALMER * shortest_kept.duration, first.spec.move.duration
    # an axis without limits may fling a load about
    near = shortest_kept if first.excess_sway < math.inf else None
    rough, exact = {start: first}, dict[float, Plan]()

    def roughly(duration: float) -> float:
        if duration != start:
            asked = attrs.evolve(problem, duration=duration)
            solution = choice.attempt(asked, "direct", coarse=True, near=near)
            rough[duration] = drafted(lasting(spec, duration), solution)
        return _excess(rough[duration])

    def exactly(duration: float) -> float:
        progress("looking for the shortest duration with little sway", remark=f"trying {duration:.3g} s")
        exact[duration] = solved(lasting(spec, duration), spread=problem.sway_spread, near=near)
        return _excess(exact[duration])

    def rounded(duration: float) -> float:
        return max(start, in_cycles(spec, duration))

    guess = least(roughly, start, COARSE_DURATION, most, rounded) if problem.worst_case is None else None
    slope = slope_of({duration: draft.excess_sway for duration, draft in rough.items()}) or 0.0
    search = (
        attrs.evolve(EXACT_DURATION, slope=slope) if slope > EXACT_DURATION.believed[0] else EXACT_DURATION
    )
    try:
        duration = least(exactly, guess or start, search, most, rounded)
    except OutOfWork:
        if guess is None:
            raise
        return rough[guess]
    return None if duration is None else exact[duration]


def _excess(draft: Plan) -> float:
    """Tell how much more sway a motion leaves than it should; infinite where it breaks limits."""
    excess = draft.excess_sway
    return math.inf if excess < math.inf and draft.broken else excess


def _drafted(spec: Spec, relaxed: Relaxed) -> Plan:
    """Take a shortest motion within limits, its duration rounded up to a cycle."""
    return drafted(lasting(spec, in_cycles(spec, relaxed.duration)), relaxed.solution)


def _slow(spec: Spec, problem: Problem) -> Spec:
    """Give a spec so much time that it is not the time that it lacks, as far as a move may last so long."""
    return lasting(spec, min(rounded_up(TIME_ENOUGH * choice.usual_duration(problem)), LONGEST_MOVE))
