"""What each PDO carries: as we map it, or as the drive's own mapping says where that cannot be changed.

======= ============ ================================================ =========================
PDO     of           content as we map it                             sent
======= ============ ================================================ =========================
RPDO1   command      controlword 6040h                                when it changes
RPDO2   setpoint     607Ah, and 60B1h or 60B2h; 60C1h:01; or 60FFh    every cycle, before SYNC
RPDO3   feed-forward 60B2h beside 60B1h: 80 bits are more than one    every cycle, before SYNC
                     frame holds; not used otherwise
TPDO1   feedback     statusword 6041h, actual position 6064h          on SYNC
======= ============ ================================================ =========================

Where a drive's own mapping tells the position in a TPDO of its own, that one is called ``position``.

The controlword has a PDO of its own, so that setpoints which still wait in a queue cannot undo a quick stop.
In a drive whose mapping is fixed (``can.fixed_pdos``) it may share one with the setpoint. Then both go in one
frame, every cycle, and a quick stop goes the same way after them.
"""

import struct
from collections.abc import Mapping, Sequence

import attrs

from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.cia402 import IP_ENABLE, MODES, Controlword

RPDO1, RPDO2, RPDO3, RPDO4 = RPDOS = (0x200, 0x300, 0x400, 0x500)  # by the COB-ID of node 0
TPDO1, TPDO2, TPDO3, TPDO4 = TPDOS = (0x180, 0x280, 0x380, 0x480)
MOST_BITS = 64  # that one PDO carries
_DUMMIES = range(1, 8)  # objects that stand for unused bits (CiA 301)


