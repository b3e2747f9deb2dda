"""Clocks of loggers: the time that a cell tells, the unit of numbers, and where a clock begins anew."""

import math
import re
from datetime import UTC, datetime

import numpy as np

from gen_profile.motion.profile import Array

TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # how many of them make a second
# least and greatest number of a clock that counts from a date, how many make a second, and what they are
EPOCHS = (
    (9e8, 4.3e9, 1.0, "s"),  # since 1970, or 1904
    (9e11, 4.3e12, 1e3, "ms"),
    (9e14, 4.3e15, 1e6, "us"),
    (9e17, 4.3e18, 1e9, "ns"),
    (1.2e17, 1.6e17, 1e7, "100 ns"),  # since 1601, as Windows counts
    (6.2e17, 6.6e17, 1e7, "100 ns"),  # since the year 1, as .NET does
    (3e4, 6e4, 1.0 / 86400.0, "d"),  # since 1900, as spreadsheets do
)
LATEST = 1e19  # in any unit
CLOSEST, FARTHEST, LONGEST = 2e-4, 2.0, 3600.0  # s between samples of a swing, and of a log
HALF_DAY = 43200.0  # s
COUNTERS = (2.0**16, 2.0**32, 86400.0, 86400e3, 86400e6)  # at which numbers begin anew
NEXT = 3.0  # samples after which a clock that began anew goes on, at most
_DAY_FIRST = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})(?!\d)")  # as in 27.11.2026
_TIME_OF_DAY = re.compile(
    r"(?:.*[^\d:.,])?(?:(\d\d?):)?(\d{1,2}):(\d\d)(?:[.,:](\d+))?"
    r"(?:\s*([AP])\.?\s?M\.?)?\s*(?:Z|UTC|GMT|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
DURATIONS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # s
_DURATION = re.compile(  # a TIME of IEC 61131-3, as in T#1m2s345ms
    r"L?T(?:IME)?#(-?)" + "".join(rf"(?:(\d+(?:\.\d+)?){unit}_?)?" for unit in DURATIONS), re.IGNORECASE
)


def seconds_of(text: str) -> float:
    """Read a date (ISO 8601, or day first) in s, a TIME, or a time of day behind any other date; else NaN."""
    if (match := _DURATION.fullmatch(text)) and any(parts := match.groups()[1:]):
        total = sum(float(part or 0.0) * unit for part, unit in zip(parts, DURATIONS.values(), strict=True))
        return -total if match[1] else total
    dated = _DAY_FIRST.sub(lambda day: f"{day[3]}-{day[2]:0>2}-{day[1]:0>2}", text).replace(",", ".")
    try:
        moment = datetime.fromisoformat(dated)
    except ValueError:
        match = _TIME_OF_DAY.fullmatch(text)
        return _of_day(match) if match else math.nan
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _of_day(match: re.Match[str]) -> float:
    """Add up hours, minutes and seconds; half past twelve a.m. is half an hour after midnight."""
    hours, minutes, seconds, fraction, half = match.groups()
    hour = float(hours or 0)
    if half:
        hour = hour % 12.0 + 12.0 * (half in "pP")
    return 3600.0 * hour + 60.0 * float(minutes) + float(f"{seconds}.{fraction or 0}")


def unit_of(times: Array) -> tuple[float, str, bool]:
    """Find the unit of a clock whose log states none.

    Parameters
    ----------
    times : (samples,) array
        As they were logged; in s where nothing tells another unit.

    Returns
    -------
    float
        How many of its unit make a second.
    str
        The unit.
    bool
        Whether it counts from a date.
    """
    steps = np.diff(times)
    step = float(np.median(np.abs(steps[steps != 0.0]))) if steps.any() else 0.0
    lasts = float(np.abs(steps[np.abs(steps) < FARTHEST * 1e3 * max(step, 1e-9)]).sum())

    def may_be(per_second: float) -> bool:
        return CLOSEST <= step / per_second <= FARTHEST and lasts / per_second <= LONGEST

    first = float(times[0]) if len(times) else 0.0
    for low, high, per_second, unit in EPOCHS:
        if low <= first <= high and (CLOSEST <= step / per_second <= FARTHEST):
            return per_second, unit, True
    found = next((unit for unit, per_second in TIME_UNITS.items() if may_be(per_second)), "s")
    return TIME_UNITS[found], found, False


def unwrapped(times: Array, *, of_day: bool) -> tuple[Array, int]:
    """Go on where a clock began anew: at midnight, noon or the hour, or at the end of a counter.

    Parameters
    ----------
    times : (samples,) array
        As they were logged.
    of_day : bool
        Whether they are times of day, in s.

    Returns
    -------
    (samples,) array
    int
        How many times it began anew.
    """
    steps, count = np.diff(times), 0
    forward = steps[steps > 0.0]
    if not len(forward):
        return times, 0
    step, shift = float(np.median(forward)), np.zeros(len(times))
    for index in np.flatnonzero(steps < 0.0).tolist():
        ends = (2.0 * HALF_DAY, HALF_DAY, 3600.0) if of_day else COUNTERS
        lost = [end for end in ends if 0.0 < end + steps[index] <= NEXT * max(step, 1.0 if of_day else 0.0)]
        if lost:
            shift[index + 1 :] += lost[0]
            count += 1
    return times + shift, count
