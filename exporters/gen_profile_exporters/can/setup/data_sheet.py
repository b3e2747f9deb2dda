"""A drive's EDS or DCF (CiA 306) in the drive's place: what it would refuse shows before there is a bus.

The drives are set up as on a bus (`gen_profile_exporters.can.setup.configuration`). What they answer is what
the file says: which objects there are, what may be written, within which limits, and what they hold at first.
"""

from __future__ import annotations

from collections.abc import Mapping
from configparser import Error as ParserError
from io import StringIO
from pathlib import Path
from typing import Any, cast

import attrs
import can
import canopen
from canopen import SdoAbortedError
from canopen.objectdictionary.datatypes import INTEGER_TYPES, SIGNED_TYPES

from gen_profile.support.bounded_file import DOCUMENT, read_bounded
from gen_profile.support.errors import ExportError, StreamAborted
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.scaling import Demand
from gen_profile_exporters.can.setup import configuration
from gen_profile_exporters.can.setup.restoration import Restoration
from gen_profile_exporters.exporter import Target

# SDO abort codes of CiA 301
NO_OBJECT, NO_SUBINDEX, READ_ONLY = 0x0602_0000, 0x0609_0011, 0x0601_0002
WRONG_LENGTH, TOO_GREAT, TOO_SMALL = 0x0607_0010, 0x0609_0031, 0x0609_0032
MODE, SHOWN_MODE, STATUSWORD, ACTUAL_POSITION = 0x6060, 0x6061, 0x6041, 0x6064
SWITCH_ON_DISABLED = 0x0250  # a statusword
MANY = 0xFFFF_FFFF  # modes


def require_fit(path: Path, demand: Demand, target: Target) -> None:
    """Require that drives of an EDS or DCF can be set up for a motion, and are fit to follow it.

    What their files do not say is taken to fit. Whether a drive is homed, and where its axis stands, no file
    tells.

    Raises
    ------
    ExportError
        The file cannot be read, or a drive of its kind would refuse the motion.
    """
    known = attrs.evolve(target, can=attrs.evolve(target.can, serial={}, homed=None))
    starts = demand.start or tuple(least for least, _ in demand.ends)
    drives = {
        node: _Sheet(_dictionary(path, node), start)
        for node, start in zip(frames.nodes(target), starts, strict=True)
    }
    try:
        configuration.configure(
            cast("Link", _Desk(drives)), known, demand, Restoration(), lambda: None, reset_fault=False
        )
    except StreamAborted as error:
        raise ExportError(f"{path.name}: {error}") from error


def _dictionary(path: Path, node: int) -> canopen.ObjectDictionary:
    try:
        text = read_bounded(path, DOCUMENT).decode("latin-1")
        if "[deviceinfo]" not in text.lower():  # which every such file has
            raise ExportError(f"{path.name} is no EDS or DCF: it has no section [DeviceInfo].")
        file = StringIO(text)
        file.name = str(path)  # by which canopen tells the format
        objects = canopen.import_od(file, node)
    except OSError as error:
        raise ExportError(f"{path} cannot be read ({error.strerror}).") from error
    except (ValueError, KeyError, AttributeError, TypeError, ParserError) as error:
        raise ExportError(f"{path.name} is no EDS or DCF that can be read ({error}).") from error
    if 0x1000 not in objects:
        raise ExportError(f"{path.name} is no EDS or DCF: it has no object 1000h.")
    return objects


class _Sheet:
    """One drive that answers by its file."""

    def __init__(self, objects: canopen.ObjectDictionary, start: int) -> None:
        self._objects = objects
        self._held: dict[tuple[int, int], bytes] = {}
        about = objects.device_information
        usual = {(0x1018, 1): about.vendor_number or 0, (0x1018, 2): about.product_number or 0}
        usual |= {(0x6502, 0): MANY, (0x6065, 0): 1}
        usual |= {(STATUSWORD, 0): SWITCH_ON_DISABLED, (ACTUAL_POSITION, 0): start}
        always = {STATUSWORD, ACTUAL_POSITION}
        for place, value in usual.items():
            entry = objects.get_variable(*place)  # of what the file does not say, what fits
            if entry is not None and (entry.default is None or place[0] in always):
                self._held[place] = _encoded(value, len(entry))

    def upload(self, index: int, sub: int) -> bytes:
        """Read what the file says that an object holds, or what was written to it."""
        entry = self._entry(index, sub)
        value = _value(entry)
        return self._held.get((index, sub), _encoded(value, len(entry)))

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write to an object as far as the file lets it be."""
        entry = self._entry(index, sub)
        value = int.from_bytes(data, "little", signed=entry.data_type in SIGNED_TYPES)
        refused = {
            READ_ONLY: not entry.writable,
            WRONG_LENGTH: len(data) * 8 != len(entry),
            TOO_GREAT: entry.max is not None and value > entry.max,
            TOO_SMALL: entry.min is not None and value < entry.min,
        }
        for code, holds in refused.items():
            if holds:
                raise SdoAbortedError(code)
        self._held[index, sub] = data
        if index == MODE:
            self._held[SHOWN_MODE, 0] = data

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


def _value(entry: Any) -> int:
    """Read a default; 0 where there is none, or no number."""
    stated = entry.value if getattr(entry, "value", None) is not None else entry.default
    return stated if isinstance(stated, int) else 0


def _encoded(value: int, bits: int) -> bytes:
    return (value & (1 << bits) - 1).to_bytes(bits // 8, "little")
