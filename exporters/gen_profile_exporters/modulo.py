"""Modulo axes: positions wrapped within a turn, and motions read back from them.

Motions are continuous everywhere but in what is written to such an axis and read from it. A turn is measured
in axis units or in whole counts; in counts it may be all of the 32 bits in which drives hold a position, and
positions then lie around zero.
"""

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import ExportError
from gen_profile.support.units import COUNTS, AxisScale

ALL_BITS = 2**32  # counts
MOST_COUNTS = 2**31  # counts, of any other turn
WHOLE = 1e-4  # of a count


def turn_counts(axis: AxisScale) -> int | None:
    """Tell the counts of a turn; None where the axis is no modulo axis.

    Raises
    ------
    ExportError
        They are not whole, or too many.
    """
    if axis.modulo is None:
        return None
    exact = axis.modulo / abs(axis.factor) * abs(axis.counts_per_si)
    turn, shown = round(exact), f"axis {axis.name}: a turn of axis.modulo = {axis.modulo:.15g} {axis.unit}"
    if turn != ALL_BITS and not 2 <= turn <= MOST_COUNTS:
        raise ExportError(
            f"{shown} has {turn} counts; drives count 2 to {MOST_COUNTS}, or all {ALL_BITS} of 32 bits."
        )
    if abs(exact - turn) > WHOLE:
        cure = "all counts of a turn"
        if axis.unit != COUNTS:
            metres = axis.modulo / abs(axis.factor)
            cure = f"axis.counts_per_metre = [COUNTS, {metres!r}] with the counts of a turn"
        raise ExportError(
            f"{shown} has {exact:.15g} counts, which are not whole, so that every turn would be off; state "
            f"{cure}."
        )
    return turn


def least(turn: float) -> float:
    """Least position of an axis, the greatest being the last one within a turn from there."""
    return -turn / 2.0 if turn == ALL_BITS else 0.0


def within(value: int, turn: int) -> int:
    """Find a count's place within a turn."""
    low = int(least(turn))
    return (value - low) % turn + low


def nearest(value: int, turn: int | None, near: int) -> int:
    """Find which of the counts that an axis tells alike is nearest to one."""
    return value if turn is None else value + turn * round((near - value) / turn)


def wrapped(position: Array, turn: float) -> Array:
    """Find the places of positions within a turn, shape (samples,)."""
    low = least(turn)
    places = np.mod(position - low, turn) + low
    return np.where(places < low + turn, places, low) + 0.0  # a rounded sum may be the turn itself


def unwrapped(places: Array, turn: float, near: float) -> Array:
    """Make a motion of places within a turn, by the shorter ways; it begins as near as can be to a position.

    Parameters
    ----------
    places : (samples,) array
    turn : float
    near : float

    Returns
    -------
    (samples,) array
        Each place, and whole turns.
    """
    turns = np.rint((near - places[0]) / turn) - np.append(0.0, np.cumsum(np.rint(np.diff(places) / turn)))
    return np.asarray(places + turn * turns)


def require_short_steps(position: Array, turn: float, axis: AxisScale, cycle_time: float) -> None:
    """Require that a motion goes less than half a turn in any cycle, so that its direction is known.

    Raises
    ------
    ExportError
    """
    steps = np.abs(np.diff(position))
    if steps.size and steps.max() >= 0.5 * turn:
        raise ExportError(
            f"axis {axis.name}: it goes half a turn of axis.modulo or more in a cycle of {cycle_time:g} s "
            f"(at {int(steps.argmax()) * cycle_time:g} s), so the direction is ambiguous; shorten the cycle."
        )
