"""Sweeps: all cases of a grid designed, checked and exported, on as many processes as there are.

The cases run on Dask workers, those of this computer or of a cluster. This process alone writes: workers hand
it what they made, case by case. So whatever stops them or this process, what is finished stays, and a sweep
that is started again works out the rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, cast

import attrs
from dask.system import CPU_COUNT
from distributed import Future, KilledWorker, as_completed

from gen_profile.cluster import client_of, processes, unable
from gen_profile.errors import GenProfileError, SpecError
from gen_profile.sweep.case import CRASHED, PASSED, CaseOutcome, failed, run_case
from gen_profile.sweep.reading import swept_table
from gen_profile.sweep.store import Keeper, Store, opened

CASES_AHEAD = 3  # per process: one at work, and what keeps it busy while this process takes results in


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
    with opened(store) as kept:
        unfinished = [case for case in range(len(grid)) if not kept.is_finished(case)]
        if unfinished:
            _work(store, kept, unfinished, scheduler=scheduler, workers=workers, progress=progress)
        table = kept.gather()
    for row in swept_table(store.folder, grid, ["case", "status", "reason"]).to_pylist():
        statuses[row["status"]] += 1
        if row["status"] != PASSED:
            reasons.setdefault(row["status"], f"case {row['case']}: {row['reason']}")
    return Sweep(
        store=store,
        statuses=dict(statuses),
        reasons=reasons,
        kept=len(grid) - len(unfinished),
        table=table,
    )


def _work(
    store: Store,
    kept: Keeper,
    unfinished: Sequence[int],
    *,
    scheduler: str | None,
    workers: int | None,
    progress: Callable[[CasesDone], None],
) -> None:
    """Hand the cases to workers, a few ahead, and keep what comes back."""
    total, failures = len(store.grid), 0
    done = total - len(unfinished)
    progress(CasesDone(done=done, failed=failures, total=total))
    waiting = iter(unfinished)
    with client_of(scheduler, min(workers or CPU_COUNT, len(unfinished))) as client:
        running: dict[Future, int] = {}
        completed = as_completed(loop=client.loop)

        def begin(case: int) -> None:
            future = client.submit(run_case, store.recipe, case, store.grid[case], pure=False)
            running[future] = case
            completed.add(future)

        for case in islice(waiting, CASES_AHEAD * processes(client)):
            begin(case)
        for future in completed:
            case = running.pop(future)
            outcome = _outcome(future, case, store.grid[case])
            kept.keep(case, outcome)
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
        raise SpecError(f"{unable(error)} What is finished is kept: sweep again.") from error
