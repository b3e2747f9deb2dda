"""Watching a playback block while it runs: each setpoint against the table that was proved."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from gen_profile.deployment.block_state import ABORTED, DONE, FAILED, MOVING, BlockState, read_state
from gen_profile.deployment.mailbox import WRONG, LinkLostError, MailboxLink
from gen_profile.deployment.table import BlockTable
from gen_profile.errors import CheckFailed, DeploymentError, GenProfileError
from gen_profile.interrupts import interrupts_collected
from gen_profile.motion.profile import Array
from gen_profile_exporters.playback.table import PlaybackTable

LAST_DIGITS = 1e-12  # of the greatest setpoint: what a compiler that fuses operations changes
STANDSTILL = 2.0  # s that a block may show the same cycle, or be ahead of or behind its cycle time
CLOCKS_DIFFER = 0.02  # relative, of this computer and of the controller's task
LOST_FOR, RETRY = 15.0, 0.5  # s that a lost connection is taken up again for, and between two trials
TORN = 10  # reads of a state of two cycles, one after the other
LEAST_INTERVAL = 0.02  # s between two looks
QUANTITIES = ("position", "velocity", "acceleration")
REFUSALS = {
    1: "fCycleTime is not the table's",
    2: "the axis does not stand where the motion begins",
    3: "fScale does not lie between 0 and 1",
    4: "bAbort is set",
    5: "the checksum is wrong",
    7: "the machine does not allow this fScale, bMirror or fStartOffset",
    8: "no way is left to continue",
}


@attrs.define(kw_only=True)
class Watched:
    """What was seen.

    Attributes
    ----------
    seconds : float
        From the first look to the last one.
    cycles, states : int
        That the block was called meanwhile, and of these the ones that were read.
    moving, exact : int
        Of the states, those whose setpoints are the table's, and of these the ones that are so bit for bit;
        the others are within `LAST_DIGITS`.
    runs, completed, off_nominal, refused : int
        Motions that began, that arrived, whose timing was changed, and starts that the block refused.
    lost : int
        Times that the connection was lost and taken up again.
    fault : GenProfileError or None
        What is not as proved, and ended it.
    """

    seconds: float = 0.0
    cycles: int = 0
    states: int = 0
    moving: int = 0
    exact: int = 0
    runs: int = 0
    completed: int = 0
    off_nominal: int = 0
    refused: int = 0
    lost: int = 0
    fault: GenProfileError | None = None

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        document = attrs.asdict(self, recurse=False)
        return document | {"fault": None if self.fault is None else str(self.fault)}


class Judge:
    """Holds each state of a block to the table, and to the state before.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        self._motions = table.motions
        self._name, self._checksum = table.path.name, int(table.checksum)
        self._axes = [axis.name for axis in table.spec.axis_scales()]
        self._greatest = [_greatest(motion) for motion in self._motions]
        self._first: tuple[BlockState, float] | None = None
        self._last: BlockState | None = None
        self.seen = Watched()

    def take(self, state: BlockState, at: float) -> str:
        """Judge a state, and tell what happened since the one before, in a few words or none.

        Parameters
        ----------
        state : BlockState
        at : float
            When it was read, in s.

        Raises
        ------
        CheckFailed
            It is not as proved.
        DeploymentError
            The controller was started anew.
        """
        if self._first is None or self._last is None:
            self._first, before = (state, at), state
            events = _phase_words(state)
        else:
            before = self._last
            events = self._events(before, state)
        self._last, seen = state, self.seen
        seen.states += 1
        seen.seconds, seen.cycles = at - self._first[1], state.calls - self._first[0].calls
        self._require_table(state)
        if state.calls < before.calls:
            raise DeploymentError(
                "The controller was started anew, or its program loaded; verify what it uses, and watch "
                "again."
            )
        self._require_setpoints(state)
        if state is not before:
            self._require_course(before, state)
            self._require_cycle_time()
        return events

    def _require_table(self, state: BlockState) -> None:
        first = state if self._first is None else self._first[0]
        if state.checksum != self._checksum or state.buffer != first.buffer:
            raise CheckFailed(
                "The controller no longer uses {name}: it has gone over to its other buffer, with the "
                "checksum {there} and not {here}. Find out who switched (deployments.json).",
                name=self._name,
                there=state.checksum,
                here=self._checksum,
            )
        if state.motion >= len(self._motions):
            raise CheckFailed(
                "The block has selected motion {motion}, which {name} does not hold.",
                motion=state.motion,
                name=self._name,
            )
        if state.checked == WRONG:
            raise CheckFailed(
                "The controller finds the checksum of its table wrong: a value was altered in its memory. It "
                "starts nothing; deploy the table again, and look after the memory if that recurs."
            )

    def _require_setpoints(self, state: BlockState) -> None:
        """Compare with the table where the motion is, and with rest where nothing moves."""
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

    def _due(self, state: BlockState) -> Array:
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
            due = np.array(
                (
                    gain * position + state.shift,
                    gain * velocity * state.rate,
                    gain * (acceleration * state.rate * state.rate + velocity * state.slope),
                )
            )
        if state.phase == MOVING or (state.setpoints[1:] != 0.0).any():  # it stops in the cycle after
            return due
        resting[0] = due[0]
        return resting

    def _span(self, state: BlockState) -> Array:
        span: Array = self._greatest[state.motion] * np.maximum(1.0, np.abs(state.gain))
        span[0] += np.abs(state.shift)
        return span

    def _require_course(self, before: BlockState, state: BlockState) -> None:
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

    def _require_cycle_time(self) -> None:
        seen, cycle_time = self.seen, self._motions[0].cycle_time
        if abs(seen.cycles * cycle_time - seen.seconds) > STANDSTILL + CLOCKS_DIFFER * seen.seconds:
            raise CheckFailed(
                "The block is called every {mean:.3g} ms on average, and its table is for {due:g} ms: "
                "motions take another time than was proved. Call it in a task of that cycle.",
                mean=1e3 * seen.seconds / max(1, seen.cycles),
                due=1e3 * cycle_time,
            )

    def _events(self, before: BlockState, state: BlockState) -> str:
        """Count what began and ended between two states, and put it into words."""
        seen, words = self.seen, []
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
        return ", ".join(words)


