"""A running stream as curves on a terminal."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from gen_profile.delivery.streaming.live import LOOK_INTERVAL, Glance, View
from gen_profile.motion.profile import Array

HEIGHT = 8  # lines of a picture
SCALE = 12  # columns beside it, for the scale
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # of a Braille character, by row
BLANK = 0x2800
PLANNED, ACTUAL = "bright_black", "bold green"


def show(view: View, look: Callable[[], Glance], over: Callable[[], bool]) -> None:
    """Draw planned and actual positions on stderr until the stream is over."""
    console = Console(stderr=True)
    with Live(console=console, auto_refresh=False, refresh_per_second=1 / LOOK_INTERVAL) as live:
        while True:
            live.update(picture(view, look(), console.width), refresh=True)
            if over():
                break
        live.update(picture(view, look(), console.width), refresh=True)


def picture(view: View, glance: Glance, width: int) -> Group:
    """Draw one moment: a line of figures, and a picture for every axis."""
    duration = (len(view.planned) - 1) * view.period
    at = max(0, glance.cycle - 1) * view.period
    head = Text(
        f"{view.name}: {glance.phase.value}, {at:.1f} of {duration:.1f} s, late by {glance.late:.0f} µs "
        "at most"
    )
    parts = [head]
    for column, (axis, unit) in enumerate(zip(view.axes, view.units, strict=True)):
        planned, actual = view.planned[:, column], glance.actual[:, column]
        answered = actual[~np.isnan(actual)]
        place = f"{answered[-1]:.4g} {unit}, " if answered.size else ""
        parts.append(Text(f"{axis}: {place}at most {1e3 * glance.apart[column]:.3g} m{unit} off the motion"))
        parts += curves(planned, actual, max(10, width - SCALE), HEIGHT)
    return Group(*parts)


def curves(planned: Array, actual: Array, width: int, height: int) -> list[Text]:
    """Draw two curves over the same time, the second one over the first; four rows of dots a line.

    Parameters
    ----------
    planned, actual : (n,) array
        Not a number where there is nothing.
    width, height : int
        In characters.
    """
    both = np.concatenate([planned, actual])
    low, high = float(np.nanmin(both)), float(np.nanmax(both))
    under, over = (_cells(values, low, high, width, height) for values in (planned, actual))
    lines = []
    for row in range(height):
        label = {0: high, height - 1: low}.get(row)
        line = Text("" if label is None else f"{label:.4g}".rjust(SCALE - 2), style="default")
        line.pad_left(SCALE - 1 - len(line))
        line.pad_right(SCALE - len(line))
        for below, above in zip(under[row], over[row], strict=True):
            line.append(chr(BLANK + int(below | above)), style=ACTUAL if above else PLANNED)
        lines.append(line)
    return lines


def _cells(values: Array, low: float, high: float, width: int, height: int) -> NDArray[np.int64]:
    """Set the dots of a curve; returns the Braille character of each cell, shape (height, width)."""
    columns, rows = 2 * width, 4 * height
    known = np.flatnonzero(~np.isnan(values))
    cells = np.zeros((height, width), dtype=np.int64)
    if not known.size:
        return cells
    x = known * (columns - 1) // max(1, len(values) - 1)
    fraction = (values[known] - low) / ((high - low) or 1.0)
    y = np.rint((1.0 - fraction) * (rows - 1)).astype(np.int64)
    np.bitwise_or.at(cells, (y // 4, x // 2), DOTS[y % 4, x % 2])
    return cells
