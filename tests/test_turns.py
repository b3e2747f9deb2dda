"""Which slow tests run: every one in three turns, and those near to what changed in each of them."""

import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path, PurePosixPath

import pytest
from turns import near, rooms_of, turns

ROOT = Path(__file__).parents[1]


FILES = {
    "tests/exporters/test_planner_far.py": "from st_programs import run\nfrom gen_profile import Spec",
    "tests/exporters/test_planner_text.py": "from gen_profile import (\n    Spec,\n    read_spec,\n)",
    "tests/exporters/can/test_vcan.py": "from gen_profile_exporters.can import drive",
    "tests/fmu/test_cache.py": "from gen_profile import Spec",
    "tests/generator/test_minimum_time.py": "import gen_profile",
    "tests/end_to_end/test_documentation.py": "from documentation import blocks",
}
PAGE = {"docs/planner.md": "import pages"}
SPARE = {
    f"tests/{folder}/test_other_{number}.py": "import gen_profile, gen_profile_exporters"
    for folder in ("exporters", "generator")
    for number in range(7)
}


@pytest.mark.parametrize(
    ("changed", "room", "files"),
    [
        ("generator/gen_profile/planner/sensor.py", "planner", ["test_planner_far", "test_planner_text"]),
        (
            "exporters/gen_profile_exporters/planner/a/b.st",
            "planner",
            ["test_planner_far", "test_planner_text"],
        ),
        ("generator/gen_profile/solvers/minimum_time.py", "minimum_time", ["test_minimum_time"]),
        ("fmu/gen_profile_fmu/building/plant_fmu.py", "fmu", ["test_cache"]),
        ("exporters/gen_profile_exporters/can/drive.py", "can", ["test_vcan"]),
        ("generator/gen_profile/spec/read_spec.py", "read_spec", ["test_planner_text"]),
        ("tests/exporters/st_programs.py", "st_programs", ["test_planner_far"]),
        ("tests/fmu/test_cache.py", "test_cache", ["test_cache"]),
        ("docs/planner.md", "planner.md", ["planner"]),
        ("tests/documentation.py", "documentation", ["planner", "test_documentation"]),
        ("tests/exporters/planner/helper.py", None, []),
        ("generator/gen_profile/units.py", None, []),
    ],
)
def test_a_file_is_near_to_the_rooms_that_it_names_or_imports(changed, room, files):
    found = near_to({changed})
    assert set(found.values()) == {room} - {None}
    assert sorted(PurePosixPath(file).stem for file in found) == files


def near_to(changed):
    sources = FILES | PAGE | SPARE
    rooms = {file: rooms_of(file, source) for file, source in sources.items()}
    return near(dict.fromkeys(sources, 30), rooms, changed)


def test_what_few_tests_use_comes_first_when_nearly_everything_changed():
    few = {"generator/gen_profile/solvers/minimum_time.py", "tests/exporters/st_programs.py"}
    assert set(near_to(few).values()) == {"minimum_time", "st_programs"}
    assert near_to({*few, "generator/gen_profile/planner/sensor.py", *FILES, *SPARE}) == near_to(few)


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
    for name in ("planner_far", *"abcdefg"):
        (tmp_path / "tests" / f"test_{name}.py").write_text(SUITE)
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\npythonpath = tests\nmarkers = slow\naddopts = --import-mode=importlib"
    )
    changed = "--changed=generator/planner/modes.py\nREADME.md"
    said = [run_in(tmp_path, "-n", "1", f"--turn={turn}", changed) for turn in (7, 8, 9)]
    assert all("of 8 slow tests 1 of changed rooms (planner)" in one for one in said), said
    ran = [int(one.rpartition(" passed")[0].split()[-1]) for one in said]
    assert sum(ran) == 3 * (8 + 1) + 7  # quick tests and the changed room thrice, the others once


@pytest.mark.slow
def test_changes_are_counted_from_the_run_that_passed_or_from_half_a_day_ago(tmp_path):
    (tmp_path / ".ci").mkdir()
    base = shutil.copy(ROOT / ".ci" / "base", tmp_path / ".ci")
    named = {f"GIT_{who}_{what}": "tests" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    environment = {key: os.environ[key] for key in os.environ.keys() - {"BASE", "TURN"}} | named

    def run(*command, **more):
        there = {"cwd": tmp_path, "env": environment | more}
        done = subprocess.run(command, check=False, capture_output=True, text=True, **there)
        return done.stdout.strip() or done.returncode

    assert run("git", "init", "-q") == 0
    assert run(base) != 0  # nothing to count from
    commits = []
    for hour in (1, 5, 9, 18):
        at = f"2026-01-01T{hour:02}:00:00Z"
        assert run("git", "commit", "-q", "--allow-empty", "-m", "some", GIT_COMMITTER_DATE=at) == 0
        commits.append(run("git", "rev-parse", "HEAD"))
    assert run(base) == f"{commits[1]} 4"
    for turn, commit in ((9, commits[0]), (10, commits[2])):
        assert run("git", "update-ref", f"refs/ci/passed/{turn}", commit) == 0
    assert run(base) == f"{commits[2]} 11"
    assert run(base, BASE="given", TURN="5") == "given 5"
