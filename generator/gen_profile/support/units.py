"""The only place where units are converted: SI inside, an axis's own unit and sign at the edges."""

import math

import attrs

from gen_profile.support.errors import ExportError

# unit → (SI unit, how many of it make one SI unit)
UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e3),
    "um": ("m", 1e6),
    "rad": ("rad", 1.0),
    "deg": ("rad", 180.0 / math.pi),
}
COUNTS = "counts"
RATES = {"velocity": "/s", "acceleration": "/s²", "jerk": "/s³"}  # of an axis, behind its unit
AXIS_UNITS = (*UNITS, COUNTS)


def units_of(si: str) -> dict[str, float]:
    """List the units that measure what an SI unit does, or its rate, and how many of them make one."""
    measured, per, time = si.partition("/s")
    return {f"{unit}{per}{time}": many for unit, (of, many) in UNITS.items() if of == measured}


@attrs.frozen(kw_only=True)
class AxisScale:
    """How a controller counts one axis.

    Attributes
    ----------
    name : str
        Of the axis, as the plant calls it.
    unit : str
        One of `AXIS_UNITS`.
    factor : float
        Axis units per SI unit; negative where the axis counts the other way.
    counts_per_si : float
        Drive counts per SI unit, negative likewise.
    modulo : float or None
        Axis units after which a modulo axis wraps; None for any other.
    """

    name: str
    unit: str
    factor: float
    counts_per_si: float
    modulo: float | None = None


def axis_factor(unit: str, counts_per_si: float) -> float:
    """Axis units per SI unit."""
    return counts_per_si if unit == COUNTS else UNITS[unit][1]


def require_one_way(axis: AxisScale, what: str, cure: str) -> None:
    """Refuse a modulo axis.

    Raises
    ------
    ExportError
    """
    if axis.modulo is not None:
        raise ExportError(
            f"axis {axis.name}: it wraps after axis.modulo = {axis.modulo:.15g} {axis.unit}, and "
            f"{what}; {cure}."
        )
