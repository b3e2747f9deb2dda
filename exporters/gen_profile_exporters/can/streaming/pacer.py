"""The beat of a stream: setpoints and SYNC at absolute instants, and heartbeats between them.

Cycle k is sent at ``start + k * period``, setpoints first, so that nothing drifts; what came late is never
made up for by a burst. A bus that sends at given instants by itself gets each cycle a quarter of a period
ahead.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import can

from gen_profile_exporters.can import frames, startup
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.streaming.link import Link
from gen_profile_exporters.exporter import Target

HEARTBEATS_PER_TIMEOUT = 3


class Pacer:
    """Sends cycles.

    Parameters
    ----------
    link : Link
    target : Target

    Attributes
    ----------
    link : Link
    period : int
        SYNC period in ns.
    timeout : int
        How long a drive waits for setpoints and heartbeats, and we for its feedback, in ns.
    due : int
        Instant of the next cycle, in ns.
    launch : int
        Instant of the latest cycle handed over, in ns.
    """

    def __init__(self, link: Link, target: Target) -> None:
        self.link, self._clock = link, link.clock
        self._commands = [own[frames.RPDO1] for own in frames.cob_ids(target)]
        self.period = frames.period_microseconds(target.can) * 1000
        self.timeout = startup.timeout_ms(target.can) * NANOSECONDS // 1000
        self.due = self.launch = 0
        self._beat_due = 0
        self._heartbeat = frames.message(frames.HEARTBEAT + frames.MASTER, b"\x05")
        self._sync = frames.message(frames.SYNC)

    @property
    def beating(self) -> bool:
        """Whether our heartbeat was sent, so that drives may wait for the next one."""
        return self._beat_due > 0

    @property
    def look(self) -> int:
        """When to judge the answers, shortly before the next cycle, in ns."""
        return self.due - self.period // 4

    def begin(self) -> None:
        """Have the first cycle one period from now."""
        self.due = self._clock.now() + self.period

    def missed(self) -> int:
        """Sleep until the next cycle, unless the bus waits for it; count the periods it is late."""
        if self.link.launching is None:
            self._clock.sleep_until(self.due)
        return (self._clock.now() - self.due + self.period // 2) // self.period

    def send(self, messages: Iterable[can.Message]) -> None:
        """Send frames, and SYNC after them, for the instant that is due.

        Raises
        ------
        StreamAborted
        """
        self.launch = self.due
        for frame in messages:
            self.link.send(frame, self.due)
        self.link.send(self._sync, self.due)
        self.beat()

    def next(self) -> None:
        """Have the next cycle one period later, or at once when that has passed."""
        self.due = max(self.due + self.period, self._clock.now())

    def beat(self) -> None:
        """Send our heartbeat, if it would be late after another period.

        Raises
        ------
        StreamAborted
        """
        now = self._clock.now()
        if now + self.period > self._beat_due:
            self.link.send(self._heartbeat)
            self._beat_due = now + self.timeout // HEARTBEATS_PER_TIMEOUT

    def outlast(self) -> None:
        """Sleep until what was handed over is on the bus, so that no setpoint follows a stop."""
        self._clock.sleep_until(self.launch)

    def commands(self, word: int) -> Sequence[can.Message]:
        """Make controlwords, one for each drive."""
        data = frames.packing(frames.COMMAND).pack(word)
        return [frames.message(cob_id, data) for cob_id in self._commands]
