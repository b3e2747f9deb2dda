"""Which frames carry the PDOs, and how much of the bus they take.

Per axis (node ids count up from ``can.node``, or stand in ``can.nodes``), COB-IDs are those of the predefined
connection set of CiA 301 (200h + n for RPDO1 of node n, 180h + n for TPDO1 …), unless ``can.cob_ids`` states
others.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal

import attrs
import numpy as np
from can import Message
from numpy.typing import NDArray

from gen_profile.spec.can import CanSpec, CobIdsSpec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.pdos import (
    CONTROLWORD,
    Field,
    constants,
    enabling,
    layout,
    packing,
    setpoint_fields,
)
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.modulo import turn_counts, within
from gen_profile_exporters.setpoints import two_digits_up

NMT = 0x000
SYNC = 0x080  # and EMCY, of node n: 080h + n
EMCY = 0x080
SDO_ANSWER = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
MASTER = 127  # node id under which the streamer sends its heartbeat
LAST_NODE = 126
CHANNEL = "can0"  # of drives that are all on one bus

MOST_LOAD = Decimal("0.7")  # of the bus, at worst; the rest is for SDOs, heartbeats and repeated frames
MICROSECONDS = 1_000_000
MOST_DIGITS, USUAL_EXPONENT = 255, -3  # of 60C2h

Integers = NDArray[np.int64]


def message(cob_id: int, data: bytes = b"") -> Message:
    """Make a frame with an 11-bit identifier."""
    return Message(arbitration_id=cob_id, data=data, is_extended_id=False)


@attrs.frozen(kw_only=True)
class SetpointFrame:
    """One of the frames that every cycle holds.

    Attributes
    ----------
    channel : str
    cob_id : int
    column : int
        Of the axes, whose it is.
    fields : tuple of Field
        What it carries.
    places : tuple of int
        Where each field that is used stands among the axis's setpoints, and behind them the constants.
    width : int
        How many setpoints an axis has.
    constants : tuple of int
        What is the same in every cycle of the motion.
    turn : int or None
        Counts after which the position begins anew, where it is the axis's first setpoint.
    """

    channel: str
    cob_id: int
    column: int
    fields: tuple[Field, ...]
    places: tuple[int, ...]
    width: int
    constants: tuple[int, ...]
    turn: int | None = None
    packing: struct.Struct = attrs.field(init=False)

    @packing.default
    def _packing(self) -> struct.Struct:
        return packing(self.fields)

    def pack(self, setpoints: Sequence[Sequence[int]]) -> bytes:
        """Take its content from all setpoints of all axes in one cycle."""
        known = [*setpoints[self.column], *self.constants]
        if self.turn is not None:
            known[0] = within(known[0], self.turn)
        return self.packing.pack(*[known[place] for place in self.places])

    def keeps_constants(self, data: bytes) -> bool:
        """Tell whether a frame holds what is the same in every cycle."""
        held = zip(self.places, self.packing.unpack(data), strict=True)
        return all(place < self.width or value == self.constants[place - self.width] for place, value in held)


def channels(target: Target) -> tuple[str, ...]:
    """List the channel of each axis's drive, in the axes' order."""
    return tuple(target.can.channels.get(axis.name, CHANNEL) for axis in target.axes)


def buses(target: Target) -> tuple[str, ...]:
    """List the channels, in the order in which SYNC is sent on them."""
    return tuple(dict.fromkeys(channels(target)))


def nodes(target: Target) -> tuple[int, ...]:
    """List the node ids, in the axes' order.

    Raises
    ------
    ExportError
        There are too few.
    """
    if target.can.nodes:
        stated = tuple(target.can.nodes[axis.name] for axis in target.axes)
        if max(stated) > LAST_NODE:
            raise ExportError(f"can.nodes: {MASTER} is the master's own; the last node id is {LAST_NODE}.")
        return stated
    first, axes = target.can.node, len(target.axes)
    if first + axes - 1 > LAST_NODE:
        raise ExportError(
            f"can.node: {axes} axes from node {first} on exceed the last node id {LAST_NODE} "
            f"({MASTER} is the master's)."
        )
    return tuple(range(first, first + axes))


def cob_ids(target: Target) -> tuple[Mapping[int, int], ...]:
    """List the COB-IDs of each axis's PDOs, by those of node 0.

    Raises
    ------
    ExportError
        There are too few node ids, or two PDOs, or one and a sensor's, have the same COB-ID.
    """
    plan, sensor = layout(target.can), target.can.sensor
    used = sorted({*plan.received, *plan.transmitted})
    identifiers, taken = [], {} if sensor is None else {sensor.cob_id: "can.sensor.cob_id"}
    for axis, node in zip(target.axes, nodes(target), strict=True):
        stated = target.can.cob_ids.get(axis.name, CobIdsSpec())
        if plan.shared and stated.command:
            raise ExportError(
                f"can.cob_ids.{axis.name}.command: by can.fixed_pdos the controlword goes with the setpoint; "
                "state that one's COB-ID only."
            )
        identifiers.append({pdo: getattr(stated, plan.role(pdo)) or pdo + node for pdo in used})
        for pdo, cob_id in identifiers[-1].items():
            place = f"can.cob_ids.{axis.name}.{plan.role(pdo)}"
            if taken.setdefault(cob_id, place) != place:
                raise ExportError(f"{place}: {cob_id:03X}h is {taken[cob_id]} already; choose another one.")
    return tuple(identifiers)


def setpoint_frames(target: Target) -> tuple[SetpointFrame, ...]:
    """List the frames of a cycle in the order in which they are sent, SYNC after them.

    Raises
    ------
    ExportError
        There are too few node ids, two PDOs have the same COB-ID, or a fixed mapping lacks what is needed.
    """
    return _frames(target, layout(target.can).setpoints)


def command_frames(target: Target) -> tuple[SetpointFrame, ...]:
    """List the frames with controlwords, one per axis; they may be among the setpoints' frames.

    Raises
    ------
    ExportError
        As `setpoint_frames`.
    """
    return _frames(target, [layout(target.can).command])


def _frames(target: Target, pdos: Iterable[int]) -> tuple[SetpointFrame, ...]:
    kept = {CONTROLWORD: enabling(target.can), **constants(target.can)}
    sent = setpoint_fields(target.can)
    known = [*sent, *kept]
    received = layout(target.can).received
    return tuple(
        SetpointFrame(
            channel=channel,
            cob_id=own[pdo],
            column=column,
            fields=received[pdo],
            places=tuple(known.index(field) for field in received[pdo] if field.used),
            width=len(sent),
            constants=tuple(kept.values()),
            turn=turn_counts(target.axes[column]) if target.can.mode != "csv" else None,
        )
        for column, (channel, own) in enumerate(zip(channels(target), cob_ids(target), strict=True))
        for pdo in pdos
    )


def period_digits(can: CanSpec) -> tuple[int, int]:
    """SYNC period as object 60C2h tells it to a drive: 1 to 255 times a power of ten of seconds.

    In milliseconds where it can be: many drives hold the power at -3, or take no greater one.

    Raises
    ------
    ExportError
        It is not known.
    """
    period = Decimal(repr(can.sync_period)).normalize()
    _, digits, exponent = period.as_tuple()
    value = int("".join(map(str, digits)))
    if value > MOST_DIGITS or not isinstance(exponent, int) or exponent < -6:
        raise ExportError(
            f"can.sync_period: drives cannot be set to an interpolation period of {period:f} s (60C2h holds "
            "1 to 255 times a power of ten, here of at least 1 µs); choose a rounder one, such as 0.004."
        )
    while exponent > USUAL_EXPONENT and value * 10 <= MOST_DIGITS:
        value, exponent = value * 10, exponent - 1
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
    """Bits of one cycle at their most: SYNC and, per axis, setpoints and answers; on the fullest bus."""
    plan = layout(target.can)
    sizes = [packing(fields).size for fields in (*plan.setpoints.values(), *plan.transmitted.values())]
    return frame_bits(0) + _most_axes(target) * sum(map(frame_bits, sizes))


def _most_axes(target: Target) -> int:
    return max(Counter(channels(target)).values())


def require_load(target: Target) -> None:
    """Refuse what overloads the bus.

    Raises
    ------
    ExportError
        With the shortest period that fits.
    """
    axes, can, bits = _most_axes(target), target.can, cycle_bits(target)
    shortest = bits / (MOST_LOAD * can.bitrate)
    if Decimal(repr(can.sync_period)) < shortest:
        raise ExportError(
            f"can.sync_period: {axes} {'axes' if axes > 1 else 'axis'} every {can.sync_period:g} s: their "
            f"frames load a bus of {can.bitrate} bit/s by {bits / can.sync_period / can.bitrate:.0%} "
            f"(limit {MOST_LOAD:.0%}); "
            f"set {two_digits_up(shortest)} s or more, or raise can.bitrate."
        )
