"""What the drives must be set to before they follow: the SDO start-up list, as a table and as concise DCF.

The list makes a drive stop by itself when setpoints cease: it watches the master's heartbeat (1016h)
and the setpoints' arrival (1401h:05 if they come by RPDO2), and answers both with a quick stop (6007h, 605Ah,
6085h).

Objects: CiA 301 (1000h to 1FFFh), CiA 402-2 (6000h and up), CiA 302-3 (concise DCF).
"""

import csv
import struct
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from math import ceil

import attrs

from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.cia402 import MODES
from gen_profile_exporters.can.drive_units import (
    ACCELERATION_UNIT,
    KEYS,
    VELOCITY_UNIT,
    per_count,
    stated_unit,
    unit_code,
)
from gen_profile_exporters.can.following_window import windows
from gen_profile_exporters.can.pdos import Field
from gen_profile_exporters.can.scaling import Demand, travel_counts
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.modulo import least, turn_counts

QUICK_STOP_ON_LOST_CONNECTION = 3  # 6007h
RAMP_THEN_DISABLE, SLOW_DOWN_THEN_DISABLE = 2, 1  # 605Ah: on 6085h, and on 6084h
OFF = 1 << 31  # of a PDO's COB-ID
NO_REMOTE_REQUEST = 1 << 30
PDO_PARAMETERS = {*range(0x1400, 0x1600), *range(0x1800, 0x1A00)}
ON_SYNC, ON_EVENT = 1, 255  # transmission types
AT_ONCE = {254, ON_EVENT}  # event-driven, as the maker or the device profile defines it: alike for an RPDO
PARAMETERS = {
    pdo: first + number
    for first, group in ((0x1400, pdos.RPDOS), (0x1800, pdos.TPDOS))
    for number, pdo in enumerate(group)
}  # of each PDO, by the COB-ID of node 0
SHORTEST_TIMEOUT = 0.02  # s, unless the spec asks for less
CYCLES_PER_TIMEOUT = 3
SLOWEST_HEARTBEAT = 100  # ms; a drive's own

NAMES = {
    "command": "controlword",
    "setpoint": "setpoint",
    "feed_forward": "feed-forward",
    "feedback": "feedback",
    "position": "actual position",
}

# what stands in for an object that a drive lacks, where can.without has it
SUBSTITUTES = {
    0x1016: "if this machine fails, missing setpoints alone stop the axis, as the drive's manual says",
    0x1017: "its answers to SYNC alone tell that it is alive",
    0x6007: "it reacts to a lost connection as its maker chose",
    0x605A: "it must brake at a quick stop by itself, and is switched off once it stands",
    0x6065: "this machine alone watches the following error, over the bus",
    0x607B: "it must begin anew by itself after axis.modulo, and take the shorter way there",
    0x6085: "it brakes on 6084h at a quick stop (605Ah = 1), or, without 605Ah, on a ramp of its own",
    0x60C2: "it must interpolate over can.sync_period by itself",
}

Lists = Mapping[int, "tuple[Entry, ...]"]


