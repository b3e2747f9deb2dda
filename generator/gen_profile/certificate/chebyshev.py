"""Chebyshev series on balls: of functions of a time and of parameters, each on [−1, 1].

A function that is analytic on the ellipses with foci ±1 and sums of half-axes ρ, and at most M there, has
coefficients of at most 2 M ρ⁻ᵏ (and 2 for each further variable); so its interpolant at Chebyshev's nodes is
off by at most the double of what those beyond the nodes come to. (L. N. Trefethen, Approximation theory and
approximation practice, 2013, theorems 8.1 and 8.2; S. N. Bernstein, 1912.)
"""

from __future__ import annotations

from functools import cache, reduce
from math import prod

import numpy as np
from numpy.typing import NDArray

from gen_profile.certificate.balls import UNIT, UPWARD, Array, Ball

COSINE = 32 * UNIT  # by which a cosine here may be off, its argument's rounding included


def nodes(count: int) -> Ball:
    """Chebyshev's nodes of the first kind, falling, shape (count,)."""
    return Ball(_cosines(count, 2)[:, 1], np.full(count, COSINE))


@cache
def values_at_nodes(count: int, terms: int) -> Ball:
    """Matrix from coefficients to values at nodes, shape (count, terms)."""
    return Ball(_cosines(count, terms), np.full((count, terms), COSINE))


@cache
def coefficients_of(count: int) -> Ball:
    """Matrix from values at nodes to the interpolant's coefficients, shape (count, count)."""
    matrix = 2.0 / count * _cosines(count, count).T
    matrix[0] *= 0.5
    return Ball(matrix, np.full((count, count), 2.0 * COSINE))


def tensor(matrix: Ball, dimensions: int) -> Ball:
    """Let a matrix act on every one of some dimensions, flattened, the last one fastest."""
    one = Ball(np.ones((1, 1)), np.zeros((1, 1)))
    return reduce(_kronecker, [matrix] * dimensions, one)


def _kronecker(a: Ball, b: Ball) -> Ball:
    mid = np.kron(a.mid, b.mid)
    rad = np.kron(np.abs(a.mid), b.rad) + np.kron(a.rad, np.abs(b.mid) + b.rad)
    return Ball(mid, (rad + UNIT * np.abs(mid)) * UPWARD)


@cache
def derivative(terms: int) -> Array:
    """Matrix from coefficients to those of the derivative, whole numbers, shape (terms, terms)."""
    matrix = np.zeros((terms, terms))
    for power in range(1, terms):
        matrix[power - 1 :: -2, power] = 2.0 * power
    matrix[0] *= 0.5
    return matrix


def degrees(terms: int, dimensions: int) -> NDArray[np.int_]:
    """Sum of degrees of every term of a tensor, flattened like `tensor`'s."""
    grids = np.meshgrid(*[np.arange(terms)] * dimensions, indexing="ij") if dimensions else [np.zeros(1, int)]
    return np.asarray(sum(grid.ravel() for grid in grids))


def missed(most: Array, time: tuple[float, int], parameters: tuple[float, int], dimensions: int) -> Array:
    """Bound how far an interpolant is off.

    Parameters
    ----------
    most : array
        Upper bounds on the ellipses.
    time, parameters : (ρ, number of nodes)
    dimensions : int
        Number of parameters.
    """
    variables = [time] + [parameters] * dimensions
    whole = [1.0 / (1.0 - 1.0 / rho) for rho, _ in variables]
    beyond = sum(rho**-count * prod(whole) for rho, count in variables)
    return np.asarray(2.0 * 2.0 ** len(variables) * most * beyond * (1.0 + 1e-12))


def between_nodes(count: int, degree: int) -> float:
    """Factor by which a polynomial may exceed its values at nodes (H. Ehlich and K. Zeller, 1964)."""
    return float(1.0 / np.cos(0.5 * np.pi * degree / count) * (1.0 + 1e-12))


@cache
def _cosines(count: int, terms: int) -> Array:
    """cos(k (2 j + 1) π / 2 N), the argument reduced in whole numbers."""
    whole = np.outer(2 * np.arange(count) + 1, np.arange(terms)) % (4 * count)
    return np.asarray(np.cos(whole * (np.pi / (2 * count))))
