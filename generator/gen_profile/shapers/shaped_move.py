"""A shaper applied to a quintic move, as exact polynomials."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Polynomial

from gen_profile.errors import InfeasibleProblem
from gen_profile.profile import Array, Profile
from gen_profile.shapers.impulses import SHAPERS, Impulses, convolve

# rest to rest from 0 to 1 in unit time, acceleration continuous; and its derivatives over their factorials
QUINTIC = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
TAYLOR = [QUINTIC.deriv(k) / float(np.prod(np.arange(1, k + 1))) for k in range(6)]
SAME_TIME = 1e-13  # knots closer than this share of the duration are one
SHORTEST_BASE = 1e-6  # a quintic of a smaller share of the duration would drown in the knots' rounding


def shaped_profile(
    name: str,
    *,
    start: Sequence[float],
    target: Sequence[float],
    duration: float,
    frequencies: Sequence[float] | Array,
) -> Profile:
    """Move every axis by a quintic passed through one shaper per mode, within `duration` delay included.

    Parameters
    ----------
    name : str
        One of `SHAPERS`.
    start, target : (axes,) sequence of float
        m (or rad).
    duration : float
        s.
    frequencies : (modes,) sequence of float
        Natural frequencies in rad/s, all positive.

    Raises
    ------
    InfeasibleProblem
        The shaper's delay leaves no time to move in.
    """
    shaper = convolve(SHAPERS[name](float(frequency)) for frequency in frequencies)
    base_duration = duration - shaper.delay
    if base_duration < duration * SHORTEST_BASE:
        raise InfeasibleProblem(
            f"move.duration: the {name} shaper's delay is {shaper.delay:.4g} s for this machine, so "
            f"{duration:g} s leaves no time to move; state more than {shaper.delay:.4g} s, "
            "or choose another method."
        )
    knots = _knots(shaper, base_duration, duration)
    first, last = np.asarray(start, dtype=np.float64), np.asarray(target, dtype=np.float64)
    coefficients = _shaped_quintic(shaper, base_duration, knots)[:, :, None] * (last - first)
    coefficients[:, 0] += first
    return Profile(knots=knots, coefficients=coefficients, target=last, method=name)


def _knots(shaper: Impulses, base_duration: float, duration: float) -> Array:
    """List the times where some quintic begins or ends, as one where they differ by rounding only."""
    times = np.sort(np.concatenate([shaper.times, shaper.times + base_duration]))
    apart = np.diff(times) > duration * SAME_TIME
    knots: Array = times[np.concatenate([[True], apart])]
    knots[-1] = duration
    return knots


def _shaped_quintic(shaper: Impulses, base_duration: float, knots: Array) -> Array:
    """Sum of delayed, weighted unit quintics, shape (segments, 6): each shifted to the segment's own time."""
    begin = (knots[:-1, None] - shaper.times) / base_duration
    middle = ((knots[:-1] + knots[1:])[:, None] / 2.0 - shaper.times) / base_duration
    moving = (middle > 0.0) & (middle < 1.0)
    coefficients = [
        np.where(moving, taylor(begin), 0.0) @ shaper.amplitudes / base_duration**k
        for k, taylor in enumerate(TAYLOR)
    ]
    coefficients[0] += (middle >= 1.0) @ shaper.amplitudes
    return np.stack(coefficients, axis=1)
