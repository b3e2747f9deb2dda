"""Bounds of an expansion, by halving the ranges of time and parameters."""

from __future__ import annotations

from functools import cache

from flint import arb, arb_mat, arb_poly

from gen_profile_recheck.boxes import Expansion, chebyshev_value, from_powers, transformed

MOST_PARTS = 4000  # of a piece and its ranges, to bound a sway


def keeps(one: Expansion, allowed: arb) -> bool:
    """Tell whether a function's absolute value is proved to be at most so much, halving where it is not."""
    waiting = [one]
    for _ in range(MOST_PARTS):
        if not waiting:
            return True
        part = waiting.pop()
        if part.size <= allowed:
            continue
        if not part.rest < allowed or not part.coefficients[0].is_finite():
            return False
        axis = _steepest(part)
        waiting += [_half(part, axis, side) for side in (-1, 1)]
    return False


def _steepest(one: Expansion) -> int:
    """Choose the variable whose own terms are greatest."""
    sizes, axes = [abs(entry) for entry in one.coefficients], range(len(one.counts))

    def own_terms(axis: int) -> float:
        weights = ([k * k if n == axis else 1 for k in range(count)] for n, count in enumerate(one.counts))
        return float(transformed([arb_mat([each]) for each in weights], sizes)[0].mid())

    return max(axes, key=own_terms)


def _half(one: Expansion, axis: int, side: int) -> Expansion:
    matrices = [_halving(count, side * (number == axis)) for number, count in enumerate(one.counts)]
    return Expansion(transformed(matrices, one.coefficients), one.counts, one.rest)


@cache
def _halving(count: int, side: int) -> arb_mat:
    """Matrix from Chebyshev coefficients on −1 … 1 to those on a half of it, or with 0 on all of it."""
    inner, columns = arb_poly([arb(side) / 2, arb(1) / (2 if side else 1)]), []
    for k in range(count):
        poly = arb_poly([1]) * chebyshev_value(k, inner)
        columns.append([poly[row] for row in range(count)])
    return from_powers(count) * arb_mat(columns).transpose()
