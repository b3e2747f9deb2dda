"""From a spec to a motion and its figures, before anything is written."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from functools import cached_property, partial

import attrs
import numpy as np

from gen_profile.designs import transient_sway
from gen_profile.designs.shape import shaped_motion
from gen_profile.errors import CosimulationError, InfeasibleProblem, LimitViolation, SolverDiverged
from gen_profile.evaluation.motion_evaluation import MotionEvaluation, evaluate, share_of_residual_sway
from gen_profile.motion.profile import Profile, grid_length, grid_times
from gen_profile.problem.limits import SWAY_TOLERANCE, breaches, rounded_up
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import Problem, problem_of
from gen_profile.progress import Progress, untold
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct.relaxation import Relaxed
from gen_profile.solvers.minimum_time import least_corrected
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution
from gen_profile.spec.model import Spec
from gen_profile.work import OutOfWork, budget, left, spend

SLOW = 5.0  # periods of the slowest mode, which are time enough where no duration keeps the limits
CALM = 0.99  # share of the limits of residual sway, which leaves room for the setpoints' own errors
EXPLAINING = "looking for what would do"
SEARCHING = 18.0  # s of work to find the shortest duration
SPREADING = 0.6  # of the work that is left for it to find the shortest duration, all machines considered
SPREADS = 3  # times that it is measured how much more than the nominal machine others sway on the way
NEARLY = 2e-3  # relative, by which it may be another than was supposed
LONGEST = 10.0  # times the shortest duration within limits, after which a calmer motion is not looked for


@attrs.frozen(kw_only=True, eq=False)
class Draft:
    """A motion that was tried on no machine, or none.

    Attributes
    ----------
    spec : Spec
        With a duration.
    solution : Solution or None
        What the solver found, or why it found nothing; None where a shaper made the motion.
    motion : Profile or None
        Of the axes.
    solver_time : float
        s.
    """

    spec: Spec
    solution: Solution | None
    motion: Profile | None
    solver_time: float

    @cached_property
    def evaluation(self) -> MotionEvaluation:
        """Of the motion, which must be there, on all machines."""
        assert self.motion is not None
        return evaluate(self.spec, self.motion)


@attrs.frozen(kw_only=True, eq=False)
class Plan:
    """A design that is not yet written.

    Attributes
    ----------
    spec : Spec
        What was planned, its duration found where the shortest was asked for.
    solution : Solution or None
        What the solver found; None where a shaper made the motion.
    solver_time : float
        s.
    evaluation : MotionEvaluation
        Of the motion.
    figures : dict of str to float
    """

    spec: Spec
    solution: Solution | None
    solver_time: float
    evaluation: MotionEvaluation
    figures: dict[str, float]

    @property
    def motion(self) -> Profile:
        """Of the axes."""
        return self.evaluation.motion

    @property
    def command(self) -> Profile:
        """Setpoints of the drives, which is the motion itself where they are ideal."""
        return self.evaluation.command


def timed(spec: Spec, progress: Progress = untold) -> Spec:
    """Find the shortest duration where a spec asks for it; it ends on a cycle of the controller.

    An optimal motion takes longer than its limits make it where it would otherwise leave more sway than the
    check allows on some machine.

    Raises
    ------
    InfeasibleProblem
        No duration was found to do.
    SolverDiverged
        None was found in the work that a search may take.
    """
    return _timed(spec, progress)[0]


def _timed(spec: Spec, progress: Progress) -> tuple[Spec, Draft | None]:
    """Find the shortest duration where a spec asks for it, and the motion, where that was looked for, too."""
    if not spec.move.shortest:
        return spec, None
    if spec.solver.shaper is not None:
        return _lasting(spec, shaped_motion(spec, spec.solver.shaper).duration), None
    try:
        with budget(SEARCHING):
            found = _shortest(spec, progress)
            return found.spec, found
    except OutOfWork as error:
        spend(0.0)
        enough = choice.sufficient_duration(_slow(spec), partial(transient_sway.as_asked_next, spec))
        cure = f"Allow about {enough} s (move.duration)" if enough else "State a duration in s"
        raise SolverDiverged(
            "move.duration: the search for the shortest duration was given up, for it took too long. "
            f"{cure}, or fewer limits."
        ) from error


def _shortest(spec: Spec, progress: Progress) -> Draft:
    problem = problem_of(spec)
    swayed = transient_sway.limited(spec, problem)
    shortest = choice.minimum_time(problem, progress, roughly=swayed)
    with suppress(OutOfWork), budget(SPREADING * left()):
        for _ in range(SPREADS):
            if shortest is None or not swayed:
                break
            more = transient_sway.spread(spec, shortest.solution)
            swayed = abs(more - problem.sway_spread) > NEARLY * more
            problem = attrs.evolve(problem, sway_spread=more)
            shortest = choice.minimum_time(problem, progress, shortest)
    if shortest is None:
        cure = (
            choice.requirements(_slow(spec), partial(transient_sway.as_asked_next, spec))
            or "Widen the limits, or see whether all numbers of the spec are in its units."
        )
        raise InfeasibleProblem(
            f"move.duration: no duration keeps the limits and brings the load to rest. {cure}"
        )

    def unrest(solution: Solution, duration: float) -> float:
        motion = None if solution.optimum is None else optimal_profile(solution)
        return _unrest(
            Draft(spec=_lasting(spec, duration), solution=solution, motion=motion, solver_time=0.0)
        )

    # an axis without limits may fling a load about
    near = shortest if unrest(shortest.solution, shortest.duration) < math.inf else None

    def exactly(duration: float) -> tuple[float, Draft]:
        progress("looking for the shortest duration with little sway", remark=f"trying {duration:.3g} s")
        found = _solved(_lasting(spec, duration), spread=problem.sway_spread, near=near)
        return _unrest(found), found

    def roughly(duration: float) -> float:
        solution = shortest.solution
        if duration > _in_cycles(spec, shortest.duration):
            timed = attrs.evolve(problem, duration=duration)
            solution = choice.attempt(timed, "direct", coarse=True, near=near)
        return unrest(solution, duration)

    calm = least_corrected(
        roughly if problem.worst_case is None else lambda duration: exactly(duration)[0],
        exactly,
        shortest.duration,
        LONGEST * shortest.duration,
        partial(_in_cycles, spec),
    )
    if calm is None:
        raise InfeasibleProblem(
            "check.residual_sway: no duration leaves so little sway on every machine of "
            "robustness.uncertain; allow more, or narrow the ranges."
        )
    return calm


def _slow(spec: Spec) -> Problem:
    """Give a problem so much time that it is not the time that it lacks, and the machines' usual spread."""
    problem = problem_of(spec)
    slowest = linearize(problem.plant, problem.parameters, problem.target).frequencies[0]
    slow = attrs.evolve(problem, duration=float(rounded_up(SLOW * 2.0 * np.pi / slowest)))
    return transient_sway.with_usual_spread(spec, slow)


