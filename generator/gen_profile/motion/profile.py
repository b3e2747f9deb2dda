"""Motion of the actuated axes, continuous (`Profile`) and on a controller's cycle grid (`SampledProfile`)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from decimal import ROUND_CEILING, Decimal
from functools import lru_cache
from numbers import Real
from typing import Any, Protocol

import attrs
import numpy as np
from attrs.converters import optional
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from gen_profile.support.errors import GenProfileError, SpecError
from gen_profile.support.suggestion import found
from gen_profile.support.summary import Drawable, Sampled, Summarised, Tabled

Array = NDArray[np.float64]

MOST_SAMPLES = 1e8  # of a profile
STANDING_SHARE = 1e-3  # of the motion that another axis makes, in which one hardly moves


def read_only(values: object) -> Array:
    """Copy to a read-only array of doubles."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _finite(_: object, attribute: attrs.Attribute[Any], value: Array | None) -> None:
    if value is not None and not np.isfinite(value).all():
        raise GenProfileError(f"{attribute.name} of a motion must be finite numbers, found NaN or infinity.")


class PiecewisePolynomial(Protocol):
    """What SciPy's PPoly and the splines derived from it have in common."""

    x: Any
    c: Any


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Motion(Sampled):
    """Position and its derivatives at given times.

    Attributes
    ----------
    position, velocity, acceleration, jerk : (samples, axes) array
        m, m/s, m/s², m/s³ (or rad …).
    """

    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Profile(Drawable):
    """Piecewise polynomial motion of every actuated axis, from rest at time 0.

    Segment k covers ``knots[k] <= t < knots[k + 1]``; its polynomial counts time from ``knots[k]``. Before
    the first knot the motion stands at its start, from the last knot on it holds `target`, or goes on from it
    with its final velocity.

    Attributes
    ----------
    knots : (segments + 1,) array
        Times in s, rising, the first one 0.
    coefficients : (segments, order, axes) array
        Position coefficients, lowest power first, in m s⁻ᵏ (or rad s⁻ᵏ).
    target : (axes,) array
        Position at the end.
    method : str
        What designed it, such as ``"optimal"`` or ``"zvd"``.
    final_velocity : (axes,) array
        m/s (or rad/s) at the end and after it; 0 by default.

    Examples
    --------
    >>> spline = CubicSpline([0.0, 1.0, 2.0], [0.0, 0.2, 0.3], bc_type="clamped")  # of SciPy
    >>> motion = gp.Profile.from_ppoly(spline, "mine")
    >>> motion(np.array([1.0])).position
    array([[0.2]])
    """

    knots: Array = attrs.field(converter=read_only, validator=_finite)
    coefficients: Array = attrs.field(converter=read_only, validator=_finite)
    target: Array = attrs.field(converter=read_only, validator=_finite)
    method: str
    final_velocity: Array = attrs.field(converter=read_only, validator=_finite)

    @final_velocity.default
    def _standstill(self) -> Array:
        return np.zeros_like(self.target)

    def __attrs_post_init__(self) -> None:
        segments, *_, axes = self.coefficients.shape or (0,)
        ends = (self.target.shape, self.final_velocity.shape)
        if self.coefficients.ndim != 3 or self.knots.shape != (segments + 1,) or ends != ((axes,), (axes,)):
            raise GenProfileError("A profile's knots, coefficients and target do not fit together.")
        if self.knots[0] != 0.0 or not (np.diff(self.knots) > 0.0).all():
            raise GenProfileError("A profile's knots must rise from 0.")

    @classmethod
    def from_ppoly(cls, spline: PiecewisePolynomial, method: str = "own") -> Profile:
        """Take over a motion of another planner.

        Parameters
        ----------
        spline : scipy.interpolate.PPoly, CubicSpline or alike
            Of position over time, in m (or rad) and s; ``spline.c`` of shape (order, segments) or
            (order, segments, axes). Its first breakpoint becomes time 0; at its last one the motion rests.
        method : str
            What designed it.

        Raises
        ------
        GenProfileError
            It is no such spline, its numbers are not finite, or its breakpoints do not rise.
        """
        if not (hasattr(spline, "x") and hasattr(spline, "c")):
            raise GenProfileError(
                "A spline with breakpoints x and coefficients c is expected, such as SciPy's PPoly, which "
                f"PPoly.from_spline makes of others, found {found(spline)}."
            )
        knots, c = np.asarray(spline.x, dtype=np.float64), np.asarray(spline.c, dtype=np.float64)
        coefficients = np.moveaxis(c.reshape(*c.shape[:2], -1)[::-1], 0, 1)
        powers = np.diff(knots[-2:]) ** np.arange(len(c))
        return cls(
            knots=knots - knots[0], coefficients=coefficients, target=powers @ coefficients[-1], method=method
        )

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "method": self.method,
            "axes": self.axes,
            "from": self.start.tolist(),
            "to": self.target.tolist(),
            "duration": f"{self.duration:g} s",
            "pieces": len(self.knots) - 1,
        }

    @property
    def duration(self) -> float:
        """Time of the last knot, in s."""
        return float(self.knots[-1])

    @property
    def axes(self) -> int:
        """Number of actuated axes."""
        return int(self.coefficients.shape[2])

    @property
    def leading(self) -> int:
        """Number of the first axis that moves, but for ways that are nothing beside another's."""
        moves = np.abs(self.coefficients[:, 1:]).max(axis=(0, 1), initial=0.0)
        return int(np.argmax(moves >= STANDING_SHARE * moves.max()))

    @property
    def start(self) -> Array:
        """Position at time 0, shape (axes,)."""
        start: Array = self.coefficients[0, 0]
        return start

    def derivative(self, times: Array, order: int) -> Array:
        """Evaluate a derivative by its order (0 = position), right-continuous, shape (times, axes).

        Raises
        ------
        GenProfileError
            The order is no whole number, or negative.
        """
        if not isinstance(order, int | np.integer) or order < 0:
            raise GenProfileError(f"The order of a derivative is 0, 1, 2 and so on, found {order!r}.")
        return self._evaluated(times, (order,))[0]

    def _evaluated(self, times: Array | float, orders: Sequence[int]) -> list[Array]:
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if times.ndim > 1:
            raise GenProfileError(f"One time or a row of times is expected, found an array {times.shape}.")
        beyond = (times - self.duration)[:, None]
        ahead = (self.target + beyond * self.final_velocity, self.final_velocity)
        moving = (times >= 0.0) & (beyond[:, 0] < 0.0)
        segment = np.searchsorted(self.knots, times[moving], side="right") - 1
        local = (times[moving] - self.knots[segment])[:, None]
        by_order = []
        for order in orders:
            values = np.zeros((len(times), self.axes))
            values[:] = ahead[order] if order < len(ahead) else 0.0
            values[times < 0.0] = self.start if order == 0 else 0.0
            values[moving] = polynomial.polyval(local, self._derived(order)[:, segment], tensor=False)
            by_order.append(values)
        return by_order

    def __call__(self, times: Array | float) -> Motion:
        """Evaluate position, velocity, acceleration and jerk at times in s; a single one is one sample."""
        position, velocity, acceleration, jerk = self._evaluated(times, range(4))
        return Motion(position=position, velocity=velocity, acceleration=acceleration, jerk=jerk)

    def within_segments(self, points: int, order: int) -> tuple[Array, Array]:
        """Evaluate on `points` evenly spaced times per segment, both ends included, so that jumps show.

        Returns
        -------
        times : (segments * points,) array
        values : (segments * points, axes) array
        """
        length = np.diff(self.knots)[:, None]
        local = length * np.linspace(0.0, 1.0, points)
        coefficients = self._derived(order)[:, :, None, :]
        values: Array = np.asarray(polynomial.polyval(local[:, :, None], coefficients, tensor=False))
        times: Array = self.knots[:-1, None] + local
        return times.ravel(), values.reshape(-1, self.axes)

    def _derived(self, order: int) -> Array:
        """Coefficients of a derivative, at least one, shape (powers, segments, axes)."""
        derived = self.coefficients
        for _ in range(min(order, derived.shape[1])):
            derived = derived[:, 1:] * np.arange(1.0, derived.shape[1])[:, None]
        powers = np.moveaxis(derived, 1, 0)
        return powers if len(powers) else np.zeros((1, *powers.shape[1:]))

    def payload_hash(self) -> str:
        """SHA-256 of the numbers, in hexadecimal: the identity of the motion, whatever format carries it."""
        onward = (self.final_velocity,) if self.final_velocity.any() else ()  # formats that stop tell none
        return _sha256(self.knots, self.coefficients, self.target, *onward)


