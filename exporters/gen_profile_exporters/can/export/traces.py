"""The same frames for bus analysers: Vector's text format ASC and binary format BLF."""

from collections import defaultdict
from collections.abc import Iterable
from io import BytesIO
from itertools import count

import can
from can.io.blf import BLFWriter

from gen_profile_exporters.can.export.candump import Frame
from gen_profile_exporters.can.frames import MICROSECONDS

# A fixed date: the same motion makes the same file. (python-can's writer takes the clock's and the locale's.)
_HEAD = """date Thu Jan 1 00:00:00.000 1970
base hex  timestamps absolute
internal events logged
Begin Triggerblock Thu Jan 1 00:00:00.000 1970
   0.000000 Start of measurement
"""


def asc(frames: Iterable[Frame]) -> bytes:
    """Render as ASC, for CANoe, CANalyzer and python-can."""
    numbers = defaultdict[str, int](count().__next__)  # of channels, as they come
    lines = [
        f"{frame.stamp // MICROSECONDS:4d}.{frame.stamp % MICROSECONDS:06d} {numbers[frame.channel] + 1}  "
        f"{frame.cob_id:<15X} Tx   d {len(frame.data)} {frame.data.hex(' ').upper()}".rstrip()
        for frame in frames
    ]
    return (_HEAD + "\n".join(lines) + "\nEnd TriggerBlock\n").encode("ascii")


def blf(frames: Iterable[Frame]) -> bytes:
    """Render as BLF, for the same."""
    file, numbers = _Kept(), defaultdict[str, int](count().__next__)
    with BLFWriter(file) as writer:
        for frame in frames:
            writer.on_message_received(
                can.Message(
                    timestamp=frame.stamp / MICROSECONDS,
                    arbitration_id=frame.cob_id,
                    data=frame.data,
                    is_extended_id=False,
                    is_rx=False,
                    channel=numbers[frame.channel],
                )
            )
    return file.getvalue()


class _Kept(BytesIO):
    """Bytes that outlive the writer, which closes its file."""

    def close(self) -> None:
        pass
