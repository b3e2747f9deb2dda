"""What became of a stream, as a value: taken down while it runs, reported afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any

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
        Position that each drive reported after each cycle's SYNC, in counts.
    answered : (cycles,) boolean array
        For which cycles there is one.
    final : tuple of int
        Last position that each drive reported.
    """

    phase: Phase
    reason: str
    aftermath: str
    launched: bool
    sent: int
    lateness: Lateness
    actual: NDArray[np.int64]
    answered: NDArray[np.bool_]
    final: tuple[int, ...]


class Book:
    """What is known of a stream so far, in one piece of memory, which another process may read meanwhile.

    Parameters
    ----------
    memory : buffer
        Of `size` bytes, zero at first.
    cycles, axes : int
        Of the motion.

    Attributes
    ----------
    phase : (1,) integer array
        Number of the `Phase` in its order.
    late : (cycles,) integer array
        How late each was sent, in ns, plus one; zero for one that was not.
    answered : (cycles,) integer array
        Not zero where the drives answered.
    actual : (cycles, axes) integer array
        Where they then were, in counts.
    """

    def __init__(self, memory: Any, cycles: int, axes: int) -> None:
        table = np.frombuffer(memory, dtype=np.int64, count=1 + cycles * (2 + axes))
        self.phase, self.late, self.answered, actual = np.split(table, [1, 1 + cycles, 1 + 2 * cycles])
        self.actual = actual.reshape(cycles, axes)

    @staticmethod
    def size(cycles: int, axes: int) -> int:
        """Bytes that it takes."""
        return 8 * (1 + cycles * (2 + axes))

    @classmethod
    def blank(cls, cycles: int, axes: int) -> Book:
        """Begin one that no other process reads."""
        return cls(bytearray(cls.size(cycles, axes)), cycles, axes)

    @property
    def state(self) -> Phase:
        """Where the streamer is."""
        return list(Phase)[int(self.phase[0])]

    def begin(self, phase: Phase) -> None:
        """Take down where the streamer is; nothing here waits for those who read it."""
        self.phase[0] = list(Phase).index(phase)

    def take_sent(self, cycle: int, late: int) -> None:
        """Take down that a cycle was sent, and how late, in ns."""
        self.late[cycle] = 1 + max(0, late)

    def take_answer(self, cycle: int, position: Sequence[int]) -> None:
        """Take down where the drives were at a cycle's SYNC."""
        self.actual[cycle] = position
        self.answered[cycle] = 1

    def record(self, reason: str, final: tuple[int, ...], *, aftermath: str, launched: bool) -> Record:
        """Make the record of a stream that is over."""
        cycles = np.flatnonzero(self.late)
        return Record(
            phase=self.state,
            reason=reason,
            aftermath=aftermath,
            launched=launched,
            sent=len(cycles),
            lateness=Lateness(cycles=cycles, late=self.late[cycles] - 1),
            actual=self.actual.copy(),
            answered=self.answered != 0,
            final=final,
        )
