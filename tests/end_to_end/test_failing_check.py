"""What fails leaves nothing behind, unless it was asked to stay; nor does what was interrupted."""

import contextlib
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command_line import PROGRAM, run_here, run_process

pytestmark = pytest.mark.slow

STRICT = ("--set", "check.residual_sway=0.0001")


def tree(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


TOWER = """
name = "tower"
plant = { type = "tower-crane", L = 20.0 }
move = { start = [0.0, 10.0], target = [1.57, 30.0], duration = 60.0 }
planner = { live = { L = [4.0, 30.0] } }
check = { residual_sway = 0.3 }
export = { cycle_time = 0.01 }

[limits]
velocity = 3.0
acceleration = 1.0
jerk = 3.0
axis.slew.travel = [-3.2, 3.2]
axis.trolley.travel = [3.0, 50.0]
"""


def test_loads_that_swing_beyond_all_measure_are_told_once_with_the_cure(tmp_path):
    """As a jib does at 1 rad/s, which was meant for the trolley, in m/s."""
    (tmp_path / "tower.toml").write_text(TOWER)
    outcome = run_process("planner", tmp_path / "tower.toml", "--histories", "16", "--out", tmp_path / "out")
    sentences = [line for line in outcome.err.splitlines() if "finite" in line]
    assert outcome.code == 4 and len(sentences) == 1
    assert sentences[0].endswith("lower the limits of the axes.")


@pytest.mark.parametrize("words", [(), ("--json",)])
def test_a_failed_check_leaves_nothing_and_says_why(tmp_path, words):
    outcome = run_here(*STRICT, "--out", tmp_path / "new" / "deploy", *words)
    assert outcome.code == 4
    reason, consequence = outcome.errors
    assert reason.startswith("Check failed: The hook sways by 2.193 mm after the move (L1 -20 %), and 0.1 mm")
    assert consequence == "Nothing was written."
    assert tree(tmp_path) == {}
    if words:
        assert outcome.document["check"]["passed"] is False
        assert outcome.document["artefacts"] == []
    else:
        assert "FAILED" in outcome.out


def test_earlier_outputs_stay_as_they_were(tmp_path):
    assert run_here("--export", "csv", "--export", "plc", "--out", tmp_path).code == 0
    before = tree(tmp_path)
    outcome = run_here(*STRICT, "--export", "csv", "--export", "can", "--out", tmp_path)
    assert outcome.code == 4
    assert outcome.errors[-1] == f"Nothing was written; {tmp_path} still holds what an earlier run wrote."
    assert tree(tmp_path) == before


def test_failed_artefacts_can_be_kept_and_are_marked(tmp_path):
    outcome = run_here(*STRICT, "--keep-failed", "--out", tmp_path, "--json")
    assert outcome.code == 4
    assert outcome.errors[-1] == "The files were kept."
    assert {path.name for path in tmp_path.iterdir()} == {"paper.csv", "manifest.json"}
    manifest = json.loads((tmp_path / "manifest.json").read_text("utf-8"))
    assert manifest["check"]["passed"] is False
    assert manifest["check"] == outcome.document["check"]
    assert [row["format"] for row in outcome.document["artefacts"]] == ["csv"]
    assert run_here("check", tmp_path / "paper.csv").code == 4


def test_the_worst_artefact_decides(tmp_path):
    """Counts of a centimetre swing the crane, the table in metres beside them does not."""
    coarse = ("--set", "axis.cart.counts_per_metre=100", "--set", "check.residual_sway=0.003")
    assert run_here(*coarse, "--export", "csv", "--out", tmp_path).code == 0
    assert run_here(*coarse, "--export", "csv", "--export", "can", "--out", tmp_path / "new").code == 4
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("out", ["file", "file/below", "/proc/gen-profile", "/proc/self/gen-profile/deeper"])
def test_an_unwritable_folder_is_one_sentence(tmp_path, monkeypatch, out):
    (tmp_path / "file").write_bytes(b"in the way")
    monkeypatch.chdir(tmp_path)
    outcome = run_here("--out", out, "--json")
    assert outcome.code == 2
    (error,) = outcome.errors
    assert error.startswith(f"Error: Cannot write to the folder {out}: ")
    assert outcome.document["error"]["exit_code"] == 2
    assert tree(tmp_path) == {"file": b"in the way"}


def test_a_full_disk_is_one_sentence(tmp_path):
    """The file system takes the name and refuses the bytes."""
    (tmp_path / "old.txt").write_bytes(b"old")
    full = Path.write_bytes

    def refuse(path, content):
        full(path, content[:100])
        raise OSError(28, "No space left on device")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "write_bytes", refuse)
        outcome = run_here("--out", tmp_path)
    assert outcome.code == 2
    (error,) = outcome.errors
    assert error.startswith(f"Error: Cannot write to the folder {tmp_path}: No space left on device; ")
    assert tree(tmp_path) == {"old.txt": b"old"}


