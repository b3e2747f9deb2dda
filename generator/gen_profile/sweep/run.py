"""Sweeps: all cases of a grid designed, checked and exported, on as many processes as there are.

The cases run on Dask workers, those of this computer or of a cluster. This process alone writes: workers hand
it what they made, case by case. So whatever stops them or this process, what is finished stays, and a sweep
that is started again works out the rest.
"""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, cast

import attrs
from dask.system import CPU_COUNT
from distributed import Client, Future, KilledWorker, LocalCluster, as_completed

from gen_profile.errors import GenProfileError, SpecError
from gen_profile.sweep.case import CRASHED, PASSED, CaseOutcome, failed, run_case
from gen_profile.sweep.store import Store, opened
from gen_profile.sweep.table import write_table

CASES_AHEAD = 3  # per process: one at work, and what keeps it busy while this process takes results in
ANSWER_TIME = "30s"  # that a scheduler and its first worker have to answer


@attrs.frozen(kw_only=True)
class CasesDone:
    """How far a sweep is.

    Attributes
    ----------
    done, failed, total : int
        Cases; those that were finished before are done, too.
    """

    done: int
    failed: int
    total: int


@attrs.frozen(kw_only=True)
class Sweep:
    """A finished sweep.

    Attributes
    ----------
    store : Store
    statuses : dict of str to int
        How many cases ended how, ``"passed"`` first.
    reasons : dict of str to str
        An example for every other status.
    kept : int
        Cases that had been finished before.
    table : Path
    """

    store: Store
    statuses: dict[str, int]
    reasons: dict[str, str]
    kept: int
    table: Path

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "name": self.store.name,
            "spec_sha256": self.store.spec_sha256,
            "cases": len(self.store.grid),
            "finished_before": self.kept,
            "statuses": self.statuses,
            "reasons": self.reasons,
            "folder": str(self.store.folder),
            "table": str(self.table),
        }


def sweep(
    store: Store,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Callable[[CasesDone], None] = lambda _: None,
) -> Sweep:
    """Work out all cases that are not finished, and write the table.

    Parameters
    ----------
    store : Store
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``; processes of this computer by default.
    workers : int, optional
        How many of those; one per processor by default.
    progress : callable
        Told after every case.

    Raises
    ------
    OutputError
        The folder cannot be written, or holds another sweep.
    SpecError
        The scheduler does not answer, or its workers have other versions.
    """
    grid = store.grid
    statuses, reasons = Counter({PASSED: 0}), dict[str, str]()
    with opened(store):
        unfinished = [case for case in range(len(grid)) if not store.is_finished(case)]
        if unfinished:
            _work(store, unfinished, scheduler, workers, progress)
        table = write_table(store.folder, grid, _counted(store.records(), statuses, reasons))
    return Sweep(
        store=store,
        statuses=dict(statuses),
        reasons=reasons,
        kept=len(grid) - len(unfinished),
        table=table,
    )


def _counted(
    records: Iterable[Mapping[str, Any]], statuses: Counter[str], reasons: dict[str, str]
) -> Iterator[Mapping[str, Any]]:
    """Pass records on, and count how they ended, with an example for every failure."""
    for record in records:
        statuses[record["status"]] += 1
        if record["status"] != PASSED:
            reasons.setdefault(record["status"], f"case {record['case']}: {record['reason']}")
        yield record


def _work(
    store: Store,
    unfinished: Sequence[int],
    scheduler: str | None,
    workers: int | None,
    progress: Callable[[CasesDone], None],
) -> None:
    """Hand the cases to workers, a few ahead, and keep what comes back."""
    total, failures = len(store.grid), 0
    done = total - len(unfinished)
    progress(CasesDone(done=done, failed=failures, total=total))
    waiting = iter(unfinished)
    with _client(scheduler, min(workers or CPU_COUNT, len(unfinished))) as client:
        running: dict[Future, int] = {}
        completed = as_completed(loop=client.loop)

        def begin(case: int) -> None:
            future = client.submit(run_case, store.recipe, case, store.grid[case], pure=False)
            running[future] = case
            completed.add(future)

        for case in islice(waiting, CASES_AHEAD * _processes(client)):
            begin(case)
        for future in completed:
            case = running.pop(future)
            outcome = _outcome(future, case, store.grid[case])
            store.keep(case, outcome)
            done, failures = done + 1, failures + (not outcome.passed)
            progress(CasesDone(done=done, failed=failures, total=total))
            for following in islice(waiting, 1):
                begin(following)


def _outcome(future: Future, case: int, values: Mapping[str, Any]) -> CaseOutcome:
    """Take a case's outcome in, whatever became of its process."""
    try:
        return cast("CaseOutcome", future.result())
    except GenProfileError:
        raise
    except KilledWorker:
        reason = "Every process that worked at it ended: it lacks memory, or a library crashes."
        return failed(case, values, CRASHED, reason)
    except Exception as error:
        raise SpecError(
            f"scheduler: the workers cannot go on ({type(error).__name__}: {error}); they must have the "
            "same gen-profile. What is finished is kept: sweep again."
        ) from error


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Client]:
    """Reach the workers: those of a scheduler, or processes of this computer.

    The latter speak TLS with a key of their own, as whoever reaches a scheduler can run what he likes.
    """
    stack = ExitStack()
    try:
        cluster: LocalCluster | str
        if scheduler is None:
            with _undisturbed():
                cluster = stack.enter_context(_local_cluster(workers))
        else:
            cluster = scheduler
        try:
            client = stack.enter_context(Client(cluster, timeout=ANSWER_TIME, set_as_default=False))
            client.wait_for_workers(1, timeout=ANSWER_TIME)
        except (OSError, ValueError) as error:
            raise SpecError(f"scheduler {scheduler}: no worker answers ({error}).") from error
        if scheduler is None:
            client.run(_ignore_interrupts)  # a terminal sends Ctrl-C to them, too; this process ends them
        yield client
    finally:
        with _undisturbed():
            stack.close()


def _local_cluster(workers: int) -> LocalCluster:
    """Start processes of this computer, which never hear Ctrl-C where that can be had from the start."""
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # which tells of processes that are stopped
    with ExitStack() as stack:
        if sys.platform != "win32":
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


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Put interruptions off until the block is done: Dask cannot end processes that are about to start."""
    came: list[int] = []
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            if callable(signal.getsignal(number)):
                before[number] = signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for stopping, handler in before.items():
            signal.signal(stopping, handler)
        for first in came[:1]:
            signal.raise_signal(first)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _processes(client: Client) -> int:
    return sum(client.nthreads().values())
