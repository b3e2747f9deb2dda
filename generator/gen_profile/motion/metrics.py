"""Figures of arrays: peaks, root mean squares, and what swings on after a move."""

import numpy as np
from numpy.polynomial import legendre, polynomial

from gen_profile.motion.profile import Array, Profile

POINTS_PER_SEGMENT = 65  # between which a derivative is taken to change its sign once at most


def extremes(profile: Profile, order: int, axis: int = 0) -> tuple[float, float]:
    """Least and greatest value of an axis' derivative of the given order, jumps included."""
    times, values = profile.within_segments(POINTS_PER_SEGMENT, order)
    _, slopes = profile.within_segments(POINTS_PER_SEGMENT, order + 1)
    slope, time = slopes[:, axis].reshape(-1, POINTS_PER_SEGMENT), times.reshape(-1, POINTS_PER_SEGMENT)
    before, after = slope[:, :-1], slope[:, 1:]
    turns = before * after < 0.0
    fraction = before[turns] / (before - after)[turns]
    turning = profile.derivative(time[:, :-1][turns] + fraction * np.diff(time)[turns], order)
    candidates = np.concatenate([values[:, axis], turning[:, axis]])
    return float(candidates.min()), float(candidates.max())


def greatest(profile: Profile, order: int, axis: int = 0) -> float:
    """Greatest magnitude of an axis' derivative of the given order; of the first axis by default."""
    return max(map(abs, extremes(profile, order, axis)))


def excursion(profile: Profile, axis: int) -> float:
    """Distance between the lowest and the highest place of an axis on its way."""
    lowest, highest = extremes(profile, 0, axis)
    return highest - lowest


def overshoot(profile: Profile) -> float:
    """Find how far the leading axis leaves the way between its start and its target."""
    axis = profile.leading
    (lowest, highest), ends = extremes(profile, 0, axis), (profile.start[axis], profile.target[axis])
    return float(max(highest - max(ends), min(ends) - lowest, 0.0))


def root_mean_square(profile: Profile, order: int) -> float:
    """Root mean square of the leading axis' derivative over the move, by an exact quadrature."""
    size = profile.coefficients.shape[1]
    nodes, weights = legendre.leggauss(size)
    lengths = np.diff(profile.knots)
    coefficients = polynomial.polyder(profile.coefficients[:, :, profile.leading].T, order)
    local = lengths[:, None] * (nodes + 1.0) / 2.0
    values = np.asarray(polynomial.polyval(local, coefficients[:, :, None], tensor=False))
    mean = (values**2 @ weights / 2.0) @ lengths / profile.duration
    return float(np.sqrt(mean))


def length(components: Array) -> Array:
    """Length of the vector in each row, as one column; a single component keeps its sign."""
    if components.shape[-1] == 1:
        return components
    return np.asarray(np.linalg.norm(components, axis=-1, keepdims=True))


def peak(values: Array) -> Array:
    """Greatest magnitude of each column, refined between samples by a parabola through the largest three.

    Parameters
    ----------
    values : (…, samples, columns) array
        At evenly spaced times.

    Returns
    -------
    (…, columns) array
    """
    columns = np.ascontiguousarray(np.swapaxes(values, -1, -2))
    magnitude, samples = np.abs(columns), columns.shape[-1]
    highest = magnitude.max(axis=-1)
    if samples < 3:
        return np.asarray(highest)
    top = magnitude.argmax(axis=-1, keepdims=True).clip(1, samples - 2)
    left, middle, right = (np.take_along_axis(columns, top + step, axis=-1)[..., 0] for step in (-1, 0, 1))
    curvature = left - 2.0 * middle + right
    safe = np.where(curvature == 0.0, 1.0, curvature)
    shift = np.clip(np.where(curvature == 0.0, 0.0, (left - right) / (2.0 * safe)), -1.0, 1.0)
    vertex = middle + shift * (right - left) / 4.0
    return np.asarray(np.maximum(np.abs(vertex), highest))


def mean_square_root(values: Array) -> Array:
    """Root mean square of each column over evenly spaced times, by the trapezoidal rule."""
    squares = values**2
    squares[[0, -1]] /= 2.0
    return np.asarray(np.sqrt(squares.sum(axis=0) / (len(values) - 1)))
