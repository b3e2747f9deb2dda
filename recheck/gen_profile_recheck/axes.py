"""The axes: straight lines between setpoints, and how far they are from the certificate's smooth motion.

On every piece the difference of positions is ε = ε̄ + ψ', where ε̄ is its mean and ψ vanishes at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

from flint import arb, arb_poly

X = arb_poly([0, 1])
Run = tuple[arb, arb_poly]  # a part of a piece: its share of it, and a polynomial on −1 … 1


@dataclass(frozen=True)
class Size:
    """Bounds of a function on a piece of time: of its absolute value, and of its root mean square."""

    most: arb
    mean: arb


@dataclass(frozen=True)
class AxisPiece:
    """One axis on a piece: its smooth position as a polynomial on −1 … 1, and the sizes of ε, ε' and ψ.

    `average` bounds ε̄, and `first` ε where the piece begins, in m (or rad).
    """

    smooth: arb_poly
    gap: Size
    rate: Size
    swing: Size
    average: arb
    first: arb


def quintic(
    half: arb, positions: Sequence[float], speeds: Sequence[float], accelerations: Sequence[float]
) -> arb_poly:
    """Give the polynomial on −1 … 1 with position, velocity and acceleration at both ends."""

    def at_end(x: arb_poly, value: arb, slope: arb, bend: arb) -> arb_poly:
        """Have these where x is 1, and three times 0 where it is −1."""
        near, second = 1 - x, value * 3 / 2 - slope
        third = bend / 2 + second * 3 / 2 - value * 3 / 4
        return (1 - arb(0.5) * near) ** 3 * (value + second * near + third * near * near)

    (p, q), (u, v), (b, c) = (
        [half**n * one for one in pair] for n, pair in enumerate([positions, speeds, accelerations])
    )
    return at_end(X, q, v, c) + at_end(-X, p, -u, b)


def axis_pieces(
    knots: Sequence[float],
    smooth: Sequence[arb_poly],
    times: Sequence[float],
    positions: Sequence[float],
    velocity: float,
) -> Iterator[AxisPiece]:
    """Bound how far an axis is from a smooth motion, piece by piece; its knots are times of setpoints."""
    place = {time: number for number, time in enumerate(times)}
    for (begin, end), polynomial in zip(pairwise(knots), smooth, strict=True):
        if begin < times[-1]:
            rows = range(place[begin], place[end] + 1)
            corners = [(arb(times[row]), arb(positions[row])) for row in rows]
        else:
            since = [arb(time) - times[-1] for time in (begin, end)]
            corners = [(one + times[-1], positions[-1] + one * velocity) for one in since]
        yield _piece(polynomial, corners)


def _piece(smooth: arb_poly, corners: Sequence[tuple[arb, arb]]) -> AxisPiece:
    (begin, first), (end, _) = corners[0], corners[-1]
    half, gaps, swings = (end - begin) / 2, list[Run](), list[Run]()
    for (time, position), (later, farther) in pairwise(corners):
        share = (later - time) / (end - begin)
        line = (position + farther) / 2 + (farther - position) / 2 * X
        gaps.append((share, line - smooth((time - begin) / half - 1 + share * (1 + X))))
    average, swing = sum((share * _mean(gap) for share, gap in gaps), start=arb(0)), arb(0)
    for share, gap in gaps:
        primitive = (gap - average).integral() * share * half
        swings.append((share, primitive + (swing - primitive(arb(-1)))))
        swing = swings[-1][1](arb(1))
    rates = [(share, gap.derivative() * (1 / (share * half))) for share, gap in gaps]
    off = abs(first - smooth(arb(-1)))
    return AxisPiece(smooth, _size(gaps), _size(rates), _size(swings), abs(average), off)


def _mean(polynomial: arb_poly) -> arb:
    return sum((one / (n + 1) for n, one in enumerate(polynomial.coeffs()) if n % 2 == 0), start=arb(0))


def _size(runs: Sequence[Run]) -> Size:
    square = sum((share * _mean(one * one) for share, one in runs), start=arb(0))
    return Size(reduce(arb.max, (_most(one) for _, one in runs)).abs_upper(), square.abs_upper().sqrt())


def _most(polynomial: arb_poly) -> arb:
    """Bound a polynomial on −1 … 1, taking x² as (1 + T₂)/2."""
    half = polynomial[2] / 2
    rest = [polynomial[1], *polynomial.coeffs()[3:]]
    return sum(map(abs, rest), start=abs(polynomial[0] + half) + abs(half)).abs_upper()
