"""Between a motion in SI units and the numbers that a controller's axes count in."""

from __future__ import annotations

from decimal import ROUND_CEILING, Decimal
from typing import Any, get_args

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array, Profile, SampledProfile, columns_of, grid_length, sample
from gen_profile.spec.values import Bounds, CycleTime
from gen_profile.support.errors import ExportError
from gen_profile.support.units import COUNTS, AxisScale
from gen_profile_exporters.exporter import Target

INT32: np.iinfo[Any] = np.iinfo(np.int32)
INT16: np.iinfo[Any] = np.iinfo(np.int16)
CYCLE_TIME: Bounds = get_args(CycleTime)[1]
MAX_SAMPLES = 1_000_001
TOO_FAR = "lower axis.counts_per_metre or put the origin nearer"


@attrs.frozen(kw_only=True, eq=False)
class AxisTable:
    """Setpoints in axis units, as they stand in an artefact.

    Attributes
    ----------
    cycle_time : float
        s.
    position : (samples, axes) array
        In axis units; whole numbers for axes that count in ``counts``.
    velocity, acceleration, jerk : (samples, axes) array or None
        In axis units per s, s², s³, where the format carries them.
    """

    cycle_time: float
    position: Array
    velocity: Array | None = None
    acceleration: Array | None = None
    jerk: Array | None = None


def sampled(
    profile: Profile, target: Target, cycle_time: float, place: str, most: int = MAX_SAMPLES
) -> SampledProfile:
    """Sample a profile for a target; `place` is the cycle time's spec path, `most` what a file holds."""
    if profile.axes != len(target.axes):
        raise ExportError(
            f"The motion has {profile.axes} axes, the target {len(target.axes)}; design it again."
        )
    samples = grid_length(profile.duration, cycle_time) + 1
    if samples > most:
        raise ExportError(
            f"{place}: {samples} samples of {cycle_time:g} s are more than the format holds ({most}); "
            f"set it to {two_digits_up(Decimal(profile.duration) / (most - 1))} s or more."
        )
    return sample(profile, cycle_time)


def axis_table(motion: SampledProfile, axes: tuple[AxisScale, ...]) -> AxisTable:
    """Convert a sampled motion, with all its derivatives, to axis units."""
    factor = np.array([axis.factor for axis in axes])
    columns = {name: in_axis_units(values, factor) for name, values in columns_of(motion).items()}
    for column, axis in enumerate(axes):
        if axis.unit == COUNTS:
            columns["position"][:, column] = counts(motion.position[:, column], axis, motion.cycle_time)
    return AxisTable(cycle_time=motion.cycle_time, **columns)


def motion_of(table: AxisTable, axes: tuple[AxisScale, ...]) -> SampledProfile:
    """Convert a table back to SI units: what the controller will issue."""
    factor = np.array([axis.factor for axis in axes])
    return SampledProfile(
        cycle_time=table.cycle_time,
        **{name: in_si(values, factor) for name, values in columns_of(table).items()},
        resolution=in_si(np.array([float(axis.unit == COUNTS) for axis in axes]), np.abs(factor)),
    )


def counts(position: Array, axis: AxisScale, cycle_time: float) -> Array:
    """Round one axis's positions, shape (samples,), to drive counts, half to even.

    Each count comes from the absolute position, so no error accumulates: it stays within half a count.

    Raises
    ------
    ExportError
        A count does not fit 32 bits, which is what drives take (CiA 402, object 607Ah).
    """
    rounded = np.rint(in_axis_units(position, np.array(axis.counts_per_si)))
    if axis.modulo is None:  # else what is written lies within a turn
        require_within(INT32, rounded, f"axis {axis.name}", TOO_FAR, cycle_time)
    return rounded


def require_within(
    limits: np.iinfo[Any], counts: NDArray[Any], what: str, cure: str, cycle_time: float
) -> None:
    """Refuse whole numbers, one per cycle, of which some do not fit the bits that they are sent in.

    Raises
    ------
    ExportError
    """
    outside = np.flatnonzero((counts < limits.min) | (counts > limits.max))
    if outside.size:
        first = int(outside[0])
        raise ExportError(
            f"{what}: {counts[first]:.15g} counts at {first * cycle_time:g} s lie outside {limits.bits} bits "
            f"({limits.min} to {limits.max}); {cure}."
        )


def is_count(values: Array) -> NDArray[np.bool_]:
    """Whether numbers are whole and fit 32 bits."""
    return np.asarray((values == np.floor(values)) & (values >= INT32.min) & (values <= INT32.max))


def plausible_cycle_time(cycle_time: float, line: int) -> float:
    """Pass on a cycle time read from a file, if a spec could have asked for it."""
    if not CYCLE_TIME.least <= cycle_time <= CYCLE_TIME.most:
        raise ExportError(
            f"line {line}: a cycle time of {cycle_time:g} s lies outside {CYCLE_TIME.least:g} to "
            f"{CYCLE_TIME.most:g} s; export the motion again."
        )
    return cycle_time


def two_digits_up(value: Decimal) -> str:
    """Round a positive number up to two digits, so that it still is enough where it is the least that is."""
    rounded = value.quantize(Decimal(1).scaleb(value.adjusted() - 1), ROUND_CEILING)
    return f"{rounded.normalize():f}"


# Adding 0.0 turns a negative zero into a plain one: equal motions get equal texts and hashes.


def in_axis_units(values: Array, factor: Array) -> Array:
    """Multiply by axis units per SI unit, broadcast."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _finite(np.asarray(values * factor + 0.0))


def in_si(values: Array, factor: Array) -> Array:
    """Divide by axis units per SI unit, broadcast."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _finite(np.asarray(values / factor + 0.0))


def _finite(values: Array) -> Array:
    if not np.isfinite(values).all():
        raise ExportError(
            "A setpoint is too large to convert between SI and axis units; check the axis's scale."
        )
    return values
