"""The terminal that a stream was started from: its signals stop the axes, and nothing waits for it."""

import queue
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread
from types import FrameType

# Everything that would kill the streamer, or freeze it, with the axes under way stops them, but for what no
# program can catch, what tells of a program that cannot go on, and what does nothing by itself.
_UNSTOPPABLE = "KILL STOP"
_BROKEN = "SEGV BUS FPE ILL ABRT IOT TRAP SYS EMT"
_HARMLESS = "CHLD CLD CONT URG WINCH INFO PIPE XFSZ"  # Python itself ignores the last two
_BACKGROUND = "TTIN TTOU"  # freezes one that reads or writes there; ignored, it may write, and reads nothing


def _named(names: str) -> set[int]:
    return {number for number in signal.Signals if number.name.removeprefix("SIG") in names.split()}


QUIET = _named(_BACKGROUND)
STOPS = signal.valid_signals() - _named(f"{_UNSTOPPABLE} {_BROKEN} {_HARMLESS}") - QUIET
LAST_WORDS = 0.5  # s, for a terminal to take them


@contextmanager
def stopped_by_signals(ask_to_stop: Callable[[str], None]) -> Iterator[None]:
    """Have signals stop the axes as any other fault does; one that `nohup` has ignored stays ignored."""

    def stop(number: int, _: FrameType | None) -> None:
        ask_to_stop(f"Stopped by {_name(number)}.")

    ignored = {number for number in STOPS if signal.getsignal(number) is signal.SIG_IGN} - {signal.SIGINT}
    handlers = dict.fromkeys(STOPS - ignored, stop) | dict.fromkeys(QUIET, signal.SIG_IGN)
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _name(number: int) -> str:
    """Name a signal; of those for any use only the first and the last have names."""
    with suppress(ValueError):
        return signal.Signals(number).name
    return f"signal {number}"


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