@attrs.frozen(kw_only=True)
class Field:
    """One object in a PDO.

    Attributes
    ----------
    index, sub : int
        Of the object dictionary.
    code : str
        Its type, as `struct` spells it: ``"H"`` for UNSIGNED16, ``"i"`` for INTEGER32 …; ``"4x"`` for four
        bytes that are neither read nor set here.
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

    @property
    def used(self) -> bool:
        """Whether it is read or set here."""
        return not self.code.endswith("x")


CONTROLWORD = Field(index=0x6040, sub=0, code="H", name="Controlword")
STATUSWORD = Field(index=0x6041, sub=0, code="H", name="Statusword")
MODE = Field(index=0x6060, sub=0, code="b", name="ModeOfOperation")
ACTUAL_POSITION = Field(index=0x6064, sub=0, code="i", name="ActualPosition")
TARGET_POSITION = Field(index=0x607A, sub=0, code="i", name="TargetPosition")
INTERPOLATION_DATA = Field(index=0x60C1, sub=1, code="i", name="InterpolationData")
TARGET_VELOCITY = Field(index=0x60FF, sub=0, code="i", name="TargetVelocity")
VELOCITY_OFFSET = Field(index=0x60B1, sub=0, code="i", name="VelocityOffset")
TORQUE_OFFSET = Field(index=0x60B2, sub=0, code="h", name="TorqueOffset")

Pdos = Mapping[int, tuple[Field, ...]]  # by COB-ID of node 0

_OTHER_MODES: Mapping[str, Pdos] = {"ip": {RPDO2: (INTERPOLATION_DATA,)}, "csv": {RPDO2: (TARGET_VELOCITY,)}}
_FEED_FORWARD: Mapping[str, Pdos] = {
    "none": {RPDO2: (TARGET_POSITION,)},
    "velocity": {RPDO2: (TARGET_POSITION, VELOCITY_OFFSET)},
    "torque": {RPDO2: (TARGET_POSITION, TORQUE_OFFSET)},
    "both": {RPDO2: (TARGET_POSITION, VELOCITY_OFFSET), RPDO3: (TORQUE_OFFSET,)},
}


@attrs.frozen(kw_only=True)
class Layout:
    """Which PDOs carry what.

    Attributes
    ----------
    received : mapping of int to tuple of Field
        What the drive is sent, in the order in which a cycle sends it.
    transmitted : mapping of int to tuple of Field
        What the drive sends at each SYNC: statusword and actual position, in one TPDO or in two.
    fixed : bool
        Whether the drive's own mapping says so, and must not be changed.
    """

    received: Pdos
    transmitted: Pdos
    fixed: bool

    @property
    def command(self) -> int:
        """The RPDO with the controlword."""
        return next(pdo for pdo, fields in self.received.items() if CONTROLWORD in fields)

    @property
    def setpoints(self) -> Pdos:
        """The RPDOs that go with every cycle."""
        only_commands = {CONTROLWORD, MODE}
        return {
            pdo: fields
            for pdo, fields in self.received.items()
            if any(field.used and field not in only_commands for field in fields)
        }

    @property
    def shared(self) -> bool:
        """Whether the controlword goes with every setpoint."""
        return self.command in self.setpoints

    @property
    def leading(self) -> int:
        """The RPDO with the position or velocity to follow."""
        leads = {TARGET_POSITION, INTERPOLATION_DATA, TARGET_VELOCITY}
        return next(pdo for pdo, fields in self.received.items() if leads & set(fields))

    def role(self, pdo: int) -> str:
        """Name a PDO in use as `can.cob_ids` does."""
        if pdo == self.leading:
            return "setpoint"
        if pdo in self.transmitted:
            return "feedback" if STATUSWORD in self.transmitted[pdo] else "position"
        return "command" if pdo == self.command else "feed_forward"

    def offset(self, wanted: Field, fields: Sequence[Field]) -> int:
        """Tell at which byte of a PDO a field begins."""
        return packing(fields[: fields.index(wanted)]).size


def layout(can: CanSpec) -> Layout:
    """Tell which PDOs carry what.

    Raises
    ------
    ExportError
        The drive's fixed mapping lacks what the mode needs, or takes an unknown object.
    """
    if not can.fixed_pdos.stated:
        return Layout(
            received={RPDO1: (CONTROLWORD,), **_setpoints(can)},
            transmitted={TPDO1: (STATUSWORD, ACTUAL_POSITION)},
            fixed=False,
        )
    return Layout(received=_fixed_received(can), transmitted=_fixed_transmitted(can), fixed=True)


def setpoint_fields(can: CanSpec) -> tuple[Field, ...]:
    """List what a drive is sent in each cycle, in all its RPDOs; what it follows comes first."""
    return tuple(field for fields in _setpoints(can).values() for field in fields)


def packing(fields: Sequence[Field]) -> struct.Struct:
    """Pack the fields as a PDO does: little-endian, without gaps."""
    return struct.Struct("<" + "".join(field.code for field in fields))


def enabling(can: CanSpec) -> int:
    """Controlword of a drive that is to follow."""
    return Controlword.ENABLE | (IP_ENABLE if can.mode == "ip" else 0)


def constants(can: CanSpec) -> dict[Field, int]:
    """List what is the same in every cycle."""
    return {MODE: MODES[can.mode]}


def _setpoints(can: CanSpec) -> Pdos:
    return _OTHER_MODES.get(can.mode, _FEED_FORWARD[can.feed_forward])


def _fixed_received(can: CanSpec) -> Pdos:
    needed = (CONTROLWORD, *setpoint_fields(can))
    stated = zip(RPDOS, can.fixed_pdos.received, strict=True)
    mapped = {
        pdo: _sized(tuple(_sent(entry, needed, place) for entry in entries), place)
        for number, (pdo, entries) in enumerate(stated, start=1)
        if entries and (place := f"can.fixed_pdos.rpdo{number}")
    }
    mapped = {pdo: fields for pdo, fields in mapped.items() if set(fields) & set(needed)}
    for field in needed:
        count = sum(fields.count(field) for fields in mapped.values())
        if count != 1:
            raise ExportError(
                f'can.fixed_pdos: mode = "{can.mode}" needs one RPDO with {_words(field)}, found {count}; '
                "choose another mode or feed_forward, or a drive whose PDOs can be mapped."
            )
    return mapped


def _sent(entry: int, needed: Sequence[Field], place: str) -> Field:
    """Tell what to send for an entry of a mapping: what is needed, or what does no harm."""
    for field in (*needed, MODE):
        if entry == field.mapping:
            return field
    harmless = {TARGET_POSITION, TARGET_VELOCITY, VELOCITY_OFFSET, TORQUE_OFFSET}  # of other modes; zero
    if entry >> 16 in _DUMMIES or entry in {field.mapping for field in harmless}:
        return _unused(entry, place)
    raise ExportError(
        f"{place}: cannot tell what to send as {entry >> 16:04X}h:{entry >> 8 & 0xFF:02X} beside setpoints; "
        "choose another RPDO, or a drive whose PDOs can be mapped."
    )


def _fixed_transmitted(can: CanSpec) -> Pdos:
    """Choose the TPDO with both, else the first with each."""
    stated = dict(zip(TPDOS, can.fixed_pdos.sent, strict=True))
    wanted = (STATUSWORD, ACTUAL_POSITION)
    both = [pdo for pdo, entries in stated.items() if {field.mapping for field in wanted} <= set(entries)]
    chosen = dict.fromkeys(both[:1])
    for field in () if both else wanted:
        holding = [pdo for pdo, entries in stated.items() if field.mapping in entries]
        if not holding:
            raise ExportError(
                f"can.fixed_pdos: no TPDO holds {_words(field)}, by which the drive is watched; state it, or "
                "use a drive whose PDOs can be mapped."
            )
        chosen |= dict.fromkeys(holding[:1])
    mapped = {}
    for pdo in chosen:
        place = f"can.fixed_pdos.tpdo{TPDOS.index(pdo) + 1}"
        mapped[pdo] = _sized(tuple(_told(entry, place) for entry in stated[pdo]), place)
    return mapped


def _told(entry: int, place: str) -> Field:
    known = {field.mapping: field for field in (STATUSWORD, ACTUAL_POSITION)}
    return known.get(entry) or _unused(entry, place)


def _unused(entry: int, place: str) -> Field:
    bits = entry & 0xFF
    if not bits or bits % 8:
        raise ExportError(f"{place}: {entry:08X}h has {bits} bits, and only whole bytes are taken.")
    return Field(index=entry >> 16, sub=entry >> 8 & 0xFF, code=f"{bits // 8}x", name="")


def _sized(fields: tuple[Field, ...], place: str) -> tuple[Field, ...]:
    bits = sum(field.bits for field in fields)
    if bits > MOST_BITS:
        raise ExportError(f"{place}: {bits} bits are more than a PDO holds ({MOST_BITS}); check the entries.")
    return fields


def _words(field: Field) -> str:
    return f"{field.index:04X}h{f':{field.sub:02X}' if field.sub else ''} ({field.mapping:08X}h)"
