"""From a motion in SI units to the whole numbers that drives take, exactly.

A position is multiplied by the exact ratio that the spec's decimal number states, and rounded once, half to
even. Nothing is added up from cycle to cycle, so nothing drifts.
"""

from fractions import Fraction

import attrs
import numpy as np

from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import ExportError
from gen_profile.support.units import AxisScale, require_one_way
from gen_profile_exporters.can import pdos
from gen_profile_exporters.can.drive_units import VELOCITY_UNIT, exact, per_count
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.pdos import Field
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.modulo import require_short_steps, turn_counts, within
from gen_profile_exporters.setpoints import INT16, INT32, TOO_FAR, require_within

NEAR_TIE = 1e-6  # of a count; doubles decide the rounding of what is further from a half
DECELERATION_MARGIN = 2.0  # of a quick stop, over the motion's own greatest acceleration
DIFFERENCE = 0.02  # s; velocities so far apart tell an acceleration without the noise of rounding


@attrs.frozen(kw_only=True, eq=False)
class Setpoints:
    """What the drives are sent, in their own counts.

    Attributes
    ----------
    period : float
        s.
    position : (samples, axes) integer array
    offsets : (samples, axes, offsets) integer array
        Feed-forward, as many as are sent: velocity 60B1h in the drive's unit, torque 60B2h in ‰.
    velocity : (samples, axes) integer array or None
        60FFh in the drive's unit, each kept for one period: what is sent instead of positions in csv.
    """

    period: float
    position: Integers
    offsets: Integers
    velocity: Integers | None = None

    @property
    def sent(self) -> Integers:
        """What each cycle's setpoints hold, shape (samples, axes, fields)."""
        leading = self.position if self.velocity is None else self.velocity
        return np.concatenate([leading[:, :, None], self.offsets], axis=2)

    @property
    def at_sync(self) -> Integers:
        """Where the axes are led to by the instant of each SYNC, shape (samples, axes)."""
        if self.velocity is not None:
            return self.position
        return np.concatenate([self.position[:1], self.position[:-1]])


