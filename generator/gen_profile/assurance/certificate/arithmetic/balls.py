"""Ball arithmetic on arrays: numbers that are known to lie within a radius of a midpoint.

A ball is a disc of the complex plane with its midpoint on the real axis. So the same evaluation encloses
rounding (tiny radii), ranges of real values, and the values of an analytic function on an ellipse around an
interval, which bound what a polynomial misses of it.

Numbers of an array may share a radius: along axes on which `rad` has length 1 and `mid` has not. Then it is
the greatest of theirs, and operations cost little more than those on plain numbers.

Radii are rounded up by a factor that is more than what the few operations of any formula here can lose.
The four operations and roots of IEEE 754 are exact to half a unit; functions of NumPy's are taken to be
exact to sixteen. A midpoint or radius that is not finite encloses everything, and proves nothing.
(S. M. Rump, Verification methods, Acta Numerica 19, 2010; J. van der Hoeven, Ball arithmetic, 2009.)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNIT = 2.0**-52  # relative, twice what a basic operation errs by
FUNCTION = 2.0**-49  # likewise of NumPy's functions
UPWARD = 1.0 + 2.0**-47  # outweighs some thirty operations on radii
LEAST = 1e-300  # outweighs underflow
MOST_FACTORS = 16  # as which a power is multiplied out


@attrs.frozen(eq=False, slots=True)
class Ball:
    """Numbers within `rad` of `mid`, which broadcast against one another.

    Attributes
    ----------
    mid, rad : array or float
    """

    mid: Any
    rad: Any
    _size: Any = None

    # so that NumPy leaves `array * ball` to the ball
    __array_ufunc__ = None

    def __add__(self, other: Operand) -> Ball:
        """Add."""
        b = ball(other)
        return _rounded(self.mid + b.mid, self.rad + b.rad)

    def __sub__(self, other: Operand) -> Ball:
        """Subtract."""
        b = ball(other)
        return _rounded(self.mid - b.mid, self.rad + b.rad)

    def __mul__(self, other: Operand) -> Ball:
        """Multiply."""
        b = ball(other)
        return _rounded(self.mid * b.mid, self.size * b.rad + self.rad * (b.size + b.rad))

    def __truediv__(self, other: Operand) -> Ball:
        """Divide; by what may be zero gives everything."""
        b = ball(other)
        mid, rads = self.mid / b.mid, (self.rad, b.rad)
        away = -_shared(-np.abs(b.mid), *rads) - b.rad
        error = self.rad + _shared(np.abs(mid), *rads) * b.rad + UNIT * self.size + LEAST  # before dividing
        return _rounded(mid, np.where(away > 0.0, error / away, np.inf))

    def __neg__(self) -> Ball:
        """Negate, exactly."""
        return Ball(-self.mid, self.rad)

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Operand) -> Ball:
        """Subtract from another."""
        return ball(other) - self

    def __rtruediv__(self, other: Operand) -> Ball:
        """Divide another."""
        return ball(other) / self

    def __getitem__(self, key: Any) -> Ball:
        """Take some of the numbers."""
        return Ball(self.mid[key], self.rad[key] if np.ndim(self.rad) else self.rad)

    def reshape(self, *shape: int) -> Ball:
        """Take the numbers in another shape."""
        return Ball(np.reshape(self.mid, shape), np.reshape(self.rad, shape))

    @property
    def size(self) -> Any:
        """Upper bound of midpoints, one for all numbers that share a radius."""
        if self._size is None:
            object.__setattr__(self, "_size", _shared(np.abs(self.mid), self.rad))
        return self._size

    @property
    def most(self) -> Array:
        """Upper bound of the absolute value."""
        return np.asarray((np.abs(self.mid) + self.rad) * UPWARD)

    @property
    def upper(self) -> Array:
        """Upper bound of the value."""
        return np.asarray(self.mid + self.rad * UPWARD + UNIT * np.abs(self.mid))

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the numbers."""
        return np.broadcast_shapes(np.shape(self.mid), np.shape(self.rad))


Operand = Ball | Array | float


def ball(value: Operand) -> Ball:
    """Take numbers as they are, exactly."""
    if isinstance(value, Ball):
        return value
    # 1/0 raises of Python's numbers
    return Ball(np.float64(value) if isinstance(value, (int, float)) else value, 0.0)


def stack(balls: list[Ball], axis: int = 0) -> Ball:
    """Join balls of different shapes along a new axis."""
    shape = np.broadcast_shapes(*(one.shape for one in balls))
    mids = [np.broadcast_to(one.mid, shape) for one in balls]
    return Ball(np.stack(mids, axis), np.stack([np.broadcast_to(one.rad, shape) for one in balls], axis))


def concatenate(balls: list[Ball]) -> Ball:
    """Join balls along their first axis."""
    rads = [np.broadcast_to(one.rad, np.shape(one.mid)) for one in balls]
    return Ball(np.concatenate([one.mid for one in balls]), np.concatenate(rads))


def matmul(a: Operand, b: Operand) -> Ball:
    """Multiply matrices; a sum of n products errs by at most n units of the sum of its absolute terms."""
    a, b = ball(a), ball(b)
    (mid_a, rad_a), (mid_b, rad_b) = ((x.mid, np.broadcast_to(x.rad, np.shape(x.mid))) for x in (a, b))
    terms = np.shape(mid_a)[-1] + 2
    sizes = np.abs(mid_b)
    if isinstance(a.rad, float) and a.rad == 0.0:
        error = np.abs(mid_a) @ (rad_b + terms * UNIT * sizes)
    else:
        error = np.abs(mid_a) @ (rad_b + terms * UNIT * sizes) + rad_a @ (sizes + rad_b)
    return Ball(mid_a @ mid_b, error * (1.0 + 2 * terms * UNIT) * UPWARD + LEAST)


