"""Object dictionary of the simulated drive, its EDS, and what may not be written to it."""

import pickle
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import attrs
import canopen
from canopen.objectdictionary import ODVariable
from canopen.objectdictionary.eds import export_eds

from gen_profile.spec.can import FixedPdosSpec
from gen_profile_exporters.can.setup.data_sheet import NO_OBJECT, NOT_MAPPABLE, may_carry
from gen_profile_exporters.can.startup import AT_ONCE, NO_REMOTE_REQUEST, OFF, PDO_PARAMETERS

PDOS = range(4)
MAPPED = 8  # entries of a mapping
VENDOR, PRODUCT, REVISION = 0x0000_02E5, 0x4750_0001, 1
PDO_BITS = 64  # what a frame carries
# further SDO abort codes of CiA 301
PDO_TOO_LONG, OUT_OF_RANGE, WRONG_STATE = 0x0604_0042, 0x0609_0030, 0x0800_0022
TRANSMISSION_TYPES = {*range(241), *AT_ONCE}  # the others are reserved, or wait for remote requests
PERIOD, SYNC_COUNTER = 0x60C2, 0x1019
HEARTBEAT_TIME = 0x1017  # which canopen's node must have, and refuses by SDO where the drive lacks it
RATE_UNITS = {0x60A9, 0x60AA}  # of velocity and acceleration
# what a drive does that lacks the object: it faults when the connection is lost, brakes on a ramp of its own
# and stays in quick stop, interpolates over 4 ms, and watches no following error
OWN = {
    (0x6007, 0): 1,
    (0x605A, 0): 6,
    (0x6065, 0): 0xFFFF_FFFF,
    (0x6085, 0): 500_000,
    (0x60C2, 1): 4,
    (0x60C2, 2): -3,
}
WINDOW = 50_000  # counts; a drive's own following error window


@attrs.frozen(kw_only=True)
class DriveVariant:
    """How one maker's drive differs from another's.

    Attributes
    ----------
    vendor, product, serial : int
        1018h.
    miss : str
        What it does without a new setpoint: ``"extrapolate"`` (and fault after `misses`), ``"hold"`` the last
        one, or ``"stop"`` after `misses`.
    misses : int
        Periods in a row.
    fixed_period : (int, int) or None
        60C2h cannot be changed: digits and power of ten.
    period_exponent : int or None
        The only power of ten that 60C2h takes.
    sync_counter : int
        1019h; where it is not 0, a SYNC must carry a counter.
    mode_delay : float
        Time in s until 6061h shows a mode that 6060h asked for.
    own_mapping : bool
        Its PDOs come with another content and other COB-IDs than CiA 402 proposes.
    fixed_pdos : FixedPdosSpec
        What its PDOs carry, if they cannot be mapped anew.
    following_error : int
        6065h, in counts.
    modes : int
        6502h.
    units : (int, int, int)
        60A8h to 60AAh, of which the last two may have another power of ten, unless `fixed_units`.
    fixed_units : bool
    encoder : (int, int)
        608Fh, increments to revolutions of the motor.
    counts_per_si : float
        Of its axis, for units of 60A9h and 60AAh that measure that in m, rad or degrees.
    lacks : tuple of int
        Objects that it does not have; what it does instead is `OWN`.
    limits : mapping of (int, int) to (int, int)
        Least and greatest value that it takes, by index and subindex.
    remote_requests : bool
        Whether its TPDOs can be asked for by remote frames; where not, it takes no COB-ID that allows them.
    """

    vendor: int = VENDOR
    product: int = PRODUCT
    serial: int = 1
    miss: str = "extrapolate"
    misses: int = 3
    fixed_period: tuple[int, int] | None = None
    period_exponent: int | None = None
    sync_counter: int = 0
    mode_delay: float = 0.0
    own_mapping: bool = False
    fixed_pdos: FixedPdosSpec = attrs.field(factory=FixedPdosSpec)
    following_error: int = WINDOW
    modes: int = 1 << 8 | 1 << 7 | 1 << 6  # csv, csp and ip
    units: tuple[int, int, int] = (0x00B5_0000, 0x00B5_0300, 0x00B5_5700)  # increments, and of s and s²
    fixed_units: bool = False
    encoder: tuple[int, int] = (1, 1)
    counts_per_si: float = 1.0
    lacks: tuple[int, ...] = ()
    limits: Mapping[tuple[int, int], tuple[int, int]] = attrs.field(factory=dict)
    remote_requests: bool = True


