"""A sweep in one file: an SQLite database.

======== =====================================================================================
sweep    one row: what was asked for, as JSON
cases    one row per finished case, as in the Parquet table; ``artefacts`` as JSON
sqlar    the artefacts and manifests, as an SQLite archive (https://sqlite.org/sqlar.html)
======== =====================================================================================

A case is one transaction, so whatever kills the writer, a case is there whole or not at all.
"""

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from gen_profile.studies.sweep.case import CaseOutcome
from gen_profile.studies.sweep.grid import Grid
from gen_profile.studies.sweep.table import case_path, row_of
from gen_profile.support.errors import OutputError

SUFFIX = ".sqlite"
TYPES = {int: "INTEGER", float: "REAL", str: "TEXT"}
MODE, TIME = 0o100644, 0  # of every file: a sweep tells of no clock and no user
QUICK = 1  # level of compression, at which text takes a third of its room
TABLES = """
CREATE TABLE IF NOT EXISTS sweep (description TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS cases ("case" INTEGER PRIMARY KEY, status TEXT NOT NULL, reason TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS sqlar (name TEXT PRIMARY KEY, mode INT, mtime INT, sz INT, data BLOB);
"""


def is_archive(path: Path) -> bool:
    """Whether a sweep of this name is one file."""
    return path.suffix == SUFFIX


class Archive:
    """A sweep's file, open."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._columns = self.columns()

    def columns(self) -> list[str]:
        """Name the columns of the cases."""
        return [name for _, name, *_ in self._connection.execute("PRAGMA table_info(cases)")]

    def description(self) -> str | None:
        """Tell what was asked for, as JSON, if that is known yet."""
        row = self._connection.execute("SELECT description FROM sweep").fetchone()
        return None if row is None else str(row[0])

    def describe(self, description: str) -> None:
        """Note what is asked for."""
        with self._connection:
            self._connection.execute("INSERT INTO sweep VALUES (?)", (description,))

    def finished(self) -> set[int]:
        """List the cases that are there."""
        return {case for (case,) in self._connection.execute('SELECT "case" FROM cases')}

    def keep(self, grid: Grid, outcome: CaseOutcome) -> None:
        """Write a finished case."""
        row = {key: _plain(value) for key, value in row_of(grid, outcome.record).items() if value is not None}
        folder = case_path(outcome.record["case"])
        files = [
            (str(folder / name), MODE, TIME, len(content), _compressed(content))
            for name, content in outcome.files.items()
        ]
        with self._connection:
            for name in [name for name in row if name not in self._columns]:
                column = f"{_quoted(name)} {TYPES.get(type(row[name]), '')}"
                self._connection.execute(f"ALTER TABLE cases ADD COLUMN {column}")
                self._columns.append(name)
            places, marks = ", ".join(map(_quoted, row)), ", ".join("?" * len(row))
            insertion = f"INSERT OR REPLACE INTO cases ({places}) VALUES ({marks})"
            self._connection.execute(insertion, tuple(row.values()))
            self._connection.executemany("INSERT OR REPLACE INTO sqlar VALUES (?, ?, ?, ?, ?)", files)

    def rows(self, columns: Sequence[str], cases: Sequence[int] | None) -> list[tuple[Any, ...]]:
        """Read columns of all cases in order, or of some in the order given; what no case has is null."""
        known = self.columns()
        chosen = ", ".join(_quoted(name) if name in known else "NULL" for name in columns)
        chosen = f"SELECT {chosen} FROM cases"
        if cases is None:
            return self._connection.execute(f'{chosen} ORDER BY "case"').fetchall()
        one = f'{chosen} WHERE "case" = ?'
        return [self._connection.execute(one, (case,)).fetchone() for case in cases]

    def files(self, folder: str) -> dict[str, bytes]:
        """Read all files of a folder by name."""
        rows = self._connection.execute(
            "SELECT name, sz, CAST(data AS BLOB) FROM sqlar WHERE name BETWEEN ? AND ? AND data IS NOT NULL",
            (f"{folder}/", f"{folder}0"),
        )
        return {
            name.rpartition("/")[2]: data if len(data) == size else zlib.decompress(data)
            for name, size, data in rows
        }


@contextmanager
def written_archive(path: Path) -> Iterator[Archive]:
    """Open a sweep's file to write, alone; make it if it is not there.

    Raises
    ------
    OutputError
        It is in use, is none, or cannot be written.
    """
    with suppress(OSError):  # which SQLite tells of
        path.parent.mkdir(parents=True, exist_ok=True)
    with _explained(path, "written"), closing(sqlite3.connect(path, timeout=0.0)) as connection:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")  # what a power cut takes is worked out again
        connection.executescript(TABLES)
        try:
            yield Archive(connection)
        finally:  # nothing is left beside it, neither now nor by who reads it
            connection.execute("PRAGMA journal_mode = DELETE")


@contextmanager
def read_archive(path: Path) -> Iterator[Archive]:
    """Open a sweep's file to read.

    Raises
    ------
    OutputError
        It is in use, is none, or cannot be read.
    """
    if not path.is_file():
        raise OutputError(f"There is no sweep in {path}: it is no file.")
    with (
        _explained(path, "read"),
        closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=0.0)) as connection,
    ):
        yield Archive(connection)


@contextmanager
def _explained(path: Path, done: str) -> Iterator[None]:
    try:
        yield
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise OutputError(f"Another sweep is at work in {path}; wait for its end.") from error
        raise OutputError(f"{path} cannot be {done} ({error}); choose another file.") from error
    except (sqlite3.DatabaseError, zlib.error) as error:
        raise OutputError(f"{path}: no sweep, or damaged ({error}); sweep to another file.") from error


def _plain(value: Any) -> Any:
    """Write lists as JSON."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | Mapping) else value


def _compressed(content: bytes) -> bytes:
    """Compress what becomes smaller, as an SQLite archive has it."""
    return min(zlib.compress(content, QUICK), content, key=len)


def _quoted(name: str) -> str:
    """Write a column's name for SQL."""
    return '"' + name.replace('"', '""') + '"'
