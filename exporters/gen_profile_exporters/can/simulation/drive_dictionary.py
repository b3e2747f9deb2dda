"""Object dictionary of the simulated drive, its EDS, and what may not be written to it."""

from collections.abc import Callable, Iterator
from io import StringIO
from typing import Any

import attrs
import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes
from canopen.objectdictionary.eds import export_eds

from gen_profile.spec.can import FixedPdosSpec
from gen_profile_exporters.can.startup import AT_ONCE, NO_REMOTE_REQUEST, OFF, PDO_PARAMETERS

U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
PDOS = range(4)
MAPPED = 8  # entries of a mapping
VENDOR, PRODUCT, REVISION = 0x0000_02E5, 0x4750_0001, 1
BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)  # kbit/s; it takes every one that CiA 306 names
# what a PDO may carry: the drive's commands, setpoints, and what it tells of itself
MAPPABLE = {0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x607A, 0x60B1, 0x60B2, 0x60C1, 0x60FF}
PDO_BITS = 64  # what a frame carries
# SDO abort codes of CiA 301
NOT_MAPPABLE, PDO_TOO_LONG = 0x0604_0041, 0x0604_0042
OUT_OF_RANGE, WRONG_STATE = 0x0609_0030, 0x0800_0022
TRANSMISSION_TYPES = {*range(241), *AT_ONCE}  # the others are reserved, or wait for remote requests
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
    own_mapping : bool
        Its PDOs come with another content and other COB-IDs than CiA 402 proposes.
    fixed_pdos : FixedPdosSpec
        What its PDOs carry, if they cannot be mapped anew.
    following_error : int
        6065h, in counts.
    modes : int
        6502h.
    remote_requests : bool
        Whether its TPDOs can be asked for by remote frames; where not, it takes no COB-ID that allows them.
    """

    vendor: int = VENDOR
    product: int = PRODUCT
    serial: int = 1
    miss: str = "extrapolate"
    misses: int = 3
    fixed_period: tuple[int, int] | None = None
    own_mapping: bool = False
    fixed_pdos: FixedPdosSpec = attrs.field(factory=FixedPdosSpec)
    following_error: int = WINDOW
    modes: int = 1 << 8 | 1 << 7 | 1 << 6  # csv, csp and ip
    remote_requests: bool = True


def dictionary(node: int, make: DriveVariant) -> canopen.ObjectDictionary:
    """Build the object dictionary of one node."""
    objects = canopen.ObjectDictionary()
    objects.node_id = node
    _identify(objects.device_information, make)
    for index, name, of, access, value in _variables(make):
        objects.add_object(_variable(index, 0, name, of, access=access, value=value))
    for index, name, kind, access, values in _records(node, make):
        record = ODRecord(name, index) if index != 0x1016 else ODArray(name, index)
        record.add_member(_count(index, values, "const" if access == "const" else "rw"))
        for sub, value in enumerate(values, start=1):
            if isinstance(kind, dict) and sub not in kind:
                continue
            of = kind[sub] if isinstance(kind, dict) else kind
            record.add_member(_variable(index, sub, f"{name} {sub}", of, access=access, value=value))
        objects.add_object(record)
    return objects


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
    if index == 0x6060:
        return None if value == 0 or supports(held(0x6502, 0), value) else OUT_OF_RANGE
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
        if not all(_may_carry(objects, index, entry) for entry in entries):
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


def _may_carry(objects: canopen.ObjectDictionary, mapping: int, entry: int) -> bool:
    """Tell whether a PDO may carry an object: one that is there, whole, and to be written by an RPDO."""
    sub, bits = entry >> 8 & 0xFF, entry & 0xFF
    variable = objects.get_variable(entry >> 16, sub)
    if variable is None or variable.subindex != sub or len(variable) != bits:
        return False
    return bool(variable.pdo_mappable and (variable.writable or mapping >= 0x1A00))


def _variables_of(objects: canopen.ObjectDictionary) -> Iterator[Any]:
    for entry in objects.values():
        yield from [entry] if isinstance(entry, ODVariable) else entry.values()


def _identify(information: Any, make: DriveVariant) -> None:
    information.vendor_name, information.vendor_number = "gen-profile", make.vendor
    information.product_name, information.product_number = "simulated CiA 402 drive", make.product
    information.revision_number, information.order_code = REVISION, "drive-sim"
    information.allowed_baudrates = {1000 * rate for rate in BIT_RATES}
    information.nr_of_RXPDO = information.nr_of_TXPDO = len(PDOS)
    information.granularity, information.simple_boot_up_slave = 8, True  # PDOs are mapped by whole bytes
    information.simple_boot_up_master = information.group_messaging = information.LSS_supported = False
    information.dynamic_channels_supported = False


def _variables(make: DriveVariant) -> Iterator[tuple[int, str, int, str, int]]:
    yield 0x1000, "Device type", U32, "ro", 0x0002_0192
    yield 0x1001, "Error register", U8, "ro", 0
    yield 0x1006, "Communication cycle period", U32, "rw", 0
    yield 0x1017, "Producer heartbeat time", U16, "rw", 0
    yield 0x6007, "Abort connection option code", I16, "rw", 1
    yield 0x6040, "Controlword", U16, "rw", 0
    yield 0x6041, "Statusword", U16, "ro", 0
    yield 0x605A, "Quick stop option code", I16, "rw", 2
    yield 0x6060, "Modes of operation", I8, "rw", 0
    yield 0x6061, "Modes of operation display", I8, "ro", 0
    yield 0x6064, "Position actual value", I32, "ro", 0
    yield 0x6065, "Following error window", U32, "rw", make.following_error
    yield 0x6066, "Following error time out", U16, "rw", 10
    yield 0x607A, "Target position", I32, "rw", 0
    yield 0x6085, "Quick stop deceleration", U32, "rw", 1_000_000
    yield 0x60B1, "Velocity offset", I32, "rw", 0
    yield 0x60B2, "Torque offset", I16, "rw", 0
    yield 0x60FF, "Target velocity", I32, "rw", 0
    yield 0x6502, "Supported drive modes", U32, "ro", make.modes


def _records(
    node: int, make: DriveVariant
) -> Iterator[tuple[int, str, int | dict[int, int], str, tuple[int, ...]]]:
    yield 0x1016, "Consumer heartbeat time", U32, "rw", (0,)
    yield 0x1018, "Identity object", U32, "ro", (make.vendor, make.product, REVISION, make.serial)
    yield 0x607D, "Software position limit", I32, "rw", (0, 0)
    for index, name in (
        (0x608F, "Position encoder resolution"),
        (0x6091, "Gear ratio"),
        (0x6092, "Feed constant"),
    ):
        yield index, name, U32, "rw", (1, 1)
    yield 0x60C1, "Interpolation data record", I32, "rw", (0,)
    access = "rw" if make.fixed_period is None else "ro"
    period = (1, -3) if make.fixed_period is None else make.fixed_period
    yield 0x60C2, "Interpolation time period", {1: U8, 2: I8}, access, period
    for pdo in PDOS:
        received, sent = _default_mapping(make, pdo)
        for base, cob_id, mapping, word in ((0x1400, 0x200, received, "RPDO"), (0x1800, 0x180, sent, "TPDO")):
            used = cob_id + 0x100 * pdo + node | (0 if mapping else OFF)
            if word == "TPDO" and not make.remote_requests:
                used |= NO_REMOTE_REQUEST
            kinds = {1: U32, 2: U8, 3: U16, 5: U16}
            yield base + pdo, f"{word} {pdo + 1} parameter", kinds, "rw", (used, 255, 0, 0, 0)
            entries = (*mapping, *(0,) * (MAPPED - len(mapping)))
            access = "const" if make.fixed_pdos.stated else "rw"
            yield base + 0x200 + pdo, f"{word} {pdo + 1} mapping", U32, access, entries


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


def _count(index: int, values: tuple[int, ...], access: str) -> ODVariable:
    """Make subindex 0; in a mapping it counts the objects that are in use."""
    if index & 0x0200 and index < 0x1C00:
        used = len(values) - values.count(0)
        return _variable(index, 0, "Number of mapped objects", U8, access=access, value=used)
    return _variable(index, 0, "Highest sub-index supported", U8, access="const", value=len(values))


def _variable(index: int, sub: int, name: str, kind: int, *, access: str, value: int) -> ODVariable:
    variable = ODVariable(name, index, sub)
    variable.data_type, variable.access_type, variable.default = kind, access, value
    variable.pdo_mappable = index in MAPPABLE and (index != 0x60C1 or sub == 1)
    return variable
