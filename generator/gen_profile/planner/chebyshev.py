"""Chebyshev interpolation in any number of variables, each from −1 to 1.

A variable t may be bent to (t + k) / (1 + k t), which leaves the ends where they are; 1 / (1 + k t) is a
straight line in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import attrs
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from gen_profile.motion.profile import Array

STRAIGHT = 1e-6  # relative difference of two slopes that counts as none


@attrs.frozen(kw_only=True, eq=False)
class Interpolant:
    """Sums of products of Chebyshev polynomials.

    Attributes
    ----------
    curvatures : sequence of float
        k of each variable.
    exponents : (variables, terms) array of int
        Degree of the polynomial of each variable in each term.
    coefficients : (functions, terms) array
    """

    curvatures: Sequence[float]
    exponents: NDArray[np.int64]
    coefficients: Array

    def __call__(self, point: Sequence[float]) -> Array:
        """Evaluate all functions at a point, as the block does."""
        factors = [
            chebyshev.chebvander(np.array([(t + k) / (1.0 + k * t)]), int(degrees.max()))[0, degrees]
            for t, k, degrees in zip(point, self.curvatures, self.exponents, strict=True)
        ]
        return np.asarray(self.coefficients @ np.prod([np.ones(self.exponents.shape[1]), *factors], axis=0))

    def without(self, negligible: float) -> Interpolant:
        """Leave out coefficients that small beside their function's largest, and terms of no others."""
        least = negligible * np.abs(self.coefficients).max(axis=1, keepdims=True)
        coefficients = np.where(np.abs(self.coefficients) > least, self.coefficients, 0.0)
        kept = coefficients.any(axis=0)
        return attrs.evolve(self, exponents=self.exponents[:, kept], coefficients=coefficients[:, kept])


def same_terms(*interpolants: Interpolant) -> tuple[NDArray[np.int64], list[Array]]:
    """Give the degrees of all terms, (variables, terms), and each interpolant's coefficients of them."""
    terms = sorted({tuple(term) for one in interpolants for term in one.exponents.T.tolist()})
    coefficients = []
    for one in interpolants:
        table = np.zeros((len(one.coefficients), len(terms)))
        table[:, [terms.index(tuple(term)) for term in one.exponents.T.tolist()]] = one.coefficients
        coefficients.append(table)
    return np.array(terms, dtype=np.int64).reshape(len(terms), -1).T, coefficients


def bend(values: Sequence[float]) -> float:
    """Find k: 1 / (1 + k t), scaled and shifted, takes these values at t = −1, 0 and 1; 0 if none does."""
    first, second = np.diff(values)
    if not first * second > 0.0 or abs(first - second) <= STRAIGHT * abs(first + second):
        return 0.0
    return float((first - second) / (first + second))


def interpolate(
    function: Callable[[Sequence[float]], Array], curvatures: Sequence[float], degree: int
) -> Interpolant:
    """Interpolate functions at the Chebyshev points of a degree.

    Parameters
    ----------
    function : point → (functions,) array
    curvatures : sequence of float
        k of each variable.
    degree : int
    """
    variables = len(curvatures)
    nodes = chebyshev.chebpts1(degree + 1)
    straight = [(nodes - k) / (1.0 - k * nodes) for k in curvatures]
    values = np.array([function(point) for point in product(*straight)])
    table = values.T.reshape(-1, *(degree + 1,) * variables)
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, degree))
    for axis in range(1, variables + 1):
        table = np.moveaxis(np.tensordot(inverse, table, axes=(1, axis)), 0, axis)
    exponents = np.array(list(product(range(degree + 1), repeat=variables)), dtype=np.int64)
    return Interpolant(
        curvatures=curvatures,
        exponents=exponents.T.reshape(variables, (degree + 1) ** variables),
        coefficients=table.reshape(len(table), -1),
    )
