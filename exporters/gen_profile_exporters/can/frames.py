"""Which frames carry what: COB-IDs, the content of each PDO, and how much of the bus they take.

Per axis (node ids count up from ``can.node``, or stand in ``can.nodes``), after the predefined connection set
of CiA 301, unless ``can.cob_ids`` states others:

========== ======================= ================================================ =========================
COB-ID     PDO                     content                                          sent
========== ======================= ================================================ =========================
200h + n   RPDO1, to the drive     controlword 6040h                                when it changes
300h + n   RPDO2, to the drive     607Ah, and 60B1h or 60B2h; 60C1h:01; or 60FFh    every cycle, before SYNC
400h + n   RPDO3, to the drive     60B2h beside 60B1h: 80 bits are more than one    every cycle, before SYNC
                                   frame holds; not used otherwise
180h + n   TPDO1, from the drive   statusword 6041h, actual position 6064h          on SYNC
========== ======================= ================================================ =========================

The controlword has a PDO of its own, so that setpoints which still wait in a queue cannot undo a quick stop.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from decimal import Decimal

import attrs
import numpy as np
from can import Message
from numpy.typing import NDArray

from gen_profile.errors import ExportError
from gen_profile.spec.can import CanSpec, CobIdsSpec
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.setpoints import two_digits_up

NMT = 0x000
SYNC = 0x080  # and EMCY, of node n: 080h + n
EMCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
RPDO2 = 0x300
RPDO3 = 0x400
SDO_ANSWER = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
MASTER = 127  # node id under which the streamer sends its heartbeat
LAST_NODE = 126

MOST_LOAD = Decimal("0.7")  # of the bus, at worst; the rest is for SDOs, heartbeats and repeated frames
MICROSECONDS = 1_000_000

Integers = NDArray[np.int64]


@attrs.frozen(kw_only=True)
class Field:
    """One object in a PDO.

    Attributes
    ----------
    index, sub : int
        Of the object dictionary.
    code : str
        Its type, as `struct` spells it: ``"H"`` for UNSIGNED16, ``"i"`` for INTEGER32 …
    name : str
        As a DBC calls it.
    """

    index: int
    sub: int
    code: str
    name: str

    @property
    def bits(self) -> int:
        """Length."""
        return 8 * struct.calcsize(self.code)

    @property
    def mapping(self) -> int:
        """Value of a mapping entry (1600h and following): index, subindex, length in bits."""
        return self.index << 16 | self.sub << 8 | self.bits


CONTROLWORD = Field(index=0x6040, sub=0, code="H", name="Controlword")
STATUSWORD = Field(index=0x6041, sub=0, code="H", name="Statusword")
ACTUAL_POSITION = Field(index=0x6064, sub=0, code="i", name="ActualPosition")
TARGET_POSITION = Field(index=0x607A, sub=0, code="i", name="TargetPosition")
INTERPOLATION_DATA = Field(index=0x60C1, sub=1, code="i", name="InterpolationData")
TARGET_VELOCITY = Field(index=0x60FF, sub=0, code="i", name="TargetVelocity")
VELOCITY_OFFSET = Field(index=0x60B1, sub=0, code="i", name="VelocityOffset")
TORQUE_OFFSET = Field(index=0x60B2, sub=0, code="h", name="TorqueOffset")

# PDOs by the COB-ID of node 0, as can.cob_ids calls them
PDO_NAMES = {RPDO1: "command", RPDO2: "setpoint", RPDO3: "feed_forward", TPDO1: "feedback"}
COMMAND = (CONTROLWORD,)
FEEDBACK = (STATUSWORD, ACTUAL_POSITION)

Pdos = Mapping[int, tuple[Field, ...]]  # by COB-ID of node 0

_OTHER_MODES: Mapping[str, Pdos] = {"ip": {RPDO2: (INTERPOLATION_DATA,)}, "csv": {RPDO2: (TARGET_VELOCITY,)}}
_FEED_FORWARD: Mapping[str, Pdos] = {
    "none": {RPDO2: (TARGET_POSITION,)},
    "velocity": {RPDO2: (TARGET_POSITION, VELOCITY_OFFSET)},
    "torque": {RPDO2: (TARGET_POSITION, TORQUE_OFFSET)},
    "both": {RPDO2: (TARGET_POSITION, VELOCITY_OFFSET), RPDO3: (TORQUE_OFFSET,)},
}


def setpoint_pdos(can: CanSpec) -> Pdos:
    """List what the RPDOs with a drive's setpoints hold."""
    return _OTHER_MODES.get(can.mode, _FEED_FORWARD[can.feed_forward])


def setpoint_fields(can: CanSpec) -> tuple[Field, ...]:
    """List what a drive is sent in each cycle, in all its RPDOs."""
    return tuple(field for fields in setpoint_pdos(can).values() for field in fields)


def message(cob_id: int, data: bytes = b"") -> Message:
    """Make a frame with an 11-bit identifier."""
    return Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def packing(fields: Sequence[Field]) -> struct.Struct:
    """Pack the fields as a PDO does: little-endian, without gaps."""
    return struct.Struct("<" + "".join(field.code for field in fields))


@attrs.frozen(kw_only=True)
class SetpointFrame:
    """One of the frames that every cycle holds.

    Attributes
    ----------
    cob_id : int
    column : int
        Of the axes, whose it is.
    fields : slice
        Which of the axis's fields it carries.
    packing : struct.Struct
    """

    cob_id: int
    column: int
    fields: slice
    packing: struct.Struct

    def pack(self, setpoints: Sequence[Sequence[int]]) -> bytes:
        """Take its content from all fields of all axes in one cycle."""
        return self.packing.pack(*setpoints[self.column][self.fields])


