"""Sweeps: what makes sense to sweep, and all its cases designed, checked and exported on many processes.

The cases run on Dask workers, those of this computer or of a cluster. This process alone writes: workers hand
it what they made, a few cases at a time. So whatever stops them or this process, what was written stays, and
a sweep that is started again works out the rest.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, cast

import attrs
from dask.system import CPU_COUNT
from distributed import Client, Future, KilledWorker, as_completed

from gen_profile.spec.model import Spec
from gen_profile.studies.sweep.case import CRASHED, PASSED, CaseOutcome, Recipe, failed, run_cases
from gen_profile.studies.sweep.grid import Grid
from gen_profile.studies.sweep.store import Keeper, Store, opened, swept_table
from gen_profile.support.artefacts.manifest import versions
from gen_profile.support.cluster import client_of, processes, unable
from gen_profile.support.errors import GenProfileError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.summary import Summarised
from gen_profile_exporters.registry import find_exporter

STAGE = "designing cases"
CASES_PER_TASK = 8  # at most; Dask's work for a task is a fifth of that for a case
# s of work for a case, one with a search, and what makes a process worth its start (docs/sweeps.md)
CASE, SEARCHED, WORTH = 0.06, 0.6, 0.65
TASKS_AHEAD = 3  # per process: one at work, and what keeps it busy while this process takes results in


def prepare(
    spec_text: tuple[str, str, Path],
    overrides: Sequence[str],
    grid: Grid,
    formats: Sequence[str],
    folder: Path,
) -> Store:
    """Say what is to be swept, once it makes sense.

    Parameters
    ----------
    spec_text : (str, str, Path)
        TOML of the spec, where it comes from, and the folder that its files are relative to.
    overrides : sequence of str
        Of the spec, the same in all cases.
    grid : Grid
    formats : sequence of str
    folder : Path
        To write to.

    Raises
    ------
    SpecError
        The spec is faulty, or no value of some axis fits it.
    """
    for name in formats:
        find_exporter(name)
    text, source, spec_folder = spec_text
    recipe = Recipe(
        text=text,
        overrides=tuple(overrides),
        source=source,
        folder=str(spec_folder.absolute()),
        formats=tuple(dict.fromkeys(formats)),
        versions=versions(),
    )
    spec = recipe.spec({})
    for axis in grid.axes:
        _require_some(recipe, axis.key, axis.values)
    return Store(folder=folder, name=spec.ascii_name, grid=grid, recipe=recipe, spec_sha256=spec.sha256())


def _require_some(recipe: Recipe, key: str, values: Sequence[Any]) -> None:
    """Tell a mistyped key from values of which some do not do."""
    faults = []
    for value in values:
        try:
            recipe.spec({key: value})
        except SpecError as error:
            faults.append(error)
        else:
            return
    raise faults[0]


@attrs.frozen(kw_only=True, repr=False)
class Sweep(Summarised):
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

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {"name": self.store.name, "folder": self.store.folder, **self.statuses}

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
    progress: Progress = no_progress,
) -> Sweep:
    """Work out all cases that are not finished, and write the table.

    Parameters
    ----------
    store : Store
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``; processes of this computer by default.
    workers : int, optional
        How many of those; by default as many as pay, one per processor at most.
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
        table = store.gather()
    for row in swept_table(store.folder, grid, ["case", "status", "reason"]).to_pylist():
        statuses[row["status"]] += 1
        if row["status"] != PASSED:
            reasons.setdefault(row["status"], f"case {row['case']}: {row['reason']}")
    before = len(grid) - len(unfinished)
    return Sweep(store=store, statuses=dict(statuses), reasons=reasons, kept=before, table=table)


def _work(
    store: Store,
    kept: Keeper,
    unfinished: Sequence[int],
    *,
    scheduler: str | None,
    workers: int | None,
    progress: Progress,
) -> None:
    """Hand the cases to workers, a few ahead, and keep what comes back.

    Where a process ends, each case that it may have ended of is worked at again by itself.
    """
    grid, total, failures = store.grid, len(store.grid), 0
    done = total - len(unfinished)
    progress(STAGE, done, total)

    def keep(outcomes: Sequence[CaseOutcome]) -> None:
        nonlocal done, failures
        for outcome in outcomes:
            kept.keep(outcome)
            done, failures = done + 1, failures + (not outcome.passed)
            progress(STAGE, done, total, f"{failures} failed" if failures else "")

    asked = workers or worthwhile(store.recipe.spec({}), len(unfinished))
    with client_of(scheduler, min(asked, len(unfinished))) as client:
        ahead = TASKS_AHEAD * processes(client)
        size = max(1, min(CASES_PER_TASK, len(unfinished) // ahead))
        tasks = (unfinished[first : first + size] for first in range(0, len(unfinished), size))
        suspects: list[int] = []
        for cases, future in _worked(client, store, tasks, ahead):
            try:
                keep(_outcomes(future))
            except KilledWorker:
                suspects += cases
        for (case,), future in _worked(client, store, [[case] for case in suspects], ahead=1):
            try:
                keep(_outcomes(future))
            except KilledWorker:
                reason = "Every process that worked at it ended: it lacks memory, or a library crashes."
                keep([failed(case, grid[case], CRASHED, reason)])


def worthwhile(spec: Spec, cases: int) -> int:
    """Estimate how many processes of this computer do so many cases soonest: each takes time to start."""
    searched = spec.move.shortest or spec.robustness.method == "range"
    work = cases * (SEARCHED if searched else CASE)
    return max(1, min(int(CPU_COUNT), int(work / WORTH)))


def _worked(
    client: Client, store: Store, tasks: Iterable[Sequence[int]], ahead: int
) -> Iterator[tuple[Sequence[int], Future]]:
    """Hand tasks of some cases each to workers, so many ahead; those that are over, in any order."""
    running: dict[Future, Sequence[int]] = {}
    completed = as_completed(loop=client.loop)
    waiting = iter(tasks)

    def begin(count: int) -> None:
        for cases in islice(waiting, count):
            values = {case: store.grid[case] for case in cases}
            future = client.submit(run_cases, store.recipe, values, pure=False)
            running[future] = cases
            completed.add(future)

    begin(ahead)
    for future in completed:
        yield running.pop(future), future
        begin(1)


def _outcomes(future: Future) -> list[CaseOutcome]:
    """Take the outcomes of some cases in."""
    try:
        return cast("list[CaseOutcome]", future.result())
    except (GenProfileError, KilledWorker):
        raise
    except Exception as error:
        raise SpecError(f"{unable(error)} What is finished is kept: sweep again.") from error
