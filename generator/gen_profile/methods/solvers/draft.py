"""A motion for a spec, not yet held to its limits."""

import math
import time
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import attrs

from gen_profile.dynamics.evaluation.clearance import Nearest
from gen_profile.dynamics.evaluation.motion_evaluation import (
    MotionEvaluation,
    evaluate,
    share_of_residual_sway,
)
from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE, Breach, breaches
from gen_profile.dynamics.problem.overshoot import counted, excess
from gen_profile.methods.solvers import transient_sway
from gen_profile.methods.solvers.direct.relaxation import Relaxed
from gen_profile.methods.solvers.motion import whole_motion
from gen_profile.methods.solvers.shape import shaped_motion
from gen_profile.methods.solvers.solution import Solution
from gen_profile.motion.profile import Profile, grid_duration
from gen_profile.spec.model import Spec
from gen_profile.support.errors import Code, CosimulationError, InfeasibleProblem, Suggestion, rounded_up
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.summary import Drawable

ROOM = 2.0  # times a shaper's delay, which leaves the base move as much time
# fraction of the limits of residual sway, which leaves room for the setpoints' errors; with 0.9 the shortest
# move takes 1 % longer
BASE_WITHIN = 0.99


@attrs.frozen(kw_only=True)
class Passage:
    """What is known of a motion over stacks.

    Attributes
    ----------
    lift : float
        How far the hoist lifts from the start, in m.
    one_by_one : float or None
        Duration in s of lifting, travelling and lowering one after the other, where one was found.
    nearest : Nearest
        Of machines all over the ranges.
    programs : int
        That were solved.
    """

    lift: float
    one_by_one: float | None
    nearest: Nearest
    programs: int

    def gained(self, duration: float) -> str:
        """Compare a duration in s with that of one axis after the other."""
        if self.one_by_one is None:
            return f"{duration:.4g} s"
        saved = 100.0 * (1.0 - duration / self.one_by_one)
        if saved < 0.0:
            return f"{duration:.4g} s, longer than one axis after the other ({self.one_by_one:.4g} s)"
        return f"{duration:.4g} s, {saved:.3g} % less than one axis after the other ({self.one_by_one:.4g} s)"


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Plan(Drawable):
    """A motion for a spec, of which nothing is written yet, or none.

    Attributes
    ----------
    spec : Spec
        With a duration, found where the shortest was asked for.
    solution : Solution or None
        What the solver found, or why it found nothing; None where a shaper made the motion, or over stacks.
    found : Profile or None
        Motion of the axes, there in what `gen_profile.plan` gives.
    solver_time : float
        s.
    passage : Passage or None
        Of a motion over stacks, which has no solution.
    """

    spec: Spec
    solution: Solution | None
    found: Profile | None
    solver_time: float = 0.0
    passage: Passage | None = None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "name": self.spec.name,
            "motion": f"{self.motion.method}, {self.motion.duration:g} s",
            "residual sway": f"{1e3 * self.figures['sway_residual_worst_m']:.4g} mm at worst",
        }

    @property
    def motion(self) -> Profile:
        """Of the axes, which must be there."""
        assert self.found is not None
        return self.found

    @property
    def command(self) -> Profile:
        """Setpoints of the drives, which is the motion itself where they are ideal."""
        return self.evaluation.command

    @property
    def figures(self) -> dict[str, float]:
        """Of the motion on all machines."""
        return self.evaluation.figures

    @cached_property
    def evaluation(self) -> MotionEvaluation:
        """Of the motion on all machines."""
        return evaluate(self.spec, self.motion)

    @cached_property
    def broken(self) -> tuple[Breach, ...]:
        """The limits that the motion, which must be there, breaks on some machine."""
        figures = self.evaluation.figures
        sway = max(figures["sway_transient_peak_m"], figures["sway_transient_worst_m"] / SWAY_TOLERANCE)
        over = counted(self.evaluation.targets, *self.evaluation.overshoot)
        return breaches(self.spec.limits, self.evaluation.command, sway, over)

    @cached_property
    def excess_sway(self) -> float:
        """How much more sway it leaves than it should, as a logarithm; infinite without a motion.

        Also where the motion sways more on the way than it may, or no machine can follow it.
        """
        if self.found is None:
            return math.inf
        try:
            evaluation, limit = self.evaluation, self.spec.limits.sway
        except CosimulationError:
            return math.inf
        if limit is not None and evaluation.figures["sway_transient_worst_m"] > SWAY_TOLERANCE * limit:
            return math.inf
        if excess(evaluation.targets, evaluation.overshoot[1]) > 0.0:
            return math.inf
        taken = share_of_residual_sway(self.spec, evaluation)
        return math.log(taken / BASE_WITHIN) if taken > 0.0 else -math.inf


def drafted(spec: Spec, solution: Solution, solver_time: float = 0.0) -> Plan:
    """Take the motion of a solution, if it has one."""
    motion = None if solution.optimum is None else whole_motion(spec, solution)
    return Plan(spec=spec, solution=solution, found=motion, solver_time=solver_time)


def solved(
    spec: Spec, progress: Progress = no_progress, spread: float = 1.0, near: Relaxed | None = None
) -> Plan:
    """Solve a spec with a duration, or shape a move for it; `near` as in `transient_sway.attempt`."""
    if spec.solver.shaper is not None:
        return _shaped(spec, spec.solver.shaper)
    began = time.perf_counter()
    solution = transient_sway.attempt(spec, progress, spread, near)
    return drafted(spec, solution, time.perf_counter() - began)


def _shaped(spec: Spec, shaper: str) -> Plan:
    """Shape a move; where that takes longer than the spec allows, try a duration that is long enough."""
    try:
        return Plan(spec=spec, solution=None, found=shaped_motion(spec, shaper))
    except InfeasibleProblem as error:
        least = error.least_duration
        if least is not None:
            limited = any(one.code is Code.LIMIT_BROKEN for one in error.reasons)
            duration = rounded_up(least if limited else ROOM * least, digits=4)
            if duration > spec.move.duration:
                error.suggestions = _longer_shaped(lasting(spec, duration), shaper)
        raise


def _longer_shaped(spec: Spec, shaper: str) -> tuple[Suggestion, ...]:
    try:
        return (suggested({"move.duration": spec.move.duration}, _shaped(spec, shaper)),)
    except InfeasibleProblem as error:
        return error.suggestions


def suggested(values: Mapping[str, Any], drafted: Plan) -> Suggestion:
    """Suggest values with which a motion was found."""
    fraction = share_of_residual_sway(drafted.spec, drafted.evaluation)
    return Suggestion(values=values, spec=drafted.spec, fraction=fraction, passes=drafted.excess_sway <= 0.0)


def lasting(spec: Spec, duration: float) -> Spec:
    """Give a spec a duration in s."""
    return spec.changed({"move.duration": duration})


def in_cycles(spec: Spec, duration: float) -> float:
    """Round a duration in s up to a cycle of a spec's controller."""
    return grid_duration(duration, spec.export.cycle_time)