def nodes(target: Target) -> tuple[int, ...]:
    """List the node ids, in the axes' order.

    Raises
    ------
    ExportError
        There are too few.
    """
    if target.can.nodes:
        return _stated_nodes(target)
    first, axes = target.can.node, len(target.axes)
    if first + axes - 1 > LAST_NODE:
        raise ExportError(
            f"can.node: {axes} axes from node {first} on exceed the last node id {LAST_NODE} "
            f"({MASTER} is the master's)."
        )
    return tuple(range(first, first + axes))


def _stated_nodes(target: Target) -> tuple[int, ...]:
    stated = tuple(target.can.nodes[axis.name] for axis in target.axes)
    if max(stated) > LAST_NODE:
        raise ExportError(f"can.nodes: {MASTER} is the master's own; the last node id is {LAST_NODE}.")
    return stated


def cob_ids(target: Target) -> tuple[Mapping[int, int], ...]:
    """List the COB-IDs of each axis's PDOs, by those of node 0.

    Raises
    ------
    ExportError
        There are too few node ids, or two PDOs have the same COB-ID.
    """
    used = {RPDO1, TPDO1, *setpoint_pdos(target.can)}
    found, taken = [], dict[int, str]()
    for axis, node in zip(target.axes, nodes(target), strict=True):
        own = target.can.cob_ids.get(axis.name, CobIdsSpec())
        found.append({pdo: getattr(own, name) or pdo + node for pdo, name in PDO_NAMES.items()})
        for pdo in sorted(used):
            cob_id, place = found[-1][pdo], f"can.cob_ids.{axis.name}.{PDO_NAMES[pdo]}"
            if taken.setdefault(cob_id, place) != place:
                raise ExportError(f"{place}: {cob_id:03X}h is {taken[cob_id]} already; choose another one.")
    return tuple(found)


def setpoint_frames(target: Target) -> tuple[SetpointFrame, ...]:
    """List the frames of a cycle in the order in which they are sent, SYNC after them.

    Raises
    ------
    ExportError
        There are too few node ids, or two PDOs have the same COB-ID.
    """
    found = []
    for column, own in enumerate(cob_ids(target)):
        first = 0
        for pdo, fields in setpoint_pdos(target.can).items():
            carried = slice(first, first + len(fields))
            found.append(
                SetpointFrame(cob_id=own[pdo], column=column, fields=carried, packing=packing(fields))
            )
            first = carried.stop
    return tuple(found)


def commanding_cob_ids(target: Target) -> set[int]:
    """List the COB-IDs that only the controller of these drives may send: commands and setpoints."""
    sent = (RPDO1, *setpoint_pdos(target.can))
    return {own[pdo] for own in cob_ids(target) for pdo in sent}


def period_digits(can: CanSpec) -> tuple[int, int]:
    """SYNC period as object 60C2h tells it to a drive: 1 to 255 times a power of ten of seconds.

    Raises
    ------
    ExportError
        It cannot be told.
    """
    period = Decimal(repr(can.sync_period)).normalize()
    _, digits, exponent = period.as_tuple()
    value = int("".join(map(str, digits)))
    if value > 255 or not isinstance(exponent, int) or exponent < -6:
        raise ExportError(
            f"can.sync_period: drives cannot be set to an interpolation period of {period:f} s (60C2h holds "
            "1 to 255 times a power of ten, here of at least 1 µs); choose a rounder one, such as 0.004."
        )
    return value, exponent


def period_microseconds(can: CanSpec) -> int:
    """SYNC period in µs."""
    value, exponent = period_digits(can)
    return int(value * Decimal(10) ** exponent * MICROSECONDS)


def frame_bits(data_bytes: int) -> int:
    """Count the bits of the longest classical frame with an 11-bit identifier, interframe space included.

    47 bits frame the data; of them 34, and all data bits, are subject to stuffing: one more bit for every
    four after the first (ISO 11898-1; Davis et al., *Controller Area Network schedulability analysis*, 2007).
    """
    return 47 + 8 * data_bytes + (33 + 8 * data_bytes) // 4


def cycle_bits(target: Target) -> int:
    """Bits of one cycle at their most: SYNC and, per axis, setpoints and an answer."""
    setpoints = [packing(fields).size for fields in setpoint_pdos(target.can).values()]
    return frame_bits(0) + len(target.axes) * sum(map(frame_bits, [*setpoints, packing(FEEDBACK).size]))


def require_load(target: Target) -> None:
    """Refuse what overloads the bus.

    Raises
    ------
    ExportError
        With the shortest period that fits.
    """
    axes, can, bits = len(target.axes), target.can, cycle_bits(target)
    shortest = bits / (MOST_LOAD * can.bitrate)
    if Decimal(repr(can.sync_period)) < shortest:
        raise ExportError(
            f"can.sync_period: {axes} {'axes' if axes > 1 else 'axis'} every {can.sync_period:g} s: their "
            f"frames load a bus of {can.bitrate} bit/s by {bits / can.sync_period / can.bitrate:.0%} "
            f"(limit {MOST_LOAD:.0%}); "
            f"set {two_digits_up(shortest)} s or more, or raise can.bitrate."
        )
