"""The nearest safe profile of a sweep, held against checks of one's own."""

import json
import shutil
from pathlib import Path

import pyarrow
import pytest
from command_line import error_of, run_here
from pyarrow import parquet
from sweeps import archived, scheduler

from gen_profile.assurance.verification.check import check_artefact
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.sweep.store import grid_of
from gen_profile.studies.sweep.table import read_table

pytestmark = pytest.mark.slow

CYCLE = "export.cycle_time=0.01"
AXES = ("--vary", "solver.method=auto,zv", "--vary", "move.distance=0.3,0.4", "--vary", "plant.L1=0.3,0.35")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    arguments = ("--preset", "paper", "--set", CYCLE, *AXES, "--export", "csv", "--out", folder)
    with scheduler() as address:
        assert run_here("sweep", *arguments, "--scheduler", address).code == 0
    return folder


def looked_up(library, *words):
    outcome = run_here("lookup", library, *words, "--json")
    assert outcome.code == 0, outcome.err
    return outcome.document


def residual(library, case, asked_for, distance):
    """Worst sway that a case's file leaves on another machine, and whether that is allowed."""
    row = read_table(library, grid_of(library)).to_pylist()[case]
    overrides = (CYCLE, f"plant.L1={asked_for}", f"move.distance={distance}", "check.residual_sway=0.003")
    check = check_artefact(library / row["folder"] / "paper.csv", preset_spec("paper", overrides)).check
    load, finding = check.worst
    return finding.residual[load], check.passed


def test_what_was_swept_is_found_itself(library):
    nearest = looked_up(library, "--move.distance", "0.3", "--plant.L1", "0.35", "--solver.method", "auto")
    row = read_table(library, grid_of(library)).to_pylist()[nearest["case"]]
    assert (row["move.distance"], row["plant.L1"], row["solver.method"]) == (0.3, 0.35, "auto")
    assert nearest["differences"] == {"move.distance": 0.0, "plant.L1": 0.0}
    assert nearest["artefact"]["manifest"] == "matches"
    assert nearest["sway_residual_worst_m"] == pytest.approx(row["check_worst_sway_m"], rel=1e-3)
    assert nearest["artefacts"][0]["path"] == str(library / row["folder"] / "paper.csv")


def test_one_file_answers_as_the_folder_does_and_gives_the_profile_out(library, tmp_path):
    words = ("--move.distance", "0.31", "--plant.L1", "0.305", "--solver.method", "auto")
    path = archived(library, tmp_path / "library.sqlite")
    due, nearest = looked_up(library, *words), looked_up(path, *words, "--out", tmp_path / "out")
    files = {"artefact": nearest["artefact"], "artefacts": nearest["artefacts"]}
    assert nearest == due | files
    for one, other in zip(due["artefacts"], nearest["artefacts"], strict=True):
        assert Path(other["path"]).parent == tmp_path / "out"
        assert Path(other["path"]).read_bytes() == Path(one["path"]).read_bytes()
    assert check_artefact(Path(nearest["artefacts"][0]["path"])).manifest == "matches"


@pytest.mark.parametrize("length", [0.305, 0.31])
def test_between_the_values_the_nearest_is_judged_on_the_machine_asked_for(library, length):
    nearest = looked_up(library, f"--plant.L1={length}", "--move.distance=0.31", "--solver.method=auto")
    assert nearest["used"] == {"solver.method": "auto", "move.distance": 0.3, "plant.L1": 0.3}
    assert nearest["differences"] == pytest.approx({"move.distance": -0.01, "plant.L1": 0.3 - length})
    sway, passed = residual(library, nearest["case"], length, 0.3)
    assert passed and nearest["sway_residual_worst_m"] == sway
    assert sway != pytest.approx(nearest["sway_residual_worst_designed_m"], rel=1e-3)


def test_a_nearer_profile_that_is_not_safe_there_is_passed_over(library):
    words = ("--move.distance", "0.39", "--plant.L1", "0.33", "--solver.method", "auto")
    nearest = looked_up(library, *words)
    assert nearest["used"]["move.distance"] == 0.3
    passed_over = [entry["case"] for entry in nearest["passed_over"]]
    assert passed_over
    for case in passed_over:
        assert not residual(library, case, 0.33, 0.4)[1]
    text = run_here("lookup", library, *words).out
    assert "move.distance -0.09; worst residual sway" in text
    assert "plant.L1 +" not in text.partition("costs")[2].partition("\n")[0]
    assert f"passed over  case {passed_over[0]}: The " in text


@pytest.mark.parametrize(("distance", "length"), [(0.39, 0.33), (0.36, 0.3), (0.33, 0.31)])
def test_nearness_counts_in_steps_of_the_grid(library, distance, length):
    nearest = looked_up(
        library, f"--move.distance={distance}", f"--plant.L1={length}", "--solver.method=auto"
    )
    tried = [*(entry["case"] for entry in nearest["passed_over"]), nearest["case"]]
    rows = [row for row in read_table(library, grid_of(library)).to_pylist() if row["status"] == "passed"]
    rows = [row for row in rows if row["solver.method"] == "auto"]
    steps = {
        row["case"]: ((row["move.distance"] - distance) / 0.1) ** 2 + ((row["plant.L1"] - length) / 0.05) ** 2
        for row in rows
    }
    assert tried == sorted(steps, key=steps.__getitem__)[: len(tried)]


