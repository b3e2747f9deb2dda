"""Sweeps in one file: what kills lose, what is refused, what others read of it."""

import shutil
import sqlite3
import subprocess
from contextlib import closing

import attrs
import pytest
from command_line import error_of, run_here
from system_parts import program

from gen_profile.spec.reading import preset_text
from gen_profile.studies.sweep.archive import read_archive
from gen_profile.studies.sweep.case import CaseOutcome, failed
from gen_profile.studies.sweep.grid import parse_grid
from gen_profile.studies.sweep.run import prepare
from gen_profile.studies.sweep.store import grid_of, opened, swept_table, take_out
from gen_profile.support.artefacts.manifest import Manifest, sha256
from gen_profile.support.errors import OutputError

TABLE = b"1;2\r\n\xb5"
ARTEFACT = {"format": "csv", "path": "paper.csv", "sha256": sha256(TABLE), "bytes": 0, "payload_sha256": "p"}
MANIFEST = Manifest(
    name="paper", spec={}, spec_sha256="", profile_sha256="", versions={}, artefacts=(), check=None
)
FILES = {"manifest.json": MANIFEST.to_json(), "paper.csv": TABLE}


def prepared(path, *axes):
    text = (preset_text("paper"), "paper", path.parent)
    return prepare(text, (), parse_grid(axes or ["plant.L1=0.4,0.5", "solver.method=auto,zv"]), ["csv"], path)


def passed(store, case):
    record = failed(case, store.grid[case], "passed", "").record
    figures = {"duration_s": 3.0, "acceleration_max_m_per_s2": 0.1 + case}
    return CaseOutcome(record=record | {"figures": figures, "artefacts": [ARTEFACT]}, files=FILES)


@pytest.fixture
def store(tmp_path):
    """A finished sweep, of which a case failed."""
    store = prepared(tmp_path / "swept.sqlite")
    with opened(store) as kept:
        for case in (2, 0, 3):
            kept.keep(passed(store, case))
        kept.keep(failed(1, store.grid[1], "infeasible", "Too fast."))
    return store


def test_the_program_of_sqlite_takes_out_every_file_as_it_was(store, tmp_path):
    subprocess.run(
        [program("sqlite3", "sqlite3"), store.folder, "-A", "--extract", "-C", tmp_path / "all"],
        check=True,
        cwd=tmp_path,
    )
    found = {
        path.relative_to(tmp_path / "all").as_posix(): path.read_bytes()
        for path in (tmp_path / "all").rglob("*.*")
    }
    due = {f"cases/0000/{case:03d}/{name}": text for case in (0, 2, 3) for name, text in FILES.items()}
    assert found == due


def test_the_table_is_in_sql(store):
    with sqlite3.connect(store.folder) as connection:
        asked = 'SELECT "case", "solver.method", "plant.L1", reason FROM cases WHERE "plant.L1" < 0.45'
        assert sorted(connection.execute(asked)) == [(0, "auto", 0.4, ""), (1, "zv", 0.4, "Too fast.")]
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    rows = swept_table(store.folder, store.grid).to_pylist()
    assert [row["case"] for row in rows] == [0, 1, 2, 3]
    assert [row["acceleration_max_m_per_s2"] for row in rows] == [0.1, None, 2.1, 3.1]
    assert rows[0]["artefacts"] == [ARTEFACT] and rows[1]["artefacts"] == []
    assert swept_table(store.folder, store.grid, ["status", "check_limit_m"], [1, 0]).to_pydict() == {
        "status": ["infeasible", "passed"],
        "check_limit_m": [None, None],
    }


def test_nothing_is_left_beside_it_and_another_case_tells_the_same(store, tmp_path):
    assert [path.name for path in tmp_path.iterdir()] == ["swept.sqlite"]
    assert grid_of(store.folder) == store.grid


def test_a_writer_that_is_killed_has_kept_every_case_whole(tmp_path):
    store, killed = prepared(tmp_path / "swept.sqlite"), tmp_path / "killed"
    killed.mkdir()
    with opened(store) as kept:
        for case in range(3):
            kept.keep(passed(store, case))
        for path in tmp_path.glob("swept.sqlite*"):  # what the disk has at this instant
            shutil.copy(path, killed)
    log = killed / "swept.sqlite-wal"
    log.write_bytes(log.read_bytes()[:-100])  # the last case had not been written to its end
    again = attrs.evolve(store, folder=killed / "swept.sqlite")
    with pytest.raises(OutputError, match="finish the sweep first"):
        swept_table(again.folder, store.grid)
    with opened(again) as kept:
        assert [kept.is_finished(case) for case in range(4)] == [True, True, False, False]
        for case in (2, 3):
            kept.keep(passed(store, case))
    assert swept_table(again.folder, store.grid)["status"].to_pylist() == 4 * ["passed"]


def test_holds_one_sweep_and_lets_one_write(store):
    with opened(store), pytest.raises(OutputError, match="Another sweep is at work"), opened(store):
        raise AssertionError
    other = prepared(store.folder, "plant.L1=0.4,0.6")
    with (
        pytest.raises(OutputError, match=r"a sweep with other values; choose another file"),
        opened(other),
    ):
        raise AssertionError
    with read_archive(store.folder) as archive:
        assert archive.finished()
    assert [path.name for path in store.folder.parent.glob("*.sqlite*")] == [store.folder.name]


@pytest.mark.parametrize("content", [b"", b"no database, however long it may be" * 40])
def test_a_file_that_is_no_sweep_is_named(tmp_path, content):
    path = tmp_path / "swept.sqlite"
    path.write_bytes(content)
    assert str(path) in error_of("lookup", path, "--plant.L1", "0.4")
    assert run_here("lookup", tmp_path / "none.sqlite", "--plant.L1", "0.4").code == 2
    if content:
        with pytest.raises(OutputError, match="no sweep, or damaged"), opened(prepared(path)):
            raise AssertionError


def test_a_file_altered_in_it_is_refused_and_worked_out_again(store, tmp_path):
    with closing(sqlite3.connect(store.folder)) as connection, connection:
        connection.execute("UPDATE sqlar SET data = 'x', sz = 1 WHERE name = 'cases/0000/002/paper.csv'")
    (row,) = swept_table(store.folder, store.grid, cases=[2]).to_pylist()
    with pytest.raises(OutputError, match=r"cases/0000/002/paper.csv is not the file that the sweep wrote"):
        take_out(store.folder, row, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with opened(store) as kept:
        assert [kept.is_finished(case) for case in range(4)] == [True, True, False, True]
        kept.keep(passed(store, 2))
    take_out(store.folder, row, tmp_path / "out")
    assert (tmp_path / "out" / "paper.csv").read_bytes() == TABLE


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with (
        pytest.raises(OutputError, match="cannot be written"),
        opened(prepared(tmp_path / "file" / "a.sqlite")),
    ):
        raise AssertionError
