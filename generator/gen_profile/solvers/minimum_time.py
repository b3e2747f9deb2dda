"""The least value that will do, where every greater one does."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import TypeVar

from gen_profile.work import OutOfWork, budget, left

PRECISION = 1e-3  # relative, of the duration; what is returned is the feasible end
STRIDE = 1.5
BISECTING = 0.6  # share of the work that is left
LONGER = 8.0  # from stride to stride away from a duration that is too short
CORRECTIONS = 3
ROUGHLY = 5e-3  # precision of rough looks, by which it is seen how fast the excess falls
UNNOTICED = 5e-3  # excess below zero that is not worth another exact look
BEYOND = 1.2  # times the distance to where a line through two tries crosses zero
ASIDE = 0.4  # of the precision, by which a try lies beside where a line crosses zero, for a narrow bracket


Found = TypeVar("Found")


def least(
    feasible: Callable[[float], bool],
    guess: float,
    most: float,
    precision: float = PRECISION,
) -> float | None:
    """Bisect for the least value that will do, where every greater one does.

    Parameters
    ----------
    feasible : float → bool
    guess : float
        Roughly.
    most : float
        Where to give up.
    precision : float
        Relative.

    Returns
    -------
    float or None
        None where none up to `most` was found to do.
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

    def excess(value: float) -> float:
        return -math.inf if feasible(value) else math.inf

    return _between(excess, (short, math.inf), (enough, -math.inf), precision)


def least_beyond(
    excess: Callable[[float], float],
    short: float,
    most: float,
    short_excess: float = math.inf,
    precision: float = PRECISION,
) -> float | None:
    """Find the least duration that will do beyond one that will not, which is often next to it.

    Parameters
    ----------
    excess : float → float
        Positive where a duration will not do, and continuous; infinite where that is all that is known.
    short : float
        Too short, in s.
    most : float
        Where to give up, in s.
    short_excess : float
        Of the one that is too short.
    precision : float
        Relative.

    Returns
    -------
    float or None
        s; None where none up to `most` was found to do.
    """
    stride, found = precision, (short, short_excess)
    while True:
        enough = (1.0 + stride) * short
        beyond = excess(enough)
        if beyond <= 0.0:
            return _between(excess, found, (enough, beyond), precision)
        if enough > most:
            return None
        farthest, falls = LONGER * stride, (found[1] - beyond) / (enough - found[0])
        if 0.0 < falls < math.inf:  # a little beyond where a line crosses zero
            farthest = min(farthest, stride + BEYOND * beyond / falls / short)
        found, stride = (enough, beyond), max(farthest, stride + precision)


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
        The excess of a duration, and what belongs to it.
    start, most : float
        Where to begin and to give up, in s.
    rounded : float → float
        Rounds up to durations that there are.

    Returns
    -------
    anything or None
        None where no duration up to `most` was found to do.
    """
    roughly, exactly = cache(roughly), cache(exactly)  # for many a duration is rounded to the same one
    start, best = rounded(start), None

    def least(excess: Callable[[float], float], precision: float = PRECISION) -> float | None:
        def of_rounded(duration: float) -> float:
            return excess(rounded(duration))

        if of_rounded(start) <= 0.0:
            return start
        found = least_beyond(of_rounded, start, most, of_rounded(start), precision)
        return None if found is None else rounded(found)

    duration = least(roughly, ROUGHLY)
    for _ in range(CORRECTIONS):
        if duration is None:
            break
        excess, found = exactly(duration)
        if excess <= 0.0 and (best is None or duration < best[0]):
            best = duration, found
        if not math.isfinite(excess) or (excess <= 0.0 and (duration == start or excess > -UNNOTICED)):
            break
        beside = start if duration > start else rounded((1.0 + ROUGHLY) * start)
        falls = (roughly(duration) - roughly(beside)) / (beside - duration)
        if not 0.0 < falls < math.inf:
            break
        duration = max(start, rounded(duration + (excess + UNNOTICED / 2.0) / falls))
    if best is None:
        duration = least(lambda duration: exactly(duration)[0])
        return None if duration is None else exactly(duration)[1]
    return best[1]


def _between(
    excess: Callable[[float], float],
    short: tuple[float, float],
    enough: tuple[float, float],
    precision: float,
) -> float:
    """Narrow a bracket as far as a share of the work that is left allows, and return the end that will do.

    Where the excess is known at both ends, by the rule of false position, an end's excess being halved when
    the other one was replaced twice (the Illinois method: M. Dowell, P. Jarratt, BIT 11, 1971, 168-174); by
    bisection elsewhere.

    Parameters
    ----------
    excess : float → float
    short, enough : (float, float)
        The ends of the bracket and their excess.
    precision : float
        Relative.
    """
    side = 0.0  # on which the last try was: -1 too short
    with suppress(OutOfWork), budget(BISECTING * left()):
        while (width := enough[0] - short[0]) > precision * enough[0]:
            middle = short[0] + width / 2.0
            if math.isfinite(enough[1] - short[1]):
                aside = ASIDE * precision * enough[0]
                crossing = enough[0] - width * enough[1] / (enough[1] - short[1])
                middle = min(max(crossing - (side or -1.0) * aside, short[0] + aside), enough[0] - aside)
            found = middle, excess(middle)
            if found[1] <= 0.0:
                enough, short = found, (short[0], short[1] * (0.5 if side > 0.0 else 1.0))
                side = 1.0
            else:
                short, enough = found, (enough[0], enough[1] * (0.5 if side < 0.0 else 1.0))
                side = -1.0
    return enough[0]
