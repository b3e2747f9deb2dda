"""Derivatives along given directions: numbers with nilpotent parts.

A jet is a sum of parts, each times a product of some of the units ε₀, ε₁, …, whose squares are 0; bit k of a
part's key stands for ε_k. What multiplies ε₀ in f(x + ε₀ a) is the derivative of f along a, what multiplies
ε₀ ε₁ in f(x + ε₀ a + ε₁ b) the second one along a and b, and so on. Parts are real or complex balls, or power
series of balls in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Scalar = Any  # of python-flint: arb, acb, arb_series; or a number of Python's


SINGLE = 1 << 9  # the first of units of which no two are multiplied: all slopes at once


class Jet:
    """Parts by the bits of their units."""

    __slots__ = ("parts",)

    def __init__(self, parts: dict[int, Scalar]) -> None:
        self.parts = parts

    def __add__(self, other: Scalar) -> Jet:
        """Add."""
        parts = dict(self.parts)
        for key, value in _parts(other).items():
            parts[key] = parts[key] + value if key in parts else value
        return Jet(parts)

    def __mul__(self, other: Scalar) -> Jet:
        """Multiply, without squares of units."""
        if not isinstance(other, Jet):
            return Jet({key: value * other for key, value in self.parts.items()})
        parts: dict[int, Scalar] = {}
        for one, first in self.parts.items():
            for two, second in other.parts.items():
                if not (one & two or (one >= SINGLE <= two)):
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


def _parts(x: Scalar) -> dict[int, Scalar]:
    return x.parts if isinstance(x, Jet) else {0: x}


def _split(x: Jet) -> tuple[Scalar, Jet]:
    """Take the part without units, and the rest, of which a power is nothing."""
    return x.parts[0], Jet({key: value for key, value in x.parts.items() if key})


def inverse(x: Scalar) -> Scalar:
    """Give 1/x: of m + n, Σ (−n)^k / m^(k+1)."""
    if not isinstance(x, Jet):
        return 1 / x
    main, rest = _split(x)
    once = 1 / main
    term = total = Jet({0: once})
    while (term := -(term * rest * once)).parts:
        total = total + term
    return total


def sine_cosine(x: Scalar) -> tuple[Scalar, Scalar]:
    """Give sine and cosine, by their addition theorems and the power series of the rest."""
    if not isinstance(x, Jet):
        return x.sin(), x.cos()
    main, rest = _split(x)
    sine, cosine = main.sin(), main.cos()
    sums, term, order = [Jet({0: 1}), Jet({})], Jet({0: 1}), 0  # of cos and sin of the rest
    while (term := term * rest).parts:
        order += 1
        term = term * (1 / sine_type(order, main))
        sums[order % 2] = sums[order % 2] + (term if order % 4 < 2 else -term)
    return sums[0] * sine + sums[1] * cosine, sums[0] * cosine - sums[1] * sine


def sine_type(order: int, like: Scalar) -> Scalar:
    """Take a whole number as one of a kind, so that 1 over it is rounded as a ball."""
    return like * 0 + order


def moved(values: Sequence[Scalar], directions: Sequence[Scalar], unit: int) -> list[Scalar]:
    """Add directions times a unit to values."""
    return [
        one
        if isinstance(way, int) and way == 0
        else Jet({**_parts(one), **{key | unit: value for key, value in _parts(way).items()}})
        for one, way in zip(values, directions, strict=True)
    ]


def along(x: Scalar, unit: int) -> Scalar:
    """Take what a unit multiplies."""
    parts = {key ^ unit: value for key, value in _parts(x).items() if key & unit}
    return 0 if not parts else parts[0] if parts.keys() == {0} else Jet(parts)
