"""Simulated drives on one bus, which together move one load."""

import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

import attrs
import can
import canopen

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.cia402 import MOVING
from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock
from gen_profile_exporters.can.host.link import FRAMES_AT_ONCE
from gen_profile_exporters.can.simulation.simulated_drive import SimulatedDrive

FAREWELL = NANOSECONDS // 2  # without SYNC, after which a stream is over
WAIT = 0.001  # s, for a frame, before the drives look at their clocks


class Load(Protocol):
    """A machine whose axes follow positions."""

    def advance(self, position: Sequence[float], duration: float) -> Sequence[float]:
        """Lead every axis evenly to a position.

        Parameters
        ----------
        position : sequence of float
            Commanded at the end, per axis, in m (or rad).
        duration : float
            s.

        Returns
        -------
        sequence of float
            Where the axes then are.
        """


class DriveBank:
    """Drives, their bus and their load.

    Parameters
    ----------
    bus : can.BusABC
        Opened; it stays the caller's.
    clock : Clock
    drives : sequence of SimulatedDrive
        One per axis of the load.
    counts_per_si : sequence of float
        Of each axis.
    load : Load
    channels : sequence of str
        Of each drive, where they are on several buses; each answers the SYNC of its own.
    others : callable
        COB-IDs and data of what other nodes send after each SYNC.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        drives: Sequence[SimulatedDrive],
        counts_per_si: Sequence[float],
        load: Load,
        *,
        channels: Sequence[str] = (),
        others: Callable[[], Sequence[tuple[int, bytes]]] = tuple,
    ) -> None:
        self.drives = tuple(drives)
        self._bus, self._clock, self.load = bus, clock, load
        self._counts_per_si = tuple(counts_per_si)
        self._network, self._others = _Network(bus, clock), others
        self._synced = clock.now()
        self._channels = tuple(channels)
        self._waiting = set(self._channels)  # for SYNC in this cycle
        for drive in self.drives:
            self._network.add_node(drive.local)
        self._network.subscribe(frames.NMT, self._obey_reset)  # after canopen's own
        for drive in self.drives:
            drive.boot()

    @property
    def finished(self) -> bool:
        """Whether every drive had been enabled, and nothing has moved or been asked for a while."""
        over = all(drive.was_enabled and drive.state not in MOVING for drive in self.drives)
        return over and self._clock.now() - self._synced > FAREWELL

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve the bus until told to stop.

        Raises
        ------
        StreamAborted
            The bus fails.
        """
        try:
            while not stop():
                self.poll(WAIT)
        except (can.CanError, OSError) as error:
            raise StreamAborted(f"The bus of the simulated drives failed ({error}).") from error

    def poll(self, wait: float = 0.0) -> None:
        """Take in what is waiting, at most so long for the first frame in s, then look at the clock."""
        for _ in range(FRAMES_AT_ONCE):
            message = self._bus.recv(wait)
            if message is None:
                break
            self._take(message)
            wait = 0.0
        now = self._clock.now()
        self._network.send_due(now)
        for drive in self.drives:
            drive.watch(now)
            self._tell(drive.events(now))
        period = round(max(drive.period for drive in self.drives) * NANOSECONDS)
        if self._moving and now - self._synced > period + period // 2:
            self._synced += period
            self._advance()

    @property
    def _moving(self) -> bool:
        return any(drive.state in MOVING for drive in self.drives)

    def _take(self, message: can.Message) -> None:
        if message.is_error_frame or message.is_extended_id or message.is_remote_frame:
            return
        if message.arbitration_id == frames.SYNC:
            self._synced = self._clock.now()
            self._synchronise(str(message.channel), len(message.data))
            return
        data = bytearray(message.data)
        for drive in self.drives:
            drive.receive(message.arbitration_id, bytes(data), self._clock.now())
        if (message.arbitration_id == frames.NMT and len(data) == 2) or self._is_request(message):
            with suppress(struct.error):  # canopen cannot refuse a request that goes on with none
                self._network.notify(message.arbitration_id, data, message.timestamp)

    def _synchronise(self, channel: str, length: int) -> None:
        """Have drives tell where they are now, and then set out for the next SYNC, once all had theirs."""
        if self._channels and channel not in self._waiting:  # another bus had none
            self._set_out()
        for number, drive in enumerate(self.drives):
            if not self._channels or self._channels[number] == channel:
                self._tell(drive.feedback())
                drive.synchronise(length)
        self._waiting.discard(channel)
        if not self._waiting:
            self._set_out()

    def _set_out(self) -> None:
        self._waiting = set(self._channels)
        self._advance()
        self._tell(self._others())

    def _tell(self, pdos: Sequence[tuple[int, bytes]]) -> None:
        for cob_id, data in pdos:
            self._network.send_message(cob_id, data)

    def _is_request(self, message: can.Message) -> bool:
        nodes = {drive.node for drive in self.drives}
        return message.arbitration_id - frames.SDO_REQUEST in nodes and len(message.data) == 8

    def _advance(self) -> None:
        """Move the load by one period."""
        goals = [drive.next_command() for drive in self.drives]
        duration = max(drive.period for drive in self.drives)
        scaled = [goal / counts for goal, counts in zip(goals, self._counts_per_si, strict=True)]
        actual = self.load.advance(scaled, duration)
        for drive, position, counts in zip(self.drives, actual, self._counts_per_si, strict=True):
            drive.arrive(position * counts)

    def _obey_reset(self, _: int, data: bytearray, __: float) -> None:
        command, node = data
        if command in {canopen.nmt.NMT_COMMANDS["RESET"], canopen.nmt.NMT_COMMANDS["RESET COMMUNICATION"]}:
            for drive in self.drives:
                if node in {0, drive.node}:
                    drive.reset()


@attrs.define
class _Periodic:
    """A frame to be repeated: canopen's heartbeat, on our clock."""

    cob_id: int
    data: bytes
    period: int
    due: int
    stopped: bool = False

    def stop(self) -> None:
        self.stopped = True

    def update(self, data: Sequence[int]) -> None:
        self.data = bytes(data)


class _Network(canopen.Network):
    """canopen's network without its threads: frames come by `notify`, periodic ones go by `send_due`."""

    def __init__(self, bus: can.BusABC, clock: Clock) -> None:
        super().__init__(bus)
        self._clock = clock
        self._periodic: list[_Periodic] = []

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> Any:
        interval = round(period * NANOSECONDS)
        task = _Periodic(can_id, bytes(data), interval, self._clock.now() + interval)
        self._periodic.append(task)
        return task

    def send_due(self, now: int) -> None:
        self._periodic = [task for task in self._periodic if not task.stopped]
        for task in self._periodic:
            if now >= task.due:
                task.due = max(task.due + task.period, now)
                self.send_message(task.cob_id, task.data)
