"""The streamer: listen → configure → align → enable → approach → stream → hold → disable; or stop.

Before each cycle the drives' answers to the one before are judged. Whatever is wrong ends in a quick stop
(`gen_profile_exporters.can.streaming.stopping`) before anything is said about it, and no setpoint follows.
Only who asks for a stop while all is well gets one without sway first, where the setpoints' source plans it.
"""

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

import can
import numpy as np

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import pdos
from gen_profile_exporters.can.cia402 import FOLLOWS, Controlword, State
from gen_profile_exporters.can.following_window import windows
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.scaling import magnitude_counts
from gen_profile_exporters.can.setup import configuration
from gen_profile_exporters.can.setup.restoration import Restoration
from gen_profile_exporters.can.setup.standing import STANDSTILL_TIME
from gen_profile_exporters.can.streaming.approach import approach
from gen_profile_exporters.can.streaming.following import Following
from gen_profile_exporters.can.streaming.pacer import Pacer
from gen_profile_exporters.can.streaming.plan import Cycle, SetpointSource, Step, cycles_of, preload
from gen_profile_exporters.can.streaming.record import Book, Phase, Record
from gen_profile_exporters.can.streaming.stopping import quick_stop
from gen_profile_exporters.can.streaming.watch import SupervisionLevel, Watch

ALIGN_CYCLES = 10  # of preloads before power goes on
SETTLED_CYCLES = 10  # within the tolerance, before power goes off
LISTEN = NANOSECONDS // 10  # for someone else in command, before anything is sent; two cycles at least
STOP_MARGIN = NANOSECONDS // 2  # beyond the ramp, for the answer that the axes stand


