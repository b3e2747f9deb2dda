"""Norms |S(p) e| of errors: matrices that are polynomials of the parameters, and nearly their inverses."""

from collections.abc import Mapping
from functools import cached_property

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic import chebyshev
from gen_profile.assurance.certificate.arithmetic.affine import Affine
from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball
from gen_profile.assurance.certificate.arithmetic.chebyshev import ROUND_UP

MORE_TERMS = 3  # of an inverse, than of the matrix


@attrs.frozen(kw_only=True, eq=False)
class Scaling:
    """S(p), and a polynomial V(p) that nearly is its inverse.

    Attributes
    ----------
    series : (boxes, pieces, 2 n_u, 2 n_u, terms, …) array
        S; one piece stands for all where they are alike.
    """

    series: Array

    @property
    def variables(self) -> int:
        """How many parameters there are."""
        return self.series.ndim - 4

    @cached_property
    def inverse(self) -> Array:
        """V, like S."""
        counts = [terms + MORE_TERMS * (terms > 1) for terms in self.series.shape[4:]]
        values = np.moveaxis(chebyshev.evaluated(self.series, counts).mid, (2, 3), (-2, -1))
        try:
            inverses = np.linalg.inv(values)
        except np.linalg.LinAlgError:
            inverses = np.full(values.shape, np.nan)
        return chebyshev.interpolate(np.moveaxis(inverses, (-2, -1), (2, 3)), self.variables)

    @cached_property
    def slip(self) -> Array:
        """Bound |S V − I|, or nan where it is no small number, (boxes, pieces)."""
        product, away = self._product(self.series, self.inverse)
        off = chebyshev.total(product - _identity(product), away).sum(axis=(-1, -2)) * ROUND_UP
        return np.where(off < 0.5, off, np.nan)

    @cached_property
    def most(self) -> Array:
        """Bound every entry of S, (boxes, pieces, 2 n_u, 2 n_u)."""
        return chebyshev.total(self.series, np.zeros(self.series.shape[:4]))

    @cached_property
    def inverse_most(self) -> Array:
        """Bound every entry of V, likewise."""
        return chebyshev.total(self.inverse, np.zeros(self.inverse.shape[:4]))

    @property
    def slack(self) -> Array:
        """Factor from bounds with V to such with the inverse of S, (boxes, pieces)."""
        return (1.0 + 2.0 * self.slip) * ROUND_UP

    def changes(self, pieces: int) -> Array:
        """Bound the norm of S after a piece's beginning times the inverse of S before, (boxes, pieces)."""
        changed = np.ones((len(self.series), pieces))
        if self.series.shape[1] == 1:
            return changed
        product = chebyshev.total(*self._product(self.series[:, 1:], self.inverse[:, :-1]))
        sums = product.sum(axis=-1).max(axis=-1), product.sum(axis=-2).max(axis=-1)
        changed[:, 1:] = np.sqrt(sums[0] * sums[1]) * self.slack[:, :-1] * ROUND_UP
        return changed

    def _product(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Multiply polynomials, at as many nodes as determine their product; as a series, and how far off."""
        counts = [one + other - 1 for one, other in zip(first.shape[4:], second.shape[4:], strict=True)]
        a, b = (chebyshev.evaluated(series, counts) for series in (first, second))
        pairs = (a[:, :, :, k, None] * b[:, :, None, k] for k in range(a.mid.shape[2]))
        products = sum(pairs, start=Ball(0.0, 0.0))
        return chebyshev.interpolated(products, self.variables)


def affine_entries(series: Array, rho: Array, far: Mapping[int, Array]) -> list[list[Affine]]:
    """Take matrices that are polynomials of the parameters apart: what is linear in these, and the rest.

    Parameters
    ----------
    series : (boxes, pieces, rows, columns, terms, …) array
    rho : (ellipses, parameters) array
        Of the ellipses on which parameters are.
    far : mapping of int to array
        How far each parameter is from 0, of `Affine`.
    """
    terms, rest = series.shape[4:], series.copy()
    constant = (0,) * len(terms)
    unit = {
        k: tuple(int(k == other) for other in range(len(terms))) for k, count in enumerate(terms) if count > 1
    }
    exact = {}
    for degrees in (constant, *unit.values()):
        place = (slice(None),) * 4 + degrees
        exact[degrees] = np.moveaxis(series[place], (2, 3), (0, 1))
        rest[place] = 0.0
    off = np.moveaxis(chebyshev.weighted(rest, chebyshev.weights(rho, terms)), (3, 4), (0, 1))

    def entry(i: int, j: int) -> Affine:
        slopes = {k: exact[degrees][i, j] for k, degrees in unit.items()}
        return Affine(exact[constant][i, j], slopes, off[i, j], far)

    return [[entry(i, j) for j in range(series.shape[3])] for i in range(series.shape[2])]


def _identity(like: Array) -> Array:
    """Give the series of the unit matrix."""
    shape = like.shape
    series = np.zeros((*shape[2:4], int(np.prod(shape[4:]))))
    series[..., 0] = np.eye(shape[2])
    return series.reshape(shape[2:])
