"""The beat of a stream: setpoints and SYNC at absolute instants, and heartbeats between them.

::

    start            + period         + 2 periods
      | k              | k + 1          | k + 2
      setpoints, SYNC  setpoints, SYNC  setpoints, SYNC        drives take setpoints over at SYNC
        answers .... | (look: answers are judged a quarter of a period before the next cycle)

Cycle k is sent at ``start + k * period``, an absolute instant, so that nothing drifts: a sleep that ends late
delays one cycle, not all that follow. What came late is never made up for by a burst, which drives would take
for a leap: whole periods that were missed are counted (`skipped`), and the streamer goes on with the
setpoints of now or stops. A bus that sends at given instants by itself gets each cycle a quarter of a period
ahead. The heartbeat (CiA 301, 1017h) goes out with a cycle, at least three times in the time that drives wait
for it.
"""

import can

from gen_profile_exporters.can import frames, pdos, startup
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.streaming.plan import Cycle
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
    watched : bool
        Whether the drives watch our heartbeat.
    left_powered : bool
        Whether a drive may stay powered after a quick stop.
    last_sent : tuple of can.Message
        Setpoints that lead no axis any further: the latest ones, or no velocity.
    """

    def __init__(self, link: Link, target: Target) -> None:
        self.link, self._clock = link, link.clock
        layout, carriers = pdos.layout(target.can), frames.command_frames(target)
        offset = layout.offset(pdos.CONTROLWORD, layout.received[layout.command])
        self._places = {frame.cob_id: offset for frame in carriers}  # of controlwords
        still = [[0] * carriers[0].width] * len(carriers)
        self._own = () if layout.shared else tuple(frames.message(f.cob_id, f.pack(still)) for f in carriers)
        self._by_velocity = target.can.mode == "csv"
        self.last_sent: Cycle = ()
        self.period = frames.period_microseconds(target.can) * 1000
        self.timeout = startup.timeout_ms(target.can) * NANOSECONDS // 1000
        self.watched, self.left_powered = "1016h" not in target.can.without, "605Ah" in target.can.without
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

    def skipped(self) -> int:
        """Sleep until the next cycle, unless the bus waits for it; count the periods it is late."""
        if self.link.launching is None:
            self._clock.sleep_until(self.due)
        return (self._clock.now() - self.due + self.period // 2) // self.period

    def send(self, messages: Cycle) -> None:
        """Send frames, and SYNC after them, for the instant that is due.

        Raises
        ------
        StreamAborted
        """
        self.launch = self.due
        if not self._by_velocity:
            self.last_sent = messages
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

    def within(self, word: int, setpoints: Cycle) -> Cycle:
        """Make a cycle whose setpoints' frames hold a controlword, where they hold one."""
        return tuple(self._with(word, message) for message in setpoints)

    def commanding(self, word: int, setpoints: Cycle) -> Cycle:
        """Make a cycle that commands each drive as well, in frames of their own or in the setpoints'."""
        return self.within(word, (*self._own, *setpoints))

    def commands(self, word: int) -> Cycle:
        """Make controlwords, one for each drive, which lead no axis any further."""
        return self.within(word, self._own or self.last_sent)

    def _with(self, word: int, message: can.Message) -> can.Message:
        place = self._places.get(message.arbitration_id)
        if place is None:
            return message
        data = bytearray(message.data)
        pdos.packing([pdos.CONTROLWORD]).pack_into(data, place, word)
        return frames.message(message.arbitration_id, bytes(data))
