"""Slow tests take turns: in each run those whose room changed, and a third of the others.

A test's file is of the rooms, folders and modules of the product, that it and its folder are named after: a
change to `planner.py`, or in a folder `fmu` or `planner`, runs `fmu/test_planner_cache.py`. In three turns
every test runs.
"""

from collections.abc import Set
from pathlib import PurePosixPath

TURNS = 3
TOO_LARGE = frozenset({"docs", "examples", "exporters", "generator"})  # to be one room


def rooms_of(changed: Set[str]) -> set[str]:
    """Name the rooms of files that changed, which are given from the root of the repository."""
    paths = [PurePosixPath(name) for name in changed if not name.startswith("tests/")]
    return {room for path in paths for room in (*path.parts[:-1], path.stem)} - TOO_LARGE


def reasons(test: str, changed: Set[str]) -> set[str]:
    """Tell for which rooms a test's file runs whatever turn it is; if it changed itself, for its own name."""
    path = PurePosixPath(test)
    name = f"_{path.parent.name}_{path.stem}_"
    return {room for room in rooms_of(changed) if f"_{room}_" in name} | ({test} & changed)


def turns(files: Set[str]) -> dict[str, int]:
    """Give each file its turn, 0 to 2: a room's stand side by side, so that each turn has a third of them."""
    return {file: place % TURNS for place, file in enumerate(sorted(files))}
