"""A playback block that is watched: each setpoint against the table that was proved."""

from pathlib import Path

import numpy as np

from gen_profile.delivery.deployment.block_state import ABORTED, DONE, FAILED, MOVING, MotionState
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.delivery.deployment.watching.judge import QUANTITIES, Judge
from gen_profile.motion.profile import Array
from gen_profile.support.errors import CheckFailed
from gen_profile_exporters.playback.table import quantities

LAST_DIGITS = 1e-12  # of the greatest setpoint: what a compiler that fuses operations changes
_LINES = (Path(__file__).parents[3] / "lists" / "refusals.txt").read_text("utf-8").splitlines()
REFUSALS = {int(number): words for number, _, words in (line.partition(" ") for line in _LINES)}


class MotionJudge(Judge[MotionState]):
    """Holds each state of a playback block to the table, and to the state before.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        super().__init__(table)
        self._motions = table.motions
        self._greatest = [np.abs(quantities(one.played)).max(axis=1) for one in self._motions]  # (3, axes)

    def _require_setpoints(self, state: MotionState) -> None:
        """Compare with the table where the motion is, and with rest where nothing moves."""
        if state.motion >= len(self._motions):
            raise CheckFailed(
                "The block has selected motion {motion}, which {name} does not hold.",
                motion=state.motion,
                name=self._name,
            )
        due = self._due(state)
        issued = state.setpoints
        with np.errstate(invalid="ignore"):
            near = np.abs(issued - due) <= LAST_DIGITS * self._span(state)
        follows = state.phase in (MOVING, DONE, ABORTED)
        near |= np.isnan(due)
        if not near.all():
            at = tuple(np.argwhere(~near)[0])
            raise CheckFailed(
                "The {quantity} of {axis} is {found} in cycle {place:.10g} of the motion, and {due} by "
                "{name}: these are not the setpoints that were proved.",
                quantity=QUANTITIES[at[0]],
                axis=self._axes[at[1]],
                found=repr(float(issued[at])),
                place=state.place,
                due=repr(float(due[at])),
                name=self._name,
            )
        self.seen.moving += follows
        self.seen.exact += follows and bool((issued == due).all())  # which for numbers are bits, zero apart

    def _due(self, state: MotionState) -> Array:
        """Give the setpoints of a state, not a number where any is right, shape (3, axes)."""
        resting = np.array((np.full(len(self._axes), np.nan), *np.zeros((2, len(self._axes)))))
        if state.phase not in (MOVING, DONE, ABORTED):
            return resting
        motion, gain = self._motions[state.motion], state.gain
        with np.errstate(over="ignore", invalid="ignore"):
            if state.cycle >= motion.last:
                resting[0] = gain * motion.target + state.shift
                return resting
            position, velocity, acceleration = motion.between(state.cycle, state.fraction)
            push = acceleration * state.rate * state.rate + velocity * state.slope
            due = np.array((gain * position + state.shift, gain * velocity * state.rate, gain * push))
        if state.phase == MOVING or (state.setpoints[1:] != 0.0).any():  # it stops in the cycle after
            return due
        resting[0] = due[0]
        return resting

    def _span(self, state: MotionState) -> Array:
        span: Array = self._greatest[state.motion] * np.maximum(1.0, np.abs(state.gain))
        span[0] += np.abs(state.shift)
        return span

    def _require_course(self, before: MotionState, state: MotionState) -> None:
        """Hold a motion's course to the cycles that were called, within a run."""
        both_moving = before.phase == state.phase == MOVING and state.runs == before.runs
        if not both_moving:
            return
        if (state.gain != before.gain).any() or (state.shift != before.shift).any():
            raise CheckFailed(
                "The gain or the shift of the motion changed on the way: something writes to it."
            )
        advance, calls = state.place - before.place, state.calls - before.calls
        planned = state.rate == before.rate and not state.off_nominal
        least = calls * state.rate - 1e-6 if planned else -1e-6
        if not least <= advance <= calls + 1e-6:
            raise CheckFailed(
                "The motion went on by {advance:.6g} cycles in {calls} calls of the block at the rate "
                "{rate:.6g}: its timing is not the one that was proved.",
                advance=advance,
                calls=calls,
                rate=state.rate,
            )

    def _events(self, before: MotionState | None, state: MotionState) -> list[str]:
        if before is None:
            return list(filter(None, [_phase_words(state)]))
        seen, words = self.seen, list[str]()
        began = max(0, state.runs - before.runs)
        if began:
            seen.runs += began
            which = f", number {state.motion} of the library" if len(self._motions) > 1 else ""
            words.append(f"motion {seen.runs} begins{which}")
        if state.off_nominal and (began or not before.off_nominal):
            seen.off_nominal += 1
            words.append("its timing is changed, so that the load swings")
        if state.phase != before.phase or began:
            seen.completed += state.phase == DONE
            seen.refused += state.phase == FAILED
            words += [_phase_words(state)] if state.phase in (DONE, ABORTED, FAILED) else []
        return words


def _phase_words(state: MotionState) -> str:
    if state.phase == FAILED:
        return f"start refused, error {state.error}: {REFUSALS.get(state.error, 'unknown')}"
    return {MOVING: "under way", DONE: "arrived", ABORTED: "stopped on the way"}.get(state.phase, "")
