"""Matrices of balls, and bounds on what matrices make of vectors."""

from functools import reduce
from operator import add
from typing import Any

import numpy as np

from gen_profile.assurance.certificate.arithmetic.affine import Affine
from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball, stack
from gen_profile.assurance.certificate.arithmetic.chebyshev import ROUND_UP


def split(values: Ball, axis: int) -> list[Ball]:
    """Split along an axis."""
    mids, rads = (np.moveaxis(part, axis, 0) for part in (values.mid, values.rad))
    return [Ball(mid, rad) for mid, rad in zip(mids, rads, strict=True)]


def array(rows: list[list[Ball]], shape: tuple[int, ...]) -> Ball:
    """Join nested rows to one array, the matrix' axes last."""
    return stack([stack([full(one, shape) for one in row], axis=-1) for row in rows], axis=-2)


def full(one: Ball, shape: tuple[int, ...]) -> Ball:
    """Give numbers, of which some may be alike, their full shape."""
    return Ball(np.broadcast_to(one.mid, shape), np.broadcast_to(one.rad, shape))


def matmul_most(matrix: Array, sizes: Array) -> Array:
    """Bound a matrix times a vector whose entries have at most some sizes."""
    return np.asarray(np.einsum("...ij,...j->...i", np.abs(matrix), sizes) * ROUND_UP)


def times(matrix: Array, sizes: Array) -> Array:
    """Bound matrices (boxes, pieces, rows, columns) times vectors (pieces, columns)."""
    return np.asarray(np.einsum("bpxa,pa->bpx", matrix, sizes))


def norm(sizes: Array) -> Array:
    """Euclidean length."""
    return np.asarray(np.sqrt((sizes**2).sum(axis=-1)) * ROUND_UP)


def gershgorin(symmetric: Ball) -> Array:
    """Bound where Gershgorin's circles of symmetric matrices end, (…, rows)."""
    unit = np.eye(symmetric.shape[-1])
    sides = (symmetric.most * (1.0 - unit)).sum(axis=-1)
    return np.asarray(np.einsum("...ii->...i", symmetric.upper) + sides + 1e-12 * sides)


def entries(values: Ball, rows: slice) -> list[list[Ball]]:
    """Take matrices apart that do not change over a piece, nor from piece to piece where there is but one."""
    rows = rows if values.mid.shape[1] > 1 else slice(None)
    mid, rad = (
        np.expand_dims(np.moveaxis(part[:, rows], (2, 3), (0, 1)), 4) for part in (values.mid, values.rad)
    )
    return [[Ball(*pair) for pair in zip(*row, strict=True)] for row in zip(mid, rad, strict=True)]


def product(a: list[list[Any]], b: list[list[Any]]) -> list[list[Any]]:
    """Multiply matrices of balls, or of what knows its parameters, many of which are nothing."""
    columns = list(zip(*b, strict=True))

    def entry(row: list[Any], column: tuple[Any, ...]) -> Any:
        products = [x * y for x, y in zip(row, column, strict=True) if _is_some(x) and _is_some(y)]
        return reduce(add, products) if products else 0.0 * row[0]

    return [[entry(row, column) for column in columns] for row in a]


def symmetric(a: list[list[Any]]) -> list[list[Any]]:
    """Take the symmetric part, below its diagonal and on it."""
    return [[0.5 * (a[i][j] + a[j][i]) for j in range(i + 1)] for i in range(len(a))]


def _is_some(x: Ball | Affine) -> bool:
    slopes = x.slopes.values() if isinstance(x, Affine) else ()
    return any(bool(np.any(part)) for part in (x.mid, x.rad, *slopes))
