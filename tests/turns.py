"""Slow tests take turns: in each run those that are near to what changed, and a third of the others.

A test is of the *rooms*, modules and folders, that its file and its folder are named after or that it
imports. A room that changed has its tests run whatever turn it is, those of few tests first, until they
are a `SHARE` of all: what nearly every test uses makes nothing run but in its turn. In three turns every
test runs.
"""

import re
from collections import Counter
from collections.abc import Mapping, Set
from pathlib import PurePosixPath

TURNS = 3
SHARE = 1 / 8
IMPORT = re.compile(r"^ *(?:from ([\w.]+) )?import (\([^)]*\)|.*)", re.MULTILINE)


def changed_rooms(changed: Set[str]) -> set[str]:
    """Name the rooms of files that changed, which are given from the root of the repository."""
    rooms: set[str] = set()
    for path in map(PurePosixPath, changed):
        if path.suffix == ".md":
            rooms.add(path.name)
        elif path.parts[0] == "tests":
            rooms.add(path.stem)
        else:
            rooms.update(path.parts[:-1], [path.stem])
    return rooms


def rooms_of(test: str, source: str) -> set[str]:
    """Name the rooms that a test's file is of: its own name, all parts of it, its folder, and its imports.

    A page whose commands are run is one of those files; its room is itself, beside what runs it.
    """
    path = PurePosixPath(test)
    if path.suffix == ".md":
        return {path.name, "documentation", "test_documentation"}
    words = path.stem.removeprefix("test_").split("_")
    ends = range(1, len(words) + 1)
    parts = {"_".join(words[begin:end]) for end in ends for begin in range(end)}
    imported = {word for found in IMPORT.findall(source) for word in re.findall(r"\w+", " ".join(found))}
    return {path.stem, path.parent.name} | parts | imported


def near(tests: Mapping[str, int], rooms: Mapping[str, Set[str]], changed: Set[str]) -> dict[str, str]:
    """Tell which files run whatever turn it is, each with a room that changed.

    Parameters
    ----------
    tests, rooms
        How many tests each file has, and the rooms that it is of.
    changed
        What changed, from the root of the repository.
    """
    of = {room: [file for file in tests if room in rooms[file]] for room in changed_rooms(changed)}
    sizes = Counter({room: sum(tests[file] for file in files) for room, files in of.items()})
    found: dict[str, str] = {}
    for room in sorted(of, key=lambda room: (sizes[room], room)):
        more = found | {file: room for file in of[room] if file not in found}
        if sum(tests[file] for file in more) > SHARE * sum(tests.values()):
            break
        found = more
    return found


def turns(files: Set[str]) -> dict[str, int]:
    """Give each file its turn, 0 to 2: a room's stand side by side, so that each turn has a third of them."""
    return {file: place % TURNS for place, file in enumerate(sorted(files))}
