"""Derivatives along given directions: numbers with nilpotent parts.

A jet is a sum of parts, each times a product of some of the units ε₀, ε₁, …, whose squares are 0; bit k of a
part's key stands for ε_k. What multiplies ε₀ in f(x + ε₀ a) is the derivative of f along a, what multiplies
ε₀ ε₁ in f(x + ε₀ a + ε₁ b) the second one along a and b, and so on. Parts are balls, or power series of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, cycle, repeat
from math import factorial
from operator import mul
from typing import Any

Scalar = Any  # of python-flint: arb, arb_series; or a number of Python's
SINGLE = 1 << 9  # the first of units of which no two are multiplied: all slopes at once


class Jet:
    """Parts by the bits of their units."""

    __slots__ = ("parts",)

    def __init__(self, parts: dict[int, Scalar]) -> None:
        self.parts = parts

    def __add__(self, other: Scalar) -> Jet:
        """Add."""
        parts = dict(self.parts)
        for key, value in parts_of(other).items():
            parts[key] = parts[key] + value if key in parts else value
        return Jet(parts)

    def __mul__(self, other: Scalar) -> Jet:
        """Multiply, without squares of units."""
        if not isinstance(other, Jet):
            return Jet({key: value * other for key, value in self.parts.items()})
        parts: dict[int, Scalar] = {}
        every = list(other.parts.items())
        common = [part for part in every if part[0] < SINGLE]
        for one, first in self.parts.items():
            for two, second in every if one < SINGLE else common:
                if not one & two:
                    product = first * second
                    parts[one | two] = parts[one | two] + product if one | two in parts else product
        return Jet(parts)

    def __neg__(self) -> Jet:
        """Negate."""
        return Jet({key: -value for key, value in self.parts.items()})

    def __sub__(self, other: Scalar) -> Scalar:
        """Subtract."""
        return self + -other

    def __rsub__(self, other: Scalar) -> Scalar:
        """Subtract from another."""
        return -self + other

    def __truediv__(self, other: Scalar) -> Scalar:
        """Divide."""
        return self * inverse(other)

    def __rtruediv__(self, other: Scalar) -> Scalar:
        """Divide another."""
        return inverse(self) * other

    __radd__ = __add__
    __rmul__ = __mul__


def parts_of(x: Scalar) -> dict[int, Scalar]:
    """List the parts of a jet, or of another number its only one."""
    return x.parts if isinstance(x, Jet) else {0: x}


def _expanded(x: Jet, slopes: Iterator[Scalar]) -> Jet:
    """Sum up powers of the part with units, each times the next of a function's slopes over a factorial."""
    rest = power = Jet({key: value for key, value in x.parts.items() if key})
    total = Jet({0: next(slopes)})
    while power.parts:
        total, power = total + power * next(slopes), power * rest
    return total


def inverse(x: Scalar) -> Scalar:
    """Give 1/x: of m + n, Σ (−n)^k / m^(k+1)."""
    if not isinstance(x, Jet):
        return 1 / x
    once = 1 / x.parts[0]
    return _expanded(x, accumulate(repeat(-once), mul, initial=once))


def sine_cosine(x: Scalar) -> tuple[Scalar, Scalar]:
    """Give sine and cosine, by their series of Taylor."""
    sine, cosine = parts_of(x)[0].sin_cos()
    if not isinstance(x, Jet):
        return sine, cosine
    slopes = [sine, cosine, -sine, -cosine]
    first, second = (
        _expanded(x, (slope / factorial(n) if n > 1 else slope for n, slope in enumerate(cycle(each))))
        for each in (slopes, slopes[1:] + slopes[:1])
    )
    return first, second


def moved(values: Sequence[Scalar], directions: Sequence[Scalar], unit: int) -> list[Scalar]:
    """Add directions times a unit to values."""
    return [
        one
        if isinstance(way, int) and way == 0
        else Jet({**parts_of(one), **{key | unit: value for key, value in parts_of(way).items()}})
        for one, way in zip(values, directions, strict=True)
    ]


def along(x: Scalar, unit: int) -> Scalar:
    """Take what a unit multiplies."""
    parts = {key ^ unit: value for key, value in parts_of(x).items() if key & unit}
    return 0 if not parts else parts[0] if parts.keys() == {0} else Jet(parts)


def derivatives(
    function: Callable[..., Sequence[Scalar]], *arguments: Sequence[Scalar]
) -> list[list[Scalar]]:
    """List the derivatives of all values of a function by all its arguments, a row for each value."""
    units = [SINGLE << number for number in range(sum(map(len, arguments)))]
    left = iter(units)
    columns = [[moved([entry], [1], next(left))[0] for entry in one] for one in arguments]
    return [[along(one, unit) for unit in units] for one in function(*columns)]