def test_nothing_safe_is_said(library):
    err = error_of(
        "lookup", library, "--move.distance=0.4", "--plant.L1=0.34", "--solver.method=auto", code=4
    )
    assert "nearest profiles is safe there. The nearest profile that passed is case 2" in err
    assert "Sweep a finer grid" in err


@pytest.mark.parametrize(
    ("distance", "length", "named", "nearest"),
    [
        (40, 0.3, ["--move.distance 40: beyond the grid, 0.3 to 0.4 were swept."], "case 2"),
        (-0.3, 0.3, ["--move.distance -0.3: beyond the grid"], "case 0"),
        (0.4, 0.2, ["--plant.L1 0.2: beyond the grid, 0.3 to 0.35 were swept."], "case 2"),
        (0.2, 0.4, ["--move.distance 0.2: beyond", "--plant.L1 0.4: beyond"], "case 1"),
    ],
)
def test_beyond_the_grid_is_refused_and_the_nearest_named(library, distance, length, named, nearest):
    words = (f"--move.distance={distance}", f"--plant.L1={length}", "--solver.method=auto")
    outcome = run_here("lookup", library, *words)
    assert (outcome.code, outcome.out) == (4, "")
    *beyond, last = outcome.err.splitlines()  # and no word of a simulation
    assert len(beyond) == len(named)
    assert all(sentence in line for sentence, line in zip(named, beyond, strict=True))
    assert f"The nearest profile that passed is {nearest} (" in last


def test_what_is_more_than_a_step_of_the_grid_away_is_no_answer(library, tmp_path):
    """As where the move asked for lies between two of which no profile passed."""
    shutil.copytree(library, tmp_path / "copy")
    description = json.loads((library / "sweep.json").read_bytes())
    description["vary"]["move.distance"] = [0.3, 0.4, 0.5]
    (tmp_path / "copy" / "sweep.json").write_text(json.dumps(description), "utf-8")
    rows = read_table(library, grid_of(library)).to_pylist()
    kept = [row for row in rows if row["move.distance"] == 0.3]
    parquet.write_table(pyarrow.Table.from_pylist(kept), tmp_path / "copy" / "sweep.parquet")
    outcome = run_here(
        "lookup", tmp_path / "copy", "--move.distance=0.41", "--plant.L1=0.3", "--solver.method=auto"
    )
    assert (outcome.code, outcome.out) == (4, "")
    (error,) = outcome.err.splitlines()
    assert (
        "No profile within a step of the grid passed its check. The nearest profile that passed is" in error
    )
    assert "case 0 (solver.method auto, move.distance 0.3, plant.L1 0.3)" in error


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--move.distance=0.3", "--plant.L1=0.3"], "solver.method: state it, auto, zv were swept."),
        (["--solver.method=auto", "--plant.L1=0.3"], "move.distance: state it, 0.3 to 0.4 were swept."),
        (["--solver.method=aut", "--move.distance=0.3", "--plant.L1=0.3"], "did you mean 'auto'?"),
        (["--solver.method=auto", "--move.distance=far", "--plant.L1=0.3"], "must be a finite number"),
        (["--solver.method=auto", "--move.distance=nan", "--plant.L1=0.3"], "must be a finite number"),
        (["--plant.L2=0.3"], "--plant.L2: the sweep did not vary this; did you mean 'plant.L1'?"),
        (["--solver.method=auto", "--move.distance=0.3", "--plant.L1=-7"], "plant.L1: must be a number from"),
        (["--solver.method=auto", "--plant.L1=0,3"], "found '0,3'; write a decimal point: 0.3."),
        (["--solver.method=aut", "--plant.L1=x"], "move.distance: state it"),
        (["--plant.L1"], "--plant.L1 needs a value"),
        (["--plant.L1", "--move.distance", "0.3"], "--plant.L1 needs a value"),
        (["--plant.L1=0.3", "--plant.L1=0.35"], "--plant.L1 is stated twice"),
        (["other"], "name one folder"),
    ],
)
def test_faults_are_named(library, words, sentence):
    outcome = run_here("lookup", library, *words)
    assert outcome.code == 2
    assert sentence in outcome.err
    assert "co-simulation" not in outcome.err  # all is read before anything is tried


def test_files_that_were_altered_or_lost_are_not_used(library, tmp_path):
    shutil.copytree(library, tmp_path / "copy")
    words = ("--move.distance=0.3", "--plant.L1=0.3", "--solver.method=auto")
    case = tmp_path / "copy" / "cases" / "0000" / "000" / "paper.csv"
    case.write_bytes(case.read_bytes().replace(b"0.1", b"0.2", 1))
    assert "was altered; sweep again" in error_of("lookup", tmp_path / "copy", *words)
    case.unlink()
    assert "Cannot read" in error_of("lookup", tmp_path / "copy", *words)


def test_a_folder_without_a_sweep_is_named(tmp_path):
    assert "There is no sweep in" in error_of("lookup", tmp_path, "--plant.L1=0.3")


def test_a_sweep_of_which_nothing_passed_is_named(library):
    """As of this one's shaped moves, which leave the hook swinging."""
    assert "has no profile that passed" in error_of(
        "lookup", library, "--move.distance=0.3", "--plant.L1=0.3", "--solver.method=zv", code=4
    )