def grid_length(duration: float, cycle_time: float) -> int:
    """Count the cycles that cover a duration, in decimal arithmetic.

    ``0.07 / 0.005`` is a little more than 14 in floats; the decimal texts of the two numbers divide exactly.
    """
    quotient = Decimal(repr(float(duration))) / Decimal(repr(float(cycle_time)))
    return int(quotient.to_integral_value(rounding=ROUND_CEILING))


@lru_cache(maxsize=16)
def grid_times(cycles: int, cycle_time: float) -> Array:
    """List the times ``k * cycle_time`` for k = 0 … cycles, each the double nearest to the decimal product.

    Python's division of two integers is correctly rounded, whatever their size. The array is read-only.
    """
    numerator, denominator = Decimal(repr(float(cycle_time))).as_integer_ratio()
    return read_only([k * numerator / denominator for k in range(cycles + 1)])


def grid_duration(duration: float, cycle_time: float) -> float:
    """Round a duration up to whole cycles, as `grid_times` has them."""
    numerator, denominator = Decimal(repr(float(cycle_time))).as_integer_ratio()
    return grid_length(duration, cycle_time) * numerator / denominator


@attrs.frozen(kw_only=True, eq=False, repr=False)
class SampledProfile(Summarised, Tabled):
    """What a controller issues each cycle: one setpoint per cycle and axis, the first at time 0.

    Attributes
    ----------
    cycle_time : float
        s.
    position : (samples, axes) array
        m (or rad); the last sample is held from then on.
    velocity, acceleration, jerk : (samples, axes) array or None
        What the artefact carries beside positions.
    resolution : (axes,) array
        Spacing of the values that the artefact can represent; 0 where it carries doubles.

    Examples
    --------
    >>> setpoints = gp.SampledProfile(cycle_time=0.5, position=[[0.0], [0.1], [0.2]])
    >>> setpoints.position.shape
    (3, 1)
    """

    cycle_time: float
    position: Array = attrs.field(converter=read_only, validator=_finite)
    velocity: Array | None = attrs.field(default=None, converter=optional(read_only), validator=_finite)
    acceleration: Array | None = attrs.field(default=None, converter=optional(read_only), validator=_finite)
    jerk: Array | None = attrs.field(default=None, converter=optional(read_only), validator=_finite)
    resolution: Array = attrs.field(converter=read_only, validator=_finite)

    @resolution.default
    def _exact(self) -> Array:
        return np.zeros(self.position.shape[1:])

    def __attrs_post_init__(self) -> None:
        if self.position.ndim != 2 or len(self.position) < 2:
            raise GenProfileError(
                "A sampled profile needs positions of the shape (samples, axes), at least two samples of one "
                f"axis, found {self.position.shape}."
            )
        for values in (self.velocity, self.acceleration, self.jerk):
            if values is not None and values.shape != self.position.shape:
                raise GenProfileError("A sampled profile's columns differ in length.")
        _require_cycle(self.cycle_time)

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        samples, axes = self.position.shape
        return {"axes": axes, "samples": samples, "cycle time": f"{self.cycle_time:g} s"}

    def records(self) -> list[dict[str, object]]:
        """List the samples: time, and what the artefact carries, in m or rad and s; axes by number from 1."""
        carried = columns_of(self)
        axes = self.position.shape[1]
        names = [name if axes == 1 else f"{name}_{axis}" for name in carried for axis in range(1, axes + 1)]
        rows = np.column_stack([self.times, *carried.values()]).tolist()
        return [dict(zip(["time", *names], row, strict=True)) for row in rows]

    @property
    def times(self) -> Array:
        """Times of the samples in s, shape (samples,)."""
        return grid_times(len(self.position) - 1, self.cycle_time)

    def payload_hash(self) -> str:
        """SHA-256 of the position setpoints and the cycle time, in hexadecimal."""
        return _sha256(np.float64(self.cycle_time), self.position)