@attrs.frozen(kw_only=True)
class Demand:
    """What a motion, or every motion of a planner, asks of each axis, in counts and s.

    Attributes
    ----------
    start : tuple of int or None
        Where the motion begins; None where it begins wherever the axes stand.
    ends : tuple of (int, int)
        Least and greatest position.
    velocity, acceleration : tuple of float
        Greatest magnitudes.
    quick_stop : tuple of int
        Deceleration 6085h of the drive's quick stop.
    """

    start: tuple[int, ...] | None
    ends: tuple[tuple[int, int], ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    quick_stop: tuple[int, ...]


def demand_of(motion: Setpoints, target: Target) -> Demand:
    """Find what a motion asks of the drives."""
    columns = motion.position.T
    accelerations = tuple(_greatest_acceleration(position, motion.period) for position in columns)
    return Demand(
        start=tuple(map(int, motion.position[0])),
        ends=tuple((int(position.min()), int(position.max())) for position in columns),
        velocity=tuple(float(np.abs(np.diff(position)).max()) / motion.period for position in columns),
        acceleration=accelerations,
        quick_stop=tuple(
            quick_stop_deceleration(DECELERATION_MARGIN * acceleration, target.can, axis)
            for acceleration, axis in zip(accelerations, target.axes, strict=True)
        ),
    )


def exact_counts(values: Array, ratio: Fraction, what: str = "a setpoint") -> Integers:
    """Multiply doubles by a ratio and round to whole numbers, half to even, without any other error.

    Parameters
    ----------
    values : array
    ratio : Fraction
    what : str
        They are, for errors.

    Raises
    ------
    ExportError
        A product lies far outside 32 bits.
    """
    product = np.asarray(values, dtype=np.float64) * float(ratio)
    if not (np.abs(product) < 2.0**40).all():
        raise ExportError(f"{what}: it lies far outside 32 bits; {TOO_FAR}.")
    counts = np.rint(product).astype(np.int64)
    for index in zip(*np.nonzero(np.abs(product - np.floor(product) - 0.5) < NEAR_TIE), strict=True):
        counts[index] = round(Fraction(float(values[index])) * ratio)
    return counts


def setpoints(motion: SampledProfile, target: Target) -> Setpoints:
    """Scale a motion that was sampled at the SYNC period.

    Raises
    ------
    ExportError
        A number leaves 32 bits (or 16, of a torque), or a position the axis's travel.
    """
    columns = [
        _positions(places, axis, target.can, motion.cycle_time)
        for places, axis in zip(motion.position.T, target.axes, strict=True)
    ]
    return Setpoints(
        period=motion.cycle_time,
        position=np.column_stack(columns),
        offsets=_offsets(motion, target),
        velocity=_velocities(motion, target) if target.can.mode == "csv" else None,
    )


def start_counts(target: Target) -> tuple[int, ...]:
    """Tell where each axis stands before the motion, in counts, whole turns included."""
    return tuple(
        int(exact_counts(np.array([place]), exact(axis.counts_per_si))[0])
        for place, axis in zip(target.start, target.axes, strict=True)
    )


def travelled(velocity: Integers, period: float, target: Target) -> Array:
    """Distance in counts by the instant of each SYNC, if each velocity is kept for a period."""
    counts = [period / float(per_count(VELOCITY_UNIT, target.can, axis)) for axis in target.axes]
    return np.asarray(np.cumsum(np.pad(velocity[:-1], ((1, 0), (0, 0))), axis=0) * counts)


def travel_counts(axis: AxisScale, can: CanSpec) -> tuple[int, int] | None:
    """Software position limits 607Dh, lower first, or None.

    Raises
    ------
    ExportError
        One does not fit 32 bits, and would be another place in the drive.
    """
    if axis.name not in can.travel:
        return None
    require_one_way(axis, f"can.travel.{axis.name} states ends", "state only one of the two")
    what, travel = f"can.travel.{axis.name}", can.travel[axis.name]
    ends = exact_counts(np.array(travel), exact(axis.counts_per_si), what)
    least, greatest = int(ends.min()), int(ends.max())
    if least < INT32.min or greatest > INT32.max:
        raise ExportError(
            f"{what}: {travel[0]:g} to {travel[1]:g} are {least} to {greatest} counts, more than 32 bits "
            f"hold ({INT32.min} to {INT32.max}); narrow the travel, or {TOO_FAR}."
        )
    return least, greatest


def magnitude_counts(value: float, axis: AxisScale) -> int:
    """Scale a distance or deceleration, always positive, never to nothing."""
    return max(1, int(exact_counts(np.array([value]), abs(exact(axis.counts_per_si)))[0]))


def quick_stop_deceleration(unstated: float, can: CanSpec, axis: AxisScale) -> int:
    """Deceleration 6085h in counts/s²: the spec's, else the one given."""
    if can.quick_stop is not None:
        return magnitude_counts(can.quick_stop, axis)
    return max(1, min(INT32.max, round(unstated)))


def _greatest_acceleration(position: Integers, period: float) -> float:
    """Greatest acceleration of one axis, in counts/s²."""
    velocity = np.diff(position) / period
    apart = max(1, round(DIFFERENCE / period))
    change = velocity[apart:] - velocity[:-apart] if len(velocity) > apart else velocity
    return float(np.abs(change).max()) / (apart * period)


def _positions(values: Array, axis: AxisScale, can: CanSpec, period: float) -> Integers:
    counts = exact_counts(values, exact(axis.counts_per_si), f"axis {axis.name}")
    turn, sent = turn_counts(axis), counts
    if turn is not None:
        require_short_steps(counts.astype(np.float64), turn, axis, period)
        sent = np.array([within(count, turn) for count in counts.tolist()], dtype=np.int64)
    require_within(INT32, sent, f"axis {axis.name}", TOO_FAR, period)
    if can.encoder is not None or can.gear is not None or can.feed is not None:
        increments = np.array([round(int(count) * position_factor(can)) for count in sent], dtype=object)
        what = f"axis {axis.name}, in the drive's increments"
        require_within(INT32, increments, what, "choose a coarser encoder", period)
    travel = travel_counts(axis, can)
    if travel is not None:
        outside = np.flatnonzero((counts < travel[0]) | (counts > travel[1]))
        if outside.size:
            raise ExportError(
                f"can.travel.{axis.name}: the motion leaves the travel at {outside[0] * period:g} s "
                f"({values[outside[0]]:.9g} m); shift the move, or widen the travel if the axis has it."
            )
    return counts


def position_factor(can: CanSpec) -> Fraction:
    """Increments per count, 6093h = 608Fh × 6091h / 6092h (CiA 402-2)."""
    encoder, gear, feed = (Fraction(*(pair or (1, 1))) for pair in (can.encoder, can.gear, can.feed))
    return encoder * gear / feed


def _velocities(motion: SampledProfile, target: Target) -> Integers:
    """Choose velocities that lead the axes to every sample, within one period's least distance.

    What rounding leaves over in one period goes into the next one, so nothing adds up.
    """
    columns = []
    for column, axis in enumerate(target.axes):
        distance = motion.position[:, column] - motion.position[0, column]
        per_period = per_count(VELOCITY_UNIT, target.can, axis) / exact(motion.cycle_time)
        velocity = np.append(np.diff(exact_counts(distance, exact(axis.counts_per_si) * per_period)), 0)
        cure = "lower axis.counts_per_metre, or set a greater can.velocity_unit in the drive"
        require_within(INT32, velocity, f"axis {axis.name}, velocity", cure, motion.cycle_time)
        columns.append(velocity)
    return np.column_stack(columns)


def _offsets(motion: SampledProfile, target: Target) -> Integers:
    offsets = pdos.setpoint_fields(target.can)[1:]
    columns = [_offset(field, motion, target) for field in offsets]
    return np.stack(columns, axis=2) if columns else np.empty((*motion.position.shape, 0), dtype=np.int64)


def _offset(field: Field, motion: SampledProfile, target: Target) -> Integers:
    columns = []
    for column, axis in enumerate(target.axes):
        ratio = exact(axis.counts_per_si)
        if field == pdos.VELOCITY_OFFSET:
            values, limits, what = motion.velocity, INT32, "velocity"
            ratio *= per_count(VELOCITY_UNIT, target.can, axis)
            cure = "lower axis.counts_per_metre"
        else:
            values, limits, what = motion.acceleration, INT16, "torque"
            cure = "lower can.torque_per_acceleration"
            ratio = exact(target.can.torque_per_acceleration or 0.0) * (1 if ratio > 0 else -1)
        assert values is not None  # samples of a profile have them all
        counts = exact_counts(values[:, column], ratio, f"axis {axis.name}, {what}")
        require_within(limits, counts, f"axis {axis.name}, {what}", cure, motion.cycle_time)
        columns.append(counts)
    return np.column_stack(columns)
