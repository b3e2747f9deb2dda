"""An encoder on a CAN bus, listened to: CiA 406 sends its position first of the process data."""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import pi
from typing import TYPE_CHECKING

import attrs
import numpy as np
from can import BusABC, CanError, Message
from canopen.sdo.exceptions import SdoError

from gen_profile.motion.profile import Array
from gen_profile.support.errors import OutputError
from gen_profile_exporters.can.host.clock import SystemClock
from gen_profile_exporters.can.host.link import Link

if TYPE_CHECKING:
    from gen_profile_exporters.can.host.port import Port

POSITION, RESOLUTION = 0x180, 0x6001  # COB-ID of node 0's first TPDO; counts of a turn
SILENT, FETCHED = 3.0, 0.3  # s without a position, after which it is lost; and s of each table


@attrs.frozen(kw_only=True)
class Encoder:
    """Where an encoder is.

    Attributes
    ----------
    port : Port
    node : int
    counts : int or None
        Of a turn; it is asked for them where they are not given, which is all that is ever sent to it.
    bitrate : int
        Of the channel in bit/s, where no system sets it.
    """

    port: Port
    node: int
    counts: int | None = None
    bitrate: int = 500_000

    def tables(self) -> Iterator[Array]:
        """Give times in s and angles in rad from the first one on, shape (samples, 2), over and over.

        It may turn over its end: half a turn between two samples is taken for none.

        Raises
        ------
        SpecError
            The bus cannot be opened.
        OutputError
            The encoder does not tell how many counts a turn has, or sends no position for `SILENT`.
        """
        with self.port.open(self.bitrate) as bus:
            turn = self.counts or self._asked(bus)
            before, angle, heard = None, 0, time.monotonic()
            while True:
                rows = []
                for message in self._received(bus):
                    counted = int.from_bytes(message.data[:4], "little")
                    angle += 0 if before is None else (counted - before + turn // 2) % turn - turn // 2
                    before = counted
                    rows.append((message.timestamp, 2.0 * pi * angle / turn))
                now = time.monotonic()
                heard = now if rows else heard
                if now - heard > SILENT:
                    raise OutputError(
                        f"Node {self.node} sends no position ({POSITION + self.node:03X}h) on "
                        f"{self.port.channel}: let its controller start it (NMT), and let it transmit by its "
                        "timer (6200h, or 1800h sub 5); compare node id and bit rate."
                    )
                yield np.array(rows, dtype=np.float64).reshape(-1, 2)

    def _received(self, bus: BusABC) -> Iterator[Message]:
        until = time.monotonic() + FETCHED
        try:
            while (left := until - time.monotonic()) > 0.0:
                message = bus.recv(left)
                if message is not None and self._is_position(message):
                    yield message
        except (CanError, OSError) as error:
            raise OutputError(f"{self.port.channel} cannot be read ({error}).") from error

    def _is_position(self, message: Message) -> bool:
        known = message.arbitration_id == POSITION + self.node and not message.is_extended_id
        return known and not message.is_error_frame and not message.is_remote_frame and len(message.data) > 0

    def _asked(self, bus: BusABC) -> int:
        """Ask how many counts a turn has."""
        why = ""
        try:
            answer = Link(bus, SystemClock()).sdo(self.node).upload(RESOLUTION, 0)
            if counts := int.from_bytes(answer, "little"):
                return counts
        except SdoError as error:
            why = f" ({error})"
        raise OutputError(
            f"Node {self.node} on {self.port.channel} does not tell the counts of a turn (6001h){why}: state "
            "them, or compare node id and bit rate."
        )
