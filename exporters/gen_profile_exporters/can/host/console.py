"""The terminal that a stream was started from: its signals stop the axes, and nobody waits for it."""

from __future__ import annotations

import queue
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread
from types import FrameType

# what else would kill the streamer, or freeze it, with the axes under way; where the system has them
_NAMES = "INT TERM HUP QUIT TSTP ALRM USR1 USR2 XCPU PWR BREAK"
STOPS = tuple(number for number in signal.Signals if number.name.removeprefix("SIG") in _NAMES.split())
LAST_WORDS = 0.5  # s, for a terminal to take them


@contextmanager
def stopped_by_signals(ask_to_stop: Callable[[str], None]) -> Iterator[None]:
    """Have signals stop the axes as any other fault does; one that `nohup` has ignored stays ignored."""

    def stop(number: int, _: FrameType | None) -> None:
        ask_to_stop(f"Stopped by {signal.Signals(number).name}.")

    ignored = {number for number in STOPS if signal.getsignal(number) is signal.SIG_IGN} - {signal.SIGINT}
    before = {number: signal.signal(number, stop) for number in STOPS if number not in ignored}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def told_aside(tell: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """Tell from a thread of its own, so that a terminal that is gone, or takes nothing, holds up no cycle."""
    words: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def speak() -> None:
        while (said := words.get()) is not None:
            with suppress(OSError, ValueError):  # broken, or closed
                tell(said)

    speaker = Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield words.put
    finally:
        words.put(None)
        speaker.join(LAST_WORDS)
