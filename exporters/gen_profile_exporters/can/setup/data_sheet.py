"""A drive's EDS or DCF (CiA 306) in the drive's place: what it would refuse shows before there is a bus.

The drives are set up as on a bus (`gen_profile_exporters.can.setup.configuration`). What they answer is what
the file says: which objects there are, what may be written, within which limits, and what they hold at first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from configparser import Error as ParserError
from io import StringIO
from typing import Any, cast

import attrs
import can
import canopen
from canopen import SdoAbortedError
from canopen.objectdictionary.datatypes import INTEGER_TYPES, SIGNED_TYPES

from gen_profile.spec.can import DataSheet
from gen_profile.support.errors import ExportError, StreamAborted
from gen_profile_exporters.can import frames, startup
from gen_profile_exporters.can.cia402 import CIA_402
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.scaling import Demand, quick_stop_deceleration, start_counts
from gen_profile_exporters.can.setup import configuration
from gen_profile_exporters.can.setup.node import Node
from gen_profile_exporters.can.setup.restoration import HEARTBEAT_WATCHED, MAPPING, Restoration
from gen_profile_exporters.exporter import Target

# SDO abort codes of CiA 301
NO_OBJECT, NO_SUBINDEX, READ_ONLY, NOT_MAPPABLE = 0x0602_0000, 0x0609_0011, 0x0601_0002, 0x0604_0041
WRONG_LENGTH, TOO_GREAT, TOO_SMALL = 0x0607_0010, 0x0609_0031, 0x0609_0032
MODE, SHOWN_MODE, STATUSWORD, ACTUAL_POSITION = 0x6060, 0x6061, 0x6041, 0x6064
SWITCH_ON_DISABLED = 0x0250  # a statusword
MANY = 0xFFFF_FFFF  # modes
MOST_TIME = 0xFFFF  # ms, of 1016h
RAMPS = frozenset({0x6084, 0x6085})  # of a quick stop, which come from the motion where none is stated
ANY_VELOCITY = 1e9  # counts/s: no window of a following error is too wide for it


def require_able(sheet: DataSheet, target: Target) -> None:
    """Require of drives of an EDS or DCF what no motion changes, before there is one.

    Raises
    ------
    ExportError
        The file cannot be read, or no motion could be exported for a drive of its kind.
    """
    start = start_counts(target)
    fast, gentle = (ANY_VELOCITY,) * len(start), (0.0,) * len(start)
    ramp = tuple(quick_stop_deceleration(0.0, target.can, axis) for axis in target.axes)
    any_motion = Demand(
        start=start,
        ends=tuple(zip(start, start, strict=True)),
        velocity=fast,
        acceleration=gentle,
        quick_stop=ramp,
    )
    unknown = RAMPS if target.can.quick_stop is None else frozenset[int]()
    _require_fit(sheet, any_motion, target, unlimited=unknown)


def require_fit(sheet: DataSheet, demand: Demand, target: Target) -> None:
    """Require that drives of an EDS or DCF can be set up for a motion, and are fit to follow it.

    What their files do not say is taken to fit. Whether a drive is homed, and where its axis stands, no file
    tells.

    Raises
    ------
    ExportError
        The file cannot be read, or a drive of its kind would refuse the motion.
    """
    _require_fit(sheet, demand, target)


def _require_fit(
    sheet: DataSheet, demand: Demand, target: Target, unlimited: frozenset[int] = frozenset()
) -> None:
    """Hold drives to a demand, but not to the limits of some objects."""
    known = attrs.evolve(target, can=attrs.evolve(target.can, serial={}, homed=None))
    starts = demand.start or tuple(least for least, _ in demand.ends)
    drives = _drives(sheet, target, starts, unlimited)
    try:
        configuration.configure(
            cast("Link", _Desk(drives)), known, demand, Restoration(), lambda: None, reset_fault=False
        )
    except StreamAborted as error:
        why = " ".join(words for drive in drives.values() for words in drive.refused_in(str(error)))
        raise ExportError(f"{sheet.name}: {error} {why}".rstrip()) from error


def fitted(sheet: DataSheet, lists: startup.Lists, target: Target) -> startup.Lists:
    """Fit start-up lists to drives of an EDS or DCF: without what they lack, and the period as they keep it.

    Raises
    ------
    ExportError
    """
    desk = cast("Link", _Desk(_drives(sheet, target, (0,) * len(target.axes))))
    return {
        number: configuration.fitted(Node(desk, number, column, axis.name), lists[number])[0]
        for column, (number, axis) in enumerate(zip(frames.nodes(target), target.axes, strict=True))
    }


def may_carry(objects: canopen.ObjectDictionary, mapping: int, entry: int) -> bool:
    """Tell whether a PDO may carry an object: one that is there, whole, and to be written by an RPDO."""
    sub, bits = entry >> 8 & 0xFF, entry & 0xFF
    variable = objects.get_variable(entry >> 16, sub)
    if variable is None or variable.subindex != sub or len(variable) != bits:
        return False
    return bool(variable.pdo_mappable and (variable.writable or mapping >= 0x1A00))


def _drives(
    sheet: DataSheet, target: Target, starts: tuple[int, ...], unlimited: frozenset[int] = frozenset()
) -> dict[int, _Sheet]:
    return {
        node: _Sheet(_dictionary(sheet, node), start, unlimited)
        for node, start in zip(frames.nodes(target), starts, strict=True)
    }


def _dictionary(sheet: DataSheet, node: int) -> canopen.ObjectDictionary:
    text = sheet.content.decode("latin-1")
    if "[deviceinfo]" not in text.lower():  # which every such file has
        raise ExportError(f"{sheet.name} is no EDS or DCF: it has no section [DeviceInfo].")
    file = StringIO(text)
    file.name = sheet.name  # by which canopen tells the format
    try:
        objects = canopen.import_od(file, node)
    except (ValueError, KeyError, AttributeError, TypeError, ParserError) as error:
        raise ExportError(f"{sheet.name} is no EDS or DCF that can be read ({error}).") from error
    if 0x1000 not in objects:
        raise ExportError(f"{sheet.name} is no EDS or DCF: it has no object 1000h.")
    return objects


class _Sheet:
    """One drive that answers by its file, which limits no value of `unlimited` objects."""

    def __init__(
        self, objects: canopen.ObjectDictionary, start: int, unlimited: frozenset[int] = frozenset()
    ) -> None:
        self._objects, self._unlimited = objects, unlimited
        self._held: dict[tuple[int, int], bytes] = {}
        self._refused: dict[tuple[int, int], str] = {}
        about = objects.device_information
        usual = {(0x1018, 1): about.vendor_number or 0, (0x1018, 2): about.product_number or 0}
        usual |= {(0x1000, 0): CIA_402, (0x6502, 0): MANY, (0x6065, 0): 1}
        usual |= {(STATUSWORD, 0): SWITCH_ON_DISABLED, (ACTUAL_POSITION, 0): start}
        always = {STATUSWORD, ACTUAL_POSITION}
        for place, value in usual.items():
            entry = objects.get_variable(*place)  # of what the file does not say, what fits
            if entry is not None and (entry.default is None or place[0] in always):
                self._held[place] = _encoded(value, len(entry))

    def upload(self, index: int, sub: int) -> bytes:
        """Read what the file says that an object holds, or what was written to it."""
        index = MODE if index == SHOWN_MODE else index
        entry = self._entry(index, sub)
        value = _value(entry)
        return self._held.get((index, sub), _encoded(value, len(entry)))

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write to an object as far as the file lets it be."""
        entry = self._entry(index, sub)
        value = int.from_bytes(data, "little", signed=entry.data_type in SIGNED_TYPES)
        if index == HEARTBEAT_WATCHED[0] and entry.max == MOST_TIME:
            value &= MOST_TIME  # some files state the limits of its time alone
        limited = index not in self._unlimited
        mapped = sub and index - MAPPING in startup.PDO_PARAMETERS and entry.writable
        refused = {
            READ_ONLY: (not entry.writable, "cannot be written"),
            WRONG_LENGTH: (len(data) * 8 != len(entry), f"has {len(entry)} bits"),
            TOO_GREAT: (
                limited and entry.max is not None and value > entry.max,
                f"takes {entry.max} at most",
            ),
            TOO_SMALL: (
                limited and entry.min is not None and value < entry.min,
                f"takes {entry.min} at least",
            ),
            NOT_MAPPABLE: (
                mapped and not may_carry(self._objects, index, value),
                f"cannot carry {value >> 16:04X}h:{value >> 8 & 0xFF:02X}",
            ),
        }
        for code, (holds, words) in refused.items():
            if holds:
                self._refused[index, sub] = words
                raise SdoAbortedError(code)
        self._held[index, sub] = data

    def refused_in(self, words: str) -> Iterator[str]:
        """Say why the file refused what a sentence is of."""
        for (index, sub), why in self._refused.items():
            if f"{index:04X}h:{sub:02X}" in words:
                yield f"By the file, {index:04X}h:{sub:02X} {why}."
                if "written" in why and index - MAPPING in startup.PDO_PARAMETERS:
                    entries = ", ".join(f"0x{entry:08X}" for entry in self._mapping(index))
                    yield f"Its mapping is fixed: state can.fixed_pdos.{_pdo_name(index)} = [{entries}]."

    def _mapping(self, index: int) -> Iterator[int]:
        for sub in range(1, int.from_bytes(self.upload(index, 0), "little") + 1):
            yield int.from_bytes(self.upload(index, sub), "little")

    def _entry(self, index: int, sub: int) -> Any:
        entry = self._objects.get_variable(index, sub)
        if entry is None or entry.data_type not in INTEGER_TYPES:
            raise SdoAbortedError(NO_SUBINDEX if index in self._objects else NO_OBJECT)
        return entry


class _Desk:
    """What stands for the bus: SDOs only, and a clock that waits for nothing."""

    def __init__(self, drives: Mapping[int, _Sheet]) -> None:
        self.sdo = drives.__getitem__
        self.clock = self
        self.meanwhile = lambda: None
        self._now = 0

    def now(self) -> int:
        """Tell the instant in ns."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Let time pass."""
        self._now = instant

    def send(self, message: can.Message) -> None:
        """Take an NMT command, which no file answers."""


def _pdo_name(mapping: int) -> str:
    return f"{'rpdo' if mapping < 0x1A00 else 'tpdo'}{(mapping & 0x1FF) + 1}"


def _value(entry: Any) -> int:
    """Read a default; 0 where there is none, or no number."""
    stated = entry.value if getattr(entry, "value", None) is not None else entry.default
    return stated if isinstance(stated, int) else 0


def _encoded(value: int, bits: int) -> bytes:
    return (value & (1 << bits) - 1).to_bytes(bits // 8, "little")
