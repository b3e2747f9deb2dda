"""Signals that come while compiled code runs, which would swallow what their handlers raise."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_collected() -> Iterator[list[int]]:
    """Collect SIGINT and SIGTERM in a list, and let them come when the context ends.

    Compiled code that calls back now and then can look whether the list is still empty.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # handlers are the main thread's
        yield came
        return
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    taken = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in taken:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield came
    finally:
        for number, handler in taken.items():
            signal.signal(number, handler)
        for caught in came:
            signal.raise_signal(caught)
