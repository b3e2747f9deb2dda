"""What is swept, and where what comes of it is kept: in one file (see `archive` beside this), or a folder.

::

    sweep.json               what is varied, from which spec, with which versions
    sweep.parquet            one row per case, once all are finished
    cases/0000/017/          case 17: its artefacts with their manifest, and case.json, its row
    .lock                    held by the one who sweeps

A case is finished when its ``case.json`` is there, which is the last of its files to appear, and the others
are as it tells: the same sweep works out again what was damaged since.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import attrs
import pyarrow as pa
from filelock import FileLock, Timeout
from pyarrow import compute

from gen_profile.spec.model import Spec
from gen_profile.spec.reading import overridden, received_spec
from gen_profile.studies.sweep.archive import Archive, is_archive, read_archive, written_archive
from gen_profile.studies.sweep.case import CaseOutcome, Recipe
from gen_profile.studies.sweep.grid import Grid, GridAxis
from gen_profile.studies.sweep.table import Table, case_path, columns_of, read_table, write_table
from gen_profile.support.artefacts.manifest import FILENAME, parse_manifest, sha256
from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.artefacts.writing import deliver, deliver_all, unwritable
from gen_profile.support.bounded_file import DOCUMENT, read_bounded
from gen_profile.support.errors import OutputError
from gen_profile.support.strict_json import parse_document, parse_json

HEAD = {"format": "gen-profile sweep", "format_version": 1}
WORDS = {"vary": "values", "spec_sha256": "spec"}  # for keys of a description
DESCRIPTION, RECORD = "sweep.json", "case.json"
RECORD_TYPES = {
    "status": str,
    "reason": str,
    "artefacts": list,
    "figures": dict,
    "check": dict,
    "solver": dict,
}
LOCK = ".lock"


@attrs.frozen(kw_only=True)
class Store:
    """What is swept, and its folder, with what is finished there.

    Attributes
    ----------
    folder : Path
        Or file.
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
        """Whether a case's record is there, and all files are as it tells: a power cut may leave a part."""
        record = self._record(case)
        try:
            files = {file.name: read_bounded(file) for file in self.case_folder(case).iterdir()}
            return record is not None and _is_whole(record.get("artefacts", []), files)
        except OSError:
            return False

    def keep(self, outcome: CaseOutcome) -> None:
        """Write a finished case.

        Raises
        ------
        OutputError
        """
        files = {**outcome.files, RECORD: _json(outcome.record)}
        deliver_all(self.case_folder(outcome.record["case"]), files)

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

    def gather(self) -> Path:
        """Write the table of all cases, which one file is already; its path.

        Raises
        ------
        OutputError
            One is not finished, or the table cannot be written.
        """
        if is_archive(self.folder):
            return self.folder
        return write_table(self.folder, self.grid, self.records())

    def _record(self, case: int) -> dict[str, Any] | None:
        """Read a case's record, if it is there and one of this case."""
        try:
            record = parse_json(read_bounded(self.case_folder(case) / RECORD, DOCUMENT))
        except (OSError, ValueError):
            return None
        own = {"case": case, "values": self.grid[case]}
        if not isinstance(record, dict) or not own.items() <= record.items():
            return None
        whole: dict[str, Any] = {"artefacts": [], "figures": {}, "check": {}, "solver": {}} | record
        sound = all(isinstance(whole.get(key), kind) for key, kind in RECORD_TYPES.items())
        return record if sound else None

    def describe(self) -> dict[str, Any]:
        """Nest plain values for ``sweep.json``: equal sweeps have equal ones, wherever their spec lies."""
        recipe = attrs.asdict(self.recipe)
        del recipe["source"], recipe["folder"]
        return {
            **HEAD,
            "name": self.name,
            "vary": {axis.key: list(axis.values) for axis in self.grid.axes},
            "spec_sha256": self.spec_sha256,
            **recipe,
            "formats": list(recipe["formats"]),
            "overrides": list(recipe["overrides"]),
            "versions": dict(recipe["versions"]),
        }


class ArchiveKeeper:
    """Finished cases in one file, as `Store` keeps them in a folder."""

    def __init__(self, grid: Grid, archive: Archive) -> None:
        self._grid, self._archive, self._finished = grid, archive, archive.finished()

    def is_finished(self, case: int) -> bool:
        """Whether a case is there, whole."""
        if case not in self._finished:
            return False
        ((artefacts,),) = self._archive.rows(["artefacts"], [case])
        try:
            listed = parse_json(artefacts or "[]")
        except ValueError:
            return False
        return _is_whole(listed, self._archive.files(str(case_path(case))))

    def keep(self, outcome: CaseOutcome) -> None:
        """Write a finished case."""
        self._archive.keep(self._grid, outcome)
        self._finished.add(outcome.record["case"])


Keeper = Store | ArchiveKeeper


def _is_whole(artefacts: Sequence[Mapping[str, str]], files: Mapping[str, bytes]) -> bool:
    """Whether a case's files are those that were written; one that failed has none."""
    try:
        if artefacts:
            parse_manifest(files[FILENAME], FILENAME)
        return all(sha256(files[one["path"]]) == one["sha256"] for one in artefacts)
    except (KeyError, TypeError, OutputError):
        return False


@contextmanager
def opened(store: Store) -> Iterator[Keeper]:
    """Begin a sweep, or go on with it; no other process may work in its folder or file meanwhile.

    Raises
    ------
    OutputError
        It holds another sweep, or is in use, or cannot be written.
    """
    asked = store.describe()
    if is_archive(store.folder):
        with written_archive(store.folder) as archive:
            if archive.description() is None:
                archive.describe(_json(asked).decode("utf-8"))
            _require_same(store.folder, asked, archive.description() or "")
            yield ArchiveKeeper(store.grid, archive)
        return
    with _locked(store.folder):
        if not (store.folder / DESCRIPTION).exists():
            deliver(store.folder / DESCRIPTION, _json(asked))
        _require_same(store.folder, asked, read_artefact(store.folder / DESCRIPTION))
        yield store


