"""The shortest duration within a spec's limits, after which no machine of its ranges sways too much."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cache, partial

import attrs

from gen_profile.designs import transient_sway
from gen_profile.designs.draft import Draft, drafted, solved
from gen_profile.designs.shape import shaped_motion
from gen_profile.errors import InfeasibleProblem, SolverDiverged
from gen_profile.motion.profile import grid_length, grid_times
from gen_profile.problem.limits import rounded_up
from gen_profile.problem.problem import Problem, problem_of
from gen_profile.progress import Progress, untold
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct.relaxation import Relaxed
from gen_profile.solvers.minimum_time import least_corrected
from gen_profile.spec.model import Spec
from gen_profile.work import OutOfWork, budget, left, spend

SLOW = 2.0  # times the usual duration, which is time enough where no duration keeps the limits
SEARCHING = 8.0  # s of work to find the shortest duration
SPREADING = 0.6  # of the work that is left for it to find the shortest duration, all machines considered
SPREADS = 3  # times that it is measured how much more than the nominal machine others sway on the way
NEARLY = 2e-3  # relative, by which it may be another than was supposed
LONGEST = 10.0  # times the shortest duration within limits, after which a calmer motion is not looked for


def timed(spec: Spec, progress: Progress = untold) -> Spec:
    """Find the shortest duration where a spec asks for it.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        As `shortest` does.
    """
    return shortest(spec, progress).spec if spec.move.shortest else spec


def shortest(spec: Spec, progress: Progress = untold) -> Draft:
    """Find the shortest motion that ends on a cycle of the controller.

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
        return Draft(spec=_lasting(spec, motion.duration), solution=None, motion=motion)
    calm = dict[str, Draft]()
    try:
        with budget(SEARCHING):
            found = _calm(spec, *_within_limits(spec, progress), progress, calm)
    except OutOfWork as error:
        spend(0.0)
        found = calm.get("exactly") or calm.get("roughly")
        if found is None:
            enough = choice.sufficient_duration(_slow(spec), partial(transient_sway.as_asked_next, spec))
            cure = f"Allow about {enough} s (move.duration)" if enough else "State a duration in s"
            raise SolverDiverged(
                "move.duration: the search for the shortest duration was given up, for it took too long. "
                f"{cure}, or fewer limits."
            ) from error
    if found is None:
        raise InfeasibleProblem(
            "check.residual_sway: no duration leaves so little sway on every machine of "
            "robustness.uncertain; allow more, or narrow the ranges."
        )
    return found


def _within_limits(spec: Spec, progress: Progress) -> tuple[Problem, Relaxed]:
    """Find the shortest motion within the limits, and the problem with the spread that machines have then."""
    problem = problem_of(spec)
    swayed = transient_sway.limited(spec, problem)
    found = choice.minimum_time(problem, progress, roughly=swayed)
    with suppress(OutOfWork), budget(SPREADING * left()):
        for _ in range(SPREADS):
            if found is None or not swayed:
                break
            more = transient_sway.spread(spec, found.solution)
            swayed = abs(more - problem.sway_spread) > NEARLY * more
            problem = attrs.evolve(problem, sway_spread=more)
            found = choice.minimum_time(problem, progress, found)
    if found is None:
        cure = (
            choice.requirements(_slow(spec), partial(transient_sway.as_asked_next, spec))
            or "Widen the limits, or see whether all numbers of the spec are in its units."
        )
        raise InfeasibleProblem(
            f"move.duration: no duration keeps the limits and brings the load to rest. {cure}"
        )
    return problem, found


def _calm(
    spec: Spec, problem: Problem, easiest: Relaxed, progress: Progress, calm: dict[str, Draft]
) -> Draft | None:
    """Find the shortest motion of least cost with little sway, beyond the one most easily within the limits.

    The last motions that do, found on few intervals or many, are put into a dictionary.
    """
    first = drafted(_lasting(spec, easiest.duration), easiest.solution)
    # an axis without limits may fling a load about
    near = easiest if first.excess_sway < math.inf else None

    def tried(how: str, found: Draft) -> float:
        if found.excess_sway <= 0.0:
            calm[how] = found
        return found.excess_sway

    @cache
    def exactly(duration: float) -> tuple[float, Draft]:
        progress("looking for the shortest duration with little sway", remark=f"trying {duration:.3g} s")
        found = solved(_lasting(spec, duration), spread=problem.sway_spread, near=near)
        return tried("exactly", found), found

    def roughly(duration: float) -> float:
        if problem.worst_case is not None:
            return exactly(duration)[0]
        if duration == first.spec.move.duration:
            return first.excess_sway
        lasting = attrs.evolve(problem, duration=duration)
        solution = choice.attempt(lasting, "direct", coarse=True, near=near)
        return tried("roughly", drafted(_lasting(spec, duration), solution))

    most = LONGEST * easiest.duration
    return least_corrected(roughly, exactly, easiest.duration, most, partial(_in_cycles, spec))


def _slow(spec: Spec) -> Problem:
    """Give a problem so much time that it is not the time that it lacks, and the machines' usual spread."""
    problem = problem_of(spec)
    slow = attrs.evolve(problem, duration=float(rounded_up(SLOW * choice.usual_duration(problem))))
    return transient_sway.with_usual_spread(spec, slow)


def _in_cycles(spec: Spec, duration: float) -> float:
    """Round a duration up to a cycle of a spec's controller."""
    cycle = spec.export.cycle_time
    return float(grid_times(grid_length(duration, cycle), cycle)[-1])


def _lasting(spec: Spec, duration: float) -> Spec:
    """Give a spec a duration, rounded up to a cycle of its controller."""
    whole = _in_cycles(spec, duration)
    return attrs.evolve(spec, move=attrs.evolve(spec.move, duration=whole, shortest=False))