def _greatest(motion: PlaybackTable) -> Array:
    """Give the greatest setpoints, shape (3, axes)."""
    played = motion.played
    quantities = (played.position, played.velocity, played.acceleration)
    return np.array([np.abs(one).max(axis=0) for one in quantities if one is not None])


def _phase_words(state: BlockState) -> str:
    if state.phase == FAILED:
        return f"start refused, error {state.error}: {REFUSALS.get(state.error, 'unknown')}"
    return {MOVING: "under way", DONE: "arrived", ABORTED: "stopped on the way"}.get(state.phase, "")


Report = Callable[[BlockState, float, str], None]


def watch(
    table: BlockTable,
    link: MailboxLink,
    report: Report = lambda *_: None,
    *,
    seconds: float | None = None,
    now: Callable[[], float] = time.monotonic,
    pause: Callable[[float], None] = time.sleep,
) -> Watched:
    """Read a block's state over and over, until something is not as proved, or until Ctrl-C.

    Parameters
    ----------
    table : BlockTable
        Which the block uses.
    link : MailboxLink
        Only read.
    report : callable
        Is given each state, when it was read in s since the first look, and what happened.
    seconds : float, optional
        To watch for.
    now, pause : callable
        Give the time in s, and let so much of it pass.

    Returns
    -------
    Watched
        With what is not as proved as its `fault`.
    """
    judge = Judge(table)
    course = _Course(table, link, judge, (now, pause), report)
    try:
        with interrupts_collected() as came:
            while not came and (seconds is None or course.elapsed() < seconds):
                course.look()
    except KeyboardInterrupt:  # which is how it ends
        pass
    except (CheckFailed, DeploymentError) as error:
        judge.seen.fault = error
    except LinkLostError as error:
        judge.seen.fault = DeploymentError(
            "The connection broke ({error}), and could not be taken up again within {seconds:g} s.",
            error=error,
            seconds=LOST_FOR,
        )
    return judge.seen


class _Course:
    """Looks at a block one after the other."""

    def __init__(
        self,
        table: BlockTable,
        link: MailboxLink,
        judge: Judge,
        clock: tuple[Callable[[], float], Callable[[float], None]],
        report: Report,
    ) -> None:
        self._link, self._judge, (self._now, self._pause), self._report = link, judge, clock, report
        self._axes, self._cycle = table.constant("cAxes"), table.spec.export.cycle_time
        self._began = self._changed = self._now()
        self._calls = -1

    def elapsed(self) -> float:
        """Time since the first look, in s."""
        return self._now() - self._began

    def look(self) -> None:
        """Read a state, judge it if it is a new one, and wait until the next one is due."""
        try:
            state, lost = self._read(), ""
        except LinkLostError as error:
            lost = self._taken_up(error)
            state = self._read()
        now = self._now()
        if state is not None and state.calls != self._calls:
            self._calls, self._changed = state.calls, now
            events = lost
            try:
                events = ", ".join(filter(None, (lost, self._judge.take(state, now - self._began))))
            except (CheckFailed, DeploymentError) as error:
                events = str(error)
                raise
            finally:
                self._report(state, now - self._began, events)
        elif now - self._changed > STANDSTILL:
            raise DeploymentError(
                "The block is no longer called in the controller, since {seconds:.1f} s: it was stopped, or "
                "its task. What the axes do now is up to their drives.",
                seconds=now - self._changed,
            )
        self._pause(max(self._cycle, LEAST_INTERVAL))

    def _read(self) -> BlockState | None:
        for _ in range(TORN):
            values = self._link.state()
            if (state := read_state(values, self._axes)) is not None or values[0] == 0.0:
                return state
        raise DeploymentError(
            "The block's state is of several cycles whenever it is read: let the controller's server take it "
            "over as a whole, between two cycles."
        )

    def _taken_up(self, error: LinkLostError) -> str:
        """Connect again, or raise the error."""
        began = self._now()
        while True:
            try:
                self._pause(RETRY)
                self._link.reopen()
            except LinkLostError:
                if self._now() - began > LOST_FOR:
                    raise error from None
                continue
            self._judge.seen.lost += 1
            self._changed = self._now()
            return f"connection lost for {self._changed - began:.1f} s"
