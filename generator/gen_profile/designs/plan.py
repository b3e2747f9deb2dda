"""From a spec to a motion and its figures, before anything is written."""

from __future__ import annotations

import time
from functools import partial

import attrs
import numpy as np

from gen_profile.designs import transient_sway
from gen_profile.designs.shape import shaped_motion
from gen_profile.errors import InfeasibleProblem, LimitViolation, SolverDiverged
from gen_profile.evaluation.motion_evaluation import MotionEvaluation, evaluate, keeps_residual_sway
from gen_profile.motion.profile import Profile, grid_length, grid_times
from gen_profile.problem.limits import SWAY_TOLERANCE, breaches, rounded_up
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import problem_of
from gen_profile.progress import Progress, untold
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.minimum_time import least_beyond
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution
from gen_profile.spec.model import Spec
from gen_profile.work import OutOfWork, budget

SLOW = 5.0  # periods of the slowest mode, which are time enough where no duration keeps the limits
CALM = 0.99  # share of the limits of residual sway, which leaves room for the setpoints' own errors
EXPLAINING = "looking for what would do"
SEARCHING = 20.0  # s of work to find the shortest duration
SPREADS = 2  # times that it is measured how much more than the nominal machine others sway on the way
LONGEST = 10.0  # times the shortest duration within limits, after which a calmer motion is not looked for


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
    if not spec.move.shortest:
        return spec
    if spec.solver.shaper is not None:
        return _lasting(spec, shaped_motion(spec, spec.solver.shaper).duration)
    try:
        with budget(SEARCHING * choice.patience(problem_of(spec))):
            return _shortest(spec, progress)
    except OutOfWork as error:
        raise SolverDiverged(
            "move.duration: the search for the shortest duration was given up, for it took too long; "
            "state a duration in s, or fewer limits."
        ) from error


def _shortest(spec: Spec, progress: Progress) -> Spec:
    problem = problem_of(spec)
    shortest = choice.minimum_time(problem, progress)
    for _ in range(SPREADS):
        if shortest is None:
            break
        more = transient_sway.measured_spread(_lasting(spec, shortest), problem.sway_spread)
        if more <= problem.sway_spread:
            break
        problem = attrs.evolve(problem, sway_spread=more)
        shortest = choice.minimum_time(problem, progress)
    if shortest is None:
        slowest = linearize(problem.plant, problem.parameters, problem.target).frequencies[0]
        slow = attrs.evolve(problem, duration=float(rounded_up(SLOW * 2.0 * np.pi / slowest)))
        cure = choice.requirements(transient_sway.with_usual_spread(spec, slow)) or "Widen the limits."
        raise InfeasibleProblem(
            f"move.duration: no duration keeps the limits and brings the load to rest. {cure}"
        )
    quickest = _lasting(spec, shortest)
    if _calms(quickest, problem.sway_spread):
        return quickest

    def calms(duration: float) -> bool:
        progress("looking for the shortest duration with little sway", remark=f"trying {duration:.3g} s")
        return _calms(_lasting(spec, duration), problem.sway_spread)

    calm = least_beyond(calms, shortest, LONGEST * shortest)
    if calm is None:
        raise InfeasibleProblem(
            "check.residual_sway: no duration leaves so little sway on every machine of "
            "robustness.uncertain; allow more, or narrow the ranges."
        )
    return _lasting(spec, calm)


def _lasting(spec: Spec, duration: float) -> Spec:
    """Give a spec a duration, rounded up to a cycle of its controller."""
    cycle = spec.export.cycle_time
    whole = float(grid_times(grid_length(duration, cycle), cycle)[-1])
    return attrs.evolve(spec, move=attrs.evolve(spec.move, duration=whole, shortest=False))


def _calms(spec: Spec, spread: float) -> bool:
    """Whether the optimal motion of a spec leaves little enough sway on every machine."""
    solution = transient_sway.attempt(spec, spread=spread)
    return solution.optimum is not None and _is_calm(spec, solution)


def _is_calm(spec: Spec, solution: Solution) -> bool:
    """Whether a solution leaves every machine of a spec little enough sway, and no more on the way."""
    evaluation, limit = evaluate(spec, optimal_profile(solution)), solution.problem.limits.sway
    swings = limit is not None and evaluation.figures["sway_transient_worst_m"] > SWAY_TOLERANCE * limit
    return not swings and keeps_residual_sway(spec, evaluation, CALM)


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
            return _planned(timed(spec, progress), progress)
    except OutOfWork:
        choice.given_up(problem_of(spec)).raise_for_status()
        raise


def _planned(spec: Spec, progress: Progress) -> Plan:
    """Plan a spec that has a duration.

    Raises
    ------
    OutOfWork
        Nothing is left of a budget.
    """
    progress("solving")
    began = time.perf_counter()
    solution, motion = _designed(spec, progress)
    solver_time = time.perf_counter() - began
    evaluation = evaluate(spec, motion)
    found = evaluation.figures
    swing = max(found["sway_transient_peak_m"], found["sway_transient_worst_m"] / SWAY_TOLERANCE)
    broken = breaches(spec.limits, evaluation.command, swing)
    if broken:
        sentences = [breach.sentence() for breach in broken]
        progress(EXPLAINING)
        cure = choice.remedy(problem_of(spec), spec.solver.solver, partial(_is_calm, spec))
        raise LimitViolation("\n".join([*sentences, cure]).strip())
    return Plan(spec=spec, solution=solution, solver_time=solver_time, evaluation=evaluation, figures=found)


def _designed(spec: Spec, progress: Progress) -> tuple[Solution | None, Profile]:
    """Solve a spec that has a duration, or find out what would help; or shape a move for it."""
    if spec.solver.shaper is not None:
        return None, shaped_motion(spec, spec.solver.shaper)
    attempt = transient_sway.attempt(spec, progress)
    if attempt.optimum is None:
        progress(EXPLAINING)
    solution = choice.diagnosed(attempt, spec.solver.solver, partial(_is_calm, spec))
    return solution, optimal_profile(solution)
