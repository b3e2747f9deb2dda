"""Simulated controllers that run beside a test, on ports that are free."""

import asyncio
import socket
import threading
from contextlib import contextmanager

import numpy as np
from command_line import run_here

from gen_profile.delivery.deployment.deploy import verify
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.support.errors import CheckFailed, DeploymentError, ExportError

MOVES = {"old": 0.3, "new": 0.25, "other": 0.2}  # m
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


def exported_moves(folder, *formats):
    """Write a block of each move into a folder of its name."""
    words = [*BARE, *(word for one in formats for word in ("--export", one))]
    for name, distance in MOVES.items():
        assert run_here(*words, "--set", f"move.distance={distance}", "--out", folder / name).code == 0
    return folder


def unchecked_deployments(monkeypatch, tables, *kinds):
    """Co-simulate nothing, but list what was to be: that takes most of the time."""
    judgement = tables["new"].check(tables["new"].values, lambda *_: None)
    assert judgement.check.passed
    checked = []

    def note(_self, values, _progress):
        checked.append(values)
        return judgement

    for kind in kinds or (BlockTable,):
        monkeypatch.setattr(kind, "check", note)
    return checked


def assert_deployed_and_watched(old, new, where, start):
    """Deploy one block in place of the other and back, and watch a motion; return where the block was."""
    done = run_here("deploy", new, *where, "--json")
    assert done.code == 0, done.err
    assert done.document["held_sha256"] == done.document["table_sha256"]
    assert run_here("deploy", new, *where, "--verify").code == 0
    assert run_here("deploy", old, *where, "--verify").code == 4
    assert "rolled back" in run_here("deploy", old, *where, "--rollback").out
    start()
    watched = run_here("deploy", old, *where, "--watch", "--for", "1.5", "--json")
    assert watched.code == 0, watched.err
    assert watched.document["moving"] == watched.document["exact"] > 1
    return done.document["controller"]


def deployed_otherwise(file, where, changed):
    """Deploy with some options changed, or left out where they are None."""
    options = dict(zip(where[::2], where[1::2], strict=True)) | changed
    given = [word for option, value in options.items() if value is not None for word in (option, value)]
    return run_here("deploy", file, *given)


def table_in_use(tables, box):
    """Name the table that a controller uses, by a mailbox without faults."""
    for name, table in tables.items():
        try:
            verify(table, box)
        except CheckFailed:
            continue
        return name
    return None


def attempted(work):
    """Return whether a deployment succeeds, and else why not."""
    try:
        work()
    except (DeploymentError, CheckFailed, ExportError) as raised:
        return False, str(raised)
    return True, ""


def assert_whole(done, error, found, fault, tables, checked):
    """Hold a controller, after a deployment under a fault, to one whole table that was proved."""
    if done:
        assert found == "new" or "happen" in fault, fault
        assert any(np.array_equal(one, tables["new"].values) for one in checked), fault
    else:
        assert found == "old" or "happen" in fault or (checked and "verify which" in error), (fault, error)
