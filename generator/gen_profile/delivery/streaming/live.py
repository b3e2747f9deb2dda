"""A running stream watched from beside: a process of its own reads what the streamer takes down anyway.

The streamer does nothing for it: its record lies in memory that both share, so there is nothing to wait for,
nothing to fill up, and a viewer that hangs or dies is not noticed.
"""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import attrs
import numpy as np

from gen_profile.delivery.streaming.outcome import Source
from gen_profile.delivery.streaming.priority import lower_priority
from gen_profile.motion.profile import Array
from gen_profile_exporters.can.streaming.record import Book, Phase

LOOK_INTERVAL = 0.1  # s between two looks
LAST_LOOK = 1.0  # s, for the viewer to show the end
OVER = (Phase.DONE, Phase.ABORTED)


@attrs.frozen(kw_only=True, eq=False)
class View:
    """What a viewer needs to know of a motion.

    Attributes
    ----------
    name : str
    axes, units : tuple of str
    period : float
        s.
    planned : (cycles, axes) array
        Position by each SYNC, in the axes' units.
    scale : (axes,) array
        Counts per unit.
    """

    name: str
    axes: tuple[str, ...]
    units: tuple[str, ...]
    period: float
    planned: Array
    scale: Array


@attrs.frozen(kw_only=True, eq=False)
class Glance:
    """A stream at one moment.

    Attributes
    ----------
    phase : Phase
    cycle : int
        How far the motion is.
    actual : (cycles, axes) array
        Positions reported, in the axes' units; not a number where none was.
    apart : (axes,) array
        Greatest distance from the motion so far.
    late : float
        Of the cycle that was most so, in µs.
    """

    phase: Phase
    cycle: int
    actual: Array
    apart: Array
    late: float

    @classmethod
    def at(cls, book: Book, view: View) -> Glance:
        """Look into the streamer's record as it is now."""
        late = book.late.copy()  # the streamer goes on writing, at which NumPy ends a search with an error
        sent, answered = np.flatnonzero(late), book.answered != 0
        actual = np.where(answered[:, None], book.actual / view.scale, np.nan)
        apart = np.abs(actual - view.planned)[answered]
        return cls(
            phase=book.state,
            cycle=int(sent[-1]) + 1 if sent.size else 0,
            actual=actual,
            apart=apart.max(axis=0) if apart.size else np.zeros(len(view.axes)),
            late=float(late.max() - 1) / 1e3 if sent.size else 0.0,
        )


Show = Callable[[View, Callable[[], Glance], Callable[[], bool]], None]


@contextmanager
def watched(source: Source, show: Show) -> Iterator[Book]:
    """Have a process show a stream, and yield the record that it is to be taken down in.

    Parameters
    ----------
    source : Source
    show : callable
        Runs in that process: is given what to show, a way to look at the stream, and one to learn whether it
        is over. It must be importable.
    """
    context = multiprocessing.get_context("spawn")
    cycles, axes = source.plan.at_sync.shape
    memory = context.RawArray("b", Book.size(cycles, axes))
    viewer = context.Process(target=_look, args=(memory, _view(source), show), daemon=True)
    viewer.start()
    try:
        yield Book(memory, cycles, axes)
    finally:
        viewer.join(LAST_LOOK)
        viewer.kill()
        viewer.join()
        viewer.close()


def _look(memory: Any, view: View, show: Show) -> None:
    """Show a stream until it is over, or its process is gone; in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # which is for the streamer
    lower_priority()
    book = Book(memory, *view.planned.shape)
    parent = multiprocessing.parent_process()

    def over() -> bool:
        time.sleep(LOOK_INTERVAL)
        return book.state in OVER or parent is None or not parent.is_alive()

    with suppress(OSError):  # a terminal that is gone
        show(view, lambda: Glance.at(book, view), over)


def _view(source: Source) -> View:
    axes = source.axes
    scale = np.array([axis.counts_per_si for axis in source.plan.target.axes])
    return View(
        name=source.spec.name,
        axes=tuple(axis.name for axis in axes),
        units=tuple(axis.unit for axis in axes),
        period=source.spec.can.sync_period,
        planned=source.plan.at_sync / scale,
        scale=scale,
    )
