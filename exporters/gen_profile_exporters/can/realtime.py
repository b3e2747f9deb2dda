"""Ask the operating system for punctuality, as far as it permits."""

from __future__ import annotations

import ctypes
import gc
import os
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
    refused = (*take_priority(PRIORITY), *_lock_memory())
    gc.collect()
    gc.freeze()
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield refused
    finally:
        if collecting:
            gc.enable()
        gc.unfreeze()
        ctypes.CDLL(None).munlockall()
        if not any("priority" in sentence for sentence in refused):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def take_priority(priority: int) -> tuple[str, ...]:
    """Give the calling thread real-time priority, for good; return what was refused, as a sentence."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return ("Real-time priority is not permitted (grant it with `ulimit -r 80` or CAP_SYS_NICE).",)
    return ()


def _lock_memory() -> tuple[str, ...]:
    if ctypes.CDLL(None, use_errno=True).mlockall(_LOCK_CURRENT_AND_FUTURE) != 0:
        return ("Memory cannot be locked (grant it with `ulimit -l unlimited` or CAP_IPC_LOCK).",)
    return ()