def interrupted(folder, word, delay, number, **environment):
    """Send a signal some time after a word of progress; return the code and stderr of what ends."""
    with subprocess.Popen(
        [PROGRAM, "--export", "csv", "--export", "plc", "--out", "deploy"],
        cwd=folder,
        env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    ) as process:
        seen = []
        while not (seen and seen[-1].startswith(word)):
            line = process.stderr.readline()
            assert line, "".join(seen)
            seen.append(line)
        time.sleep(delay)
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(number)
        _, rest = process.communicate()
        return process.returncode, "".join(seen) + rest


@pytest.mark.parametrize(
    ("word", "delay", "number"),
    [
        ("solving", 0.02, signal.SIGINT),
        ("solving", 0.15, signal.SIGTERM),
        ("exporting", 0.0, signal.SIGINT),
        ("checking", 0.03, signal.SIGTERM),
    ],
)
def test_an_interrupted_run_leaves_all_or_nothing(tmp_path, word, delay, number):
    code, stderr = interrupted(tmp_path, word, delay, number)
    assert "Traceback" not in stderr
    whole = {path.name for path in tmp_path.glob("deploy/*")} == {"paper.csv", "paper.st", "manifest.json"}
    if code == 0:
        assert whole
    else:  # whole, where it came between the files' delivery and the process's end
        assert (code, stderr.splitlines()[-1]) == (130, "Error: Interrupted.")
        assert whole or tree(tmp_path) == {}


def test_a_run_that_is_interrupted_while_it_compiles_can_be_repeated(tmp_path):
    """With a compiler that goes on while there is a gate, so that the signal cannot come too late."""
    folder, gate, compiler = tmp_path / "run", tmp_path / "gate", tmp_path / "compiler"
    folder.mkdir()
    gate.touch()
    compiler.write_text(
        f'#!/bin/sh\n[ -e {gate} ] && [ "$1" != --version ] && exec sleep 3600\nexec gcc "$@"\n'
    )
    compiler.chmod(0o755)
    cold = {"GEN_PROFILE_CACHE": str(tmp_path / "cache"), "GEN_PROFILE_CC": str(compiler)}
    code, stderr = interrupted(folder, "compiling", 0.02, signal.SIGINT, **cold)
    assert (code, stderr.splitlines()[-1]) == (130, "Error: Interrupted.")
    assert tree(folder) == {}
    gate.unlink()
    assert run_process("--out", folder, **cold).code == 0


def test_an_interruption_that_compiled_code_turns_into_its_own_error_is_one(tmp_path, monkeypatch):
    def solve(*_, **__):
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as stop:
            raise RuntimeError("of a library") from stop

    monkeypatch.setattr("gen_profile.methods.solvers.method_selection.attempt", solve)
    outcome = run_here("--out", tmp_path / "deploy")
    assert (outcome.code, outcome.errors) == (130, ["Error: Interrupted."])
    assert tree(tmp_path) == {}


def test_an_interruption_between_two_files_leaves_the_old_manifest_to_tell(tmp_path, monkeypatch):
    """Files are replaced one by one, each whole; the manifest comes last."""
    assert run_here("--out", tmp_path).code == 0
    old = (tmp_path / "manifest.json").read_bytes()
    whole = Path.replace

    def replace(path, target):
        if target.name == "manifest.json":
            raise KeyboardInterrupt
        return whole(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    outcome = run_here("--set", "move.duration=4", "--out", tmp_path)
    assert (outcome.code, outcome.errors[-1]) == (130, "Error: Interrupted.")
    assert (tmp_path / "manifest.json").read_bytes() == old
    monkeypatch.undo()
    check = run_here("check", tmp_path / "paper.csv")
    assert check.code == 4
    assert any("manifest.json" in line for line in check.errors)
