"""Which slow tests run: every one in three turns, and those of a room that changed in each of them."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from turns import reasons, turns

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("test", "changed", "room"),
    [
        ("tests/exporters/test_planner_far.py", "generator/gen_profile/planner/sensor.py", "planner"),
        ("tests/exporters/test_planner_far.py", "exporters/gen_profile_exporters/planner/a/b.st", "planner"),
        (
            "tests/generator/test_minimum_time.py",
            "generator/gen_profile/methods/solvers/minimum_time.py",
            "minimum_time",
        ),
        ("tests/fmu/test_cache.py", "fmu/gen_profile_fmu/building/plant_fmu.py", "fmu"),
        ("tests/exporters/can/test_vcan.py", "exporters/gen_profile_exporters/can/drive.py", "can"),
        ("tests/generator/test_watch.py", "tests/generator/test_watch.py", "tests/generator/test_watch.py"),
        ("tests/exporters/test_planner_far.py", "exporters/gen_profile_exporters/csv_table.py", None),
        ("tests/exporters/test_planner_far.py", "tests/exporters/planner/helper.py", None),
        ("tests/end_to_end/test_scanner.py", "exporters/gen_profile_exporters/can/drive.py", None),
    ],
)
def test_a_file_is_of_the_rooms_that_its_name_names(test, changed, room):
    assert reasons(test, {changed}) == ({room} - {None})


def test_each_turn_has_a_third_of_a_room():
    room = {f"tests/exporters/test_planner_{part}.py" for part in "abcdefg"}
    turn_of = turns(room | {"tests/exporters/can/test_vcan.py", "tests/fmu/test_cache.py"})
    assert sorted(Counter(turn_of[file] for file in room).values()) == [2, 2, 3]


SUITE = """
import pytest

@pytest.mark.slow
def test_slow(): pass

def test_quick(): pass
"""


def run_in(folder, *arguments):
    command = [sys.executable, "-m", "pytest", "-q", "-rN", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_three_turns_run_everything_and_a_changed_room_runs_in_each(tmp_path):
    (tmp_path / "tests").mkdir()
    for file in ("conftest.py", "turns.py"):
        (tmp_path / "tests" / file).write_text((ROOT / "tests" / file).read_text("utf-8"))
    for name in ("planner_far", "sweep", "report", "plot"):
        (tmp_path / "tests" / f"test_{name}.py").write_text(SUITE)
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\npythonpath = tests\nmarkers = slow\naddopts = --import-mode=importlib"
    )
    changed = "--changed=generator/planner/modes.py\nREADME.md"
    said = [run_in(tmp_path, "-n", "1", f"--turn={turn}", changed) for turn in (7, 8, 9)]
    assert all("of 4 slow tests 1 of changed rooms (planner)" in one for one in said), said
    ran = [int(one.rpartition(" passed")[0].split()[-1]) for one in said]
    assert sum(ran) == 3 * (4 + 1) + 3  # quick tests and the changed room thrice, the others once
