"""The table of a playback block: the motion of all axes in the units of the target, in one of three layouts.

========== ==================================================================================
segments   quintics between cycles (`quintic_segments`): exact between cycles, too, and small
samples    position, velocity and acceleration at every cycle, as doubles
counts     the same as whole 32-bit drive counts, counts per s and counts per s²
========== ==================================================================================
"""

from collections.abc import Sequence
from functools import cached_property
from math import ceil

import attrs
import numpy as np

from gen_profile.motion.profile import Array, Profile, SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile.support.units import COUNTS, AxisScale
from gen_profile_exporters import setpoints
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.machine_variants import AxisVariants
from gen_profile_exporters.modulo import require_short_steps, turn_counts
from gen_profile_exporters.playback.block import BlockShape
from gen_profile_exporters.playback.path_limits import PathLimits, latest_stop, path_limits
from gen_profile_exporters.playback.quintic_segments import QuinticSegments, fit, horner

MOST_SAMPLES = 100_001  # larger tables were not seen to compile
LEAST_CHECKS = 8  # values that enter the checksum in a cycle
CHECKED_WITHIN = 1.0  # s, whatever the length of the table
# Compilers refuse LREAL literals that a REAL could not hold.
SMALLEST, GREATEST = 1e-37, 1e37


@attrs.frozen(kw_only=True, eq=False)
class PlaybackTable:
    """Columns as they stand in a block, with what the block needs to know about them.

    Attributes
    ----------
    layout : str
    cycle_time : float
        s.
    axes : tuple of AxisScale
        As the block counts them.
    first : (segments,) array or None
        Cycle at which each segment begins.
    columns : (columns, rows, axes) array
        Powers 0 to 5 of every segment, or position, velocity and acceleration of every cycle.
    last : int
        Cycle of the end.
    target : (axes,) array
        Position at the end, in axis units.
    variants : tuple of AxisVariants
        What may be changed of the motion at its start, axis by axis.
    stated_play_on : int or None
        What a block says of `play_on`.
    """

    layout: str
    cycle_time: float
    axes: tuple[AxisScale, ...]
    first: Array | None
    columns: Array
    last: int
    target: Array
    variants: tuple[AxisVariants, ...]
    stated_play_on: int | None = None

    @property
    def shape(self) -> BlockShape:
        """Of the block that holds it."""
        return shape_for(self.axes, self.layout)

    @property
    def start(self) -> Array:
        """Position at the beginning, in axis units, shape (axes,)."""
        start: Array = self.columns[0, 0]
        return start

    def arrival(self) -> Array:
        """Position to which the table leads, in axis units, shape (axes,)."""
        if self.first is None:
            end: Array = self.columns[0, -1]
            return end
        time = (self.last - self.first[-1]) * self.cycle_time
        return horner(self.columns[:, -1], np.array(time))[0]

    def values(self) -> Array:
        """List all numbers of the table in the order in which the block counts them off."""
        columns = [column.ravel() for column in self.columns]
        if self.first is not None:
            columns.append(np.repeat(self.first, len(self.axes)).astype(np.float64))
        return np.concatenate(columns)

    def checks(self) -> int:
        """Values that the block takes into its checksum in a cycle."""
        return checks_of(len(self.values()), self.cycle_time)

    @cached_property
    def play_on(self) -> int:
        """Cycle from which a stop by the motion's own peaks would end no sooner than the motion."""
        if self.stated_play_on is not None:
            return self.stated_play_on
        _, velocity, acceleration = quantities(self.played)
        return latest_stop(self.limits, velocity, acceleration, self.cycle_time)

    @cached_property
    def played(self) -> setpoints.AxisTable:
        """What the block issues every cycle when nothing disturbs it, in axis units."""
        position, velocity, acceleration = (
            self.columns if self.first is None else self._segments().at_cycles()
        )
        return setpoints.AxisTable(
            cycle_time=self.cycle_time, position=position, velocity=velocity, acceleration=acceleration
        )

    def between(self, cycle: int, fraction: float) -> Array:
        """Work out what the block issues between cycles, operation by operation.

        Parameters
        ----------
        cycle : int
            From 0 to before the last one.
        fraction : float
            Of the next cycle, from 0 to 1.

        Returns
        -------
        (3, axes) array
            Position, velocity and acceleration along the path, in axis units and s.
        """
        if self.first is not None:
            segment = int(np.searchsorted(self.first, cycle, side="right")) - 1
            time = (float(cycle - int(self.first[segment])) + fraction) * self.cycle_time
            return np.array(horner(self.columns[:, segment], np.array(time)))
        (position, velocity, acceleration), following = self.columns[:, cycle], self.columns[:, cycle + 1]
        advance, rest = following[0] - position, 1.0 - fraction
        way = (
            advance
            + rest * rest * (velocity * self.cycle_time - advance)
            - rest * fraction * (following[1] * self.cycle_time - advance)
        )
        speed = velocity + fraction * (following[1] - velocity)
        push = acceleration + fraction * (following[2] - acceleration)
        return np.array((position + fraction * way, speed, push))

    def motion(self) -> SampledProfile:
        """Convert what the block issues to SI units."""
        motion = setpoints.motion_of(self.played, self.axes)
        return motion if self.first is None else attrs.evolve(motion, resolution=np.zeros(len(self.axes)))

    @cached_property
    def peaks(self) -> Array:
        """Bounds of the magnitudes of velocity, acceleration and jerk along the path, shape (3, axes)."""
        if self.first is not None:
            return self._segments().peaks()
        _, velocity, acceleration = np.abs(self.columns)
        jerk = np.abs(np.diff(self.columns[2], axis=0)).max(axis=0) / self.cycle_time
        speed = np.abs(np.diff(self.columns[1], axis=0)).max(axis=0) / self.cycle_time
        return np.array([velocity.max(axis=0), np.maximum(acceleration.max(axis=0), speed), jerk])

    @cached_property
    def limits(self) -> PathLimits:
        """How the block may slow down and speed up."""
        return path_limits(self.peaks)

    def _segments(self) -> QuinticSegments:
        first = np.array([] if self.first is None else self.first, dtype=np.int64)
        return QuinticSegments(
            cycle_time=self.cycle_time,
            first=np.append(first, self.last),
            coefficients=np.moveaxis(self.columns, 0, 1),
            target=self.target,
        )


