"""Points of a time cam: the knots that a controller interpolates between."""

from collections.abc import Iterator

import attrs
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gen_profile.motion.profile import Array, Profile, SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.playback.table import tabulate

Indices = NDArray[np.int64]


@attrs.frozen(kw_only=True, eq=False)
class QuinticPoints:
    """Knots with position, velocity and acceleration: a quintic between two of them is determined.

    Attributes
    ----------
    time : (points,) array
        s.
    position, velocity, acceleration : (points, axes) array
        In axis units.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array

    def literals(self, axis: int) -> Iterator[tuple[str, ...]]:
        """Write time, position, velocity and acceleration of an axis, point by point."""
        columns = (self.time, *(q[:, axis] for q in (self.position, self.velocity, self.acceleration)))
        return zip(*(map(literal, column.tolist()) for column in columns), strict=True)


def quintic_points(profile: Profile, target: Target) -> QuinticPoints:
    """Take the knots of the quintic segments, see `gen_profile_exporters.playback.quintic_segments`."""
    export = attrs.evolve(target.export, plc_layout="segments")  # whatever layout the target asks for
    table = tabulate(profile, attrs.evolve(target, export=export))
    first = np.zeros(0) if table.first is None else table.first
    still = np.zeros((1, len(table.axes)))
    position, velocity, half = table.columns[:3]
    return QuinticPoints(
        time=np.append(first, table.last) * table.cycle_time,
        position=np.concatenate([position, table.target[None]]),
        velocity=np.concatenate([velocity, still]),
        acceleration=np.concatenate([2.0 * half, still]),
    )


def spline_cycles(motion: SampledProfile, most: int, error: float, place: str, *, single: bool) -> Indices:
    """Choose as few evenly spaced cycles as a cubic spline through them needs.

    Parameters
    ----------
    motion : SampledProfile
    most : int
        Points that the target holds.
    error : float
        m (or rad), allowed at the cycles between.
    place : str
        The target, for the error.
    single : bool
        Whether times and positions are rounded to single precision first.

    Returns
    -------
    (points,) array of int

    Raises
    ------
    ExportError
        So many points are not enough; with the numbers.
    """
    last = len(motion.position) - 1
    coarseness = spline_error(motion, np.arange(last + 1, dtype=np.int64), single=single)
    if coarseness > error:
        raise ExportError(
            f"{place}: its numbers are so coarse at these positions that {coarseness:.2g} m of error remain "
            f"with any number of points, {error:g} m are allowed; put the origin nearer, or take another "
            "format."
        )
    stride = 1 << max(0, last.bit_length() - 2)
    while True:
        cycles: Indices = np.unique(np.append(np.arange(0, last, stride), last))
        deviation = spline_error(motion, cycles, single=single)
        if len(cycles) > most:
            raise ExportError(
                f"{place}: {len(cycles)} points would be needed, it holds {most}; shorten the motion or "
                "take another format."
            )
        if deviation <= error:
            return cycles
        stride //= 2


def spline_error(motion: SampledProfile, cycles: Indices, *, single: bool) -> float:
    """Greatest distance in m between a spline through some cycles and all of them."""
    times, position = motion.times, motion.position
    played = play_spline(times[cycles], position[cycles], times, single=single)
    return float(np.abs(played - position).max())


def play_spline(knots: Array, values: Array, times: Array, *, single: bool) -> Array:
    """Interpolate by the cubic spline that stands still at both ends, shape (times, axes)."""
    if single:
        knots, values = (part.astype(np.float32).astype(np.float64) for part in (knots, values))
    spline = CubicSpline(knots, values, bc_type="clamped")
    return np.asarray(spline(np.clip(times, knots[0], knots[-1])), dtype=np.float64)
