"""A controller that is watched while the studio runs, as pages ask for it."""

from __future__ import annotations

from threading import Event, Thread
from typing import Any

import numpy as np

from gen_profile.delivery.deployment.block_state import BlockState
from gen_profile.delivery.deployment.mailbox import MailboxLink
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.delivery.deployment.watching.judge import Watched
from gen_profile.delivery.deployment.watching.run_so_far import so_far
from gen_profile.delivery.deployment.watching.watch import watch
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
        self._table, self._link, self._run = table, link, so_far(table)
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
        """Tell how the block stands, and what it did so far beside what it was to do."""
        fault = None if self._seen is None else self._seen.fault
        run = self._run
        step = -(-len(run.times) // MOST_POINTS)
        return {
            "part": "watched",
            "of": "watch",
            "name": self._table.path.name,
            "faults": [] if fault is None else list(fault.sentences),
            "times": run.times[::step].tolist(),
            "axes": [
                {
                    "name": name,
                    "unit": unit,
                    "planned": [_points(row[:, column], step) for row in run.planned],
                    "seen": [_points(row[:, column], step) for row in run.seen],
                }
                for column, (name, unit) in enumerate(self._table.axes)
            ],
            **self._now,
        }

    def _watch(self) -> None:
        self._seen = watch(self._table, self._link, self._take, pause=self._pause)

    def _pause(self, seconds: float) -> None:
        if self._ended.wait(seconds):
            raise KeyboardInterrupt  # which is how a watch ends

    def _take(self, state: BlockState, at: float, _events: str) -> None:
        self._now = {
            "seconds": at,
            "phase": state.phase_name,
            "error": state.error,
            "setpoints": state.setpoints.T.tolist(),
            **self._run.take(state),
        }


def _points(values: Array, step: int) -> list[float | None]:
    """Thin a curve out, with the last value that is a number in each piece."""
    pieces = (values[at : at + step] for at in range(0, len(values), step))
    known = (piece[~np.isnan(piece)] for piece in pieces)
    return [float(piece[-1]) if len(piece) else None for piece in known]
