"""S, by which errors are measured: a polynomial of the parameters, and nearly its inverse."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, reduce
from itertools import product
from math import prod
from typing import Any

from flint import arb, arb_mat

from gen_profile_recheck.boxes import (
    MachineState,
    MotionPiece,
    Places,
    Values,
    chebyshev_value,
    grid,
    interpolation,
    kronecker,
    wide,
)
from gen_profile_recheck.machines import inner
from gen_profile_recheck.reading import require

NODES = 5  # of each parameter for K
MISSED = 2.0**-20  # of 1, that series of S K may leave out
Matrix = Sequence[Sequence[Any]]


class PolynomialMatrix:
    """A matrix of polynomials of the parameters, with so many terms in each; `most` encloses its entries."""

    def __init__(self, entries: Any, counts: Sequence[int]) -> None:
        self.at, self.entries = cache(self._at), [[[arb(x) for x in one] for one in row] for row in entries]
        self.degrees = list(product(*map(range, counts)))
        self.most = [[wide(sum(map(abs, entry), start=arb(0))) for entry in row] for row in self.entries]

    def _at(self, places: Places) -> Matrix:
        """Evaluate at places of the parameters."""
        basis = [prod(map(chebyshev_value, each, places), start=arb(1)) for each in self.degrees]
        return [[inner(basis, entry) for entry in row] for row in self.entries]


class ScaleMatrix:
    """S, and a polynomial K of the parameters with nearly S K = 1, by which no inverse is needed.

    S⁻¹ = K (S K)⁻¹, and so |M S⁻¹| ≤ |M K| / (1 − gap) for any M, where |S K − 1| ≤ `gap`. `rows` bounds the
    rows of S⁻¹.
    """

    def __init__(self, piece: MotionPiece, entries: Sequence[Sequence[Sequence[float]]]) -> None:
        n, single = len(entries), len(entries[0][0]) == 1
        few = [1 if single else min(3, terms) for terms in piece.box.terms]
        counts = [1 if count == 1 else NODES for count in few]
        self.piece, self.scale = piece, PolynomialMatrix(entries, few)
        middles = map(self.scale.at, grid(tuple(counts)))
        values = arb_mat([arb_mat(one).inv().entries() for one in middles])
        columns = [
            [one.mid() for one in row]
            for row in (kronecker(map(interpolation, counts)) * values).transpose().tolist()
        ]
        self.nearly = PolynomialMatrix([columns[row : row + n] for row in range(0, n * n, n)], counts)
        self.gap = self._norm(self, 1)
        require(self.gap < 1, "a matrix of scales that is nearly singular")
        self.rows = [norm([one / (1 - self.gap) for one in row]) for row in self.nearly.most]

    def _norm(self, before: ScaleMatrix, less: int) -> arb:
        """Bound the norm of S times the K of another, less so many times the unit."""
        n = len(self.scale.entries)

        def times(s: MachineState) -> Values:
            rows = multiplied(self.scale.at(s.places), before.nearly.at(s.places))
            return [one - less * (i == j) for i, row in enumerate(rows) for j, one in enumerate(row)]

        taken = self.piece.few_terms()
        found = self.piece.enclosed(times, lambda residual: all(one < MISSED for one in residual), taken)
        return _norm([[one.size for one in found[row : row + n]] for row in range(0, n * n, n)])

    def changed(self, lower: Matrix, places: Places) -> Matrix:
        """Give S J K at places, where J has such rows below those of (0, 1)."""
        scale, nearly = self.scale.at(places), self.nearly.at(places)
        return multiplied(scale, [*nearly[len(lower) :], *multiplied(lower, nearly)])

    def change(self, before: ScaleMatrix) -> arb:
        """Bound the norm of this S times the inverse of another."""
        return self._norm(before, 0) / (1 - before.gap)

    def length(self, vector: Sequence[arb]) -> arb:
        """Bound the length of S times a vector of balls."""
        return norm([inner(row, vector) for row in self.scale.most])

    def per_length(self, matrix: Matrix) -> Matrix:
        """Give the rows of a matrix of balls times S⁻¹: each bounds what a unit of length changes."""
        columns = multiplied(matrix, self.nearly.most[: len(matrix[0])])
        return [[one / (1 - self.gap) for one in row] for row in columns]

    def size(self, matrix: Matrix) -> arb:
        """Bound the norm of S times a matrix of balls times the inverse of S."""
        return _norm(multiplied(self.scale.most, self.per_length(matrix)))


def multiplied(a: Matrix, b: Matrix) -> list[Values]:
    """Multiply matrices."""
    columns = list(zip(*b, strict=True))
    return [[inner(row, column) for column in columns] for row in a]


def norm(values: Sequence[Any]) -> arb:
    """Bound a vector's length."""
    return sum((arb(one).abs_upper() ** 2 for one in values), start=arb(0)).sqrt().abs_upper()


def _norm(matrix: Matrix) -> arb:
    sums = (
        [sum(map(abs, row), start=arb(0)) for row in kind] for kind in (matrix, zip(*matrix, strict=True))
    )
    rows, columns = (reduce(arb.max, one) for one in sums)
    return (rows * columns).abs_upper().sqrt().abs_upper()
