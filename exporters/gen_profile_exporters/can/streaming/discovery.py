"""Which nodes answer on a bus, and what they are; only reads, and not where another master is in command."""

from __future__ import annotations

import struct
from contextlib import suppress

import attrs
import can
from canopen.sdo.exceptions import SdoError

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.cia402 import CIA_402, MODES
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.host.link import Link

LISTEN = NANOSECONDS // 2  # before anything is asked; several heartbeats of ours, and of most drives
QUESTION_INTERVAL = NANOSECONDS // 500  # from one question to the next, so that no queue fills
ANSWER_TIMEOUT = NANOSECONDS // 2  # for the last answer
NODES = range(1, frames.MASTER + 1)
READ_DEVICE_TYPE = struct.pack("<BHBxxxx", 0x40, 0x1000, 0)  # SDO upload (CiA 301)
CONTROLLERS = {frames.NMT, frames.SYNC, frames.HEARTBEAT + frames.MASTER}


@attrs.frozen(kw_only=True)
class IdentifiedNode:
    """What a node tells of itself; None for what it does not.

    Attributes
    ----------
    number : int
        Node id.
    device : int or None
        1000h; its low word is the number of the profile.
    vendor, product, serial : int or None
        1018h:01, :02 and :04.
    modes : int or None
        6502h, of drives.
    name : str or None
        1008h.
    """

    number: int
    device: int | None = None
    vendor: int | None = None
    product: int | None = None
    serial: int | None = None
    modes: int | None = None
    name: str | None = None

    @property
    def is_drive(self) -> bool:
        """Whether it says that it is a CiA 402 drive."""
        return self.device is not None and self.device & 0xFFFF == CIA_402

    @property
    def mode_names(self) -> tuple[str, ...]:
        """Those of its modes that motions can be streamed in."""
        return tuple(name for name, mode in MODES.items() if (self.modes or 0) >> (mode - 1) & 1)


def discover(link: Link) -> tuple[IdentifiedNode, ...]:
    """Ask every node id who is there.

    Raises
    ------
    StreamAborted
        The bus is in use by a controller, with which questions would interfere; disturbed, so that questions
        would be lost; or it fails.
    """
    heard, answered = listen(link), set[int]()

    def take(message: can.Message) -> None:  # a refusal is an answer, too
        if not message.is_extended_id:
            answered.add(message.arbitration_id - frames.SDO_ANSWER)

    link.subscribe(take)
    for number in NODES:
        link.send(frames.message(frames.SDO_REQUEST + number, READ_DEVICE_TYPE))
        _wait(link, QUESTION_INTERVAL)
        heard.require_undisturbed()
    _wait(link, ANSWER_TIMEOUT)
    heard.require_undisturbed()
    return tuple(_identified(link, number) for number in sorted(answered.intersection(NODES)))


def listen(link: Link) -> _BusMonitor:
    """Listen for a while that no other master is in command.

    Raises
    ------
    StreamAborted
        One is, or the bus is disturbed.
    """
    heard = _BusMonitor()
    link.subscribe(heard.take)
    _wait(link, LISTEN)
    heard.require_quiet()
    return heard


class _BusMonitor:
    """Notes who else speaks on the bus, and error frames."""

    def __init__(self) -> None:
        self._controller: int | None = None
        self._disturbed = False

    def take(self, message: can.Message) -> None:
        if message.is_error_frame:
            self._disturbed = True
        elif not message.is_extended_id:
            cob_id = message.arbitration_id
            if cob_id in CONTROLLERS or cob_id - frames.SDO_REQUEST in NODES:
                self._controller = cob_id

    def require_quiet(self) -> None:
        self.require_undisturbed()
        if self._controller is not None:
            raise StreamAborted(
                f"Frame {self._controller:03X}h: a controller is at work on this bus, and questions might "
                "disturb it; ask again while it rests."
            )

    def require_undisturbed(self) -> None:
        if self._disturbed:
            raise StreamAborted(
                "The bus is disturbed (error frames): check the bit rate, cable and termination."
            )


def _identified(link: Link, number: int) -> IdentifiedNode:
    device = _number(link, number, 0x1000)
    name = _read(link, number, 0x1008)
    return IdentifiedNode(
        number=number,
        device=device,
        vendor=_number(link, number, 0x1018, 1),
        product=_number(link, number, 0x1018, 2),
        serial=_number(link, number, 0x1018, 4),
        modes=_number(link, number, 0x6502)
        if IdentifiedNode(number=number, device=device).is_drive
        else None,
        name=None if name is None else name.rstrip(b"\0").decode("latin-1"),
    )


def _number(link: Link, node: int, index: int, sub: int = 0) -> int | None:
    data = _read(link, node, index, sub)
    return None if data is None else int.from_bytes(data[:4], "little")


def _read(link: Link, node: int, index: int, sub: int = 0) -> bytes | None:
    with suppress(SdoError, struct.error):
        data: bytes = link.sdo(node).upload(index, sub)
        return data
    return None


def _wait(link: Link, duration: int) -> None:
    """Take in what comes for so long, in ns."""
    end = link.clock.now() + duration
    while link.clock.now() < end:
        link.wait_until(min(end, link.clock.now() + QUESTION_INTERVAL))
