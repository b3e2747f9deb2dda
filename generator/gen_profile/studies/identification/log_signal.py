"""The signal of a swing among a logger's columns: which hold it, about which axis, and where it jumps."""

import math
import re

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.log_table import LogTable
from gen_profile.support.errors import OutputError
from gen_profile.support.phrase import AND, Phrase, joined

_TIME = re.compile(
    r".*(time|zeit|temps|tempo|tiempo|stamp|elapsed|millis|micros|seconds|date|datum|uhr|epoch).*"
    r"|t([ _\[(].*)?",
    re.IGNORECASE,
)
_FREQUENCY = re.compile(r"#?\s*(freq|frequency|frequenz|fréquence|frecuencia)\b.*", re.IGNORECASE)
_COUNT = re.compile(r"#|no\.?|nr\.?|num|index|samples?|records?", re.IGNORECASE)  # of rows, and no time
NAMES = {  # what columns are called that hold a quantity
    "angle": re.compile(r".*(angle|winkel|angol|ángulo|tilt|incl|pitch|roll).*", re.IGNORECASE),
    "sway": re.compile(r".*(sway|auslenk|oscill|oscilac|deflection).*", re.IGNORECASE),
    "rate": re.compile(r".*(gyr|rate|omega|ω|angular.?vel).*", re.IGNORECASE),
    "acceleration": re.compile(r".*(acc|beschl).*", re.IGNORECASE),
}
ALONE = 0.9  # of a swing, which a sensor shows about one axis where the load swings in one direction
LOOKED_AT = 100  # rows all over a log, by which a column of values differs from one of names and channels
NEIGHBOURS = 51  # samples, among which one that jumps stands out
JUMP = 12.0  # times as far beside the middle of its neighbours as most are around it
ROUNDS = 3
GAP = 3.5  # usual steps, over which nothing tells where a swing would be
PEAK = 0.1  # of a spectrum's greatest peak, by which a resonance stands out
STEPS = 10.0  # of a sensor's resolution, which no jump is less than


def likely_columns(table: LogTable, quantity: str) -> tuple[str, str]:
    """Choose the columns of times and of values by their names, or else by what they hold; numbers from 1.

    Of several columns that may hold the values the first one is taken whose numbers change.
    """
    head = table.head(("1", "2"))
    names = list(table.rows[head]) if table.is_head(head) else []
    clocks = [place for place, name in enumerate(names) if _TIME.fullmatch(name)]
    counts = [place for place, name in enumerate(names) if _COUNT.fullmatch(name)]
    first, last = min(head + 2, len(table.rows) - 1), len(table.rows) - 1
    running = [place for place in clocks if table.seconds(first, place) < table.seconds(last, place)]
    readable = [place for place in clocks if not math.isnan(table.seconds(last, place))]  # at midnight, too
    time = next(iter(running or readable or clocks or counts), 0)
    others = [place for place in range(len(names)) if place not in {*clocks, *counts, time}]
    named = [place for place in others if NAMES[quantity].fullmatch(names[place])]
    swinging = (place for place in others if _changes(table, place, range(first, last + 1)))
    value = named[0] if named else next(swinging, next(iter(others), 1))
    return str(time + 1), str(value + 1)


def refuse_spectrum(table: LogTable, head: int, time: int) -> None:
    """Refuse a table over frequencies, such as Klipper's resonances, and tell the periods of its peaks.

    Raises
    ------
    OutputError
    """
    name = table.cell(head, time)
    if not (table.is_head(head) and (_FREQUENCY.fullmatch(name) or table.unit(head, time) == "Hz")):
        return
    rows = range(head + 1, len(table.rows))
    cells = [[table.number(row, place) for place in range(len(table.rows[head]))] for row in rows]
    values = np.array([row for row in cells if math.isfinite(row[time])] or [[0.0]])
    frequencies, power = values[:, min(time, values.shape[1] - 1)], np.zeros(len(values))
    for column in np.nan_to_num(np.delete(values, time, axis=1)).T if values.shape[1] > 1 else ():
        power = max(power, column, key=np.ptp)
    from scipy.signal import find_peaks  # noqa: PLC0415  (half of what the command line takes to start)

    peaks, _ = find_peaks(power, prominence=PEAK * max(float(power.max()), 1e-300))
    found = [(float(frequencies[at]), float(np.ptp(frequencies[at - 1 : at + 2]) / 4.0)) for at in peaks]
    cure: str = "log a swing over the time"
    if found := [(hertz, apart) for hertz, apart in found if hertz > 0.0 and apart > 0.0]:
        template = "state the periods of what swings by itself, such as {periods}"
        periods = [
            f"--period {f'{mode}:' * (mode > 1)}{1.0 / hertz:.4g}±{apart / hertz**2:.2g}"
            for mode, (hertz, apart) in enumerate(found, 1)
        ]
        cure = Phrase(template, periods=" ".join(periods))
    shown = joined(AND, [f"{hertz:.4g}" for hertz, _ in found]) if found else ""
    peaked: str = Phrase(" with peaks at {hertz} Hz", hertz=shown) if found else ""
    template = "{source}: over {name!r} this is a spectrum{peaked}, and no swing over the time; {cure}."
    raise OutputError(template, source=table.source, name=name, peaked=peaked, cure=cure)


