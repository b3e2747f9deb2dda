"""The folder of a sweep: what was asked for, what is finished, and the artefacts.

::

    sweep.json               what is varied, from which spec, with which versions
    sweep.parquet            one row per case, once all are finished
    cases/0000/017/          case 17: its artefacts with their manifest, and case.json, its row
    .lock                    held by the one who sweeps

A case is finished when its ``case.json`` is there, which is the last of its files to appear, whole.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import attrs
from filelock import FileLock, Timeout

from gen_profile.artefacts.manifest import sha256
from gen_profile.artefacts.writing import deliver, staged
from gen_profile.errors import OutputError
from gen_profile.sweep.case import CaseOutcome, Recipe
from gen_profile.sweep.grid import Grid, GridAxis

FORMAT, FORMAT_VERSION = "gen-profile sweep", 1
DESCRIPTION, RECORD, TABLE, CASES = "sweep.json", "case.json", "sweep.parquet", "cases"
RECORD_TYPES = {
    "status": str,
    "reason": str,
    "artefacts": list,
    "figures": dict,
    "check": dict,
    "solver": dict,
}
LOCK = ".lock"
PER_FOLDER = 1000


@attrs.frozen(kw_only=True)
class Store:
    """A sweep's folder, and what is swept in it.

    Attributes
    ----------
    folder : Path
    name : str
        Of the spec.
    grid : Grid
    recipe : Recipe
    spec_sha256 : str
        Of the spec before anything is varied, the files that it names included.
    """

    folder: Path
    name: str
    grid: Grid
    recipe: Recipe
    spec_sha256: str

    def case_folder(self, case: int) -> Path:
        """Tell where a case's files lie."""
        return self.folder / case_path(case)

    def is_finished(self, case: int) -> bool:
        """Whether a case's record is there, and whole: a power cut may leave a part."""
        return self._record(case) is not None

    def keep(self, case: int, outcome: CaseOutcome) -> None:
        """Write a finished case.

        Raises
        ------
        OutputError
        """
        with staged(self.case_folder(case)) as staging:
            for name, content in outcome.files.items():
                staging.write(name, content)
            staging.write(RECORD, _json(outcome.record))
            staging.deliver()

    def records(self) -> Iterator[dict[str, Any]]:
        """Read the records of all cases in their order.

        Raises
        ------
        OutputError
            One is not finished.
        """
        for case in range(len(self.grid)):
            record = self._record(case)
            if record is None:
                raise OutputError(f"{self.case_folder(case) / RECORD}: missing or damaged; sweep again.")
            yield record

    def _record(self, case: int) -> dict[str, Any] | None:
        """Read a case's record, if it is there and one of this case."""
        try:
            record = json.loads((self.case_folder(case) / RECORD).read_bytes())
        except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
            return None
        own = {"case": case, "values": self.grid[case]}
        if not isinstance(record, dict) or any(record.get(key) != value for key, value in own.items()):
            return None
        whole: dict[str, Any] = {"artefacts": [], "figures": {}, "check": {}, "solver": {}} | record
        sound = all(isinstance(whole.get(key), kind) for key, kind in RECORD_TYPES.items())
        return record if sound else None

    def describe(self) -> dict[str, Any]:
        """Nest plain values for ``sweep.json``: equal sweeps have equal ones, wherever their spec lies."""
        recipe = attrs.asdict(self.recipe)
        del recipe["source"], recipe["folder"]
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "name": self.name,
            "vary": {axis.key: list(axis.values) for axis in self.grid.axes},
            "spec_sha256": self.spec_sha256,
            **recipe,
            "formats": list(recipe["formats"]),
            "overrides": list(recipe["overrides"]),
            "versions": dict(recipe["versions"]),
        }


def case_path(case: int) -> Path:
    """Place a case's folder within that of its sweep."""
    return Path(CASES) / f"{case // PER_FOLDER:04d}" / f"{case % PER_FOLDER:03d}"


@contextmanager
def opened(store: Store) -> Iterator[None]:
    """Begin a sweep, or go on with it; nobody else may work in its folder meanwhile.

    Raises
    ------
    OutputError
        The folder holds another sweep, or is in use, or cannot be written.
    """
    with _locked(store.folder):
        asked = store.describe()
        if not (store.folder / DESCRIPTION).exists():
            deliver(store.folder / DESCRIPTION, _json(asked))
        found = _description(store.folder)
        if found != asked:
            other = ", ".join(key for key in asked if found.get(key) != asked[key])
            raise OutputError(
                f"{store.folder} holds another sweep (its {other} differ); choose another folder."
            )
        yield


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a lock that ends with the process, however that ends."""
    lock = FileLock(folder / LOCK)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout as error:
        raise OutputError(f"Another sweep is at work in {folder}; wait for its end.") from error
    except (OSError, NotImplementedError) as error:  # the latter of file systems without locks
        raise OutputError(
            f"Cannot write to the folder {folder}: {getattr(error, 'strerror', '') or error}; "
            "choose another one."
        ) from error
    try:
        yield
    finally:
        lock.release()


def grid_of(folder: Path) -> Grid:
    """Read what a folder's sweep varies.

    Raises
    ------
    OutputError
        There is no sweep in it.
    """
    vary = _description(folder)["vary"]
    return Grid(axes=tuple(GridAxis(key=key, values=tuple(values)) for key, values in vary.items()))


def read_swept(path: Path, digest: str | None = None) -> bytes:
    """Read a case's file, which must have the SHA-256 that the table has of it, if that is given.

    Raises
    ------
    OutputError
        It is gone or was altered.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OutputError(f"Cannot read {path}: {error.strerror or error}; sweep again.") from error
    if digest is not None and sha256(content) != digest:
        raise OutputError(f"{path} is not the file that the sweep wrote: it was altered; sweep again.")
    return content


def _description(folder: Path) -> dict[str, Any]:
    path = folder / DESCRIPTION
    try:
        document = json.loads(path.read_bytes())
        if (document["format"], document["format_version"]) != (FORMAT, FORMAT_VERSION):
            raise ValueError("another format")
    except OSError as error:
        raise OutputError(f"There is no sweep in {folder}: cannot read {path} ({error.strerror}).") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise OutputError(f"{path}: not a sweep of this version of gen-profile.") from error
    vary = document.get("vary")
    values = vary.values() if isinstance(vary, dict) else ()
    if not values or not all(isinstance(listed, list) and listed for listed in values):
        raise OutputError(f"{path}: damaged; sweep again.")
    return dict(document)


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8")