@attrs.frozen
class Entry:
    """One object to be set.

    Attributes
    ----------
    index, sub : int
    bits : int
        8, 16 or 32.
    value : int
        Negative ones in two's complement; one that its bits do not hold is refused by an `ExportError`.
    meaning : str
    optional : bool
        A drive without this object will do.
    fixed : bool
        The drive must hold it already.
    """

    index: int
    sub: int
    bits: int
    value: int = attrs.field()
    meaning: str
    optional: bool = False
    fixed: bool = False

    @value.validator
    def _fits(self, _: object, value: int) -> None:
        if not -(1 << self.bits - 1) <= value < 1 << self.bits:
            raise ExportError(
                f"{self.index:04X}h:{self.sub:02X}, {self.meaning}: {value} does not fit {self.bits} bits; "
                "state less in the spec, or lower axis.counts_per_metre."
            )

    @property
    def is_code(self) -> bool:
        """Whether its bits mean something each, so that people read it in hexadecimal."""
        return self.bits == 32 and (self.index < 0x6000 or self.index in KEYS)

    @property
    def data(self) -> bytes:
        """The value as SDOs carry it."""
        return (self.value & (1 << self.bits) - 1).to_bytes(self.bits // 8, "little")


def timeout_ms(can: CanSpec) -> int:
    """How long a drive waits for the next setpoint, in ms.

    Raises
    ------
    ExportError
        It is shorter than two cycles.
    """
    if can.timeout is None:
        return ceil(1e3 * max(SHORTEST_TIMEOUT, CYCLES_PER_TIMEOUT * can.sync_period))
    if can.timeout < 2.0 * can.sync_period:
        raise ExportError(
            f"can.timeout: {can.timeout:g} s are less than two cycles of {can.sync_period:g} s, so that a "
            f"drive would stop for one late frame; set {2.0 * can.sync_period:g} s or more."
        )
    return ceil(round(1e3 * can.timeout, 9))


def heartbeat_ms(can: CanSpec) -> int:
    """Period of the drives' own heartbeats in ms."""
    return min(SLOWEST_HEARTBEAT, timeout_ms(can))


def startup_lists(demand: Demand, target: Target) -> dict[int, tuple[Entry, ...]]:
    """List by node what its drive must be set to, in the order in which it must be set."""
    drives = zip(frames.nodes(target), frames.cob_ids(target), strict=True)
    lacking = {int(name[:4], 16) for name in target.can.without}
    return {
        node: tuple(
            attrs.evolve(entry, optional=entry.optional or entry.index in lacking)
            for entry in _entries(node, column, own, demand, target)
        )
        for column, (node, own) in enumerate(drives)
    }


def table(lists: Lists) -> bytes:
    """Render lists as a table for people and scripts (RFC 4180)."""
    text = StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["node", "object", "subindex", "bits", "value", "meaning"])
    for node, entries in lists.items():
        for entry in entries:
            place = (f"{entry.index:04X}h", f"{entry.sub:02X}h")
            rows.writerow([node, *place, entry.bits, _number(entry), entry.meaning])
    return text.getvalue().encode("utf-8")


def concise_dcf(entries: Sequence[Entry]) -> bytes:
    """Render one node's list as the content of object 1F22h, for CANopen managers."""
    entries = [entry for entry in entries if not entry.fixed]
    parts = [struct.pack("<I", len(entries))]
    parts += [struct.pack("<HBI", entry.index, entry.sub, len(entry.data)) + entry.data for entry in entries]
    return b"".join(parts)


def _number(entry: Entry) -> str:
    return f"0x{entry.value:08X}" if entry.is_code else str(entry.value)


def _entries(
    node: int, column: int, own: Mapping[int, int], demand: Demand, target: Target
) -> Iterator[Entry]:
    can, axis = target.can, target.axes[column]
    yield from _monitoring(can)
    yield from _mapping(node, own, can)
    digits, exponent = frames.period_digits(can)
    yield Entry(0x60C2, 1, 8, digits, "interpolation period: digits")
    yield Entry(0x60C2, 2, 8, exponent, "interpolation period: power of ten (s)")
    yield Entry(0x6060, 0, 8, MODES[can.mode], f"mode of operation: {can.mode}")
    yield Entry(0x6007, 0, 16, QUICK_STOP_ON_LOST_CONNECTION, "connection lost: quick stop")
    ramp_of, action = (
        (0x6084, SLOW_DOWN_THEN_DISABLE) if "6085h" in can.without else (0x6085, RAMP_THEN_DISABLE)
    )
    yield Entry(0x605A, 0, 16, action, "quick stop: brake on its ramp and disable")
    yield from _units(can)
    per = per_count(ACCELERATION_UNIT, can, axis)
    ramp, unit = ceil(demand.quick_stop[column] * per), stated_unit(ACCELERATION_UNIT, can).words
    unknown = {"605Ah", "6085h"}.issubset(can.without)  # on which ramp, if on any, it brakes
    yield Entry(ramp_of, 0, 32, ramp, f"deceleration of a quick stop ({unit})", optional=unknown)
    if can.following_error is not None:
        window = windows(demand, target)[column]
        watches = can.mode != "csv"  # there, the streamer does
        yield Entry(0x6065, 0, 32, window, "following error window (counts)", optional=not watches)
    travel = travel_counts(axis, can)
    if travel is not None:
        yield Entry(0x607D, 1, 32, travel[0], "lower end of the travel (counts)")
        yield Entry(0x607D, 2, 32, travel[1], "upper end of the travel (counts)")
    turn = turn_counts(axis)
    if turn is not None:
        low = int(least(turn))
        yield Entry(0x607B, 1, 32, low, "least position within a turn (counts)")
        yield Entry(0x607B, 2, 32, low + turn - 1, "greatest position within a turn (counts)")
    for index, pair, meaning in (
        (0x608F, can.encoder, "encoder: increments per motor revolutions"),
        (0x6091, can.gear, "gear: motor revolutions per shaft revolutions"),
        (0x6092, can.feed, "feed: counts per shaft revolutions"),
    ):
        for sub, value in enumerate(pair or (), start=1):
            yield Entry(index, sub, 32, value, meaning)


