"""The clock as the streamer sees it: a port, so that tests can hold it, and the machine's own."""

from __future__ import annotations

import time
from typing import Protocol

import attrs

NANOSECONDS = 1_000_000_000


class Clock(Protocol):
    """A clock that only ever goes forward."""

    def now(self) -> int:
        """Time in ns since any fixed instant."""
        ...

    def sleep_until(self, instant: int) -> None:
        """Return at that instant, or at once when it has passed."""
        ...


@attrs.frozen
class SystemClock:
    """The machine's monotonic clock.

    Attributes
    ----------
    spin : int
        How long before an instant sleeping ends and spinning begins, in ns. Wake-ups are late by tens of
        microseconds; a processor that does nothing but wait is not.
    """

    spin: int = 0

    def now(self) -> int:
        """Time in ns."""
        return time.monotonic_ns()

    def sleep_until(self, instant: int) -> None:
        """Sleep towards an absolute instant, so that no error adds up."""
        remaining = instant - self.spin - time.monotonic_ns()
        if remaining > 0:
            time.sleep(remaining / NANOSECONDS)
        while time.monotonic_ns() < instant:
            pass
