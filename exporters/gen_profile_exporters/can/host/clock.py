"""The clock as the streamer sees it: a port, so that tests can hold it, and the machine's own."""

import time
from collections.abc import Callable
from typing import Protocol

import attrs

NANOSECONDS = 1_000_000_000


class Clock(Protocol):
    """A clock that only ever goes forward."""

    def now(self) -> int:
        """Time in ns since any fixed instant."""

    def sleep_until(self, instant: int) -> None:
        """Return at that instant, or at once when it has passed."""


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


NAP = NANOSECONDS // 1000


@attrs.define
class SharedClock:
    """A clock for one thread that does everybody's work; it stands still while the thread is kept from it.

    For simulated drives and their streamer: a machine that stalls delays the simulation as a whole, and none
    of them sees the others late.

    Attributes
    ----------
    longest : int
        Between two looks at the clock, in ns; what is more was a stall.
    work : callable
        What the others have to do while one of them sleeps.
    stalled : int
        How long the clock stood still, in ns.
    """

    longest: int
    work: Callable[[], None] = lambda: None
    stalled: int = 0
    _seen: int = attrs.field(factory=time.monotonic_ns)

    def now(self) -> int:
        """Time in ns."""
        real = time.monotonic_ns()
        self.stalled += max(0, real - self._seen - self.longest)
        self._seen = real
        return real - self.stalled

    def catch_up(self) -> int:
        """Take what was done until now for a stall; returns for how long the clock has stood still, in ns."""
        self.now()
        return self.stalled

    def sleep_until(self, instant: int) -> None:
        """Have the others work until an instant, once at least."""
        self.work()
        while (remaining := instant - self.now()) > 0:
            time.sleep(min(remaining, NAP, self.longest // 2) / NANOSECONDS)
            self.work()
