"""Log of CAN frames in candump's format (``candump -L`` of can-utils): written, and read back strictly.

::

    (0000000000.000000) can0 301#00000000
    (0000000000.000000) can0 080#
    (0000000000.004000) can0 301#01000000
    (0000000000.004000) can0 080#

Frames of one cycle carry the stamp of its SYNC; they are sent in the file's order.
"""

import re
from collections.abc import Iterable, Iterator

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.frames import CHANNEL, MICROSECONDS

_FRAME = re.compile(r"\((\d{1,12})\.(\d{6})\) (\S+) ([0-9A-F]{3})#((?:[0-9A-F]{2}){0,8})")


@attrs.frozen
class Frame:
    """A classical data frame.

    Attributes
    ----------
    stamp : int
        µs.
    cob_id : int
        11 bits.
    data : bytes
    line : int
        Where it was read, from 1; 0 where it was not.
    channel : str
    """

    stamp: int
    cob_id: int
    data: bytes
    line: int = 0
    channel: str = CHANNEL


def write(frames: Iterable[Frame]) -> bytes:
    """Render frames, ASCII."""
    return "".join(
        f"({frame.stamp // MICROSECONDS:010d}.{frame.stamp % MICROSECONDS:06d}) {frame.channel} "
        f"{frame.cob_id:03X}#{frame.data.hex().upper()}\n"
        for frame in frames
    ).encode("ascii")


def read(content: bytes) -> Iterator[Frame]:
    """Read frames in the file's order.

    Raises
    ------
    ExportError
        A line is none, the text breaks off, or a stamp falls.
    """
    lines = content.decode("latin-1").split("\n")
    if lines.pop().strip():
        raise ExportError(
            f"line {len(lines) + 1}: the CAN log breaks off without a line end; export it again."
        )
    stamp = 0
    for number, text in enumerate(lines, start=1):
        match = _FRAME.fullmatch(text.rstrip("\r"))
        if match is None:
            raise altered(number, f"{text[:60]!r} is no frame in candump's format")
        seconds, microseconds, channel, cob_id, data = match.groups()
        instant = int(seconds) * MICROSECONDS + int(microseconds)
        frame = Frame(instant, int(cob_id, 16), bytes.fromhex(data), number, channel)
        if frame.stamp < stamp:
            raise altered(number, "the stamp falls")
        stamp = frame.stamp
        yield frame


def altered(line: int, what: str) -> ExportError:
    """Say what is wrong in a line of a log."""
    return ExportError(f"line {line}: {what}; export the log again.")
