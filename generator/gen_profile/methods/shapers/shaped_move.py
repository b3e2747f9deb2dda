"""A shaper applied to a base move, as exact polynomials."""

import math
from collections.abc import Sequence

import attrs
import numpy as np
from numpy.polynomial import polynomial

from gen_profile.methods.shapers.base_moves import QUINTIC, BaseMove
from gen_profile.methods.shapers.impulses import SHAPERS, Impulses, convolve
from gen_profile.motion.profile import Array, Profile
from gen_profile.support.errors import Code, InfeasibleProblem, Reason, rounded_up
from gen_profile.support.phrase import Phrase

SAME_TIME = 1e-13  # knots closer than this share of the duration are one
SHORTEST_BASE = 1e-6  # a base move of a smaller share of the duration would drown in the knots' rounding
BLOCK = 1_000_000  # polynomials evaluated at once


@attrs.frozen(kw_only=True, eq=False)
class ShapedMove:
    """A move through a shaper, of any duration longer than the shaper's delay.

    Attributes
    ----------
    name : str
        Of the shaper.
    start, target : (axes,) sequence of float
        m (or rad).
    shaper : Impulses
        For all modes.
    base : BaseMove
        Made by every axis at once, each over its own distance.
    """

    name: str
    start: Sequence[float]
    target: Sequence[float]
    shaper: Impulses
    base: BaseMove

    def profile(self, duration: float) -> Profile:
        """Make the motion.

        Parameters
        ----------
        duration : float
            s, the shaper's delay included.

        Raises
        ------
        InfeasibleProblem
            The shaper's delay leaves no time to move in.
        """
        delay = self.shaper.delay
        stretch = duration - delay
        if stretch < duration * SHORTEST_BASE:
            raise self.too_short(duration, delay)
        knots = _knots(self.shaper, self.base, stretch, duration)
        first, last = np.asarray(self.start, dtype=np.float64), np.asarray(self.target, dtype=np.float64)
        coefficients = _shaped(self.shaper, self.base, stretch, knots)[:, :, None] * (last - first)
        coefficients[:, 0] += first
        return Profile(knots=knots, coefficients=coefficients, target=last, method=self.name)

    def too_short(self, duration: float, least: float) -> InfeasibleProblem:
        """Say that a duration in s leaves too little time to move in, and what the least is."""
        least = rounded_up(least, digits=4)
        template = (
            "move.duration: the {name} shaper's delay is {delay:.4g} s for this machine, so "
            "{duration:g} s leaves too little time to move. No less than {least:g} s can do, and the check "
            "may ask for more; or choose another method."
        )
        return InfeasibleProblem(
            Phrase(template, name=self.name, delay=self.shaper.delay, duration=duration, least=least),
            reasons=[too_short(duration, least)],
        )


def too_short(duration: float, least: float) -> Reason:
    """Say that a duration in s is below the least."""
    return Reason(code=Code.TOO_SHORT, place="move.duration", found=duration, allowed=least)


def shaped_move(
    name: str,
    *,
    start: Sequence[float],
    target: Sequence[float],
    frequencies: Sequence[float] | Array,
    damping_ratios: Sequence[float] | Array | None = None,
    base: BaseMove = QUINTIC,
) -> ShapedMove:
    """Pass a base move through one shaper per mode.

    Parameters
    ----------
    name : str
        One of `SHAPERS`.
    start, target : (axes,) sequence of float
        m (or rad).
    frequencies : (modes,) sequence of float
        Natural frequencies, undamped, in rad/s, all positive.
    damping_ratios : (modes,) sequence of float, optional
        0 by default.
    base : BaseMove

    Raises
    ------
    InfeasibleProblem
        There is no such shaper for modes damped so much, or for so many.
    """
    ratios = np.zeros(len(frequencies)) if damping_ratios is None else damping_ratios
    make = SHAPERS[name]
    trains = [make(float(f), float(ratio)) for f, ratio in zip(frequencies, ratios, strict=True)]
    return ShapedMove(name=name, start=start, target=target, shaper=convolve(trains), base=base)


def _knots(shaper: Impulses, base: BaseMove, stretch: float, duration: float) -> Array:
    """List the times where some polynomial begins or ends, as one where they differ by rounding only."""
    times = np.sort(np.add.outer(shaper.times, base.knots * stretch).ravel())
    apart = np.diff(times) > duration * SAME_TIME
    knots = np.asarray(times[np.concatenate([[True], apart])])
    knots[-1] = duration
    return knots


def _shaped(shaper: Impulses, base: BaseMove, stretch: float, knots: Array) -> Array:
    """Sum delayed, weighted base moves, shape (segments, order): each shifted to the segment's own time."""
    blocks = np.array_split(np.arange(len(knots) - 1), math.ceil(len(knots) * len(shaper.times) / BLOCK))
    return np.concatenate([_block(shaper, base, stretch, knots[[*block, block[-1] + 1]]) for block in blocks])


def _block(shaper: Impulses, base: BaseMove, stretch: float, knots: Array) -> Array:
    begin = (knots[:-1, None] - shaper.times) / stretch
    middle = ((knots[:-1] + knots[1:])[:, None] / 2.0 - shaper.times) / stretch
    moving = (middle > 0.0) & (middle < 1.0)
    piece = np.clip(np.searchsorted(base.knots, middle, side="right") - 1, 0, len(base.knots) - 2)
    local = begin - base.knots[piece]
    rows = np.asarray(base.coefficients.T)
    taylor = []
    for k in range(len(rows)):
        values = polynomial.polyval(local, rows[:, piece], tensor=False)
        taylor.append(np.where(moving, values, 0.0) @ shaper.amplitudes / stretch**k)
        rows = np.asarray(polynomial.polyder(rows) / (k + 1.0), dtype=np.float64)
    taylor[0] += (middle >= 1.0) @ shaper.amplitudes
    return np.stack(taylor, axis=1)
