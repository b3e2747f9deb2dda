"""A controller that is watched while the studio runs, as pages ask for it."""

from __future__ import annotations

from threading import Event, Thread
from typing import Any

import numpy as np

from gen_profile.deployment.block_state import PHASES, BlockState
from gen_profile.deployment.mailbox import MailboxLink
from gen_profile.deployment.run_so_far import RunSoFar
from gen_profile.deployment.table import BlockTable
from gen_profile.deployment.watch import Watched, watch
from gen_profile.motion.profile import Array

MOST_POINTS = 500  # of a curve


class Watching:
    """A thread that watches from the context's beginning to its end, or until something is not as proved.

    Parameters
    ----------
    table : BlockTable
        Which the controller uses.
    link : MailboxLink
        Only read.
    """

    def __init__(self, table: BlockTable, link: MailboxLink) -> None:
        self._table, self._link, self._run = table, link, RunSoFar(table)
        self._ended, self._thread = Event(), Thread(target=self._watch, daemon=True)
        self._now: dict[str, Any] = {}
        self._seen: Watched | None = None

    def __enter__(self) -> Watching:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def part(self) -> dict[str, Any]:
        """Tell how the block stands, and its run so far beside its table's."""
        fault = None if self._seen is None else self._seen.fault
        axes = self._table.spec.axis_scales()
        cycles = self._run.planned.shape[1]
        step = -(-cycles // MOST_POINTS)
        times = self._table.spec.export.cycle_time * np.arange(cycles)
        return {
            "part": "watched",
            "of": "watch",
            "name": self._table.path.name,
            "faults": [] if fault is None else list(fault.sentences),
            "duration": float(times[-1]),
            "times": times[::step].tolist(),
            "axes": [
                {
                    "name": axis.name,
                    "unit": axis.unit,
                    "planned": [_points(row[:, column], step) for row in self._run.planned],
                    "seen": [_points(row[:, column], step) for row in self._run.seen],
                }
                for column, axis in enumerate(axes)
            ],
            **self._now,
        }

    def _watch(self) -> None:
        self._seen = watch(self._table, self._link, self._take, pause=self._pause)

    def _pause(self, seconds: float) -> None:
        if self._ended.wait(seconds):
            raise KeyboardInterrupt  # which is how a watch ends

    def _take(self, state: BlockState, at: float, _events: str) -> None:
        place = self._run.take(state)
        self._now = {
            "seconds": at,
            "phase": PHASES[state.phase],
            "error": state.error,
            "changed": state.off_nominal,
            "runs": state.runs,
            "motion": state.motion if len(self._table.motions) > 1 else None,
            "time": place * self._table.spec.export.cycle_time,
            "rate": state.rate,
            "setpoints": state.setpoints.T.tolist(),
        }


def _points(values: Array, step: int) -> list[float | None]:
    """Thin a curve out, with the last value that is a number in each piece."""
    pieces = (values[at : at + step] for at in range(0, len(values), step))
    known = (piece[~np.isnan(piece)] for piece in pieces)
    return [float(piece[-1]) if len(piece) else None for piece in known]
