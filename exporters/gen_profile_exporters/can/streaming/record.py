"""What became of a stream, as a value: taken down while it runs, reported afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile_exporters.can.host.lateness import Lateness


class Phase(Enum):
    """Where the streamer is, as people call it."""

    CONFIGURE = "configure"
    ALIGN = "align"
    ENABLE = "enable"
    APPROACH = "approach"
    STREAM = "stream"
    HOLD = "hold"
    DISABLE = "disable"
    DONE = "done"
    ABORTED = "aborted"


@attrs.frozen(kw_only=True, eq=False)
class Record:
    """What became of a stream.

    Attributes
    ----------
    phase : Phase
        `Phase.DONE` or `Phase.ABORTED`.
    reason : str
        Why it was aborted; empty when it was not.
    aftermath : str
        What was wrong after the motion was done; empty when nothing was.
    launched : bool
        Whether the bus sent each cycle at its instant by itself.
    sent : int
        Cycles of the motion that were sent.
    lateness : Lateness
    actual : (cycles, axes) integer array
        Position that each drive told after each cycle's SYNC, in counts.
    told : (cycles,) boolean array
        For which cycles there is one.
    final : tuple of int
        Last position that each drive told.
    """

    phase: Phase
    reason: str
    aftermath: str
    launched: bool
    sent: int
    lateness: Lateness
    actual: NDArray[np.int64]
    told: NDArray[np.bool_]
    final: tuple[int, ...]


class Recorder:
    """Takes down what was sent and answered, cycle by cycle.

    Parameters
    ----------
    cycles, axes : int
        Of the motion.
    """

    def __init__(self, cycles: int, axes: int) -> None:
        self._late = np.full(cycles, -1, dtype=np.int64)
        self._actual = np.zeros((cycles, axes), dtype=np.int64)
        self._told = np.zeros(cycles, dtype=np.bool_)

    @property
    def sent(self) -> int:
        """How many cycles were sent."""
        return int(np.count_nonzero(self._late >= 0))

    def take_sent(self, cycle: int, late: int) -> None:
        """Take down that a cycle was sent, and how late, in ns."""
        self._late[cycle] = max(0, late)

    def take_answer(self, cycle: int, position: Sequence[int]) -> None:
        """Take down where the drives were at a cycle's SYNC."""
        self._actual[cycle], self._told[cycle] = position, True

    def record(
        self,
        phase: Phase,
        reason: str,
        final: tuple[int, ...],
        *,
        aftermath: str,
        launched: bool,
        period: int,
    ) -> Record:
        """Make the record; the period is that of SYNC, in ns."""
        cycles = np.flatnonzero(self._late >= 0)
        return Record(
            phase=phase,
            reason=reason,
            aftermath=aftermath,
            launched=launched,
            sent=self.sent,
            lateness=Lateness(cycles=cycles, late=self._late[cycles], period=period),
            actual=self._actual,
            told=self._told,
            final=final,
        )