def dictionary(node: int, make: DriveVariant) -> canopen.ObjectDictionary:
    """Build the object dictionary of one node: that of ``drive.eds``, where the maker's is no other."""
    objects: canopen.ObjectDictionary = pickle.loads(_usual())
    objects.node_id, about = node, objects.device_information
    about.allowed_baudrates = {*sorted(about.allowed_baudrates)}  # an EDS has their order
    about.vendor_number, about.product_number = make.vendor, make.product
    about.granularity = 8  # PDOs are mapped by whole bytes; canopen reads it as a truth value
    own = _own_values(node, make)
    for variable in _variables_of(objects):
        variable.default = own.get((variable.index, variable.subindex), variable.default)
        variable.default_raw = None  # what an EDS says of it is written anew
        if variable.index == PERIOD and variable.subindex and make.fixed_period is not None:
            variable.access_type = "ro"
        if variable.index in RATE_UNITS and make.fixed_units:
            variable.access_type = "ro"
        if variable.index - 0x200 in PDO_PARAMETERS and make.fixed_pdos.stated:
            variable.access_type = "const"
        variable.min, variable.max = make.limits.get((variable.index, variable.subindex), (None, None))
    for index in {*make.lacks} - {HEARTBEAT_TIME}:
        del objects[index]
    return objects


@cache
def _usual() -> bytes:
    """Read what the drives have in common: a copy of it takes a fortieth of the time."""
    return pickle.dumps(canopen.import_od(str(Path(__file__).with_name("drive.eds")), 1))


def _own_values(node: int, make: DriveVariant) -> dict[tuple[int, int], int]:
    """Give what depends on the maker, by index and subindex."""
    values = {(0x1018, 1): make.vendor, (0x1018, 2): make.product, (0x1018, 4): make.serial}
    values |= {(0x60A8 + place, 0): unit for place, unit in enumerate(make.units)}
    values |= {(0x608F, sub): number for sub, number in enumerate(make.encoder, start=1)}
    values |= {(0x6065, 0): make.following_error, (0x6502, 0): make.modes}
    values[SYNC_COUNTER, 0] = make.sync_counter
    if make.period_exponent is not None:
        values[PERIOD, 2] = make.period_exponent
    if make.fixed_period is not None:
        values |= dict(zip(((PERIOD, 1), (PERIOD, 2)), make.fixed_period, strict=True))
    asked_for = 0 if make.remote_requests else NO_REMOTE_REQUEST
    for pdo in PDOS:
        received, sent = _default_mapping(make, pdo)
        for index, cob_id, mapping in ((0x1400, 0x200, received), (0x1800, 0x180 | asked_for, sent)):
            values[index + pdo, 1] = cob_id + 0x100 * pdo + node | (0 if mapping else OFF)
            entries = (len(mapping), *mapping, *(0,) * (MAPPED - len(mapping)))
            values |= {(index + 0x200 + pdo, sub): entry for sub, entry in enumerate(entries)}
    return values


def eds(node: int, make: DriveVariant, file_name: str = "drive.eds") -> str:
    """Render the electronic data sheet (CiA 306), the same at any time."""
    about = {
        "FileName": file_name,
        "FileVersion": 1,
        "FileRevision": REVISION,
        "EdsVersion": "4.0",
        "Description": "Simulated CiA 402 drive",
        "CreatedBy": "gen-profile",
        "ModifiedBy": "gen-profile",
    }
    for change in ("Creation", "Modification"):
        about |= {f"{change}Date": "01-01-2026", f"{change}Time": "12:00AM"}
    objects = dictionary(node, make)
    if HEARTBEAT_TIME in make.lacks:
        del objects[HEARTBEAT_TIME]
    for variable in _variables_of(objects):
        value = variable.default
        if variable.index in PDO_PARAMETERS and variable.subindex == 1:
            variable.default_raw = f"$NODEID+0x{value - node:X}"
        elif value < 0:  # decimal: two's complement in hexadecimal is read as a positive number by some
            variable.default_raw = str(value)
    text = StringIO()
    export_eds(objects, text, about)
    return text.getvalue()


