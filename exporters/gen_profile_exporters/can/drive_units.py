"""In what a drive counts velocities and accelerations: in its positions' counts, or in units of its own.

Objects 60A8h to 60AAh hold a power of ten and codes of units (CiA 402-2, 303-2): ``FDB44700h`` are 10⁻³ rpm.
A drive without them is taken to count in its positions' counts, unless the spec states otherwise.
"""

import math
from decimal import Decimal
from fractions import Fraction

import attrs

from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import ExportError
from gen_profile.support.units import AxisScale

POSITION_UNIT, VELOCITY_UNIT, ACCELERATION_UNIT = 0x60A8, 0x60A9, 0x60AA
METRE, REVOLUTION, INCREMENT = 0x0100, 0xB400, 0xB500  # of a position
# unit → code in the middle bytes of its object
CODES = {
    VELOCITY_UNIT: {
        "counts/s": 0xB503,
        "rpm": 0xB447,
        "rev/s": 0xB403,
        "m/s": 0x0103,
        "rad/s": 0x1003,
        "deg/s": 0x4103,
    },
    ACCELERATION_UNIT: {
        "counts/s^2": 0xB557,
        "rpm/s": 0xC003,
        "rev/s^2": 0xB457,
        "m/s^2": 0x0157,
        "rad/s^2": 0x1057,
        "deg/s^2": 0x4157,
    },
}
KEYS = {VELOCITY_UNIT: "can.velocity_unit", ACCELERATION_UNIT: "can.acceleration_unit"}
PLAIN = {VELOCITY_UNIT: "counts/s", ACCELERATION_UNIT: "counts/s^2"}
PER_MINUTE = 60
LARGEST_DENOMINATOR = 10_000  # of an encoder's ratio


@attrs.frozen
class DriveUnit:
    """A unit of velocity or acceleration: a power of ten, and a name of `CODES`."""

    exponent: int
    name: str

    @property
    def words(self) -> str:
        """As a spec states it."""
        return f"{Decimal(1).scaleb(self.exponent):f} {self.name}" if self.exponent else self.name


def stated_unit(index: int, can: CanSpec) -> DriveUnit:
    """Read the unit that a spec states for 60A9h or 60AAh; counts where it states none."""
    text = (can.velocity_unit if index == VELOCITY_UNIT else can.acceleration_unit) or PLAIN[index]
    factor, _, name = text.rpartition(" ")
    return DriveUnit(Decimal(factor or "1").adjusted(), name)


def unit_code(index: int, unit: DriveUnit) -> int:
    """Tell what an object holds where it means a unit."""
    return (unit.exponent & 0xFF) << 24 | CODES[index][unit.name] << 8


def codes(can: CanSpec) -> tuple[int, int, int]:
    """Tell what 60A8h to 60AAh hold in a drive as the spec has it, whose positions are increments."""
    velocity, acceleration = (unit_code(index, stated_unit(index, can)) for index in KEYS)
    return INCREMENT << 8, velocity, acceleration


def encoder(can: CanSpec) -> tuple[int, int]:
    """Tell what 608Fh holds in such a drive: increments to revolutions; a ratio of 1 where none is stated."""
    return exact(can.counts_per_revolution or 1.0).limit_denominator(LARGEST_DENOMINATOR).as_integer_ratio()


def unit_of(index: int, value: int) -> DriveUnit | None:
    """Read what an object holds; None where it says nothing, or what is not known here.

    A unit without a dimension is the positions' count, and its exponent says nothing.
    """
    code = value >> 8 & 0xFFFF
    names = {known: name for name, known in CODES[index].items()}
    if code and not code >> 8 and code & 0xFF == CODES[index][PLAIN[index]] & 0xFF:
        return DriveUnit(0, PLAIN[index])
    return DriveUnit(exponent_of(value), names[code]) if code in names else None


def exponent_of(value: int) -> int:
    """Read the power of ten of 60A8h to 60AAh."""
    exponent = value >> 24
    return exponent - 256 if exponent > 127 else exponent


def per_count(index: int, can: CanSpec, axis: AxisScale) -> Fraction:
    """Tell how many of the drive's units make a count/s, or a count/s².

    Raises
    ------
    ExportError
        The unit counts revolutions, and the spec does not say how many counts make one.
    """
    unit = stated_unit(index, can)
    return _per_count(unit.name, KEYS[index], can, axis) / Fraction(10) ** unit.exponent


def _per_count(name: str, key: str, can: CanSpec, axis: AxisScale) -> Fraction:
    measured = name.partition("/")[0]
    if measured == "counts":
        return Fraction(1)
    if measured in {"rpm", "rev"}:
        if can.counts_per_revolution is None:
            raise ExportError(
                f"can.counts_per_revolution: required, as {key} counts revolutions; state how many counts "
                "of positions (607Ah) one revolution makes of which the drive tells the speed, most often "
                "the motor's."
            )
        return (PER_MINUTE if measured == "rpm" else 1) / exact(can.counts_per_revolution)
    others = {"rad", "deg"} if measured == "m" else {"m", "mm", "um"}
    if axis.unit in others:
        raise ExportError(f"{key}: {name!r} does not measure the axis {axis.name}, which is in {axis.unit}.")
    return (exact(math.degrees(1.0)) if measured == "deg" else 1) / abs(exact(axis.counts_per_si))


def exact(value: float) -> Fraction:
    """Read a double as the shortest decimal number that means it, as a spec states it."""
    return Fraction(Decimal(repr(float(value))))