def columns_of(table: Any) -> dict[str, Array]:
    """Give position, velocity, acceleration and jerk by name, as far as a table carries them."""
    names = ("position", "velocity", "acceleration", "jerk")
    return {name: values for name in names if (values := getattr(table, name)) is not None}


def sample(profile: Profile, cycle_time: float) -> SampledProfile:
    """Sample a profile on the cycle grid; the last sample is the first one at or after its end.

    Raises
    ------
    GenProfileError
        It is no profile, or the cycle time in s is not positive, or too short for a motion so long.

    Examples
    --------
    >>> gp.sample(gp.plan(gp.preset_spec("paper")).motion, cycle_time=0.01).position.shape
    (301, 1)
    """
    require_motion(profile)
    _require_cycle(cycle_time)
    if profile.duration / cycle_time > MOST_SAMPLES:
        raise GenProfileError(f"A motion of {profile.duration:g} s has too many cycles of {cycle_time:g} s.")
    times = grid_times(grid_length(profile.duration, cycle_time), cycle_time)
    motion = profile(times)
    return SampledProfile(
        cycle_time=cycle_time,
        position=motion.position,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        jerk=motion.jerk,
    )


def require_motion(value: object) -> None:
    """Refuse, by a `SpecError`, what is no profile: most often a plan, which holds one."""
    if not isinstance(value, Profile):
        raise SpecError(f"A Profile is expected, such as gp.plan(spec).motion, found {found(value)}.")


def require_samples(value: object, axes: int) -> None:
    """Refuse, by a `SpecError`, what is no sampled profile, most often not sampled yet, or of other axes."""
    if not isinstance(value, SampledProfile):
        known = "gp.sample(motion, cycle_time=0.01)"
        raise SpecError(f"A SampledProfile is expected, such as {known} gives, found {found(value)}.")
    if value.position.shape[1] != axes:
        raise SpecError(f"The setpoints are for {value.position.shape[1]} axes, and the machine has {axes}.")


def _require_cycle(cycle_time: float) -> None:
    if not isinstance(cycle_time, Real) or not (np.isfinite(cycle_time) and cycle_time > 0.0):
        raise GenProfileError("A sampled profile's cycle time must be positive.")


def _sha256(*arrays: object) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        contiguous = np.ascontiguousarray(array, dtype="<f8")
        digest.update(repr(contiguous.shape).encode("ascii"))
        digest.update(contiguous.tobytes())
    return digest.hexdigest()
