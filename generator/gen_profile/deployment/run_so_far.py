"""A run of a watched block so far, beside what its table has it do: what pictures of it are drawn from."""

from __future__ import annotations

import numpy as np

from gen_profile.deployment.block_state import MOVING, BlockState
from gen_profile.deployment.table import BlockTable
from gen_profile.motion.profile import Array


class RunSoFar:
    """Positions and velocities by their cycle of the motion, in axis units and s.

    Parameters
    ----------
    table : BlockTable

    Attributes
    ----------
    planned, seen : (2, cycles, axes) array
        By the table; and read from the controller, not a number where nothing was.
    """

    def __init__(self, table: BlockTable) -> None:
        self._motions = [np.array((one.played.position, one.played.velocity)) for one in table.motions]
        self._begun = (-1, -1)
        self.planned: Array = self._motions[0]
        self.seen = np.full_like(self.planned, np.nan)

    def take(self, state: BlockState) -> int:
        """Add what a state tells, and give the cycle of the motion that it stands for."""
        if (state.runs, state.motion) != self._begun:
            self._begun, self.planned = (state.runs, state.motion), self._motions[state.motion]
            self.seen = np.full_like(self.planned, np.nan)
        cycle: int = min(state.cycle, self.planned.shape[1] - 1)
        if state.phase == MOVING:
            self.seen[:, cycle] = state.position, state.velocity
        return cycle
