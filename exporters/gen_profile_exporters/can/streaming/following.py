"""Whether drives take the setpoints: what each tells of its way, held against the motion."""

from collections.abc import Sequence

import attrs
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.streaming.watch import WatchedAxis
from gen_profile_exporters.exporter import Target

LAG = 0.1  # s; a drive may be so late, and is not taken for one that stands still
SLOW = 0.1  # of the motion's greatest step; slower setpoints tell nothing
LEAST_STEP = 4  # counts; smaller steps tell nothing beside rounding


@attrs.frozen(kw_only=True)
class Standstill:
    """Cycles in which an axis stood still, or nearly, while its setpoints went on.

    Attributes
    ----------
    column : int
        Of the axes.
    cycles : tuple of int
        Their numbers, in order.
    apart : int
        How far the axis was off the motion in one of them at most, in counts.
    """

    column: int
    cycles: tuple[int, ...]
    apart: int


def standstills(
    led: Integers, actual: Integers, answered: NDArray[np.bool_], period: float
) -> tuple[Standstill, ...]:
    """Find the cycles in which axes moved less than half of the least that the latest setpoints asked for.

    Parameters
    ----------
    led : (cycles, axes) integer array
        Where the axes were to be by each SYNC, in counts.
    actual : (cycles, axes) integer array
        Where they were.
    answered : (cycles,) boolean array
        For which cycles that is known.
    period : float
        SYNC period in s.
    """
    window = max(1, round(LAG / period))
    steps = np.diff(led, axis=0)
    if len(steps) < window:
        return ()
    still = []
    for column in range(led.shape[1]):
        latest = sliding_window_view(steps[:, column], window)  # by row: the steps up to cycle row + window
        ahead = np.where((latest > 0).all(axis=1), latest.min(axis=1), 0)
        back = np.where((latest < 0).all(axis=1), latest.max(axis=1), 0)
        least = ahead + back
        moved = np.diff(actual[:, column])[window - 1 :] * np.sign(least)
        moving = np.abs(least) >= max(LEAST_STEP, SLOW * np.abs(steps[:, column]).max())
        known = (answered[1:] & answered[:-1])[window - 1 :]
        cycles = np.flatnonzero(moving & known & (moved < 0.5 * np.abs(least))) + window
        if cycles.size:
            apart = np.abs(actual[cycles, column] - led[cycles, column]).max()
            still.append(Standstill(column=column, cycles=tuple(map(int, cycles)), apart=int(apart)))
    return tuple(still)


class Following:
    """Holds what each axis tells of its position to where it was led, whatever its drive makes of it.

    Parameters
    ----------
    axes : sequence of WatchedAxis
    target : Target
    windows : sequence of int
        How far each may be off, in counts.
    """

    def __init__(self, axes: Sequence[WatchedAxis], target: Target, windows: Sequence[int]) -> None:
        self._axes, self._windows = axes, windows
        self._scales = [abs(axis.counts_per_si) for axis in target.axes]
        self._led: Integers | None = None
        self._judged = [0] * len(axes)  # instants of the positions judged last

    def lead(self, led: Integers) -> None:
        """Take down where the axes are to be by the SYNC that was sent just now, in counts."""
        self._led = led

    def require(self) -> None:
        """Require that each position reported since the last time is near where the axis was to be.

        Raises
        ------
        StreamAborted
        """
        for column, axis in enumerate(self._axes):
            if self._led is None or axis.placed == self._judged[column]:
                continue
            self._judged[column] = axis.placed
            apart, window = abs(axis.position - int(self._led[column])), self._windows[column]
            if apart > window:
                off, most = (counts / self._scales[column] for counts in (apart, window))
                raise StreamAborted(
                    f"axis {axis.name}: it is {off:.3g} off the motion, more than can.following_error "
                    f"({most:.3g}, stated or from the motion's lag); check whether it is blocked or runs "
                    "away, the drive's scaling, and how far it lags."
                )
