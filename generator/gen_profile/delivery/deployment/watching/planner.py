"""A planner block that is watched: limits, travel, rest, and that one setpoint leads to the next.

What it is commanded is not known here from cycle to cycle, so that its setpoints have no table. What it may
do whatever it is commanded was proved, and is held to.
"""

import numpy as np

from gen_profile.assurance.proof.judging import ROUNDING, STEADY
from gen_profile.delivery.deployment.block_state import (
    AT_VELOCITY,
    BRAKING,
    DISABLED,
    GUIDED,
    STANDING,
    TO_POSITION,
    PlannerState,
)
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.delivery.deployment.watching.judge import QUANTITIES, Judge
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import planned_axes
from gen_profile.planner.events import WORDS
from gen_profile.planner.interface import LOST
from gen_profile.planner.stated import quick_limits
from gen_profile.support.errors import CheckFailed

LONGEST_GAP = 1.0  # s between two looks, beyond which the axis may have braked and gone on in between
STATE, COMMAND, ERROR, PROMISE, REACHED = 10, 20, 50, 60, 70  # codes of events, as the block numbers them
QUIET = (COMMAND, ERROR, PROMISE)


class PlannerJudge(Judge[PlannerState]):
    """Holds each state of a planner block to its limits, and to the state before.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        super().__init__(table)
        spec, axes = table.spec, list(planned_axes(table.spec))
        own = [spec.limits.of(axis) for axis in axes]
        quick = np.array([quick_limits(spec, axis) for axis in axes]).T
        self._low, self._high = np.array([limits.travel for limits in own], dtype=float).T
        usual = np.array([(limits.velocity, limits.acceleration) for limits in own], dtype=float).T
        braked = np.array([np.full(len(axes), np.inf), np.maximum(usual[1], quick[0])])
        still = np.zeros((2, len(axes)))
        self._most = {STANDING: still, GUIDED: usual * (1.0 + ROUNDING), BRAKING: braked * (1.0 + ROUNDING)}
        self._jerk = np.maximum(np.array([limits.jerk for limits in own], dtype=float), quick[1])

    def _require_setpoints(self, state: PlannerState) -> None:
        """Hold velocity and acceleration to the limits of the state that the block is in."""
        if state.phase == DISABLED:  # then they are the axis's own
            return
        self.seen.moving += state.phase != STANDING
        above = np.abs(state.setpoints[1:]) > self._most[state.phase]
        if above.any():
            quantity, axis = np.argwhere(above)[0].tolist()
            raise CheckFailed(
                "The {quantity} of {axis} is {found:.6g} while {name} is {phase}, where {most:.6g} is the "
                "most that was proved.",
                quantity=QUANTITIES[1 + quantity],
                axis=self._axes[axis],
                found=float(state.setpoints[1 + quantity, axis]),
                name=self._name,
                phase=state.phase_name,
                most=float(self._most[state.phase][quantity, axis]),
            )

    def _require_course(self, before: PlannerState, state: PlannerState) -> None:
        """Hold two states to the jerk, where the block guided the axes all the time, and to the travel."""
        span = (state.calls - before.calls) * self._cycle_time
        if DISABLED in (before.phase, state.phase) or state.disabled_at > before.calls or span > LONGEST_GAP:
            return
        position = before.position + span * (before.velocity + 0.5 * span * before.acceleration)
        velocity = before.velocity + span * before.acceleration
        due = np.array((position, velocity, before.acceleration))
        reach = np.array((span**3 / 6.0, 0.5 * span**2, span))[:, None] * self._jerk * (1.0 + ROUNDING)
        apart = np.abs(state.setpoints - due)
        if (far := apart > reach + STEADY).any():
            quantity, axis = np.argwhere(far)[0].tolist()
            raise CheckFailed(
                "The {quantity} of {axis} went from {first} to {found} in {calls} calls of the block, which "
                "no motion within the limits of {name} does: these setpoints were not proved.",
                quantity=QUANTITIES[quantity],
                axis=self._axes[axis],
                first=repr(float(before.setpoints[quantity, axis])),
                found=repr(float(state.setpoints[quantity, axis])),
                calls=state.calls - before.calls,
                name=self._name,
            )
        beyond, further = self._beyond(before), self._beyond(state)
        if BRAKING not in (before.phase, state.phase) and (out := further > beyond + STEADY).any():
            axis = int(np.argmax(out))
            raise CheckFailed(
                "The position of {axis}, {found:.6g}, lies beyond the travel, {low:g} to {high:g}, and leads "
                "further out: {name} was proved to do that only where it is braked at once.",
                axis=self._axes[axis],
                found=float(state.position[axis]),
                low=float(self._low[axis]),
                high=float(self._high[axis]),
                name=self._name,
            )

    def _beyond(self, state: PlannerState) -> Array:
        outside: Array = np.maximum(np.maximum(self._low - state.position, state.position - self._high), 0.0)
        return outside

    def _events(self, before: PlannerState | None, state: PlannerState) -> list[str]:
        known = QUIET if before is None else _codes(before)
        new = [code for code in _codes(state) if code not in known]
        if before is not None:
            seen = self.seen
            seen.runs += STATE + GUIDED in new
            seen.completed += REACHED in new
            seen.refused += state.error not in (0, before.error)
            seen.off_nominal += state.promise in LOST and before.promise not in LOST
            if before.command == state.command == TO_POSITION and (before.target != state.target).any():
                new.append(COMMAND + TO_POSITION)
        value = {COMMAND + TO_POSITION: state.target, COMMAND + AT_VELOCITY: state.speed}
        unknown = "an event that is not known here"
        return [WORDS.get(code, unknown).format(float(value.get(code, state.position)[0])) for code in new]


def _codes(state: PlannerState) -> tuple[int, ...]:
    """Give the codes of the events that would have led to a state."""
    there = (np.abs(state.target - state.position) <= STEADY).all()
    reached = state.phase == STANDING and state.command == TO_POSITION and there
    codes = (STATE + state.phase, COMMAND + state.command, ERROR + state.error, PROMISE + state.promise)
    return (*codes, REACHED) if reached else codes
