"""What a watched block did so far, beside what it was to do: what pictures of it are drawn from."""

from typing import Any, Protocol

import numpy as np

from gen_profile.delivery.deployment import block_state
from gen_profile.delivery.deployment.block_state import MotionState, PlannerState
from gen_profile.delivery.deployment.table import BlockTable, PlannerTable
from gen_profile.motion.profile import Array

SHOWN, PERIOD = 60.0, 0.1  # s of a planner block's past, and between two of its values


class RunSoFar(Protocol):
    """Positions and velocities over time, in axis units and s.

    Attributes
    ----------
    times : (n,) array
        s.
    planned, seen : (2, n, axes) array
        What was to be, and what was read from the controller; not a number where there is nothing.
    """

    times: Array
    planned: Array
    seen: Array

    def take(self, state: Any) -> dict[str, Any]:
        """Add what a state of the block's kind shows, and give the figures beside the picture."""


class MotionSoFar:
    """A run of a playback block, by the cycles of its motion, as `RunSoFar`.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        self._motions = [np.array((one.played.position, one.played.velocity)) for one in table.motions]
        self._begun = (-1, -1)
        self._cycle = table.spec.export.cycle_time
        self._begin(0)

    def take(self, state: MotionState) -> dict[str, Any]:
        """Add what a state shows; times are the motion's, in s."""
        if (state.runs, state.motion) != self._begun:
            self._begun = (state.runs, state.motion)
            self._begin(state.motion)
        cycle: int = min(state.cycle, len(self.times) - 1)
        if state.phase == block_state.MOVING:
            self.seen[:, cycle] = state.position, state.velocity
        return {
            "changed": state.off_nominal,
            "runs": state.runs,
            "motion": state.motion if len(self._motions) > 1 else None,
            "time": float(self.times[cycle]),
            "duration": float(self.times[-1]),
            "rate": state.rate,
        }

    def _begin(self, motion: int) -> None:
        self.planned: Array = self._motions[motion]
        self.seen: Array = np.full_like(self.planned, np.nan)
        self.times: Array = self._cycle * np.arange(self.planned.shape[1], dtype=float)


class PlannerSoFar:
    """The last minute of a planner block beside what it was commanded, as `RunSoFar`.

    Parameters
    ----------
    table : BlockTable
    """

    def __init__(self, table: BlockTable) -> None:
        count = round(SHOWN / PERIOD)
        self.times: Array = PERIOD * np.arange(1 - count, 1, dtype=float)
        self.planned: Array = np.full((2, count, len(table.axes)), np.nan)
        self.seen: Array = self.planned.copy()
        self._cycle, self._last = table.spec.export.cycle_time, -1

    def take(self, state: PlannerState) -> dict[str, Any]:
        """Add what a state shows; the time to go is in s."""
        now = int(state.calls * self._cycle / PERIOD)
        gone = min(max(0, now - self._last), len(self.times)) if self._last >= 0 else 0
        self._last = now
        for values in (self.planned, self.seen):
            values[:] = np.roll(values, -gone, axis=1)
            values[:, len(self.times) - gone :] = np.nan
        self.seen[:, -1] = state.position, state.velocity
        command = state.command if state.phase != block_state.DISABLED else block_state.NO_COMMAND
        self.planned[0, -1] = state.target if command == block_state.TO_POSITION else np.nan
        self.planned[1, -1] = state.speed if command == block_state.AT_VELOCITY else np.nan
        return {
            "promise": state.promise,
            "command": command,
            "commanded": (state.target if command == block_state.TO_POSITION else state.speed).tolist(),
            "to_go": state.time_to_go,
        }


def so_far(table: BlockTable) -> RunSoFar:
    """Begin what pictures of a block of this kind are drawn from."""
    return PlannerSoFar(table) if isinstance(table, PlannerTable) else MotionSoFar(table)
