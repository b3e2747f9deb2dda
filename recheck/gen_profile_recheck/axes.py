"""The axes: straight lines between setpoints, and how far they are from the certificate's smooth motion.

On every piece the difference of positions is ε = ε̄ + ψ', where ε̄ is its mean and ψ vanishes at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

from flint import arb, arb_poly

FINER = 4  # parts of a cycle, between whose ends bounds are by the greatest acceleration


@dataclass(frozen=True, eq=False)
class AxisPiece:
    """One axis on a piece of time: its smooth position as a polynomial on −1 … 1, and bounds of the rest.

    `gap` bounds |ε| in m (or rad), `rate` its rate, `mean` |ε̄|, `swing` |ψ|, and `first` |ε| at first;
    `mean_gap` and `mean_swing` the means of |ε| and |ψ| over the piece. Its parts take these `shares` of
    its time; on them `gaps` and `rates` bound |ε| and its rate.
    """

    smooth: arb_poly
    gap: arb
    rate: arb
    mean: arb
    swing: arb
    first: arb
    mean_gap: arb
    mean_swing: arb
    shares: Sequence[arb]
    gaps: Sequence[arb]
    rates: Sequence[arb]


@cache
def mean_products(pieces: tuple[AxisPiece, ...]) -> list[list[arb]]:
    """Bound the means over a piece of all products of two of every axis' |ε|, and their rates after them."""
    sizes = [*(one.gaps for one in pieces), *(one.rates for one in pieces)]
    return [[_mean(pieces[0].shares, one, two) for two in sizes] for one in sizes]


def _mean(*factors: Sequence[arb]) -> arb:
    total = arb(0)
    for share, one, two in zip(*factors, strict=True):
        total += share * one * two
    return total.abs_upper()


def magnitude(values: Sequence[arb]) -> arb:
    """Bound the absolute values of all."""
    largest = arb(0)
    for one in values:
        largest = largest.max(one.abs_upper())
    return largest


def quintic(
    half: arb, positions: Sequence[float], speeds: Sequence[float], accelerations: Sequence[float]
) -> arb_poly:
    """Give the polynomial on −1 … 1 with position, velocity and acceleration at both ends."""
    (p, q), (u, v), (b, c) = (
        positions,
        [half * one for one in speeds],
        [half * half * one for one in accelerations],
    )
    x, even, odd = (
        arb_poly([0, 1]),
        (arb(p) + q) / 2,
        (arb(q) - p) / 2,
    )  # of value, then slope and bend, that are odd where it is even
    slope, other = (v - u) / 2, (v + u) / 2
    bend, twist = (b + c) / 2, (c - b) / 2
    square = x * x - 1
    lead = (other - odd) / 2  # of x (x² − 1), whose slope at 1 is 2 and bend 6
    fifth = (twist - 6 * lead) / 8  # of x (x² − 1)², whose bend at 1 is 8
    fourth = (bend - slope) / 8  # of (x² − 1)², whose bend at 1 is 8, beside slope/2 (x² − 1)
    return even + odd * x + slope / 2 * square + lead * x * square + (fourth + fifth * x) * square * square


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
        yield _piece(polynomial, list(_finer(corners)))


def _finer(corners: Sequence[tuple[arb, arb]]) -> Iterator[tuple[arb, arb]]:
    for (time, position), (later, farther) in pairwise(corners):
        for part in range(FINER):
            yield time + (later - time) * part / FINER, position + (farther - position) * part / FINER
    yield corners[-1]


def _piece(smooth: arb_poly, points: Sequence[tuple[arb, arb]]) -> AxisPiece:
    begin, end = points[0][0], points[-1][0]
    half, primitive, slope = (end - begin) / 2, smooth.integral(), smooth.derivative()
    bend = sum((abs(one) for one in slope.derivative().coeffs()), start=arb(0)) / half**2
    local = [(time - begin) / half - 1 for time, _ in points]
    off = [position - smooth(x) for (_, position), x in zip(points, local, strict=True)]
    rates, area, areas, longest, steps = [], arb(0), [arb(0)], arb(0), []
    for ((time, position), (later, farther)), (x, y) in zip(pairwise(points), pairwise(local), strict=True):
        step = later - time
        rates.append((farther - position) / step - slope((x + y) / 2) / half)
        area += step * (position + farther) / 2 - half * (primitive(y) - primitive(x))
        areas.append(area)
        longest = longest.max(step.abs_upper())
        steps.append(step)
    mean = area / (end - begin)
    swings = [abs(one - mean * (time - begin)) for one, (time, _) in zip(areas, points, strict=True)]
    rates = [abs(one) + bend * longest / 2 for one in rates]
    gaps = [magnitude(pair) + bend * longest**2 / 8 for pair in pairwise(off)]
    swung = [
        magnitude(pair) + rate * longest**2 / 8 for pair, rate in zip(pairwise(swings), rates, strict=True)
    ]
    shares = [step / (end - begin) for step in steps]
    whole = [arb(1)] * len(shares)
    return AxisPiece(
        smooth=smooth,
        gap=magnitude(gaps),
        rate=magnitude(rates),
        mean=magnitude([mean]),
        swing=magnitude(swung),
        first=magnitude(off[:1]),
        mean_gap=_mean(shares, gaps, whole),
        mean_swing=_mean(shares, swung, whole),
        shares=shares,
        gaps=gaps,
        rates=rates,
    )
