"""A sweep's profiles in one PLC file: which are in it, that it issues what was checked, what is refused."""

import json
import re
import shutil
from pathlib import Path

import pytest
from command_line import error_of, run_here
from sweeps import archived, scheduler

from gen_profile.delivery.deployment.table import read_table as read_block_table
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.sweep import library as profile_library
from gen_profile.studies.sweep.store import grid_of
from gen_profile.studies.sweep.table import read_table
from gen_profile.support.errors import CheckFailed, ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.playback.library import read_library
from gen_profile_exporters.registry import container_of, find_container

pytestmark = pytest.mark.slow

CYCLE = "export.cycle_time=0.01"
AXES = (
    "--vary",
    "check.residual_sway=1e-6,0.003",
    "--vary",
    "solver.method=zv,zvd",
    "--vary",
    "plant.L1=0.45,0.5",
)


def sweep(folder, *arguments):
    words = ("sweep", "--preset", "paper-beta0", "--set", CYCLE, *arguments, "--out", folder)
    with scheduler() as address:
        outcome = run_here(*words, "--scheduler", address)
    assert outcome.code == 0, outcome.err
    return folder


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The blocks may lie in any container, not only in that of the library."""
    return sweep(tmp_path_factory.mktemp("swept"), *AXES, "--export", "csv", "--export", "twincat")


@pytest.fixture(scope="module")
def library(swept, tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "bay 3.st"
    outcome = run_here("library", swept, "--out", path, "--json")
    assert outcome.code == 0, outcome.err
    stages = {re.sub(", .*", " …", line) for line in outcome.err.splitlines()}  # and how far, for how long
    assert stages >= {"writing the library and reading it back …"}
    assert stages <= {"reading profiles …", "writing the library and reading it back …"}
    return path, outcome.document


def test_one_file_gives_the_same_library(swept, library, tmp_path):
    path = archived(swept, tmp_path / "swept.sqlite")
    assert run_here("library", path, "--out", tmp_path / "bay 3.st").code == 0
    assert (tmp_path / "bay 3.st").read_bytes() == library[0].read_bytes()


def test_a_library_and_a_motion_of_its_names_are_kept_apart(swept, tmp_path):
    one = ("--preset", "paper-beta0", "--set", CYCLE, "--export", "plc", "--no-check", "--out")
    assert run_here(*one, tmp_path / "first", "--set", "name=bay 3").code == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "first").iterdir()}
    assert "The folder holds 'bay 3', and the library would share fb_bay_3" in error_of(
        "library", swept, "--out", tmp_path / "first/bay_3.st"
    )
    assert {path.name: path.read_bytes() for path in (tmp_path / "first").iterdir()} == before
    (tmp_path / "second").mkdir()
    for _ in range(2):  # its own files are no other's
        assert run_here("library", swept, "--out", tmp_path / "second/bay 3.st").code == 0
    assert "The folder holds the library of bay 3.json, and 'bay 3' would share" in error_of(
        *one, tmp_path / "second", "--set", "name=bay 3"
    )
    assert run_here(*one, tmp_path / "second", "--set", "name=bay 4").code == 0


def test_holds_the_profiles_that_passed_in_their_order(swept, library):
    path, document = library
    rows = [row for row in read_table(swept, grid_of(swept)).to_pylist() if row["status"] == "passed"]
    assert 2 <= len(rows) < 8
    assert [entry["case"] for entry in document["profiles"]] == [row["case"] for row in rows]
    for number, (entry, row) in enumerate(zip(document["profiles"], rows, strict=True)):
        assert entry["number"] == number
        assert entry["values"] == {
            key: row[key] for key in ("check.residual_sway", "solver.method", "plant.L1")
        }
        assert entry["sway_residual_worst_m"] == row["check_worst_sway_m"] <= 0.003
    index = json.loads(path.with_suffix(".json").read_text("utf-8"))
    assert index["profiles"] == document["profiles"]
    assert index["block"] == document["block"] == "FB_bay_3"
    assert f"FUNCTION_BLOCK {index['block']}\n" in path.read_text("ascii")
    assert document["bytes"] == path.stat().st_size


def test_issues_what_was_checked(library):
    path, document = library
    target = target_of(preset_spec("paper-beta0", [CYCLE]))
    motions = read_library(parse_function_block(path.read_text("ascii")), target)
    hashes = [entry["payload_sha256"] for entry in document["profiles"]]
    assert [motion.payload_hash() for motion in motions] == hashes
    assert len(set(hashes)) == len(hashes)


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("bay 3.XML", []),
        ("bay 3.codesys.xml", []),
        ("bay 3.scl", ["bay 3_velocity.scl"]),
        ("FB_bay_3.TcPOU", ["FB_bay_3_Axis.TcPOU"]),
    ],
)
def test_the_suffix_tells_the_format(swept, library, tmp_path, name, others):
    outcome = run_here("library", swept, "--out", tmp_path / name, "--json")
    assert (outcome.code, outcome.errors) == (0, [])
    document, due = outcome.document, library[1]
    assert [Path(path).name for path in document["files"]] == [name, *others]
    assert (document["block"], document["profiles"]) == (due["block"], due["profiles"])
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [name, *others, Path(document["index"]).name]
    )
    target = target_of(preset_spec("paper-beta0", [CYCLE]))
    block = find_container(container_of(name)).unwrap((tmp_path / name).read_bytes(), target)
    hashes = [motion.payload_hash() for motion in read_library(block, target)]
    assert hashes == [entry["payload_sha256"] for entry in due["profiles"]]
    table = read_block_table(tmp_path / name)
    assert table.hashes["payload_sha256"]
    for other in others:
        (tmp_path / other).write_bytes((tmp_path / other).read_bytes().replace(b"cIdle", b"cTaking"))
        with pytest.raises(CheckFailed, match=f"^{other} is not the one that was exported with {name}"):
            read_block_table(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("bay.L5X", "rockwell-l5x carries no playback block"),
        ("bay.csv", "csv carries no playback block"),
        ("bay.pdf", "no format has that suffix"),
        ("bay", "no format has that suffix"),
    ],
)
def test_a_suffix_of_no_block_is_refused(swept, tmp_path, name, fault):
    outcome = run_here("library", swept, "--out", tmp_path / name)
    assert (outcome.code, outcome.errors) == (
        2,
        [
            f"Error: {tmp_path / name}: {fault}; the suffixes of those that do are .codesys.xml (codesys), "
            ".st (plc), .xml (plcopen-xml), .scl (siemens-scl), .TcPOU (twincat)."
        ],
    )
    assert list(tmp_path.iterdir()) == []


def test_the_same_sweep_makes_the_same_bytes(swept, library, tmp_path):
    path, _ = library
    outcome = run_here("library", swept, "--out", tmp_path / path.name)
    assert f"FB_bay_3, {len(library[1]['profiles'])} profiles" in outcome.out
    for name in (path.name, "bay 3.json"):
        assert (tmp_path / name).read_bytes() == (path.parent / name).read_bytes()


def test_a_file_that_was_altered_is_not_put_in(swept, tmp_path):
    copy = shutil.copytree(swept, tmp_path / "copy")
    case = next(iter(sorted(copy.glob("cases/*/*/FB_paper*[!s].TcPOU"))))
    case.write_bytes(case.read_bytes().replace(b"cLast : DINT := ", b"cLast : DINT := 1"))
    outcome = run_here("library", copy, "--out", tmp_path / "library.st")
    assert (outcome.code, outcome.errors) == (
        2,
        [f"Error: {case} is not the file that the sweep wrote: it was altered; sweep again."],
    )
    assert not (tmp_path / "library.st").exists()


def test_a_library_that_would_issue_something_else_is_not_written(swept, tmp_path, monkeypatch):
    def shuffled(entries, target):
        return library_source(entries[::-1], target)

    library_source = profile_library.library_source
    monkeypatch.setattr(profile_library, "library_source", shuffled)
    with pytest.raises(ExportError, match="Profile 0 would not issue what case"):
        profile_library.write_library(swept, tmp_path / "library.st")
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_without_plc_blocks_is_refused(tmp_path):
    folder = sweep(tmp_path / "swept", "--vary", "solver.method=zvd")
    outcome = run_here("library", folder, "--out", tmp_path / "library.st")
    assert (outcome.code, outcome.errors) == (
        2,
        ["Error: A library needs the cases' PLC blocks: sweep again with the format plc."],
    )


def test_a_sweep_of_which_nothing_passed_is_refused(tmp_path):
    folder = sweep(tmp_path / "swept", "--vary", "check.residual_sway=1e-9", "--set", "solver.method=zvd")
    assert "passed, so there is nothing to put into a library" in error_of(
        "library", folder, "--out", tmp_path / "library.st"
    )


def test_no_folder_and_no_libraries_are_named(tmp_path):
    assert "There is no sweep in" in run_here("library", tmp_path, "--out", tmp_path / "x.st").err
    assert "DIR" in run_here("library").err
    assert Path(tmp_path / "x.st").exists() is False
