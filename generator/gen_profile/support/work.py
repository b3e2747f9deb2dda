"""What a search may cost at most, so that every spec is answered in bounded time.

Work is counted where it is done, in seconds that it takes on a usual processor, by formulas of its size: so a
search ends at the same place on every machine and every day. The processor's own clock, which counts what all
threads of this process compute, ends what takes longer than an answer may.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

import attrs

CLOCK_INTERVAL = 0.05  # s of work between looks at the clock, which take time themselves


Found = TypeVar("Found")


class OutOfWork(Exception):
    """A search has used up its budget."""


class Overtaken(BaseException):
    """What is computed is no longer asked for; no search goes on with what it has found."""


@attrs.define
class _Budget:
    left: float
    ends: float  # by the processor's clock
    look: float  # at the clock, when so much is left
    outer: _Budget | None
    stop: Callable[[], bool] | None

    def take(self, seconds: float) -> None:
        self.left -= seconds
        if self.left < 0.0:
            raise OutOfWork
        if self.left < self.look:
            self.look = self.left - CLOCK_INTERVAL
            if self.stop is not None and self.stop():
                raise Overtaken
            if time.process_time() > self.ends:
                self.left = -math.inf  # for code that catches this and goes on
                raise OutOfWork


_current: ContextVar[_Budget | None] = ContextVar("budget", default=None)


@contextmanager
def budget(seconds: float, clock: float = math.inf, stop: Callable[[], bool] | None = None) -> Iterator[None]:
    """Let what is done in the context cost no more than this, nor more than budgets around it have left.

    Parameters
    ----------
    seconds : float
        Of counted work.
    clock : float
        By the processor's clock, in s.
    stop : callable, optional
        Asked whether to go on, whenever the clock is looked at.

    Raises
    ------
    Overtaken
        It is to go no further.
    """
    token = _current.set(_Budget(seconds, time.process_time() + clock, seconds, _current.get(), stop))
    try:
        yield
    finally:
        _current.reset(token)


def left() -> float:
    """Tell how much work in s the budgets have left: infinitely much without any."""
    least, own = math.inf, _current.get()
    while own is not None:
        least, own = min(least, own.left), own.outer
    return least


def clock_left() -> float:
    """Tell for how long in s the processor's clock lets the budgets go on: infinitely long without any."""
    ends, own = math.inf, _current.get()
    while own is not None:
        ends, own = min(ends, own.ends), own.outer
    return ends - time.process_time()


def spend(seconds: float) -> None:
    """Count work that is done next.

    Raises
    ------
    OutOfWork
        No budget is left for it. Call ``spend(0.0)`` to raise it again where a budget around is used up, too.
    """
    own = _current.get()
    while own is not None:
        own.take(seconds)
        own = own.outer


def afford(find: Callable[[], Found], seconds: float, clock: float = math.inf) -> Found | None:
    """Find something for so much work in s; None where that is not enough.

    Parameters
    ----------
    find : callable
    seconds, clock : float
        As in `budget`.

    Raises
    ------
    OutOfWork
        A budget around this one is used up, too.
    """
    try:
        with budget(seconds, clock):
            return find()
    except OutOfWork:
        spend(0.0)
        return None
