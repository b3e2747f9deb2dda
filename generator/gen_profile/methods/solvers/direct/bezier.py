"""Piecewise polynomial motion of an axis in Bézier form.

A polynomial stays within the hull of its Bézier coefficients: what bounds the coefficients bounds the motion
at every instant, not only at samples. (Farin, Curves and Surfaces for CAGD, chapter 5.)
"""

import math

import attrs
import numpy as np

from gen_profile.motion.profile import Array

CONTROL_DEGREE = 3  # of the control on an interval, jerk or snap: the position is of degree 6 or 7

comb = np.vectorize(math.comb, otypes=[np.float64])  # SciPy's takes 0.1 s to load


def bernstein(degree: int, times: Array) -> Array:
    """Evaluate the Bernstein polynomials of a degree at times from 0 to 1, shape (times, degree + 1)."""
    i = np.arange(degree + 1)
    t = np.asarray(times)[:, None]
    return np.asarray(comb(degree, i) * t**i * (1.0 - t) ** (degree - i))


def gram(degree: int) -> Array:
    """Integrate the products of Bernstein polynomials over [0, 1], shape (degree + 1, degree + 1)."""
    i = np.arange(degree + 1)
    binomials = comb(degree, i)
    return np.asarray(
        np.outer(binomials, binomials) / comb(2 * degree, np.add.outer(i, i)) / (2 * degree + 1)
    )


def elevation(degree: int) -> Array:
    """Raise the degree by one without changing the polynomial, shape (degree + 2, degree + 1)."""
    fraction = np.arange(degree + 2) / (degree + 1)
    raised = np.zeros((degree + 2, degree + 1))
    raised[:-1] += np.diag(1.0 - fraction[:-1])
    raised[1:] += np.diag(fraction[1:])
    return raised


def halving(degree: int) -> Array:
    """Cut a polynomial in two by de Casteljau's algorithm, shape (2, degree + 1, degree + 1)."""
    i = np.arange(degree + 1)
    first = comb(i[:, None], i) / 2.0 ** i[:, None]
    return np.stack([first, first[::-1, ::-1]])


def power_basis(degree: int) -> Array:
    """Turn Bézier coefficients into those of powers, lowest first, shape (degree + 1, degree + 1)."""
    i = np.arange(degree + 1)
    signs = (-1.0) ** np.subtract.outer(i, i)
    return np.asarray(comb(degree, i)[:, None] * comb(i[:, None], i) * signs)


@attrs.frozen(kw_only=True, eq=False)
class Piece:
    """One interval of a motion, or many, as linear maps of their local coordinates.

    The local coordinates are the position and its derivatives at the interval's beginning, up to order − 1,
    then the Bézier coefficients of the derivative of that order, the control.

    Attributes
    ----------
    order : int
        Of the control: 3 for jerk, 4 for snap.
    length : float or (intervals,) array
        Of the interval, or of each: what follows then has one dimension more in front.
    """

    order: int
    length: Array = attrs.field(converter=np.asarray)

    @property
    def size(self) -> int:
        """Number of local coordinates."""
        return self.order + CONTROL_DEGREE + 1

    def derivative(self, order: int) -> Array:
        """Bézier coefficients of a derivative, shape (degree + 1, size)."""
        length = self.length[..., None, None]
        rows = np.broadcast_to(
            np.eye(self.size)[self.order :], (*self.length.shape, CONTROL_DEGREE + 1, self.size)
        )
        for k in range(self.order - 1, order - 1, -1):
            gained = np.cumsum(rows, axis=-2) * (length / rows.shape[-2])
            rows = np.eye(self.size)[k] + np.concatenate([np.zeros_like(gained[..., :1, :]), gained], axis=-2)
        return rows

    def at(self, order: int, times: Array) -> Array:
        """Values of a derivative at times from 0 to 1 of the interval, shape (times, size)."""
        rows = self.derivative(order)
        return bernstein(rows.shape[-2] - 1, times) @ rows

    def leading(self, order: int, lag: float) -> Array:
        """Bézier coefficients of a derivative plus lag times the next one: what leads a first-order drive."""
        rows = self.derivative(order)
        if lag == 0.0:
            return rows
        ahead = self.derivative(order + 1)
        return rows + lag * elevation(ahead.shape[-2] - 1) @ ahead
