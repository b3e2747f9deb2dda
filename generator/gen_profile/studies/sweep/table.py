"""The table of a sweep: a Parquet file with one row per case, whichever process worked it out."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from gen_profile.studies.sweep.grid import Grid, GridAxis
from gen_profile.support.errors import OutputError

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


TABLE = "sweep.parquet"
Table = Any  # pyarrow.Table, which has no types
BATCH = 10_000  # rows that are Python objects at a time
TEXT, WHOLE = pa.string(), pa.int64()
FILE = {"format": TEXT, "path": TEXT, "sha256": TEXT, "bytes": WHOLE, "payload_sha256": TEXT}
ARTEFACTS = pa.list_(pa.struct(FILE))
COLUMNS = {"case": WHOLE, "status": TEXT, "folder": TEXT}


def write_table(folder: Path, grid: Grid, records: Iterable[Mapping[str, Any]]) -> Path:
    """Gather records, in the order of their cases.

    Returns
    -------
    Path
        Of the file, which appears whole.

    Raises
    ------
    OutputError
        It cannot be written, or a record was altered.
    """
    path = folder / TABLE
    unfinished = path.with_name(f".{TABLE}")
    try:
        pq.write_table(_gathered(grid, iter(records)), unfinished, write_page_checksum=True)
        unfinished.replace(path)
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
    except pa.ArrowException as error:
        raise OutputError(
            f"{folder}: a case's record was altered ({error}); sweep to another folder."
        ) from error
    return path


def _gathered(grid: Grid, records: Iterator[Mapping[str, Any]]) -> Table:
    parts = []
    while batch := list(islice(records, BATCH)):
        parts.append(columns_of([row_of(grid, record) for record in batch]))
    table = pa.concat_tables(parts, promote_options="permissive")
    for index, field in enumerate(table.schema):
        if pa.types.is_null(field.type):  # no case has it
            table = table.set_column(index, field.name, table.column(index).cast(pa.float64()))
    return table


def read_table(folder: Path, grid: Grid) -> Table:
    """Read the table of a grid's cases.

    Raises
    ------
    OutputError
        The sweep is not finished, or the table is damaged.
    """
    path = folder / TABLE
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read()
        columns = {axis.key: pa.float64() if axis.numeric else TEXT for axis in grid.axes} | COLUMNS
        for name, type_ in columns.items():
            if table.schema.field(name).type != type_:
                raise pa.ArrowInvalid(f"another type of {name}")
    except FileNotFoundError as error:
        raise OutputError(
            f"There is no {TABLE} in {folder}: finish the sweep first (the same gen-profile sweep goes on)."
        ) from error
    except (OSError, KeyError, pa.ArrowException) as error:
        raise OutputError(f"{path}: damaged ({error}); sweep again, which only gathers it anew.") from error
    return table


def columns_of(rows: Sequence[Mapping[str, Any]], names: Sequence[str] = ()) -> Table:
    """Turn rows, of which some lack cells, into columns: those named, or all as they first appear."""
    names = list(names or dict.fromkeys(name for row in rows for name in row))
    types = {"artefacts": ARTEFACTS, "spec_sha256": TEXT, "profile_sha256": TEXT}
    arrays = [pa.array([row.get(name) for row in rows], type=types.get(name)) for name in names]
    return pa.table(arrays, names=names)