def _changes(table: LogTable, place: int, rows: range) -> bool:
    """Tell whether a column holds different numbers in some rows all over a log, and no name or channel."""
    some = rows[:: max(len(rows) // LOOKED_AT, 1)]
    return len({number for row in some if not math.isnan(number := table.number(row, place))}) > 1


def same_sensor(table: LogTable, head: int, place: int) -> tuple[int, ...]:
    """Find the columns of a sensor's axes x, y and z by the name of one; else that one alone."""
    if not table.is_head(head):
        return (place,)
    names, name = list(table.rows[head]), table.cell(head, place)
    for at, letter in enumerate(name):
        axes = next((axes for axes in ("xyz", "XYZ") if letter in axes), "")
        found = [f"{name[:at]}{axis}{name[at + 1 :]}" for axis in axes]
        if axes and all(one in names for one in found):
            return tuple(names.index(one) for one in found)
    return (place,)


def about_one_axis(values: Array, chosen: int) -> tuple[Array, Array, float]:
    """Combine a sensor's axes into that of the swing.

    Parameters
    ----------
    values : (samples, 3) array
    chosen : int
        The axis that shall be positive.

    Returns
    -------
    (samples,) array
    axis : (3,) array
        Its direction, of length 1.
    share : float
        How much of what all axes show it does.
    """
    swing = values - values.mean(axis=0)
    powers, axes = np.linalg.eigh(swing.T @ swing)
    axis = axes[:, -1]
    sign = np.sign(axis[chosen]) or 1.0
    return values @ axis * sign, axis * sign, float(powers[-1] / max(powers.sum(), 1e-300))


def axis_note(name: str, axis: Array, share: float) -> str:
    """Tell which axis was taken, and whether that is all of it."""
    words = " ".join(f"{part:+.2f} {letter}" for part, letter in zip(axis.tolist(), "xyz", strict=True))
    if share < ALONE:
        template = (
            "of {name!r} and the sensor's other axes the swing's own is taken ({words}), though it shows "
            "{share:.0%} only of what they show: let the load swing in one direction, and not turn"
        )
        return Phrase(template, name=name, words=words, share=share)
    template = "of {name!r} and the sensor's other axes the swing's own is taken ({words})"
    return Phrase(template, name=name, words=words)


def resolution(values: Array) -> float:
    """Find the least step between different values, as of an encoder that counts; infinite without any."""
    steps = np.diff(np.sort(values))  # NumPy's unique takes ten times as long for floats
    return float(steps[steps > 0.0].min(initial=np.inf))


def jumps(times: Array, values: Array, resolution: float) -> NDArray[np.intp]:
    """Find single samples that are beside a smooth swing, as a lost bit or a loose contact leaves them.

    Parameters
    ----------
    times, values : (samples,) arrays
    resolution : float
        Least step between different values.

    Returns
    -------
    (jumps,) array of int
    """
    kept = np.arange(len(values))
    for _ in range(ROUNDS):  # one jump beside another is seen once that is left out
        beside = _alone(times[kept], values[kept], resolution) if len(kept) > NEIGHBOURS else kept[:0]
        kept = np.delete(kept, beside)
    return np.delete(np.arange(len(values)), kept)


def _alone(times: Array, values: Array, resolution: float) -> NDArray[np.intp]:
    """Find samples that are farther beside a line between their neighbours than those are beside theirs."""
    before, after = values[:-2], values[2:]
    steps = np.diff(times)
    share = steps[:-1] / (steps[:-1] + steps[1:])
    beside = np.abs(values[1:-1] - (before + share * (after - before)))
    around = median_filter(beside, NEIGHBOURS, mode="reflect")
    limit = JUMP * around + STEPS * (resolution if np.isfinite(resolution) else 0.0)
    padded = np.pad(beside, 1)
    alone = beside > np.maximum(padded[:-2], padded[2:])
    close = np.maximum(steps[:-1], steps[1:]) < GAP * np.median(steps)
    return np.flatnonzero((beside > limit) & alone & close) + 1