def refusal(
    make: DriveVariant,
    objects: canopen.ObjectDictionary,
    held: Callable[[int, int], int],
    place: tuple[int, int],
    value: int,
) -> int | None:
    """Tell by which SDO abort code a drive refuses to be set so, or None.

    Parameters
    ----------
    make : DriveVariant
    objects : canopen.ObjectDictionary
    held : callable
        What an object (index, subindex) holds.
    place : (int, int)
        Index and subindex of an object that is there.
    value : int
        What is written to it, unsigned.
    """
    index, sub = place
    if index in make.lacks:
        return NO_OBJECT
    least, greatest = make.limits.get(place, (value, value))
    if not least <= value <= greatest:
        return OUT_OF_RANGE
    if index == 0x6060:
        return None if value == 0 or supports(held(0x6502, 0), value) else OUT_OF_RANGE
    if index == SYNC_COUNTER:
        return WRONG_STATE if held(0x1006, 0) else None
    if place == (PERIOD, 2) and make.period_exponent is not None:
        return None if value == make.period_exponent & 0xFF else OUT_OF_RANGE
    if index in RATE_UNITS:
        return None if (value ^ held(index, 0)) & 0xFF_FFFF == 0 else OUT_OF_RANGE
    asked_for = sub == 1 and not value & NO_REMOTE_REQUEST
    if asked_for and index in PDO_PARAMETERS and index >= 0x1800 and not make.remote_requests:
        return OUT_OF_RANGE
    if index in PDO_PARAMETERS:
        return _refusal_of_parameter(index, held(index, 1), sub, value)
    if index - 0x200 in PDO_PARAMETERS:
        if not held(index - 0x200, 1) & OFF or (sub and held(index, 0)):
            return WRONG_STATE
        entries = [value] if sub else [held(index, n) for n in range(1, min(value, MAPPED) + 1)]
        if (not sub and value > MAPPED) or sum(entry & 0xFF for entry in entries) > PDO_BITS:
            return PDO_TOO_LONG
        if not all(may_carry(objects, index, entry) for entry in entries):
            return NOT_MAPPABLE
    return None


def supports(modes: int, mode: int) -> bool:
    """Tell whether 6502h lists a mode of 6060h."""
    return 1 <= mode <= 32 and bool(modes >> (mode - 1) & 1)


def _refusal_of_parameter(index: int, cob_id: int, sub: int, value: int) -> int | None:
    exists = not cob_id & OFF
    renamed = sub == 1 and not value & OFF and (cob_id ^ value) & 0x1FFF_FFFF
    if exists and (renamed or sub == 3):  # inhibit time
        return WRONG_STATE
    acyclic = index >= 0x1800 and value == 0  # a TPDO on SYNC after a change, which this drive does not do
    return OUT_OF_RANGE if sub == 2 and (acyclic or value not in TRANSMISSION_TYPES) else None


def _variables_of(objects: canopen.ObjectDictionary) -> Iterator[Any]:
    for entry in objects.values():
        yield from [entry] if isinstance(entry, ODVariable) else entry.values()


def _default_mapping(make: DriveVariant, pdo: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Entries of an RPDO and a TPDO as they come: CiA 402's proposal, or the maker's own."""
    if make.fixed_pdos.stated:
        return make.fixed_pdos.received[pdo], make.fixed_pdos.sent[pdo]
    proposed = {
        0: ((0x6040_0010,), (0x6041_0010,)),
        1: ((0x6040_0010, 0x6060_0008), (0x6041_0010, 0x6061_0008)),
    }
    own = {0: ((0x607A_0020, 0x6040_0010), (0x6064_0020,)), 3: ((0x60B1_0020,), (0x6041_0010, 0x6064_0020))}
    return (own if make.own_mapping else proposed).get(pdo, ((), ()))