def _units(can: CanSpec) -> Iterator[Entry]:
    """Set the units that the spec states, which a drive may know otherwise, or not at all."""
    for index, stated in ((VELOCITY_UNIT, can.velocity_unit), (ACCELERATION_UNIT, can.acceleration_unit)):
        if stated is not None:
            unit, what = stated_unit(index, can), KEYS[index].removeprefix("can.").replace("_", " ")
            yield Entry(index, 0, 32, unit_code(index, unit), f"{what}: {unit.words}", optional=True)


def _monitoring(can: CanSpec) -> Iterator[Entry]:
    yield Entry(0x1017, 0, 16, heartbeat_ms(can), "heartbeat of the drive (ms)")
    yield Entry(
        0x1016, 1, 32, frames.MASTER << 16 | timeout_ms(can), "watch the controller's heartbeat (node, ms)"
    )
    # CiA 301: a counter changes only while no period is set; no SYNC of ours has one
    yield Entry(0x1006, 0, 32, 0, "period of SYNC: none while its counter changes", optional=True)
    yield Entry(0x1019, 0, 8, 0, "SYNC without a counter", optional=True)
    microseconds = frames.period_microseconds(can)
    yield Entry(0x1006, 0, 32, microseconds, "period of SYNC (µs)", optional=True)


def _mapping(node: int, own: Mapping[int, int], can: CanSpec) -> Iterator[Entry]:
    layout = pdos.layout(can)
    for pdo, fields in layout.received.items():
        every_cycle = pdo in layout.setpoints
        kind, name = (ON_SYNC if every_cycle else ON_EVENT), NAMES[layout.role(pdo)]
        yield from _pdo(PARAMETERS[pdo], own[pdo], kind, fields, name, fixed=layout.fixed)
        if pdo == layout.leading:
            yield Entry(
                PARAMETERS[pdo], 5, 16, timeout_ms(can), "longest wait for a setpoint (ms)", optional=True
            )
    for pdo, fields in layout.transmitted.items():
        answer, name = NO_REMOTE_REQUEST | own[pdo], NAMES[layout.role(pdo)]
        yield from _pdo(PARAMETERS[pdo], answer, ON_SYNC, fields, name, fixed=layout.fixed)
    for pdo, index in PARAMETERS.items():
        if pdo not in own:
            remote = NO_REMOTE_REQUEST if pdo in pdos.TPDOS else 0
            yield Entry(index, 1, 32, OFF | remote | pdo + node, "not used: off", optional=True)


def _pdo(
    index: int, cob_id: int, kind: int, fields: Sequence[Field], name: str, *, fixed: bool
) -> Iterator[Entry]:
    """Set up a PDO in the order that CiA 301 asks for: off, mapping (unless it is fixed), on."""
    mapping, as_stated = index + 0x200, ", as can.fixed_pdos has them" if fixed else ""
    count = Entry(mapping, 0, 8, len(fields), f"{name}: entries{as_stated}", fixed=fixed)
    yield Entry(index, 1, 32, OFF | cob_id, f"{name}: off while it changes")
    yield count if fixed else Entry(mapping, 0, 8, 0, f"{name}: mapping cleared")
    for number, field in enumerate(fields, start=1):
        words = f"{name}: {field.name or 'not used'}"
        yield Entry(mapping, number, 32, field.mapping, words, fixed=fixed)
    if not fixed:
        yield count
    yield Entry(index, 2, 8, kind, f"{name}: {'on SYNC' if kind == ON_SYNC else 'at once'}")
    yield Entry(index, 1, 32, cob_id, f"{name}: on")
