"""Shaped motions for a spec: within its limits, in its duration or in the shortest."""

import math
from functools import partial

import attrs

from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE, Breach, breaches
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.overshoot import counted
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.shapers.base_moves import BASES
from gen_profile.methods.shapers.shaped_move import ShapedMove, shaped_move, too_short
from gen_profile.methods.solvers.search import Search, least
from gen_profile.methods.solvers.transient_sway import overshoots, sways
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.profile import Profile, grid_duration
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import FAST
from gen_profile.support.errors import Code, InfeasibleProblem, Reason, rounded_up
from gen_profile.support.phrase import Phrase

# peaks of a shaped motion fall with the base move's duration, not quite evenly where delayed parts overlap
SHORTEST_SHAPED = Search(precision=1e-4, close=0.0, stride=math.log(2.0), growth=1.0, downward=True)
LONGEST_SHAPED = 1e6  # times the shaper's delay, after which a duration is not looked for


def shaped_motion(spec: Spec, name: str) -> Profile:
    """Feed a shaper with the spec's base move, and hold the motion to the limits.

    Parameters
    ----------
    spec : Spec
    name : str
        One of `gen_profile.methods.shapers.impulses.SHAPERS`.

    Raises
    ------
    InfeasibleProblem
        It would take longer than the spec allows, or there is no such shaper for the machine.
    SpecError
        The base move needs something that the spec does not state.
    """
    move = spec.move
    if move.initial or not move.stops:
        cause = "move.initial" if move.initial else "move.final_velocity"
        template = "{place}: a shaper moves from rest to rest only; take an optimal motion (solver.method)."
        raise InfeasibleProblem(
            Phrase(template, place=cause), reasons=[Reason(code=Code.NOT_AT_REST, place=cause)]
        )
    # where the load would swing on; a shaper knows one frequency per mode, whatever the hoist does on the way
    linear = linearize(spec.machine(), spec.plant.parameters, move.target)
    shaped = shaped_move(
        name,
        start=move.start,
        target=move.target,
        frequencies=linear.distinct_frequencies,
        damping_ratios=linear.distinct_damping_ratios,
        base=BASES[spec.solver.base](spec.limits, move.distance),
    )
    if move.shortest:
        shortest = shortest_duration(spec, shaped)
        if shortest is None:
            raise InfeasibleProblem(
                Phrase("move.duration: no duration keeps the limits; widen them."),
                reasons=[Reason(code=Code.INFEASIBLE, place="move.duration")],
            )
        return shaped.profile(shortest)
    quickest = shaped.shaper.delay + _plausible_stretch(spec, shaped)
    if move.duration < quickest:
        raise shaped.too_short(move.duration, quickest)
    motion = shaped.profile(move.duration)
    if broken := _breaches(spec, motion):
        sentences, reasons = [one.sentence() for one in broken], [one.reason() for one in broken]
        shortest = shortest_duration(spec, shaped)
        if shortest is not None:
            least = rounded_up(shortest, digits=4)
            sentences.append(Phrase("With this shaper the move takes at least {least:g} s.", least=least))
            reasons.append(too_short(move.duration, least))
        raise InfeasibleProblem(*sentences, reasons=reasons)
    return motion


def shortest_duration(spec: Spec, shaped: ShapedMove) -> float | None:
    """Find the shortest duration in s that keeps the limits and ends on a cycle of the controller, if any."""
    delay, in_cycles = shaped.shaper.delay, partial(grid_duration, cycle_time=spec.export.cycle_time)
    quickest = delay + _plausible_stretch(spec, shaped)

    def excess(duration: float) -> float:
        long_enough = duration > in_cycles(quickest) and duration >= (spec.move.bounds.least or 0.0)
        keeps = long_enough and not _breaches(spec, shaped.profile(duration))
        return -math.inf if keeps else math.inf

    return least(excess, 2.0 * delay, SHORTEST_SHAPED, LONGEST_SHAPED * delay, in_cycles)


def _plausible_stretch(spec: Spec, shaped: ShapedMove) -> float:
    """Find the shortest base move in s, of any limits, that asks the axes for nothing implausible."""
    axes = zip(spec.machine().actuated, spec.move.distance, strict=True)
    stretches = (
        (shaped.base.peak(order) * abs(way) / FAST[axis.unit, kind][0]) ** (1.0 / order)
        for axis, way in axes
        for order, kind in ((1, "velocity"), (2, "acceleration"))
    )
    return float(max(stretches))


def _breaches(spec: Spec, motion: Profile) -> tuple[Breach, ...]:
    """Find the limits that a motion breaks; the sway's last, for it must be integrated."""
    command = lag_compensated(motion, spec.actuator.tau)
    limits, problem = spec.limits, problem_of(spec, whole=True)
    broken = breaches(attrs.evolve(limits, sway=None, overshoot=None), command, 0.0)
    if broken or (limits.sway is None and limits.overshoot is None):
        return broken
    nominal, worst = (0.0, 0.0) if limits.sway is None else sways(problem, motion)
    over = (-math.inf, -math.inf) if limits.overshoot is None else overshoots(problem, motion)
    return breaches(limits, command, max(nominal, worst / SWAY_TOLERANCE), counted(problem.targets, *over))