def _require_same(path: Path, asked: dict[str, Any], description: bytes | str) -> None:
    stored = _parsed(path, description)
    if stored != asked:
        other = " and ".join(WORDS.get(key, key) for key in asked if stored.get(key) != asked[key])
        what = "file" if is_archive(path) else "folder"
        raise OutputError(f"{path} holds a sweep with other {other}; choose another {what}.")


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a lock that ends with the process, however that ends."""
    lock = FileLock(folder / LOCK)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = lock.acquire(blocking=False)
    except Timeout as error:
        raise OutputError(f"Another sweep is at work in {folder}; wait for its end.") from error
    except (OSError, NotImplementedError) as error:  # the latter of file systems without locks
        raise unwritable(folder, error) from error
    with held:
        yield


def grid_of(path: Path) -> Grid:
    """Read what the sweep in a folder or file varies.

    Raises
    ------
    OutputError
        There is no sweep in it.
    """
    if is_archive(path):
        with read_archive(path) as archive:
            description: bytes | str = archive.description() or ""
    else:
        try:
            description = read_bounded(path / DESCRIPTION)
        except OSError as error:
            raise OutputError(
                f"There is no sweep in {path}: cannot read {path / DESCRIPTION} ({error.strerror})."
            ) from error
    vary = _parsed(path, description)["vary"]
    return Grid(axes=tuple(GridAxis(key=key, values=tuple(values)) for key, values in vary.items()))


def _parsed(path: Path, description: bytes | str) -> dict[str, Any]:
    place = path if is_archive(path) else path / DESCRIPTION
    try:
        document = parse_document(description, HEAD)
    except ValueError as error:
        raise OutputError(f"{place}: not a sweep of this version of gen-profile.") from error
    vary = document.get("vary")
    values = vary.values() if isinstance(vary, dict) else ()
    if not values or not all(isinstance(listed, list) and listed for listed in values):
        raise OutputError(f"{place}: damaged; sweep again.")
    return document


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8")


def swept_table(
    path: Path, grid: Grid, columns: Sequence[str] | None = None, cases: Sequence[int] | None = None
) -> Table:
    """Read the table of a sweep's cases, or some columns of it, or of some cases in the order given.

    Raises
    ------
    OutputError
        The sweep is not finished, or damaged.
    """
    if not is_archive(path):
        table = read_table(path, grid)
        if cases is not None:
            table = table.take(compute.index_in(pa.array(cases, pa.int64()), table["case"]))
        return table if columns is None else table.select(columns)
    with read_archive(path) as archive:
        if len(archive.finished()) < len(grid):
            raise OutputError(f"{path}: finish the sweep first (the same gen-profile sweep goes on).")
        names = archive.columns() if columns is None else list(columns)
        rows = archive.rows(names, cases)
    read = [dict(zip(names, row, strict=True)) for row in rows]
    try:
        for row in read if "artefacts" in names else ():
            row["artefacts"] = parse_json(row["artefacts"])
    except ValueError as error:
        raise OutputError(f"{path}: damaged; sweep again.") from error
    return columns_of(read, names)


def case_files(path: Path, row: Mapping[str, Any]) -> dict[str, bytes]:
    """Read a case's manifest and artefacts, by name; these must be those that the sweep wrote.

    Raises
    ------
    OutputError
        One is gone or was altered.
    """
    try:
        if is_archive(path):
            with read_archive(path) as archive:
                files = archive.files(row["folder"])
        else:
            files = {file.name: read_bounded(file) for file in (path / row["folder"]).iterdir()}
            files.pop(RECORD, None)
    except OSError as error:
        raise OutputError(f"Cannot read {path / row['folder']}: {error.strerror}; sweep again.") from error
    for artefact in row["artefacts"]:
        place = path / row["folder"] / artefact["path"]
        if artefact["path"] not in files:
            raise OutputError(f"Cannot read {place}: it is not there; sweep again.")
        if sha256(files[artefact["path"]]) != artefact["sha256"]:
            raise OutputError(f"{place} is not the file that the sweep wrote: it was altered; sweep again.")
    if FILENAME not in files:
        raise OutputError(f"Cannot read {path / row['folder'] / FILENAME}: it is not there; sweep again.")
    return files


@contextmanager
def case_folder(path: Path, row: Mapping[str, Any]) -> Iterator[Path]:
    """Have a case's files as they were delivered, in a folder for as long as they are needed."""
    files = case_files(path, row)
    if not is_archive(path):
        yield path / row["folder"]
        return
    with TemporaryDirectory(prefix="gen-profile-") as name:
        for file, content in files.items():
            (Path(name) / file).write_bytes(content)
        yield Path(name)


def case_spec(path: Path, row: Mapping[str, Any], case: Path, changes: Sequence[str] = ()) -> Spec:
    """Read the spec of a case, whose files lie in a folder, with changes such as ``plant.L1=0.5``.

    Raises
    ------
    OutputError, SpecError
    """
    manifest = parse_manifest(read_artefact(case / FILENAME, DOCUMENT), str(path / row["folder"] / FILENAME))
    return received_spec(overridden(dict(manifest.spec), changes), case)


def take_out(path: Path, row: Mapping[str, Any], folder: Path) -> None:
    """Write a case's files to a folder, as an export of its own would have.

    Raises
    ------
    OutputError
    """
    deliver_all(folder, case_files(path, row))
