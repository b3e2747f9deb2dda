"""What a finished sweep holds, in a folder or one file: its grid, its table, the files of its cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pyarrow as pa
from pyarrow import compute

from gen_profile.artefacts.manifest import FILENAME, parse_manifest, sha256
from gen_profile.artefacts.reading import read_artefact
from gen_profile.artefacts.writing import staged
from gen_profile.bounded_file import DOCUMENT, read_bounded
from gen_profile.errors import OutputError
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import overridden, spec_from_dict
from gen_profile.strict_json import parse_json
from gen_profile.sweep.archive import is_archive, read_archive
from gen_profile.sweep.grid import Grid
from gen_profile.sweep.store import RECORD
from gen_profile.sweep.table import Table, columns_of, read_table


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
    try:
        decoded = [_decoded(dict(zip(names, row, strict=True))) for row in rows]
    except ValueError as error:
        raise OutputError(f"{path}: damaged; sweep again.") from error
    return columns_of(decoded, names)


def _decoded(row: dict[str, Any]) -> dict[str, Any]:
    return row | {"artefacts": parse_json(row["artefacts"])} if "artefacts" in row else row


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
    return spec_from_dict(overridden(dict(manifest.spec), changes), case)


def take_out(path: Path, row: Mapping[str, Any], folder: Path) -> None:
    """Write a case's files to a folder, as an export of its own would have.

    Raises
    ------
    OutputError
    """
    with staged(folder) as staging:
        for name, content in case_files(path, row).items():
            staging.write(name, content)
        staging.deliver()
