"""Judging the states of a block in a controller: what was seen, and what holds for every kind of block."""

from abc import ABC, abstractmethod
from typing import Any, Generic

import attrs

from gen_profile.delivery.deployment.block_state import State
from gen_profile.delivery.deployment.mailbox import WRONG
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.support.errors import CheckFailed, DeploymentError, GenProfileError

STANDSTILL = 2.0  # s that a block may show the same cycle, or be ahead of or behind its cycle time
CLOCKS_DIFFER = 0.02  # relative, of this computer and of the controller's task
QUANTITIES = ("position", "velocity", "acceleration")


@attrs.define(kw_only=True)
class Watched:
    """What was seen.

    Attributes
    ----------
    seconds : float
        From the first look to the last one.
    cycles, states : int
        That the block was called meanwhile, and of these the ones that were read.
    moving, exact : int
        Of the states, those of a motion (of a playback block also at its end), and of these the ones whose
        setpoints are the table's bit for bit; the others are within its last digits (a planner block has no
        table).
    runs, completed, off_nominal, refused : int
        Motions that began, that arrived, whose timing was changed or whose promise was withdrawn, and starts
        that the block refused, or its errors.
    lost : int
        Times that the connection was lost and taken up again.
    fault : GenProfileError or None
        What is not as proved, and ended it.
    """

    seconds: float = 0.0
    cycles: int = 0
    states: int = 0
    moving: int = 0
    exact: int = 0
    runs: int = 0
    completed: int = 0
    off_nominal: int = 0
    refused: int = 0
    lost: int = 0
    fault: GenProfileError | None = None

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        document = attrs.asdict(self, recurse=False)
        return document | {"fault": None if self.fault is None else str(self.fault)}


class Judge(ABC, Generic[State]):
    """Holds each state of a block to what was proved, and to the state before.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        self._name, self._checksum = table.path.name, int(table.checksum)
        self._axes = [name for name, _ in table.axes]
        self._cycle_time = table.spec.export.cycle_time
        self._first: tuple[State, float] | None = None
        self._last: State | None = None
        self.seen = Watched()

    def take(self, state: State, at: float) -> str:
        """Judge a state, and tell what happened since the one before, in a few words or none.

        Parameters
        ----------
        state : BlockState
            Of the block's kind.
        at : float
            When it was read, in s.

        Raises
        ------
        CheckFailed
            It is not as proved.
        DeploymentError
            The controller was started anew.
        """
        before = self._last
        if before is not None and state.calls < before.calls:
            raise DeploymentError(
                "The controller was started anew, or its program loaded; verify what it uses, and watch "
                "again."
            )
        if self._first is None:
            self._first = (state, at)
        first, begin = self._first
        events = ", ".join(self._events(before, state))
        self._last, seen = state, self.seen
        seen.states += 1
        seen.seconds, seen.cycles = at - begin, state.calls - first.calls
        self._require_table(first, state)
        self._require_setpoints(state)
        if before is not None:
            self._require_course(before, state)
            self._require_cycle_time()
        return events

    @abstractmethod
    def _events(self, before: State | None, state: State) -> list[str]:
        """Count what began and ended between two states, and put it into words."""

    @abstractmethod
    def _require_setpoints(self, state: State) -> None:
        """Hold the setpoints of one cycle to what was proved."""

    @abstractmethod
    def _require_course(self, before: State, state: State) -> None:
        """Hold what became of them between two states to it."""

    def _require_table(self, first: State, state: State) -> None:
        if state.checksum != self._checksum or state.buffer != first.buffer:
            raise CheckFailed(
                "The controller no longer uses {name}: it has switched to its other buffer, with the "
                "checksum {there} and not {here}. Find out who switched (deployments.json).",
                name=self._name,
                there=state.checksum,
                here=self._checksum,
            )
        if state.checked == WRONG:
            raise CheckFailed(
                "The controller finds the checksum of its table wrong: a value was altered in its memory. It "
                "starts nothing; deploy the table again, and check its memory if that recurs."
            )

    def _require_cycle_time(self) -> None:
        seen, cycle_time = self.seen, self._cycle_time
        if abs(seen.cycles * cycle_time - seen.seconds) > STANDSTILL + CLOCKS_DIFFER * seen.seconds:
            raise CheckFailed(
                "The block is called every {mean:.3g} ms on average, and its table is for {due:g} ms: "
                "motions take another time than was proved. Call it in a task of that cycle.",
                mean=1e3 * seen.seconds / max(1, seen.cycles),
                due=1e3 * cycle_time,
            )
