"""Chebyshev series on balls: of functions of a time and of parameters, each on [−1, 1].

A function that is analytic on the ellipse with foci ±1 and sum of half-axes ρ, and at most M there, differs
from its interpolant at N of Chebyshev's nodes by at most 4 M ρ⁻ᴺ / (1 − 1/ρ). Interpolation at N nodes makes
values greater by at most 1 + 2/π ln N. So variables may be taken one after the other, each with an ellipse of
its own, while all others are real. (L. N. Trefethen, Approximation theory and approximation practice, 2013,
theorem 8.2; S. N. Bernstein, 1912; T. J. Rivlin, The Chebyshev polynomials, 1974, theorem 1.2.)

Arrays have an axis for each variable, after others.
"""

from collections.abc import Sequence
from functools import cache
from math import prod

import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import UNIT, Array, Ball

COSINE = 32 * UNIT  # by which a cosine here may be off, its argument's rounding included
ROUND_UP = 1.0 + 1e-12  # outweighs the rounding of sums of up to 9000 terms, 2⁻⁵³ each
MOST_TOGETHER = 256  # values that a matrix of several variables sums up
TINY = 1e-5  # of a bound, up to which coefficients of the highest degrees are not halved any more
PORTION, MOST_WORK = 2**18, 2**31  # coefficients that are halved at once, and in all
NEAR = 1.005  # of the greatest value seen: how closely a bound is sought


def nodes(count: int) -> Ball:
    """Chebyshev's nodes of the first kind, falling, shape (count,)."""
    return Ball(values_at_nodes(count, 2)[:, 1], np.full(count, COSINE))


@cache
def coefficients_of(count: int) -> Array:
    """Matrix from values at nodes to the interpolant's coefficients; entries are off by twice `COSINE`."""
    matrix = 2.0 / count * values_at_nodes(count, count).T
    matrix[0] *= 0.5
    return matrix


def evaluated(series: Array, counts: Sequence[int]) -> Ball:
    """Evaluate series at nodes; all values of a series share a radius."""
    terms = series.shape[series.ndim - len(counts) :]
    matrices = [values_at_nodes(*sizes) for sizes in zip(counts, terms, strict=True)]
    off = 2.0 * COSINE * len(terms) + _rounding(matrices)
    return Ball(_turned(matrices, series), _sum(np.abs(series), len(counts)) * off * ROUND_UP)


def interpolated(values: Ball, variables: int) -> tuple[Array, Array]:
    """Interpolate values at nodes, which share a radius: a series, and how far off it may be anywhere.

    Coefficients are off by their rounding, each of them; but a radius is made greater by no more than the
    whole interpolation makes values.
    """
    counts = np.shape(values.mid)[np.ndim(values.mid) - variables :]
    size = np.abs(values.mid).max(axis=tuple(range(-variables, 0)), keepdims=True)
    most = 2.0**variables  # as no row of such a matrix sums to more than 2
    matrices = [coefficients_of(count) for count in counts]
    off = 2.0 * COSINE * sum(counts) + _rounding(matrices)
    rounding = prod(counts) * most * size * off
    rad = (prod(map(_lebesgue, counts)) * values.rad + rounding) * ROUND_UP
    return _turned(matrices, values.mid), rad.reshape(rad.shape[: rad.ndim - variables])


def _lebesgue(count: int) -> float:
    """Bound by how much interpolation makes values greater."""
    return float(1.0 + 2.0 / np.pi * np.log(count))


def interpolate(values: Array, variables: int) -> Array:
    """Interpolate values, with the rounding of plain numbers."""
    return _turned([coefficients_of(count) for count in values.shape[values.ndim - variables :]], values)


def _turned(matrices: Sequence[Array], values: Array) -> Array:
    """Let a matrix act on each of the last axes."""
    shape = (*values.shape[: values.ndim - len(matrices)], *(len(matrix) for matrix in matrices))
    after = 1
    for matrix in _together(matrices):
        values = values.reshape(-1, matrix.shape[1], after)
        values = values[..., 0] @ matrix.T if after == 1 else matrix @ values
        after *= len(matrix)
    return values.reshape(shape)


