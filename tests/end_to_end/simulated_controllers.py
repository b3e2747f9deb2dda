"""Simulated controllers that run beside a test, on ports that are free."""

import asyncio
import socket
import threading
from contextlib import contextmanager

SETTINGS = ("export.plc_tables=variables", "export.plc_layout=samples", "export.cycle_time=0.02")
BARE = ("--preset", "paper", *(word for one in SETTINGS for word in ("--set", one)), "--no-check")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@contextmanager
def in_thread(main):
    """Run a coroutine that calls its argument once it is ready, until it is asked to end."""
    ready, loops = threading.Event(), []

    async def running():
        end = asyncio.Event()
        loops.append((asyncio.get_running_loop(), end))
        await main(lambda *_: ready.set(), end)

    thread = threading.Thread(target=asyncio.run, args=(running(),))
    thread.start()
    try:
        assert ready.wait(600)
        yield
    finally:
        loop, end = loops[0]
        loop.call_soon_threadsafe(end.set)
        thread.join()


@contextmanager
def serving(controller):
    """Let a simulated controller play by itself in a thread, and give its address."""
    ready, addresses = threading.Event(), []

    def tell(address):
        addresses.append(address)
        ready.set()

    thread = threading.Thread(target=controller.serve, args=(tell,))
    thread.start()
    try:
        assert ready.wait(600)
        yield addresses[0]
    finally:
        controller.ended.set()
        thread.join()