def _in_cycles(spec: Spec, duration: float) -> float:
    """Round a duration up to a cycle of a spec's controller."""
    cycle = spec.export.cycle_time
    return float(grid_times(grid_length(duration, cycle), cycle)[-1])


def _lasting(spec: Spec, duration: float) -> Spec:
    """Give a spec a duration, rounded up to a cycle of its controller."""
    whole = _in_cycles(spec, duration)
    return attrs.evolve(spec, move=attrs.evolve(spec.move, duration=whole, shortest=False))


def _unrest(found: Draft) -> float:
    """Tell how much more sway a draft leaves than it should, as a logarithm; infinite without a motion."""
    if found.motion is None or found.solution is None:
        return math.inf
    try:
        evaluation, limit = found.evaluation, found.solution.problem.limits.sway
    except CosimulationError:  # which no machine can follow
        return math.inf
    if limit is not None and evaluation.figures["sway_transient_worst_m"] > SWAY_TOLERANCE * limit:
        return math.inf
    share = share_of_residual_sway(found.spec, evaluation)
    return math.log(share / CALM) if share > 0.0 else -math.inf


def _is_calm(spec: Spec, solution: Solution) -> bool:
    """Whether a solution leaves every machine of a spec little enough sway, and no more on the way."""
    motion = optimal_profile(solution)
    return _unrest(Draft(spec=spec, solution=solution, motion=motion, solver_time=0.0)) <= 0.0


def plan(spec: Spec, progress: Progress = untold) -> Plan:
    """Solve a spec, or shape a move for it, and try the motion on all machines.

    Parameters
    ----------
    spec : Spec
    progress : Progress

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation
    """
    try:
        with budget(*choice.ANSWER):
            return judged(draft(spec, progress), progress)
    except OutOfWork:
        choice.given_up(problem_of(spec)).raise_for_status()
        raise


def draft(spec: Spec, progress: Progress = untold) -> Draft:
    """Solve a spec, or shape a move for it, and look no further.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        No duration, or no shaped move, was found.
    OutOfWork
        Nothing is left of a budget.
    """
    spec, found = _timed(spec, progress)
    progress("solving")
    return found or _solved(spec, progress)


def _solved(
    spec: Spec, progress: Progress = untold, spread: float = 1.0, near: Relaxed | None = None
) -> Draft:
    """Solve a spec with a duration, or shape a move for it."""
    began = time.perf_counter()
    solution: Solution | None = None
    motion: Profile | None = None
    if spec.solver.shaper is not None:
        motion = shaped_motion(spec, spec.solver.shaper)
    else:
        solution = transient_sway.attempt(spec, progress, spread, near)
        if solution.optimum is not None:
            motion = optimal_profile(solution)
    return Draft(spec=spec, solution=solution, motion=motion, solver_time=time.perf_counter() - began)


def judged(found: Draft, progress: Progress = untold) -> Plan:
    """Try a drafted motion on all machines; say what would help where there is none within the limits.

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation
    OutOfWork
        Nothing is left of a budget.
    """
    spec = found.spec
    if found.motion is None:
        found = attrs.evolve(found, motion=_motion(found, progress))
    evaluation = found.evaluation
    figures = evaluation.figures
    swing = max(figures["sway_transient_peak_m"], figures["sway_transient_worst_m"] / SWAY_TOLERANCE)
    broken = breaches(spec.limits, evaluation.command, swing)
    if broken:
        sentences = [breach.sentence() for breach in broken]
        progress(EXPLAINING)
        cure = choice.remedy(
            problem_of(spec),
            spec.solver.solver,
            partial(_is_calm, spec),
            partial(transient_sway.as_asked_next, spec),
        )
        raise LimitViolation("\n".join([*sentences, cure]).strip())
    return Plan(
        spec=spec,
        solution=found.solution,
        solver_time=found.solver_time,
        evaluation=evaluation,
        figures=figures,
    )


def _motion(found: Draft, progress: Progress) -> Profile:
    """Take a draft's motion, or find out what would help."""
    if found.motion is not None:
        return found.motion
    assert found.solution is not None  # a shaper has a motion, or raises
    progress(EXPLAINING)
    spec = found.spec
    return optimal_profile(
        choice.diagnosed(
            found.solution,
            spec.solver.solver,
            partial(_is_calm, spec),
            partial(transient_sway.as_asked_next, spec),
        )
    )
