"""Shaped motions for a spec: within its limits, in its duration or in the shortest."""

from __future__ import annotations

import attrs

from gen_profile.designs.transient_sway import sways
from gen_profile.errors import InfeasibleProblem
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.profile import Profile, grid_length, grid_times
from gen_profile.problem.limits import SWAY_TOLERANCE, Breach, breaches, rounded_up
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import problem_of
from gen_profile.shapers.base_moves import BASES
from gen_profile.shapers.shaped_move import ShapedMove, shaped_move
from gen_profile.spec.model import Spec


def shaped_motion(spec: Spec, name: str) -> Profile:
    """Feed a shaper with the spec's base move, and hold the motion to the limits.

    Parameters
    ----------
    spec : Spec
    name : str
        One of `gen_profile.shapers.impulses.SHAPERS`.

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
        raise InfeasibleProblem(
            f"{cause}: a shaper moves from rest to rest only; take an optimal motion (solver.method)."
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
        return _shortest(spec, shaped)
    motion = shaped.profile(move.duration)
    broken = _breaches(spec, motion)
    if broken:
        shortest = shaped.shortest(lambda trial: not _breaches(spec, trial))
        sentences = [breach.sentence() for breach in broken]
        if shortest is not None:
            sentences.append(f"With this shaper the move takes at least {rounded_up(shortest, digits=4)} s.")
        raise InfeasibleProblem(" ".join(sentences))
    return motion


def _shortest(spec: Spec, shaped: ShapedMove) -> Profile:
    """Make a shaped motion as short as the limits permit; it ends on a cycle of the controller."""
    shortest = shaped.shortest(lambda trial: not _breaches(spec, trial))
    if shortest is None:
        raise InfeasibleProblem("move.duration: no duration keeps the limits; widen them.")
    cycle = spec.export.cycle_time
    count = grid_length(shortest, cycle)
    while _breaches(spec, motion := shaped.profile(float(grid_times(count, cycle)[-1]))):
        count += 1
    return motion


def _breaches(spec: Spec, motion: Profile) -> tuple[Breach, ...]:
    """Find the limits that a motion breaks; the sway's last, for it must be integrated."""
    command = lag_compensated(motion, spec.actuator.tau)
    broken = breaches(attrs.evolve(spec.limits, sway=None), command, 0.0)
    if broken or spec.limits.sway is None:
        return broken
    nominal, worst = sways(spec, problem_of(spec), motion)
    return breaches(spec.limits, command, max(nominal, worst / SWAY_TOLERANCE))
