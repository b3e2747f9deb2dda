"""Ask the operating system for punctuality, as far as it permits."""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PRIORITY = 80  # SCHED_FIFO; above most interrupt threads, below what keeps the machine alive
PEER_PRIORITY = 70  # of simulated drives: behind the streamer, before everything that can wait
_LOCK_CURRENT_AND_FUTURE = 3  # MCL_CURRENT | MCL_FUTURE


@contextmanager
def real_time() -> Iterator[tuple[str, ...]]:
    """Run the block with real-time priority, locked memory and no garbage collection.

    Yields
    ------
    tuple of str
        What was refused, a sentence each.
    """
    with priority(PRIORITY) as refused, _locked_memory() as also_refused:
        gc.collect()
        gc.freeze()
        collecting = gc.isenabled()
        gc.disable()
        try:
            yield (*refused, *also_refused)
        finally:
            if collecting:
                gc.enable()
            gc.unfreeze()


@contextmanager
def priority(level: int) -> Iterator[tuple[str, ...]]:
    """Run the block's thread with real-time priority; yields what was refused, as a sentence."""
    if sys.platform != "linux":
        yield ("Real-time priority is available on Linux only.",)
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except OSError:
        yield ("Real-time priority is not permitted (grant it with `ulimit -r 80` or CAP_SYS_NICE).",)
        return
    try:
        yield ()
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def _locked_memory() -> Iterator[tuple[str, ...]]:
    try:
        system = ctypes.CDLL(None, use_errno=True)
        locked = system.mlockall(_LOCK_CURRENT_AND_FUTURE) == 0
    except (OSError, TypeError, AttributeError):  # no C library under that name; no such call in it
        locked = False
    if not locked:
        yield ("Memory cannot be locked (grant it with `ulimit -l unlimited` or CAP_IPC_LOCK).",)
        return
    try:
        yield ()
    finally:
        system.munlockall()
