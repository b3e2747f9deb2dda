"""S, by which errors are measured: a polynomial of the parameters, and its inverse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import product
from math import prod
from typing import Any

from flint import arb, arb_mat

from gen_profile_recheck.boxes import MachineState, MotionPiece, Values, chebyshev_value, first, wide

NODES = 7  # of each parameter for the inverse of S
Matrix = Sequence[Sequence[Any]]


class ScaleMatrix:
    """S, enclosures of the entries of its inverse, and bounds of that one's rows."""

    def __init__(self, piece: MotionPiece, entries: Sequence[Sequence[Sequence[float]]]) -> None:
        self.piece, self.entries, self.known = piece, entries, dict[Any, Any]()
        self.counts = tuple(1 if len(entries[0][0]) == 1 else min(3, terms) for terms in piece.box.terms)
        self.most = [[sum(map(abs, map(arb, entry)), start=arb(0)) for entry in row] for row in entries]
        self.inverse = self._enclosed(lambda s: self.at(s)[1])
        self.rows = [norm(row) for row in self.inverse]

    def _enclosed(self, matrix: Callable[[MachineState], Matrix]) -> Matrix:
        counts, n = tuple(1 if count == 1 else NODES for count in self.counts), len(self.most)
        flat = self.piece.enclosed(lambda s: [one for row in matrix(s) for one in row], 1, counts)
        return [[wide(one.size) for one in flat[row : row + n]] for row in range(0, n * n, n)]

    def at(self, s: MachineState) -> tuple[Matrix, Matrix]:
        """Give S and its inverse; entries that are nothing are 0."""
        if s.key not in self.known:
            degrees = product(*map(range, self.counts))
            basis = [prod(map(chebyshev_value, each, s.places), start=arb(1)) for each in degrees]

            def value(entry: Sequence[float]) -> Any:
                return sum((one * arb(two) for one, two in zip(basis, entry, strict=True) if two), start=0)

            matrix = [[value(entry) for entry in row] for row in self.entries]
            self.known[s.key] = matrix, inverted(matrix)
        found: tuple[Matrix, Matrix] = self.known[s.key]
        return found

    def change(self, before: ScaleMatrix) -> arb:
        """Bound the norm of this S times the inverse of another."""
        return _norm(self._enclosed(lambda s: multiplied(self.at(s)[0], before.at(s)[1])))

    def length(self, vector: Values) -> arb:
        """Bound the length of S times a vector of balls."""
        return norm(
            [sum((a * wide(b) for a, b in zip(row, vector, strict=True)), start=arb(0)) for row in self.most]
        )

    def size(self, matrix: Matrix) -> arb:
        """Bound the norm of S times a matrix of balls times the inverse of S."""
        return _norm(multiplied(multiplied(self.most, matrix), self.inverse))


def inverted(matrix: Matrix) -> Matrix:
    """Invert a matrix: nearly by that of its middle, and what it is times that one by elimination."""
    middle = arb_mat([[first(one).mid() for one in row] for row in matrix]).inv().tolist()
    nearly = [[0 if one.is_zero() else one.mid() for one in row] for row in middle]
    unit = [[int(i == j) for j in range(len(matrix))] for i in range(len(matrix))]
    rows = [[*one, *other] for one, other in zip(multiplied(matrix, nearly), unit, strict=True)]
    for column, row in enumerate(rows):
        row[:] = [0 if _nothing(one) else one / row[column] for one in row]
        for other in rows:
            if other is not row and not _nothing(factor := other[column]):
                pairs = zip(other, row, strict=True)
                other[:] = [one if _nothing(two) else one - factor * two for one, two in pairs]
    return multiplied(nearly, [row[len(rows) :] for row in rows])


def multiplied(a: Matrix, b: Matrix) -> list[Values]:
    """Multiply matrices many of whose entries are 0."""
    columns = list(zip(*b, strict=True))

    def entry(row: Sequence[Any], column: Sequence[Any]) -> Any:
        pairs = zip(row, column, strict=True)
        return sum((x * y for x, y in pairs if not (_nothing(x) or _nothing(y))), start=0)

    return [[entry(row, column) for column in columns] for row in a]


def norm(values: Sequence[Any]) -> arb:
    """Bound a vector's length."""
    return sum((one.abs_upper() ** 2 for one in values), start=arb(0)).sqrt().abs_upper()


def _norm(matrix: Matrix) -> arb:
    sums = (
        [sum(map(abs, row), start=arb(0)) for row in kind] for kind in (matrix, zip(*matrix, strict=True))
    )
    rows, columns = (reduce(arb.max, one) for one in sums)
    return (rows * columns).abs_upper().sqrt().abs_upper()


def _nothing(value: Any) -> bool:
    return isinstance(value, int) and value == 0