def checks_of(values: int, cycle_time: float) -> int:
    """Tell how many of so many values are to enter a checksum in a cycle."""
    return max(LEAST_CHECKS, ceil(values * cycle_time / CHECKED_WITHIN))


def tabulate(profile: Profile, target: Target) -> PlaybackTable:
    """Sample a motion at the target's cycle time and put it into the target's layout.

    Raises
    ------
    ExportError
        A position does not fit the axis's counts, or the table is too long to compile.
    """
    motion = setpoints.sampled(profile, target, target.cycle_time, "export.cycle_time", MOST_SAMPLES)
    axes = counted_axes(target, target.export.plc_layout)
    for axis, positions in zip(axes, motion.position.T, strict=True):
        if axis.modulo is not None:
            require_short_steps(positions * axis.factor, axis.modulo, axis, motion.cycle_time)
    first, last = None, len(motion.position) - 1
    if target.export.plc_layout == "segments":
        segments = fit(quantities(motion), motion.cycle_time)
        first = segments.first[:-1].astype(np.float64)
        factor = np.array([axis.factor for axis in axes])
        columns = _literal(setpoints.in_axis_units(np.moveaxis(segments.coefficients, 1, 0), factor))
        end = _literal(setpoints.in_axis_units(segments.target, factor))
    else:
        columns = quantities(setpoints.axis_table(motion, axes))
        columns = _literal(_whole(columns, axes) if target.export.plc_layout == "counts" else columns)
        end = columns[0, -1]
    return PlaybackTable(
        layout=target.export.plc_layout,
        cycle_time=motion.cycle_time,
        axes=axes,
        first=first,
        columns=columns,
        last=last,
        target=end,
        variants=target.variants or (AxisVariants(),) * len(axes),
    )


def quantities(table: setpoints.AxisTable | SampledProfile) -> Array:
    """Stack position, velocity and acceleration, shape (3, samples, axes)."""
    columns = (table.position, table.velocity, table.acceleration)
    return np.stack([values for values in columns if values is not None])


def shape_for(axes: Sequence[AxisScale], layout: str) -> BlockShape:
    """Give the shape of a block for axes."""
    return BlockShape(layout, len(axes), has_modulo=any(axis.modulo is not None for axis in axes))


def counted_axes(target: Target, layout: str) -> tuple[AxisScale, ...]:
    """Scale the axes as a block of that layout counts them.

    Raises
    ------
    ExportError
        A turn of a modulo axis has no whole counts.
    """
    if layout != "counts":
        return target.axes
    return tuple(
        attrs.evolve(axis, unit=COUNTS, factor=axis.counts_per_si, modulo=turn_counts(axis))
        for axis in target.axes
    )


def _literal(columns: Array) -> Array:
    """Keep to numbers that every compiler reads."""
    if np.abs(columns).max() >= GREATEST:
        raise ExportError(
            f"The table would hold {np.abs(columns).max():.3g}, which compilers refuse; "
            "take another axis.unit or export.plc_layout."
        )
    return np.where(np.abs(columns) < SMALLEST, 0.0, columns)


def _whole(columns: Array, axes: tuple[AxisScale, ...]) -> Array:
    """Round velocities and accelerations, too."""
    rounded = np.rint(columns) + 0.0
    outside = np.argwhere(np.abs(rounded) > setpoints.INT32.max)
    if len(outside):
        column, _, axis = outside[0]
        quantity = ("position", "velocity", "acceleration")[column]
        raise ExportError(
            f"axis {axes[axis].name}: its {quantity} reaches {np.abs(rounded[column, :, axis]).max():.3g} "
            f"counts{('', '/s', '/s²')[column]}, more than 32 bits hold; lower axis.counts_per_metre or take "
            "another export.plc_layout."
        )
    return rounded