def _together(matrices: Sequence[Array]) -> list[Array]:
    """Let small matrices of several axes act at once, as their Kronecker product; of the last axes first."""
    joined: list[Array] = []
    for matrix in reversed(matrices):
        if joined and joined[-1].shape[1] * matrix.shape[1] <= MOST_TOGETHER:
            joined[-1] = np.asarray(np.kron(matrix, joined[-1]), dtype=np.float64)
        else:
            joined.append(matrix)
    return joined


def _rounding(matrices: Sequence[Array]) -> float:
    """Bound the rounding of sums and of products of entries, as a share of the absolute terms."""
    summed = sum(matrix.shape[1] for matrix in _together(matrices))
    return UNIT * float(summed + 4 * len(matrices))


def _sum(values: Array, variables: int) -> Array:
    return np.asarray(values.sum(axis=tuple(range(-variables, 0)), keepdims=True))


def total(series: Array, off: Array) -> Array:
    """Bound the absolute values of series that may be so far off: by the sum of their coefficients'."""
    axes = tuple(range(off.ndim, series.ndim))
    return np.asarray((np.abs(series).sum(axis=axes) + off) * ROUND_UP)


def weights(rho: Array, terms: Sequence[int]) -> list[Array]:
    """Bound the terms of every variable on ellipses, each (ellipses, terms).

    Parameters
    ----------
    rho : (ellipses, variables) array
        Sums of half-axes.
    terms : (variables,) sequence of int
    """
    return [rho[:, k, None] ** np.arange(count) for k, count in enumerate(terms)]


def weighted(series: Array, weights: Sequence[Array]) -> Array:
    """Sum absolute coefficients with weights of each variable's terms, (ellipses, …)."""
    others, last = list(range(series.ndim - len(weights))), series.ndim
    operands: list[object] = [np.abs(series), list(range(series.ndim))]
    for axis, weight in enumerate(weights, start=len(others)):
        operands += [weight, [last, axis]]
    if not weights:
        return np.abs(series)[None]
    return np.asarray(np.einsum(*operands, [last, *others], optimize=True)) * ROUND_UP  # type: ignore[call-overload]


def first(series: Array, variables: int) -> Array:
    """Take the coefficients of degree 0 in all variables."""
    return series.reshape(*series.shape[: series.ndim - variables], -1)[..., 0]


def spread(series: Array, variables: int) -> Ball:
    """Enclose exact series: their first coefficient, and the sum of all others."""
    middle = first(series, variables)
    sizes = np.abs(series).sum(axis=tuple(range(-variables, 0)))
    return Ball(middle, (sizes - np.abs(middle)) * ROUND_UP + 1e-15 * sizes)


@cache
def derivative(terms: int) -> Array:
    """Matrix from coefficients to those of the derivative, whole numbers, shape (terms, terms)."""
    matrix = np.zeros((terms, terms))
    for power in range(1, terms):
        matrix[power - 1 :: -2, power] = 2.0 * power
    matrix[0] *= 0.5
    return matrix


@cache
def halves(terms: int) -> tuple[Array, Array]:
    """Matrices from coefficients to those on [−1, 0] and [0, 1], dyadic numbers, shape (terms, terms)."""
    matrices = []
    for shift in (-1.0, 1.0):  # T_k((x ± 1)/2), by T_(k+1)(u) = 2 u T_k(u) − T_(k−1)(u)
        matrix = np.eye(terms, terms)
        if terms > 1:
            matrix[:2, 1] = 0.5 * shift, 0.5
        for power in range(2, terms):
            before = matrix[:, power - 1]
            matrix[:, power] = shift * before - matrix[:, power - 2]
            matrix[1:, power] += 0.5 * before[:-1]
            matrix[1, power] += 0.5 * before[0]
            matrix[:-1, power] += 0.5 * before[1:]
        matrices.append(matrix)
    return matrices[0], matrices[1]


