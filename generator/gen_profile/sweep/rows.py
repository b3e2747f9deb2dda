"""A case as a row of the table, and where its files lie within a sweep."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from gen_profile.sweep.grid import Grid, GridAxis

CASES = "cases"
PER_FOLDER = 1000


def case_path(case: int) -> PurePosixPath:
    """Place a case's files within its sweep."""
    return PurePosixPath(CASES, f"{case // PER_FOLDER:04d}", f"{case % PER_FOLDER:03d}")


def cell(axis: GridAxis, value: Any) -> float | str:
    """Write a value as its column holds it: a number, or a text."""
    if axis.numeric:
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)


def row_of(grid: Grid, record: Mapping[str, Any]) -> dict[str, Any]:
    """Lay a record out flat."""
    return {
        "case": record["case"],
        **{axis.key: cell(axis, record["values"][axis.key]) for axis in grid.axes},
        "status": record["status"],
        "reason": record["reason"],
        "folder": str(case_path(record["case"])),
        "artefacts": record.get("artefacts", []),
        "spec_sha256": record.get("spec_sha256"),
        "profile_sha256": record.get("profile_sha256"),
        **record.get("figures", {}),
        **{f"check_{key}": value for key, value in record.get("check", {}).items()},
        **{f"solver_{key}": value for key, value in record.get("solver", {}).items()},
    }
