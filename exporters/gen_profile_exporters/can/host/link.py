"""One CAN bus and one clock: frames go out, frames that came in are handed to those who asked for them.

Nothing here has a thread of its own: frames are taken in when the streamer has time for them, in the order in
which they came. That also makes it run on a clock that a test holds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import can
import canopen
from canopen.sdo.client import SdoClient

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock

POLL = NANOSECONDS // 5000  # between two looks for an awaited answer
ANSWER_TIMEOUT = 0.5  # s, unless it is said
SEGMENT_ANSWERS, ABORT = (
    {0: 1, 3: 0},
    4,
)  # command specifiers (CiA 301): of segments asked for, of their answers
FRAMES_AT_ONCE = 64  # a flooded bus must not keep a loop from looking at the clock


@runtime_checkable
class Launching(Protocol):
    """A bus that may send frames at given instants by itself."""

    def keeps_instants(self) -> bool:
        """Try whether it does; sends a frame that no CANopen device takes."""

    def send_at(self, message: can.Message, instant: int) -> None:
        """Have a frame sent at an instant of the clock, in ns."""


class Link:
    """A bus with a clock.

    Parameters
    ----------
    bus : can.BusABC
        Opened; it stays the caller's.
    clock : Clock
    answer_timeout : float
        For which an answer to an SDO is awaited, in s.

    Attributes
    ----------
    launching : Launching or None
        The bus, once it proved that it sends at given instants.
    meanwhile : callable
        What must go on while an SDO is awaited: heartbeats, for instance.
    """

    def __init__(self, bus: can.BusABC, clock: Clock, answer_timeout: float = ANSWER_TIMEOUT) -> None:
        self.bus = bus
        self.clock = clock
        self.answer_timeout = round(answer_timeout * NANOSECONDS)
        self.launching: Launching | None = None
        self.meanwhile: Callable[[], None] = lambda: None
        self._takers: list[Callable[[can.Message], None]] = []
        self._sdos: dict[int, _Sdo] = {}

    def try_launch_times(self) -> None:
        """Have cycles sent at their instants by the bus from now on, if it can."""
        if isinstance(self.bus, Launching) and self.bus.keeps_instants():
            self.launching = self.bus

    def subscribe(self, take: Callable[[can.Message], None]) -> None:
        """Hand every frame received from now on to `take`."""
        self._takers.append(take)

    def send(self, message: can.Message, instant: int | None = None) -> None:
        """Send one frame now, or have it sent at an instant if the bus can, or say why not.

        Raises
        ------
        StreamAborted
        """
        try:
            if self.launching is not None and instant is not None:
                self.launching.send_at(message, instant)
            else:
                self.bus.send(message)
        except (can.CanError, OSError) as error:
            raise StreamAborted(
                f"Frame {message.arbitration_id:03X}h cannot be sent ({error}): the transmit buffer is full "
                "or the bus is down; check cable, termination, bit rate and `ip -details link`."
            ) from error

    def receive(self) -> bool:
        """Take in one frame, if one is waiting.

        Raises
        ------
        StreamAborted
            The interface fails.
        """
        try:
            message = self.bus.recv(0)
        except (can.CanError, OSError) as error:
            raise StreamAborted(f"The bus cannot be read ({error}): the interface went down.") from error
        if message is None:
            return False
        for take in self._takers:
            take(message)
        node = message.arbitration_id - frames.SDO_ANSWER
        if node in self._sdos and not message.is_extended_id and len(message.data) == 8:
            self._sdos[node].on_response(message.arbitration_id, message.data, message.timestamp)
        return True

    def drain(self) -> None:
        """Take in what is waiting."""
        for _ in range(FRAMES_AT_ONCE):
            if not self.receive():
                return

    def wait_until(self, instant: int) -> None:
        """Sleep until an instant, then take in what came meanwhile."""
        self.clock.sleep_until(instant)
        self.drain()

    def sdo(self, node: int) -> _Sdo:
        """Open the SDO channel of a node."""
        if node not in self._sdos:
            self._sdos[node] = _Sdo(self, node)
        return self._sdos[node]


class _Sdo(SdoClient):
    """canopen's SDO client, which sends by the link, and waits for answers by it instead of by a thread."""

    def __init__(self, link: Link, node: int) -> None:
        super().__init__(frames.SDO_REQUEST + node, frames.SDO_ANSWER + node, canopen.ObjectDictionary())
        self._link = link

    def send_request(self, request: bytes) -> None:
        """Send as everything is sent, so that a bus that fails is reported as everywhere."""
        self._request = bytes(request)
        self._link.send(frames.message(self.rx_cobid, self._request))

    def read_response(self) -> bytes:
        """Wait for the answer, and fail as canopen does when none comes; late ones to others do not count."""
        deadline = self._link.clock.now() + self._link.answer_timeout
        while self._link.clock.now() < deadline:
            if not self.responses.empty():
                if _answers(self.responses.queue[0], self._request):
                    answer: bytes = super().read_response()
                    return answer
                self.responses.get()
            elif not self._link.receive():
                self._link.clock.sleep_until(self._link.clock.now() + POLL)
            self._link.meanwhile()
        raise canopen.SdoCommunicationError(f"no answer within {self._link.answer_timeout / NANOSECONDS:g} s")


def _answers(answer: bytes, request: bytes) -> bool:
    """Whether an answer is to a request, by the object that both name; segments name none."""
    asked, kind = request[0] >> 5, answer[0] >> 5
    if asked in SEGMENT_ANSWERS:
        return kind in {SEGMENT_ANSWERS[asked], ABORT}
    return answer[1:4] == request[1:4] or (kind == ABORT and not any(answer[1:4]))
