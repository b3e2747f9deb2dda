"""The least value that will do, where every greater one does."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TypeVar

import attrs

from gen_profile.work import OutOfWork, budget, left

PRECISION = 1e-3  # relative, of the duration; what is returned is the feasible end
STRIDE = 1.5
BISECTING = 0.6  # share of the work that is left
LONGER = 8.0  # from stride to stride away from a duration that is too short
STEEPNESS = 15.0  # with which an excess falls over the duration's logarithm, as far as nothing is known of it
BEYOND = 1.1  # times the distance to where a line through two tries crosses zero
UNKNOWN = 1e-9  # excess of the duration to begin with, where it may do
BENT = 0.35  # share of what a shorter duration leaves that counts: an excess falls ever more slowly
ASIDE = 0.4  # of the precision, by which a try lies at least beside another one


@attrs.frozen
class Enough:
    """What need not be known more exactly: a duration, relatively, or an excess between two bounds."""

    precision: float
    low: float
    high: float


ROUGHLY = Enough(5e-3, -3e-2, 3e-2)
EXACTLY = Enough(PRECISION, -5e-3, 0.0)

Found = TypeVar("Found")


def least(
    feasible: Callable[[float], bool], guess: float, most: float, precision: float = PRECISION
) -> float | None:
    """Bisect for the least value up to `most` that will do, where every greater one does; None without any.

    Parameters
    ----------
    feasible : float → bool
    guess, most : float
        Where to begin and to give up.
    precision : float
        Relative.
    """
    if feasible(guess):
        enough, short = guess, guess / STRIDE
        with suppress(OutOfWork):
            while feasible(short):
                enough, short = short, short / STRIDE
    else:
        enough, short = STRIDE * guess, guess
        while not feasible(enough):
            enough, short = STRIDE * enough, enough
            if enough > most:
                return None

    with suppress(OutOfWork), budget(BISECTING * left()):
        while enough - short > precision * enough:
            middle = (short + enough) / 2.0
            short, enough = (short, middle) if feasible(middle) else (middle, enough)
    return enough


def least_corrected(
    roughly: Callable[[float], float],
    exactly: Callable[[float], tuple[float, Found]],
    start: float,
    most: float,
    rounded: Callable[[float], float],
) -> Found | None:
    """Find what belongs to the least duration that will do, with few exact looks.

    What the rough excess and the exact one differ by should hardly depend on the duration.

    Parameters
    ----------
    roughly, exactly : float → float, float → (float, anything)
        The excess of a duration, positive where it will not do, and what belongs to it.
    start, most : float
        Where to begin and to give up, in s.
    rounded : float → float
        Rounds up to durations that there are.

    Returns
    -------
    anything or None
        None where no duration up to `most` was found to do.
    """
    start = rounded(start)
    rough = dict[float, float]()
    trial: float | None = start
    while trial is not None:
        rough[trial] = roughly(trial)
        trial = _next(rough, ROUGHLY, most, rounded)
    known, found = dict[float, float](), dict[float, Found]()
    first = trial = min((each for each in rough if rough[each] <= ROUGHLY.high), default=start)
    while trial is not None:
        known[trial], found[trial] = exactly(trial)
        beside = known[first] - rough[first]
        bent = BENT if min(known.values()) <= 0.0 else 1.0
        below = {each: bent * (rough[each] + beside) for each in rough if each < min(known)}
        too_short = {each: excess for each, excess in below.items() if excess > 0.0}
        if start in below:
            too_short.setdefault(start, UNKNOWN)
        trial = _next(too_short | known, EXACTLY, most, rounded)
    best = min((each for each in found if known[each] <= 0.0), default=None)
    return None if best is None else found[best]


def _next(
    known: Mapping[float, float], sufficient: Enough, most: float, rounded: Callable[[float], float]
) -> float | None:
    """Choose the next duration to try by the excess of those that are known; None where that is enough."""
    if any(sufficient.low <= excess <= sufficient.high for excess in known.values()):
        return None
    enough = min((each for each in known if known[each] <= 0.0), default=math.inf)
    short = max((each for each in known if each < enough), default=-math.inf)
    if enough == math.inf:
        trial = _beyond(known, sufficient.precision)
    elif enough - short <= sufficient.precision * enough or short == -math.inf:
        return None
    else:
        trial = _between(known, sufficient, short, enough)
    trial = rounded(trial)
    return None if trial > most or trial in known else trial


def _beyond(known: Mapping[float, float], precision: float) -> float:
    """Step on from durations none of which will do, with longer strides where nothing tells how far."""
    tried = sorted(known)
    finite = [each for each in tried if known[each] < math.inf][-2:]
    last, stride = tried[-1], precision
    if len(tried) > 1:
        stride = max(stride, LONGER * (last / tried[-2] - 1.0))
    if last in finite:
        falls = (known[finite[0]] - known[last]) / (last - finite[0]) if len(finite) > 1 else STEEPNESS / last
        if falls > 0.0:
            stride = BEYOND * known[last] / falls / last
    return last * (1.0 + max(stride, precision))


def _between(known: Mapping[float, float], sufficient: Enough, short: float, enough: float) -> float:
    """Interpolate between the two durations whose excess is nearest to zero, or bisect."""
    nearest, near = sorted(known, key=lambda each: abs(known[each]))[:2]
    falls, aside = (known[nearest] - known[near]) / (near - nearest), ASIDE * sufficient.precision * enough
    if 0.0 < falls < math.inf:
        trial = nearest + (known[nearest] - (sufficient.low + sufficient.high) / 2.0) / falls
        if short < trial < enough:
            return min(max(trial, short + aside), enough - aside)
    return (short + enough) / 2.0
