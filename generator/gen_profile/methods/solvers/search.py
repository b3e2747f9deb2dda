"""The least value that works, where every greater one does: one search for whatever is looked for like that.

A candidate is a number: a duration, how many times as wide limits are, a spread of machines. Its excess
is the logarithm of what it takes over what is allowed; a candidate works where that is not positive. Excesses
fall with the logarithm of the number, more or less steadily: secants lead to the least one that works, and
bisection where an excess is infinite, so that only is known whether the candidate works.
"""

import math
from collections.abc import Callable, Mapping

import attrs

from gen_profile.support.work import OutOfWork

ASIDE = 0.4  # of the precision, by which a try lies at least beside another one
# where an excess falls by no more than that over some twice the value, none works
LEAST_FALL, HOPELESS = 0.01, 0.99 * math.log(2.0)
FARTHEST = math.log(30.0)  # longest step where two tries tell how the excess falls


@attrs.frozen(kw_only=True)
class Search:
    """How a least value is looked for; lengths are differences of its logarithm.

    Attributes
    ----------
    precision : float
        Between a value that works and one that does not, at which a search ends.
    close : float
        How far below zero an excess may be that is as good as zero; by default the first value that works is.
    aim : float
        Excess that steps aim at.
    slope : float
        With which an excess falls, until two tries tell.
    believed : (float, float)
        Between which what two tries tell of it is believed.
    stride, growth, longest : float
        First step from a value of which only is known whether it works, from step to step, and the longest.
    downward : bool
        Whether values below the first one are tried.
    tries : int
        At most.
    """

    precision: float
    close: float = math.inf
    aim: float = 0.0
    slope: float = 1.0
    believed: tuple[float, float] = (1.0, 1.0)
    stride: float = attrs.field()
    growth: float = 2.0
    longest: float = math.log(2.0)
    downward: bool = False
    tries: int = 50

    @stride.default
    def _precision(self) -> float:
        return self.precision


def least(
    excess: Callable[[float], float],
    start: float,
    search: Search,
    most: float = math.inf,
    rounded: Callable[[float], float] = float,
) -> float | None:
    """Find the least value that works, or the best one that was found when the work was used up.

    Parameters
    ----------
    excess : float → float
        Called once for each value.
    start, most : float
        Where to begin and to give up.
    search : Search
    rounded : float → float
        To values that there are.

    Returns
    -------
    float or None
        None where no value was found to work.

    Raises
    ------
    OutOfWork
        Before any was.
    """
    tried: dict[float, float] = {}
    trial: float | None = rounded(start)
    try:
        while trial is not None and trial <= most and trial not in tried and len(tried) < search.tries:
            tried[trial] = excess(trial)
            trial = _next(tried, search)
            trial = None if trial is None else rounded(trial)
    except OutOfWork:
        if all(exceeds > 0.0 for exceeds in tried.values()):
            raise
    return min((value for value, exceeds in tried.items() if exceeds <= 0.0), default=None)


def _next(tried: Mapping[float, float], search: Search) -> float | None:
    """Choose the next value to try; none where what is known will do."""
    upper = min((value for value in tried if tried[value] <= 0.0), default=math.inf)
    lower = max((value for value in tried if value < upper), default=0.0)
    if upper == math.inf:
        step = _step(tried, lower, search)
        return None if step is None else lower * math.exp(step)
    if tried[upper] >= -search.close:
        return None
    if lower == 0.0:
        return upper * math.exp(_step(tried, upper, search) or 0.0) if search.downward else None
    gap = math.log(upper / lower)
    if gap <= search.precision:
        return None
    slope = slope_of(tried)
    nearest = min(tried, key=lambda value: abs(tried[value]))
    if slope is not None and slope > 0.0:
        beyond = math.log(nearest / lower) + (tried[nearest] - search.aim) / slope
        aside = ASIDE * search.precision
        if 0.0 < beyond < gap:
            return lower * math.exp(min(max(beyond, aside), gap - aside))
    return math.sqrt(upper * lower)


def _step(tried: Mapping[float, float], last: float, search: Search) -> float | None:
    """Step on from the greatest value, if none works, or back from the least; none where none will work."""
    exceeds, sign = tried[last], math.copysign(1.0, tried[last])
    if math.isinf(exceeds):
        unknown = (value for value in tried if value != last and math.isinf(tried[value]))
        strides = [abs(math.log(last / value)) for value in unknown]
        return sign * min(search.growth * min(strides) if strides else search.stride, search.longest)
    unchanged = min((value for value in tried if tried[value] < exceeds + LEAST_FALL), default=last)
    if sign > 0.0 and math.log(last / unchanged) > HOPELESS:
        return None
    slope, longest, known = search.slope, search.longest, slope_of(tried)
    if known is not None and known > 0.0:
        slope = min(max(known, search.believed[0]), search.believed[1])
        longest = FARTHEST if slope == known else longest
    return sign * min(max(abs(exceeds - search.aim) / slope, search.precision), longest)


def slope_of(tried: Mapping[float, float]) -> float | None:
    """Tell how an excess falls between the two values that are nearest to the least one, if there are two."""
    known = [value for value in tried if math.isfinite(tried[value])]
    if len(known) < 2:
        return None
    one, other = sorted(known, key=lambda value: abs(tried[value]))[:2]
    return (tried[one] - tried[other]) / math.log(other / one)
