"""Sweeps without processes of their own, and laid out otherwise."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from distributed import LocalCluster

from gen_profile.studies.sweep.archive import written_archive
from gen_profile.studies.sweep.case import CaseOutcome
from gen_profile.studies.sweep.store import grid_of

LOOPBACK = {"dashboard_address": None, "scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"}}


@contextmanager
def scheduler() -> Iterator[str]:
    """Start a Dask scheduler whose only worker is a thread: for tests of what is swept, not of processes."""
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, **LOOPBACK) as cluster:
        yield cluster.scheduler_address


def archived(folder: Path, path: Path, leave_out: tuple[int, ...] = ()) -> Path:
    """Put what a sweep left in a folder into one file, but for some cases."""
    grid = grid_of(folder)
    with written_archive(path) as archive:
        archive.describe((folder / "sweep.json").read_text("utf-8"))
        for case in sorted(folder.glob("cases/*/*")):
            files = {file.name: file.read_bytes() for file in case.iterdir()}
            record = json.loads(files.pop("case.json"))
            if record["case"] not in leave_out:
                archive.keep(grid, CaseOutcome(record=record, files=files))
    return path
