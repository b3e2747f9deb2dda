"""Affine arithmetic: balls that know how they depend on the parameters, to first order.

A number is mid + Σ slopes[k] ε_k, to within rad, where ε_k is anything in the disc around 0 of radius
reach[k]. A parameter that stands in a formula twice does not count twice so, as it does for balls: the
determinant of a crane's matrix of inertia is a small difference of terms that change with the ropes alike.
(J. Stolfi and L. H. de Figueiredo, Self-validated numerical methods and applications, 1997.)
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import LEAST, UNIT, UPWARD, Array, Ball, Operand, ball


@attrs.frozen(eq=False, slots=True)
class Affine:
    """Numbers that depend on parameters; all that are used together have the same reach.

    Attributes
    ----------
    mid : array
    slopes : mapping of int to array
        Where they are not nothing.
    rad : array
    reach : mapping of int to array
    """

    mid: Array
    slopes: Mapping[int, Array]
    rad: Array
    reach: Mapping[int, Array]

    # so that NumPy leaves `array * affine` to the latter
    __array_ufunc__ = None

    @property
    def off(self) -> Array:
        """Bound how far a number is from its midpoint."""
        return self.beyond(())

    @property
    def ball(self) -> Ball:
        """Forget what depends on what."""
        return Ball(self.mid, self.off)

    def beyond(self, linear: Collection[int]) -> Array:
        """Bound how far a number is from a linear function of some of what it depends on."""
        others = {k: slope for k, slope in self.slopes.items() if k not in linear}
        return np.asarray((self._turned(others) + self.rad) * UPWARD)

    def _turned(self, slopes: Mapping[int, Array]) -> Array:
        """Bound what slopes add up to."""
        return np.asarray(sum((np.abs(slope) * self.reach[k] for k, slope in slopes.items()), start=0.0))

    def _made(self, mid: Array, slopes: Mapping[int, Array], error: Array, size: Array) -> Affine:
        """Add rounding, of numbers that are at most so large."""
        return Affine(mid, slopes, (error + 8.0 * UNIT * size) * UPWARD + LEAST, self.reach)

    def _like(self, value: AffineOperand) -> Affine:
        return value if isinstance(value, Affine) else constant(value, self.reach)

    def __add__(self, other: AffineOperand) -> Affine:
        """Add."""
        b = self._like(other)
        mid, slopes = self.mid + b.mid, _sum(self.slopes, 1.0, b.slopes, 1.0)
        return self._made(mid, slopes, self.rad + b.rad, np.abs(mid) + self._turned(slopes))

    def __neg__(self) -> Affine:
        """Negate."""
        return Affine(-self.mid, {k: -slope for k, slope in self.slopes.items()}, self.rad, self.reach)

    def __sub__(self, other: AffineOperand) -> Affine:
        """Subtract."""
        return self + -self._like(other)

    def __rsub__(self, other: AffineOperand) -> Affine:
        """Subtract from another."""
        return -self + other

    def __mul__(self, other: AffineOperand) -> Affine:
        """Multiply."""
        b = self._like(other)
        mid, slopes = self.mid * b.mid, _sum(self.slopes, b.mid, b.slopes, self.mid)
        sizes, offs = (np.abs(self.mid), np.abs(b.mid)), (self.off, b.off)
        error = sizes[0] * b.rad + sizes[1] * self.rad + offs[0] * offs[1]
        return self._made(mid, slopes, error, np.abs(mid) + sizes[0] * offs[1] + sizes[1] * offs[0])

    def __truediv__(self, other: AffineOperand) -> Affine:
        """Divide; by what may be zero gives everything: a/b = q + n/m − n (b − m)/(m b), with n = a − q b."""
        b = self._like(other)
        mid, size, off = self.mid / b.mid, np.abs(b.mid), b.off
        slopes = {k: s / b.mid for k, s in _sum(self.slopes, 1.0, b.slopes, -mid).items()}
        rest = self.rad + np.abs(mid) * b.rad + 4.0 * UNIT * np.abs(self.mid) + LEAST
        whole = rest + self._turned({k: s * b.mid for k, s in slopes.items()})
        ratio = np.where(off < size, off / (size - off) + LEAST, np.inf)
        error = rest / size + whole / size * ratio
        return self._made(mid, slopes, error, np.abs(mid) + (self.off + np.abs(mid) * off) / size)

    def __rtruediv__(self, other: AffineOperand) -> Affine:
        """Divide another."""
        return self._like(other) / self

    __radd__ = __add__
    __rmul__ = __mul__


AffineOperand = Affine | Operand


def constant(value: Operand, reach: Mapping[int, Array]) -> Affine:
    """Take numbers that depend on no parameter."""
    x = ball(value)
    return Affine(np.asarray(x.mid), {}, np.asarray(x.rad), reach)


def _sum(
    a: Mapping[int, Array], by_a: Array | float, b: Mapping[int, Array], by_b: Array | float
) -> dict[int, Array]:
    """Add multiples of slopes."""
    total = {k: slope * by_a for k, slope in a.items()}
    for k, slope in b.items():
        total[k] = total[k] + slope * by_b if k in total else slope * by_b
    return total


def sine_like(value: Callable[[Array], Array], slope: Callable[[Array], Array]) -> Callable[[Affine], Affine]:
    """Enclose f with f'' = ±f: f(m + d) is f(m) cos d + f'(m) sin d, or the same of cosh and sinh."""

    def enclosed(x: Affine) -> Affine:
        mid, along, off = value(x.mid), slope(x.mid), x.off
        sizes = (np.abs(one) + LEAST for one in (mid, along))  # which may have vanished
        bent = next(sizes) * 2.0 * np.sinh(0.5 * off) ** 2 + next(sizes) * off**3 / 6.0 * np.cosh(off)
        slopes = {k: one * along for k, one in x.slopes.items()}
        return x._made(mid, slopes, np.abs(along) * x.rad + bent, np.abs(mid) + np.abs(along) * off)

    return enclosed