def shared(x: Ball, axes: tuple[int, ...]) -> Ball:
    """Let numbers share a radius along axes."""
    rad = np.broadcast_to(x.rad, np.shape(x.mid))
    return Ball(x.mid, rad.max(axis=axes, keepdims=True))


def _shared(values: Any, *rads: Any) -> Any:
    """Take the greatest of values for numbers that share a radius."""
    shape, own = np.broadcast_shapes(*map(np.shape, rads)), np.shape(values)
    if len(shape) != len(own) or shape == own:
        return values
    axes = tuple(axis for axis, (one, many) in enumerate(zip(shape, own, strict=True)) if one < many)
    return values.max(axis=axes, keepdims=True)


def _rounded(mid: Any, error: Any, unit: float = UNIT) -> Ball:
    """Add the rounding of a midpoint to what else it misses."""
    size = _shared(np.abs(mid), error)
    return Ball(mid, (error + unit * size) * UPWARD + LEAST, size)


def _evaluated(mid: Any, error: Any, x: Ball) -> Ball:
    """Take what a function of NumPy's gives, and what it misses over x."""
    return _rounded(mid, _shared(error, x.rad), FUNCTION)


def _sine_like(value: Callable[[Any], Any], slope: Callable[[Any], Any]) -> Callable[[Ball], Ball]:
    """Enclose f with f'' = ±f: f(m + d) is f(m) cos d + f'(m) sin d, or the same of cosh and sinh."""

    def enclosed(x: Ball) -> Ball:
        rad = x.rad * UPWARD
        mid, along = value(x.mid), np.abs(slope(x.mid))
        return _evaluated(mid, along * np.sinh(rad) + np.abs(mid) * 2.0 * np.sinh(0.5 * rad) ** 2, x)

    return enclosed


sin = _sine_like(np.sin, np.cos)
cos = _sine_like(np.cos, np.sin)
sinh = _sine_like(np.sinh, np.cosh)
cosh = _sine_like(np.cosh, np.sinh)


def exp(x: Ball) -> Ball:
    """Enclose e to the power: |e^d − 1| ≤ e^|d| − 1."""
    mid = np.exp(x.mid)
    return _evaluated(mid, (mid + LEAST) * np.expm1(x.rad), x)


def sqrt(x: Ball) -> Ball:
    """Enclose the root: off by most at the end next to zero."""
    ratio = np.where(x.rad < x.mid, x.rad / x.mid, np.nan) * UPWARD
    mid = np.sqrt(np.where(x.mid > 0.0, x.mid, np.nan))
    exact = (np.asarray(x.mid) == 0.0) & (np.asarray(x.rad) == 0.0)
    root = _evaluated(mid, mid * ratio / (1.0 + np.sqrt(np.maximum(1.0 - ratio, 0.0))), x)
    return Ball(np.where(exact, 0.0, root.mid), _shared(np.where(exact, 0.0, root.rad), x.rad))


def log(x: Ball) -> Ball:
    """Enclose the natural logarithm: off by most at the end next to zero."""
    ratio = np.where(x.rad < x.mid, x.rad / x.mid, np.nan) * UPWARD
    return _evaluated(np.log(np.where(x.mid > 0.0, x.mid, np.nan)), -np.log1p(-ratio), x)


def tanh(x: Ball) -> Ball:
    """Enclose the hyperbolic tangent: by its addition theorem with |tanh d| ≤ tan |d|, or by u = e^−2|m|."""
    mid = np.tanh(x.mid)
    off = np.tan(np.where(x.rad < 1.5, x.rad, np.nan)) * UPWARD
    near = np.where((away := 1.0 - np.abs(mid) * off) > 0.0, off / np.cosh(x.mid) ** 2 / away, np.inf)
    small = np.exp(-2.0 * np.abs(x.mid))
    far = np.where(
        (away := 1.0 - small * np.exp(2.0 * x.rad) * UPWARD) > 0.0,
        2.0 * small * np.expm1(2.0 * x.rad) / away,
        np.inf,
    )
    return _evaluated(mid, np.fmin(near, far), x)


def tan(x: Ball) -> Ball:
    """Enclose the tangent."""
    return sin(x) / cos(x)


def absolute(x: Ball) -> Ball:
    """Enclose the absolute value where the sign is known, so that it is analytic."""
    return Ball(np.abs(x.mid), _shared(np.where(x.rad < np.abs(x.mid), x.rad, np.nan), x.rad))


def sign(x: Ball) -> Ball:
    """Tell the sign where it is known."""
    return Ball(np.sign(x.mid), _shared(np.where(x.rad < np.abs(x.mid), 0.0, np.nan), x.rad))


def power(x: Any, exponent: float) -> Any:
    """Enclose a constant power."""
    if exponent == int(exponent) and abs(exponent) <= MOST_FACTORS:
        product: Any = 1.0
        for _ in range(int(abs(exponent))):
            product = product * x
        return product if exponent >= 0.0 else 1.0 / product
    if exponent in (0.5, -0.5):
        return sqrt(x) if exponent > 0.0 else 1.0 / sqrt(x)
    return exp(exponent * log(x))
