"""A streamer and drives on one bus, in one thread, on a simulated clock.

What the tests judge is the bus alone: a third party on it takes down every frame, as candump does.
"""

import copy
import itertools
import random
import struct
from collections import defaultdict, deque
from typing import ClassVar

import attrs
import can
from exporters.motions import quintic, target

from gen_profile_exporters.can import frames
from gen_profile_exporters.can.export import exporter
from gen_profile_exporters.can.host.clock import SharedClock
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.can.simulation.drive_bank import DriveBank
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.simulation.simulated_drive import SimulatedDrive
from gen_profile_exporters.can.streaming.joint_bus import opened
from gen_profile_exporters.can.streaming.plan import plan_of
from gen_profile_exporters.can.streaming.streamer import Streamer

MS = 1_000_000
BEGINNING = 1_000 * MS
QUICK_STOP = b"\x02\x00"
OTHER_MAKE = DriveVariant(own_mapping=True, fixed_period=(40, -4), miss="hold")  # 4 ms, said in another way
_channels = itertools.count()


class HastyClock(SharedClock):
    """A shared clock that does not wait: each sleep is over as soon as the others have worked."""

    passed = 0

    def now(self):
        return self.passed

    def sleep_until(self, instant):
        self.work()
        while self.passed < instant:
            self.passed = min(self.passed + MS, instant)
            self.work()


@attrs.define
class RigidLoad:
    """Axes that follow at once, or with a first-order lag, whatever hangs on them.

    Attributes
    ----------
    position : list of float
        Where the axes are, in m (or rad).
    lag : float
        Share of the distance that is left after one step; 0 follows at once.
    """

    position: list[float]
    lag: float = 0.0

    def advance(self, position, duration):
        del duration
        self.position = [
            goal + self.lag * (at - goal) for at, goal in zip(self.position, position, strict=True)
        ]
        return self.position


class FakeClock:
    """Time that passes only while one sleeps, and lets all others act meanwhile."""

    def __init__(self, step):
        self._now = BEGINNING
        self._step = step
        self.actors = []
        self.alarms = []  # instants at which the others act for certain

    def now(self):
        return self._now

    def sleep_until(self, instant):
        while self._now < instant:
            self.alarms = [alarm for alarm in self.alarms if alarm > self._now]
            self._now = min(self._now + self._step, instant, *self.alarms)
            for act in self.actors:
                act()

    def stall(self, duration):
        """Let time pass while nothing else acts: this machine was busy."""
        self._now += duration


class Line(can.BusABC):
    """One end of a bus: python-can's virtual one without its locks and waits, a third of the time."""

    ends: ClassVar = defaultdict(list)  # by channel

    def __init__(self, channel):
        super().__init__(channel)
        self._channel, self._frames = channel, deque()
        self.ends[channel].append(self)

    def send(self, msg, timeout=None):
        del timeout
        frame = copy.copy(msg)
        frame.channel = self._channel
        for end in self.ends[self._channel]:
            if end is not self:
                end._frames.append(frame)

    def recv(self, timeout=None):
        del timeout
        return self._frames.popleft() if self._frames else None

    def shutdown(self):
        super().shutdown()
        self.ends[self._channel].remove(self)


class LinePort(Port):
    """Opens a line whatever the interface."""

    def open(self, bitrate):
        del bitrate
        return Line(self.channel)


class Tampered:
    """One end of a bus, with something wrong with it."""

    def __init__(self, bus):
        self._bus = bus
        self.sending = lambda message: True  # whether a frame really goes out
        self.receiving = lambda message: message
        self.inbox = []

    def send(self, message, timeout=None):
        del timeout
        if self.sending(message):
            self._bus.send(message)

    def shutdown(self):
        self._bus.shutdown()

    def recv(self, timeout=None):
        return self.receiving(self.inbox.pop() if self.inbox else self._bus.recv(timeout))


class Launching(Tampered):
    """One end of a bus that sends at given instants, as a kernel with launch times does."""

    def __init__(self, bus, clock):
        super().__init__(bus)
        self._clock, self._waiting = clock, []
        clock.actors.append(self._launch)

    def keeps_instants(self):
        return True

    def send_at(self, message, instant):
        self._waiting.append((instant, message))
        self._clock.alarms.append(instant)

    def _launch(self):
        while self._waiting and self._waiting[0][0] <= self._clock.now():
            self.send(self._waiting.pop(0)[1])


class Sluggish:
    """A clock that wakes its user up late, by up to a millisecond."""

    def __init__(self, clock):
        self._clock, self._generator = clock, random.Random(1)
        self.now = clock.now

    def sleep_until(self, instant):
        self._clock.sleep_until(instant + self._generator.randrange(MS))


