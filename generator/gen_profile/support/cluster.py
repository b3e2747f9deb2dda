"""Dask workers: processes of this computer, or those of a scheduler that runs elsewhere."""

import logging
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import dask
from distributed import Client, LocalCluster
from tornado.ioloop import PeriodicCallback

from gen_profile.support.artefacts.manifest import versions
from gen_profile.support.errors import SpecError
from gen_profile.support.interrupts import interrupts_collected
from gen_profile.support.private_folder import temporary_folder

# else workers look at their own stack every 10 ms, and remember it for 1000 s: 80 MB; and all look at their
# event loops every 20 ms, and at the whole computer twice a second
UNWATCHED = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
ANSWER_TIME = "30s"  # that a scheduler and its first worker have to answer
START_TIME = "10 minutes"  # that a process of this computer has to start, as others may keep it busy
RENEWAL = 5000  # ms between looks for processes that ended while they started, which Dask gives up


@contextmanager
def client_of(scheduler: str | None, workers: int) -> Iterator[Client]:
    """Reach the workers: those of a scheduler, or so many processes of this computer.

    Raises SpecError where no worker answers. Processes of this computer speak TLS with a key of their own, as
    any program that reaches a scheduler can run code there.
    """
    stack = ExitStack()
    try:
        cluster: LocalCluster | str
        answer_time, silent = ANSWER_TIME, f"scheduler {scheduler}: no worker answers"
        if scheduler is None:
            answer_time, silent = START_TIME, f"workers: no process of this computer started in {START_TIME}"
            stack.enter_context(_own_scratch_space())
            stack.enter_context(_script_hidden())
            with interrupts_collected():  # Dask cannot end processes that are about to start
                cluster = stack.enter_context(_local_cluster(workers))
            _keep_up(cluster, workers, stack)
        else:
            cluster = scheduler
        try:
            client = stack.enter_context(Client(cluster, timeout=answer_time, set_as_default=False))
            client.wait_for_workers(1, timeout=answer_time)
        except (OSError, ValueError) as error:
            raise SpecError(f"{silent} ({error}).") from error
        if scheduler is None:
            client.run(_ignore_interrupts)  # a terminal sends Ctrl-C to them, too; this process ends them
        try:
            yield client
        except BaseException:
            if isinstance(cluster, LocalCluster):
                _end_at_once(cluster)
            raise
    finally:
        with interrupts_collected():
            stack.close()


@contextmanager
def _own_scratch_space() -> Iterator[None]:
    """Keep Dask out of the folder that all users share, where it writes through links and imports from."""
    shared = Path(dask.config.get("temporary-directory", None) or gettempdir())
    with (
        temporary_folder(shared, "gen-profile-workers-") as own,
        dask.config.set({"temporary-directory": str(own)}),
    ):
        yield


@contextmanager
def _script_hidden() -> Iterator[None]:
    """Let processes start without the script that is running, which each of them would run once more."""
    main = vars(sys.modules["__main__"])
    hidden: dict[str, Any] = {name: main[name] for name in ("__file__", "__spec__") if main.get(name)}
    main.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        main.update(hidden)


def _local_cluster(workers: int) -> LocalCluster:
    """Start processes of this computer, which never hear Ctrl-C where that can be had from the start."""
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # which tells of processes that are stopped
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(UNWATCHED))
        if sys.platform != "win32":
            resource_tracker.ensure_running()  # else the first process starts it, and it ends the blocking
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            stack.callback(signal.pthread_sigmask, signal.SIG_SETMASK, before)
        return LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            security=True,
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # of its health page, which stays
            silence_logs=logging.CRITICAL,
        )


def _keep_up(cluster: LocalCluster, workers: int, stack: ExitStack) -> None:
    """Have processes that Dask gave up started anew, until the stack is closed."""
    renewal = PeriodicCallback(lambda: cluster.scale(workers), RENEWAL)
    cluster.loop.add_callback(renewal.start)
    stack.callback(cluster.loop.add_callback, renewal.stop)


def _end_at_once(cluster: LocalCluster) -> None:
    """End processes that may be at work, for whose cases Dask would wait four seconds."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid:
            with suppress(OSError):  # it has just ended
                os.kill(nanny.pid, signal.SIGTERM)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def processes(client: Client) -> int:
    """Count how many can work at once."""
    return sum(client.nthreads().values())


def unable(error: Exception) -> SpecError:
    """Say that workers fail at what this program can do."""
    return SpecError(
        f"scheduler: the workers cannot go on ({type(error).__name__}: {error}); they must have the "
        "same gen-profile."
    )


def require_versions(needed: Sequence[tuple[str, str]], work: str) -> None:
    """Find out, on a worker, whether it has the libraries that some work was planned with.

    Raises
    ------
    SpecError
        With what it has, and what it needs.
    """
    if versions() != tuple(needed):
        raise SpecError(
            f"scheduler: a worker has {_listed(versions())}, and {work} needs {_listed(needed)}; "
            "install the same there."
        )


def _listed(installed: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{library} {number}" for library, number in installed)