def interpolation_error(most: Array, rhos: Sequence[float], counts: Sequence[int]) -> Array:
    """Bound how far interpolants are off.

    Parameters
    ----------
    most : (variables, ellipses, …) array
        Upper bounds, each on one variable's ellipse for all real values of the others.
    rhos : (ellipses,) sequence of float
    counts : (variables,) sequence of int
        Nodes.
    """
    error, lebesgue = np.zeros(most.shape[2:]), 1.0
    for bounds, count in zip(most, counts, strict=True):
        each = [
            4.0 * rho**-count / (1.0 - 1.0 / rho) * bound for rho, bound in zip(rhos, bounds, strict=True)
        ]
        error = error + lebesgue * np.fmin.reduce(each)
        lebesgue *= _lebesgue(count)
    return np.asarray(error * ROUND_UP)


def greatest(series: Array, off: Array, target: float) -> float:
    """Bound absolute values of series closely, by halving wherever they may exceed what was seen.

    Parameters
    ----------
    series : (items, terms, …) array
    off : (items,) array
        How far values are from those of the series.
    target : float
        A bound that is low enough.
    """
    variables, bound, largest = series.ndim - 1, 0.0, 0.0
    waiting, work = [(series, off)], 0
    while waiting:
        items, missing = waiting.pop()
        if not (np.isfinite(items).all() and np.isfinite(missing).all()):
            return float("nan")
        largest = max(largest, float(np.abs(_turned([ends(n) for n in items.shape[1:]], items)).max()))
        sizes = (_sum(np.abs(items), variables).ravel() + missing) * ROUND_UP
        wide = sizes > max(target, NEAR * largest)
        work += items.size
        if work > MOST_WORK:
            wide &= False
        bound = max(bound, float(sizes[~wide].max(initial=0.0)))
        if wide.any():
            waiting += _halved(*_shortened(items[wide], missing[wide], TINY * max(target, largest)))
    return bound


def _shortened(items: Array, off: Array, tiny: float) -> tuple[Array, Array]:
    """Leave out the highest degrees where their coefficients are tiny."""
    for axis in range(1, items.ndim):
        sizes = np.abs(items).sum(axis=tuple(other for other in range(1, items.ndim) if other != axis))
        beyond = np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1] * ROUND_UP  # what is left out from a degree on
        kept = max(2, int((beyond.max(axis=0) > tiny).sum()))
        if kept < items.shape[axis]:
            off = off + beyond[:, kept]
            items = items.take(range(kept), axis=axis)
    return items, off


def _halved(items: Array, off: Array) -> list[tuple[Array, Array]]:
    """Halve each series' variable that makes its values differ most from a plane's, in portions."""
    variables = items.ndim - 1
    degree = sum(np.ix_(*map(np.arange, items.shape[1:])))
    bent = np.abs(items) * (degree > 1)
    whole = _sum(bent, variables).ravel()
    still = [_sum(bent.take([0], axis=axis), variables).ravel() for axis in range(1, variables + 1)]
    chosen = 1 + np.argmax(whole - np.array(still), axis=0)
    parts = []
    for axis in np.unique(chosen).tolist():
        own, rest, terms = items[chosen == axis], off[chosen == axis], items.shape[axis]
        rest = rest + 2.0 * terms * (terms + 4) * UNIT * _sum(np.abs(own), variables).ravel()
        for matrix in halves(terms):
            part = np.moveaxis(np.tensordot(own, matrix, axes=(axis, 1)), -1, axis)
            portions = -(-part.size // PORTION)
            parts += list(zip(np.array_split(part, portions), np.array_split(rest, portions), strict=True))
    return [one for one in parts if len(one[1])]


@cache
def ends(terms: int) -> Array:
    """Matrix from coefficients to values at −1, 0 and 1."""
    power = np.arange(terms)
    return np.array([(-1.0) ** power, np.cos(0.5 * np.pi * power), np.ones(terms)])


@cache
def values_at_nodes(count: int, terms: int) -> Array:
    """Matrix from coefficients to values at nodes, cos(k (2 j + 1) π / 2 N), shape (count, terms).

    Arguments are reduced in whole numbers; entries are off by `COSINE`.
    """
    whole = np.outer(2 * np.arange(count) + 1, np.arange(terms)) % (4 * count)
    return np.asarray(np.cos(whole * (np.pi / (2 * count))))