@attrs.frozen
class Heard:
    """A frame on the bus, at an instant in ms."""

    at: float
    cob_id: int
    data: bytes
    channel: str = ""


class Bench:
    """Everything on one bus."""

    def __init__(
        self,
        *names,
        profile=None,
        make=None,
        load=None,
        stand=None,
        step=MS // 2,
        launching=False,
        sluggish=False,
        reset_fault=False,
        kind=SimulatedDrive,
        source=None,
        port=LinePort,
        **options,
    ):
        self.clock = FakeClock(step)
        self.target = target(*names, **options) if source is None else source.target
        self.plan = source or plan_of(
            exporter.encode(profile or quintic((0.1, 0.4)), self.target)[0].content, self.target
        )
        there = port(interface="virtual", channel=f"bench-{next(_channels)}")
        self._buses = [opened(there, self.target) for _ in range(3)]
        self.witness = self._buses[0]
        self.drive_end = Tampered(self._buses[1])
        self.streamer_end = Launching(self._buses[2], self.clock) if launching else Tampered(self._buses[2])
        self.heard = []
        self.clock.actors.append(self._listen)
        self.drives = self._drives(kind, make or DriveVariant(), load, stand)
        self.drives_alive = True
        self.clock.actors.append(lambda: self.drives.poll() if self.drives_alive else None)
        self._streamer_clock = Sluggish(self.clock) if sluggish else self.clock
        self.renew(reset_fault=reset_fault)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for bus in self._buses:
            bus.shutdown()

    @property
    def drive(self):
        return self.drives.drives[0]

    @property
    def now(self):
        """ms since the beginning."""
        return (self.clock.now() - BEGINNING) / MS

    def renew(self, *, reset_fault=False):
        """Begin again with another streamer, on the same bus and drives."""
        self.phases = []
        self.streamer = Streamer(
            self.streamer_end, self._streamer_clock, self.plan, self.phases.append, reset_fault=reset_fault
        )
        self.fault_at = None

    def at_cycle(self, cycle, act):
        """Do something once so many setpoints have been streamed, and note when."""

        def note():
            self.fault_at = self.now
            act()

        self.then_at_cycle(cycle, note)

    def then_at_cycle(self, cycle, act):
        """Do something once so many setpoints have been streamed."""
        due = [act]

        def look():
            if due and self.streamer.cycles_sent >= cycle:
                due.pop()()

        self.clock.actors.insert(0, look)

    def say(self, cob_id, data=b"", **options):
        """Speak up as another node on the bus; the witness hears itself, too."""
        options.setdefault("is_extended_id", False)
        self.witness.send(can.Message(arbitration_id=cob_id, data=data, **options))

    def run(self):
        record = self.streamer.run()
        self.wait(2)
        return record

    def wait(self, milliseconds):
        self.clock.sleep_until(self.clock.now() + int(milliseconds * MS))

    def of(self, cob_id):
        return [frame for frame in self.heard if frame.cob_id == cob_id]

    def positions(self):
        """What the first drive reported: instants, and positions in counts."""
        answers = self.of(0x180 + self.target.can.node)
        return [(frame.at, int.from_bytes(frame.data[2:6], "little", signed=True)) for frame in answers]

    def asked(self, index):
        """Ask the first drive by SDO for an object, as any node on the bus may; None without an answer."""
        node, before = self.target.can.node, len(self.heard)
        self.say(0x600 + node, struct.pack("<BHB4x", 0x40, index, 0))
        self.wait(2)
        answers = [frame for frame in self.heard[before:] if frame.cob_id == 0x580 + node]
        return int.from_bytes(answers[0].data[4:], "little", signed=True) if answers else None

    def _listen(self):
        while (message := self.witness.recv(0)) is not None:
            self.heard.append(
                Heard(self.now, message.arbitration_id, bytes(message.data), str(message.channel))
            )

    def _drives(self, kind, make, load, stand):
        first = [int(at) for at in (self.plan.motion.position[0] if stand is None else stand)]
        counts = [axis.counts_per_si for axis in self.target.axes]
        nodes = frames.nodes(self.target)
        drives = [kind(node, make, at) for node, at in zip(nodes, first, strict=True)]
        rest = [at / count for at, count in zip(first, counts, strict=True)]
        channels = frames.channels(self.target) if self.target.can.channels else ()
        return DriveBank(
            self.drive_end, self.clock, drives, counts, load or RigidLoad(rest), channels=channels
        )
