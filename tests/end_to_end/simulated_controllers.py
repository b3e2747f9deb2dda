"""Simulated controllers that run beside a test."""

import threading
from contextlib import contextmanager


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