class Streamer:
    """One stream; run it once.

    Parameters
    ----------
    bus : can.BusABC
        Opened; it stays the caller's.
    clock : Clock
    source : SetpointSource
    tell : callable, optional
        Told each phase as it begins. While it works the drives get nothing.
    reset_fault : bool
        Whether drives that are in fault are reset first.
    book : Book, optional
        Where to take down how it goes.

    Attributes
    ----------
    cycles_sent : int
        Of the motion, so far.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        source: SetpointSource,
        tell: Callable[[str], None] = lambda _: None,
        *,
        reset_fault: bool = False,
        book: Book | None = None,
    ) -> None:
        self._source, self._clock, self._tell = source, clock, tell
        self._target = target = source.target
        self._reset_fault = reset_fault
        self._link = Link(bus, clock, target.can.sdo_timeout)
        self._patience = configuration.state_patience(target)  # brakes take their time, and settling does
        self._pacer = Pacer(self._link, target)
        self._watch = Watch(target, clock)
        self._link.subscribe(self._watch.take)
        self._link.subscribe(source.take)
        self._following = Following(self._watch.axes, target, windows(source.demand, target))
        self._book = book or Book.blank(source.most, len(target.axes))
        self.cycles_sent = 0
        self._found = Restoration()
        self._left: tuple[str, ...] = ()  # of the settings found, what could not be put back
        self._stops_asked = deque[str]()
        self._can_end = False  # whether the source issues setpoints now
        self._ended = ""  # why it was asked to end
        self._commanded = False
        self._answers_for = -1  # cycle whose answers are still to come
        self._sent_at = 0

    def ask_to_stop(self, reason: str) -> None:
        """Have the axes stopped from the next cycle on; may be called from a signal handler.

        Without sway, where the source plans such a stop, unless it was asked for before.
        """
        self._stops_asked.append(reason)

    def run(self) -> Record:
        """Go through all phases; always ends with drives that do not move, or says so."""
        try:
            self._listen()
            rest_counts = self._configure()
            self._align(rest_counts)
            self._enable()
            self._approach(rest_counts)
            last = self._stream(rest_counts)
            self._hold(last)
            self._disable(last.messages)
        except StreamAborted as error:
            return self._record(Phase.ABORTED, f"{error} {self._stop()}".rstrip())
        except BaseException:  # a bug, maybe, but the axes must not run on
            self._stop()
            raise
        if why := self._ended or self._source.failure:
            return self._record(Phase.ABORTED, f"{why} The axes were stopped without sway.")
        return self._record(Phase.DONE, "")

    def _begin(self, phase: Phase) -> None:
        self._book.begin(phase)
        self._say(phase.value)

    def _say(self, words: str) -> None:
        with suppress(OSError, ValueError):  # the receiver may be gone
            self._tell(words)

    def _listen(self) -> None:
        """Hear whether someone else is in command, before anything is sent."""
        self._begin(Phase.CONFIGURE)
        until = self._clock.now() + max(LISTEN, 2 * self._pacer.period)
        while self._clock.now() < until:
            self._link.wait_until(min(until, self._clock.now() + LISTEN // 10))
            self._require_well()
        self._link.try_launch_times()

    def _configure(self) -> tuple[int, ...]:
        """Set the drives up; find out where they stand, in counts."""
        self._watch.raise_alert(SupervisionLevel.CONFIGURING)
        rest_counts = configuration.configure(
            self._link,
            self._target,
            self._source.demand,
            self._found,
            self._attend,
            reset_fault=self._reset_fault,
        )
        self._require_well()
        return rest_counts

    def _attend(self) -> None:
        """Keep our heartbeat going while the drives are set up, as long as all is well."""
        self._require_well()
        self._pacer.beat()

    def _align(self, rest_counts: Sequence[int]) -> None:
        """Make the drives' setpoints equal to where they stand, before power goes on."""
        self._begin(Phase.ALIGN)
        self._commanded = True
        self._pacer.last_sent = self._preload = preload(self._target, rest_counts)
        self._following.lead(np.array(rest_counts))
        configuration.start(self._link, self._target)
        self._pacer.begin()
        for _ in range(ALIGN_CYCLES):
            self._cycle(self._pacer.within(Controlword.DISABLE_VOLTAGE, self._preload))
        self._watch.raise_alert(SupervisionLevel.CYCLIC)

    def _enable(self) -> None:
        self._begin(Phase.ENABLE)
        self._command(Controlword.SHUTDOWN, State.READY, self._preload)
        self._command(Controlword.SWITCH_ON, State.SWITCHED_ON, self._preload)
        self._command(pdos.enabling(self._target.can), State.ENABLED, self._preload, bits=FOLLOWS)
        self._watch.raise_alert(SupervisionLevel.FOLLOWING)

    def _approach(self, rest_counts: Sequence[int]) -> None:
        """Lead axes that stand off the first setpoint to it, slowly."""
        way = approach(rest_counts, self._source.demand, self._target)
        if len(way.position):
            self._begin(Phase.APPROACH)
        for messages, led in zip(cycles_of(way, self._target), way.at_sync, strict=True):
            self._cycle(messages, led)

    def _stream(self, rest_counts: Sequence[int]) -> Step:
        """Send every cycle at its instant; return the last."""
        self._begin(Phase.STREAM)
        source, pacer, cycle = self._source, self._pacer, 0
        due: Step | None = source.begin(rest_counts)
        start, self._can_end = pacer.due, True
        assert due is not None  # a motion has a first cycle
        last = sent = due
        while due is not None:
            last = due
            pacer.due = start + cycle * pacer.period
            self._judge()
            if skipped := pacer.skipped():
                due = source.step(cycle + skipped)
                self._require_skippable(sent, due or last, cycle, skipped)
                cycle += skipped
                continue
            pacer.send(last.messages)
            self._sent_at = self._clock.now()
            self._book.take_sent(cycle, self._sent_at - pacer.due)
            self.cycles_sent += 1
            self._following.lead(last.at_sync)
            self._answers_for = cycle
            sent, cycle = last, cycle + 1
            due = source.step(cycle)  # now, while there is time
            if last.words:
                self._say(last.words)
        pacer.due = start + cycle * pacer.period
        self._can_end = False
        return last

    def _hold(self, last: Step) -> None:
        """Repeat the last setpoint until the axes stand at it."""
        self._begin(Phase.HOLD)
        allowed = [magnitude_counts(self._target.can.start_tolerance, axis) for axis in self._target.axes]
        settled, heard, deadline = 0, 0, self._clock.now() + self._patience
        while settled < SETTLED_CYCLES:
            self._cycle(last.messages, last.position)
            apart = [
                abs(axis.position - int(at)) for axis, at in zip(self._watch.axes, last.position, strict=True)
            ]
            before, heard = heard, min(axis.heard for axis in self._watch.axes)
            if any(a > b for a, b in zip(apart, allowed, strict=True)):
                settled = 0
            elif heard > before:  # each report counts once
                settled += 1
            if self._clock.now() > deadline:
                raise StreamAborted(f"The axes do not settle at the target; they stand {apart} counts off.")

    def _disable(self, last: Cycle) -> None:
        self._begin(Phase.DISABLE)
        self._watch.raise_alert(SupervisionLevel.CYCLIC)
        self._command(Controlword.SWITCH_ON, State.SWITCHED_ON, last)
        self._command(Controlword.SHUTDOWN, State.READY, last)
        self._command(Controlword.DISABLE_VOLTAGE, State.SWITCH_ON_DISABLED, last)
        self._release()

    def _release(self) -> None:
        """Leave drives alone that are switched off, as they were found, our heartbeat going on meanwhile."""
        self._link.meanwhile = self._pacer.beat
        self._left = configuration.release(self._link, self._target, self._found)

    def _stop(self) -> str:
        """Stop what may move, leave the drives alone, and then say what became of it."""
        self._link.meanwhile = lambda: None
        said = ""
        if self._commanded:
            stop = quick_stop(self._pacer, self._watch, self._stopping_time())
            said = stop.words
            if stop.unconfirmed:
                return said  # and those drives watch our heartbeat, which has ended
        if self._pacer.beating or self._found.any:
            self._release()
        return said

    def _stopping_time(self) -> int:
        """Time in ns in which every axis comes to rest on its ramp from its greatest velocity."""
        demand = self._source.demand
        ramps = [v / braking for v, braking in zip(demand.velocity, demand.quick_stop, strict=True)]
        return STOP_MARGIN + STANDSTILL_TIME + 10 * self._pacer.period + int(max(ramps) * NANOSECONDS)

    def _command(self, word: int, state: State, setpoints: Cycle, *, bits: int = 0) -> None:
        """Send a controlword every cycle until all drives are in a state."""
        cycle, deadline = self._pacer.commanding(word, setpoints), self._clock.now() + self._patience
        while not all(axis.state is state and axis.statusword & bits == bits for axis in self._watch.axes):
            if self._clock.now() > deadline:
                raise StreamAborted(self._not_reached(state))
            self._cycle(cycle)

    def _not_reached(self, state: State) -> str:
        """Say what is missing of a state: the state itself, or that the drives follow in it."""
        words = ", ".join(f"{axis.name}: {axis.state.words}" for axis in self._watch.axes)
        waited = f"within {self._target.can.state_timeout:g} s (can.state_timeout)"
        if any(axis.state is not state for axis in self._watch.axes):
            cure = "check power, brakes and enabling inputs"
            return f"The drives do not reach {state.words!r} {waited} ({words}); {cure}."
        idle = ", ".join(axis.name for axis in self._watch.axes if not axis.statusword & FOLLOWS)
        return (
            f"axis {idle}: the drive is enabled, but says that it follows no setpoints {waited}: bit 12 of "
            "its statusword is not set; check the mode of operation, and whether it takes SYNC and setpoints."
        )

    def _cycle(self, messages: Cycle, led: Integers | None = None) -> None:
        """Send frames and SYNC at the next instant, by which the axes are led to a place; judged before."""
        self._judge()
        self._pacer.skipped()
        self._pacer.send(messages)
        self._sent_at = self._clock.now()
        if led is not None:
            self._following.lead(led)
        self._pacer.next()

    def _judge(self) -> None:
        """Take in the answers, shortly before the next cycle."""
        self._link.wait_until(self._pacer.look)
        self._require_well()
        answered = all(axis.heard >= self._sent_at for axis in self._watch.axes)
        if answered and self._answers_for >= 0:
            self._book.take_answer(self._answers_for, [axis.position for axis in self._watch.axes])
        self._answers_for = -1
        self._following.require()

    def _require_well(self) -> None:
        self._watch.require_well()
        if self._stops_asked:
            asked = self._stops_asked.popleft()
            if self._ended or not self._can_end or not self._source.end():
                raise StreamAborted(asked)
            self._ended = asked

    def _require_skippable(self, sent: Step, following: Step, cycle: int, skipped: int) -> None:
        """Pass over one setpoint that is too late, if the next one is no greater a step than any other."""
        greatest = self._source.demand.velocity
        apart = abs(following.position - sent.position)
        steps = [velocity * self._pacer.period / NANOSECONDS for velocity in greatest]
        if skipped > 1 or any(far > step + 0.5 for far, step in zip(apart, steps, strict=True)):
            raise StreamAborted(
                f"This machine was {skipped * self._pacer.period / 1e6:g} ms late at cycle {cycle}; run "
                "less on it, permit real-time priority, or choose a longer can.sync_period (the self-test "
                "measures it)."
            )

    def _record(self, phase: Phase, reason: str) -> Record:
        if phase is Phase.ABORTED:
            self._begin(phase)
        self._book.begin(phase)
        fault = self._watch.fault if phase is Phase.DONE else None
        return self._book.record(
            reason,
            tuple(axis.position for axis in self._watch.axes),
            aftermath=" ".join(filter(None, [fault, *self._left])),
            launched=self._link.launching is not None,
        )
