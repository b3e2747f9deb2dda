"""What a drive says of its units, held against the spec's, before a number of it is believed."""

from fractions import Fraction

from gen_profile.support.units import AxisScale
from gen_profile_exporters.can import drive_units, pdos
from gen_profile_exporters.can.drive_units import (
    ACCELERATION_UNIT,
    INCREMENT,
    KEYS,
    METRE,
    PLAIN,
    POSITION_UNIT,
    REVOLUTION,
    VELOCITY_UNIT,
    exact,
    exponent_of,
)
from gen_profile_exporters.can.setup.node import Node
from gen_profile_exporters.exporter import Target

ENCODER, GEAR, FEED = 0x608F, 0x6091, 0x6092
CLOSE = 1e-6  # relative, between ratios of which one is stated as a decimal number
TURNING = {"rad", "deg"}


def require_units(node: Node, target: Target) -> None:
    """Require that a drive counts velocities and accelerations as the spec has them.

    Raises
    ------
    StreamAborted
    """
    can = target.can
    spoken = {pdos.TARGET_VELOCITY, pdos.VELOCITY_OFFSET}.intersection(pdos.setpoint_fields(can))
    known = {VELOCITY_UNIT: can.velocity_unit or not spoken, ACCELERATION_UNIT: can.acceleration_unit}
    unstated = [index for index, stated in known.items() if not stated]  # the others are set, and read back
    for index in unstated:
        value = _number(node, index)
        unit = drive_units.unit_of(index, value)
        if not value or (unit is not None and unit.words == PLAIN[index]):
            continue
        words = "a unit that is not known here" if unit is None else unit.words
        stated = "as its manual has it" if unit is None else f"= {unit.words!r}"
        raise node.unfit(
            f"the drive counts in {words} where the spec has {PLAIN[index]} ({index:04X}h is {value:08X}h); "
            f"state {KEYS[index]} {stated}, and export again."
        )
    if can.counts_per_revolution is not None:
        _require_revolution(node, exact(can.counts_per_revolution))


def require_position_unit(node: Node, axis: AxisScale) -> None:
    """Require that a drive which counts positions in metres counts as many to one as the spec says.

    Raises
    ------
    StreamAborted
    """
    value = _number(node, POSITION_UNIT)
    if value & 0xFFFF00 != METRE << 8 or axis.unit in TURNING:
        return
    theirs, ours = Fraction(10) ** -exponent_of(value), abs(exact(axis.counts_per_si))
    if not _close(theirs, ours):
        raise node.unfit(
            f"the drive counts {float(theirs):g} to a metre (60A8h is {value:08X}h), and the spec "
            f"{float(ours):g}; state axis.counts_per_metre = {float(theirs):g}, and export again."
        )


def _require_revolution(node: Node, ours: Fraction) -> None:
    """Hold the counts of a revolution to what the drive tells, of the motor's or the shaft's."""
    theirs = _revolutions(node)
    if theirs and not any(_close(one, ours) for one in theirs):
        raise node.unfit(
            f"a revolution is {float(ours):g} counts by can.counts_per_revolution, and "
            f"{' or '.join(f'{float(one):g}' for one in theirs)} by the drive (60A8h, 608Fh, 6091h, 6092h); "
            "state the drive's, and export again."
        )


def _revolutions(node: Node) -> list[Fraction]:
    """Tell how many counts of positions a revolution may be: of the motor, or behind its gear."""
    value = _number(node, POSITION_UNIT)
    if value & 0xFFFF00 == REVOLUTION << 8:
        return [Fraction(10) ** -exponent_of(value)]
    encoder, gear, feed = (_ratio(node, index) for index in (ENCODER, GEAR, FEED))
    if feed == 1 or value & 0xFFFF00 == INCREMENT << 8:  # 1 is what drives hold that do not use it
        return [] if encoder == 1 else [encoder, encoder * gear]
    return [feed, feed / gear]


def _ratio(node: Node, index: int) -> Fraction:
    """Read a ratio; 1 where the drive has none."""
    above, below = _number(node, index, 1), _number(node, index, 2)
    return Fraction(above, below) if above and below else Fraction(1)


def _number(node: Node, index: int, sub: int = 0) -> int:
    """Read a number; 0 where the drive has none."""
    return int.from_bytes(node.upload(index, sub, optional=True) or b"", "little")


def _close(one: Fraction, other: Fraction) -> bool:
    return abs(one / other - 1) < CLOSE
