"""Sweeps laid out otherwise."""

from __future__ import annotations

import json
from pathlib import Path

from gen_profile.sweep.archive import written_archive
from gen_profile.sweep.case import CaseOutcome
from gen_profile.sweep.store import grid_of


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
