"""The streamer: configure → align → enable → stream → hold → disable, or abort from wherever it is.

Setpoint k and its SYNC are sent at the absolute instant ``start + k * period``, the setpoint first, so that
nothing drifts; what came late is never made up for by a burst. A bus that sends at given instants by itself
gets each cycle a quarter of a period ahead. Before each cycle the drives' answers to the one before are
judged. Whatever is wrong ends in a quick stop, sent at once and repeated every cycle until the drives say
that they no longer move; no setpoint follows it. The drives brake on their own ramp (6085h), which needs
nothing more from a controller or a bus that just proved unreliable. If not even that gets through, they stop
by themselves, as they were set up to.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from enum import Enum

import attrs
import can
import numpy as np
from canopen.sdo.exceptions import SdoError
from numpy.typing import NDArray

from gen_profile.errors import StreamAborted
from gen_profile_exporters.can import configuration, frames, startup
from gen_profile_exporters.can.cia402 import FOLLOWS, IP_ENABLE, Controlword, State
from gen_profile_exporters.can.clock import NANOSECONDS, Clock
from gen_profile_exporters.can.lateness import Lateness
from gen_profile_exporters.can.link import Link
from gen_profile_exporters.can.plan import StreamPlan, message
from gen_profile_exporters.can.scaling import magnitude_counts, quick_stop_deceleration
from gen_profile_exporters.can.watch import Alert, Axis, Watch

ALIGN_CYCLES = 10  # of preloads before power goes on
SETTLED_CYCLES = 10  # within the tolerance, before power goes off
PATIENCE = 5 * NANOSECONDS  # for a change of state (brakes take their time), and for settling
LISTEN = NANOSECONDS // 10  # for someone else in command, before anything is sent
STOP_MARGIN = NANOSECONDS // 2  # beyond the ramp, for the answer that the axes stand
HEARTBEATS_PER_TIMEOUT = 3


class Phase(Enum):
    """Where the streamer is, as people call it."""

    CONFIGURE = "configure"
    ALIGN = "align"
    ENABLE = "enable"
    STREAM = "stream"
    HOLD = "hold"
    DISABLE = "disable"
    DONE = "done"
    ABORTED = "aborted"


@attrs.frozen(kw_only=True, eq=False)
class Record:
    """What became of a stream.

    Attributes
    ----------
    phase : Phase
        `Phase.DONE` or `Phase.ABORTED`.
    reason : str
        Why it was aborted; empty when it was not.
    sent : int
        Cycles of the motion that were sent.
    lateness : Lateness
    actual : (cycles, axes) integer array
        Position that each drive told after each cycle's SYNC, in counts.
    told : (cycles,) boolean array
        For which cycles there is one.
    final : tuple of int
        Last position that each drive told.
    """

    phase: Phase
    reason: str
    sent: int
    lateness: Lateness
    actual: NDArray[np.int64]
    told: NDArray[np.bool_]
    final: tuple[int, ...]


class Streamer:
    """One stream; run it once.

    Parameters
    ----------
    bus : can.BusABC
        Opened; it stays the caller's.
    clock : Clock
    plan : StreamPlan
    tell : callable, optional
        Told each phase as it begins.
    reset_fault : bool
        Whether drives that are in fault are reset first.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        plan: StreamPlan,
        tell: Callable[[str], None] = lambda _: None,
        *,
        reset_fault: bool = False,
    ) -> None:
        self._plan, self._clock, self._tell = plan, clock, tell
        self._reset_fault = reset_fault
        self._link = Link(bus, clock)
        target = plan.target
        self._nodes = frames.nodes(target)
        self._period = frames.period_microseconds(target.can) * 1000
        timeout = startup.timeout_ms(target.can) * NANOSECONDS // 1000
        self._watch = Watch(
            [Axis(axis.name, node) for axis, node in zip(target.axes, self._nodes, strict=True)],
            clock,
            period=self._period,
            heartbeat=startup.heartbeat_ms(target.can) * NANOSECONDS // 1000,
            timeout=timeout,
            setpoints=[frame.cob_id for frame in frames.setpoint_frames(target)],
        )
        self._link.subscribe(self._watch.take)
        self._sync = message(frames.SYNC, b"")
        self._heartbeat = message(frames.HEARTBEAT + frames.MASTER, b"\x05")
        self._beat_every = max(1, timeout // HEARTBEATS_PER_TIMEOUT // self._period)
        self._beats = 0
        self._due = self._launch = 0
        self._stop_asked = ""
        self._answers_for = -1  # cycle whose answers are still to come
        self._sent_at = 0
        cycles = len(plan.cycles)
        self._late = np.full(cycles, -1, dtype=np.int64)
        self._actual = np.zeros((cycles, len(self._nodes)), dtype=np.int64)
        self._told = np.zeros(cycles, dtype=np.bool_)
        self._led = plan.motion.at_sync

    def ask_to_stop(self, reason: str) -> None:
        """Have the stream aborted before its next cycle; may be called from a signal handler."""
        self._stop_asked = reason

    @property
    def cycles_sent(self) -> int:
        """How many setpoints of the motion have been sent."""
        return int(np.count_nonzero(self._late >= 0))

    def run(self) -> Record:
        """Go through all phases; always ends with drives that do not move, or says so."""
        commanded = False
        try:
            self._begin(Phase.CONFIGURE)
            self._link.wait_until(self._clock.now() + LISTEN)
            self._require_well()
            self._watch.raise_alert(Alert.CONFIGURING)
            standing = configuration.configure(
                self._link, self._plan.target, self._plan.motion, reset_fault=self._reset_fault
            )
            self._require_well()
            commanded = True
            self._align(standing)
            self._enable()
            self._stream()
            self._hold()
            self._disable()
        except StreamAborted as error:
            reason = str(error)
            if commanded:
                reason = f"{reason} {self._abort()}"
            return self._record(Phase.ABORTED, reason)
        except BaseException:  # a bug, maybe, but the axes must not run on
            if commanded:
                self._abort()
            raise
        return self._record(Phase.DONE, "")

    def _begin(self, phase: Phase) -> None:
        self._tell(phase.value)

    def _align(self, standing: Sequence[int]) -> None:
        """Make the drives' setpoints equal to where they stand, before power goes on."""
        self._begin(Phase.ALIGN)
        self._preload = self._plan.preload(standing)
        configuration.start(self._link, self._plan.target)
        self._due = self._clock.now() + self._period
        for _ in range(ALIGN_CYCLES):
            self._cycle(self._preload)
        self._watch.raise_alert(Alert.CYCLIC)

    def _enable(self) -> None:
        self._begin(Phase.ENABLE)
        enable = Controlword.ENABLE | (IP_ENABLE if self._plan.target.can.mode == "ip" else 0)
        self._command(Controlword.SHUTDOWN, State.READY, self._preload)
        self._command(Controlword.SWITCH_ON, State.SWITCHED_ON, self._preload)
        self._command(enable, State.ENABLED, self._preload, bits=FOLLOWS)
        self._watch.raise_alert(Alert.FOLLOWING)

    def _stream(self) -> None:
        """Send every cycle at its instant."""
        self._begin(Phase.STREAM)
        start, cycle = self._due, 0
        while cycle < len(self._plan.cycles):
            self._due = start + cycle * self._period
            self._judge()
            self._await_due()
            missed = (self._clock.now() - self._due + self._period // 2) // self._period
            if missed:
                self._require_skippable(cycle, missed)
                cycle += missed
                continue
            self._send(self._plan.cycles[cycle])
            self._sent_at = self._clock.now()
            self._late[cycle] = max(0, self._sent_at - self._due)
            cycle += 1
            self._answers_for = cycle - 1
        self._due = start + cycle * self._period

    def _hold(self) -> None:
        """Repeat the last setpoint until the axes stand at it."""
        self._begin(Phase.HOLD)
        last, target = self._plan.cycles[-1], self._plan.motion.position[-1]
        allowed = [magnitude_counts(self._plan.target.can.start_tolerance, a) for a in self._plan.target.axes]
        settled, deadline = 0, self._clock.now() + PATIENCE
        while settled < SETTLED_CYCLES:
            self._cycle(last)
            apart = [abs(axis.position - int(at)) for axis, at in zip(self._watch.axes, target, strict=True)]
            settled = settled + 1 if all(a <= b for a, b in zip(apart, allowed, strict=True)) else 0
            if self._clock.now() > deadline:
                raise StreamAborted(f"The axes do not settle at the target; they stand {apart} counts off.")

    def _disable(self) -> None:
        self._begin(Phase.DISABLE)
        self._watch.raise_alert(Alert.CYCLIC)
        last = self._plan.cycles[-1]
        self._command(Controlword.SWITCH_ON, State.SWITCHED_ON, last)
        self._command(Controlword.SHUTDOWN, State.READY, last)
        self._command(Controlword.DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED, last)
        self._release()

    def _release(self) -> None:
        """Leave drives alone that are switched off; one that does not listen will report a lost heartbeat."""
        with suppress(StreamAborted, SdoError, struct.error):
            configuration.release(self._link, self._plan.target)

    def _abort(self) -> str:
        """Quick-stop all axes, and say whether they confirmed it."""
        self._begin(Phase.ABORTED)
        self._clock.sleep_until(self._launch)  # no setpoint may follow the stop
        stop = self._commands(Controlword.QUICK_STOP)
        deadline = self._clock.now() + self._stopping_time()
        while True:
            for frame in (*stop, self._sync, self._heartbeat):
                with suppress(StreamAborted):
                    self._link.send(frame)
            with suppress(StreamAborted):
                self._link.wait_until(self._clock.now() + self._period)
            if self._watch.standing:
                self._release()
                return "The axes were stopped."
            if self._clock.now() > deadline:
                return (
                    "Not every drive confirmed the quick stop: they stop by their own time-outs; make sure "
                    "that the axes stand before you approach them."
                )

    def _stopping_time(self) -> int:
        """Time in ns in which every axis comes to rest on its ramp from its greatest velocity."""
        motion, can = self._plan.motion, self._plan.target.can
        fastest = np.abs(np.diff(motion.position, axis=0)).max(axis=0) / motion.period
        ramps = [
            fastest[column] / quick_stop_deceleration(motion.position[:, column], motion.period, can, axis)
            for column, axis in enumerate(self._plan.target.axes)
        ]
        return STOP_MARGIN + 10 * self._period + int(max(ramps) * NANOSECONDS)

    def _command(self, word: int, state: State, setpoints: Sequence[can.Message], *, bits: int = 0) -> None:
        """Send a controlword every cycle until all drives are in a state."""
        commands, deadline = self._commands(word), self._clock.now() + PATIENCE
        while not all(axis.state is state and axis.statusword & bits == bits for axis in self._watch.axes):
            if self._clock.now() > deadline:
                words = ", ".join(f"{axis.name}: {axis.state.words}" for axis in self._watch.axes)
                raise StreamAborted(
                    f"The drives do not reach {state.words!r} within {PATIENCE // NANOSECONDS} s ({words}); "
                    "check power, brakes and enabling inputs."
                )
            self._cycle((*commands, *setpoints))

    def _cycle(self, messages: Iterable[can.Message]) -> None:
        """Send frames and SYNC at the next instant, judged before and after."""
        self._judge()
        self._await_due()
        self._send(messages)
        self._due = max(self._due + self._period, self._clock.now())

    def _judge(self) -> None:
        """Take in the answers, shortly before the next cycle."""
        self._link.wait_until(self._due - self._period // 4)
        self._require_well()
        if self._answers_for >= 0:
            self._actual[self._answers_for] = [axis.position for axis in self._watch.axes]
            told = all(axis.heard >= self._sent_at for axis in self._watch.axes)
            self._told[self._answers_for] = told
            if told and self._plan.motion.velocity is not None:
                self._require_following(self._answers_for)
            self._answers_for = -1

    def _require_well(self) -> None:
        if self._stop_asked:
            raise StreamAborted(self._stop_asked)
        self._watch.require_well()

    def _require_following(self, cycle: int) -> None:
        """Hold the axes to the motion where no drive does: in csv it controls its velocity only."""
        can, led = self._plan.target.can, self._led[cycle]
        for axis, scale, at in zip(self._watch.axes, self._plan.target.axes, led, strict=True):
            apart = abs(axis.position - int(at))
            if apart > magnitude_counts(can.following_error or can.start_tolerance, scale):
                raise StreamAborted(
                    f"axis {axis.name}: it is {apart / abs(scale.counts_per_si):.3g} off the motion, more "
                    "than can.following_error; check the drive's scaling, or whether the axis is blocked."
                )

    def _require_skippable(self, cycle: int, missed: int) -> None:
        """Pass over one setpoint that is too late, if the next one is no greater a step than any other."""
        steps = np.abs(np.diff(self._plan.motion.position, axis=0)).max(axis=0)
        before, after = max(cycle - 1, 0), min(cycle + missed, len(self._plan.cycles) - 1)
        step = np.abs(self._plan.motion.position[after] - self._plan.motion.position[before])
        if missed > 1 or (step > steps).any():
            raise StreamAborted(
                f"This machine was {missed * self._period / 1e6:g} ms late at cycle {cycle}; relieve it, "
                "permit real-time priority, or choose a longer can.sync_period (see --self-test)."
            )

    def _await_due(self) -> None:
        """Sleep until the next cycle's instant, unless it is the bus that waits for it."""
        if self._link.launching is None:
            self._clock.sleep_until(self._due)

    def _send(self, messages: Iterable[can.Message]) -> None:
        self._launch = self._due
        for frame in messages:
            self._link.send(frame, self._due)
        self._link.send(self._sync, self._due)
        self._beats += 1
        if self._beats % self._beat_every == 0:
            self._link.send(self._heartbeat)

    def _commands(self, word: int) -> tuple[can.Message, ...]:
        data = frames.packing(frames.COMMAND).pack(word)
        return tuple(message(frames.RPDO1 + node, data) for node in self._nodes)

    def _record(self, phase: Phase, reason: str) -> Record:
        cycles = np.flatnonzero(self._late >= 0)
        return Record(
            phase=phase,
            reason=reason,
            sent=self.cycles_sent,
            lateness=Lateness(cycles=cycles, late=self._late[cycles], period=self._period),
            actual=self._actual,
            told=self._told,
            final=tuple(axis.position for axis in self._watch.axes),
        )
