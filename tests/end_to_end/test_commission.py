"""From a tape measure to a controller in one command, with answers by options and from a keyboard."""

import json
import re
import subprocess

import numpy as np
import pytest
from command_line import PROGRAM, run_here
from end_to_end.simulated_controllers import free_port, serving

from gen_profile.delivery.deployment.plc_sim import PlcSimOptions, SimulatedOpcUaController
from gen_profile.delivery.deployment.table import read_table
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.spec.reading import preset_spec, read_spec

ROPE, DAMPING = 6.05, 400.0


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder with the log of a phone, on a rope that is shorter than the tape says."""
    monkeypatch.chdir(tmp_path)
    crane = preset_spec("bay-crane", plant={"L1": ROPE, "c1": DAMPING})
    mode = linearize(crane.machine(), crane.plant.parameters)
    frequency, ratio = mode.frequencies[0], mode.damping_ratios[0]
    times = np.arange(0.0, 40.0, 0.04)
    angles = 0.04 * np.exp(-ratio * frequency * times) * np.cos(frequency * times)
    rates = np.gradient(angles, times) + np.random.default_rng(1).normal(0.0, 0.001, times.size)
    np.savetxt("run.csv", np.column_stack([times, rates]), "%.5f", ",", header="t (s),x (rad/s)", comments="")
    return tmp_path


@pytest.mark.slow
def test_options_answer_everything(site):
    settings = ("--set", "export.plc_tables=variables", "--set", "export.cycle_time=0.02")
    made = run_here("--preset", "bay-crane", *settings, "--export", "plc", "--no-check", "--out", "first")
    assert made.code == 0
    port = free_port()
    controller = SimulatedOpcUaController(
        read_table(site / "first" / "bay-crane.st"), PlcSimOptions(port=port, secure=False)
    )
    identified = ("--measured", "L1=6.2±0.1", "--free", "c1", "--swing", "run.csv", "--signal", "rate:hook")
    deployed = ("--to", f"opc.tcp://127.0.0.1:{port}", "--security", "none", "--by", "me")
    with serving(controller):
        outcome = run_here(
            "commission", "hall.toml", "--preset", "bay-crane", *identified, *deployed,
            *settings, "--set", "move.distance=5", "--export", "plc", "--yes", "--json",
        )  # fmt: skip
        assert outcome.code == 0, outcome.err
        again = run_here("commission", "hall.toml", *deployed, "--export", "plc", "--yes")
        assert again.code == 0, again.err
        assert re.findall(r"^(\d)\. ", again.err, re.MULTILINE) == ["1", "2", "3", "4"]  # none left out
    spec = read_spec("hall.toml")
    assert spec.plant.parameters["L1"] == pytest.approx(ROPE, rel=2e-3)
    assert spec.plant.parameters["c1"] == pytest.approx(DAMPING, rel=0.1)
    assert spec.move.distance == (5.0,)
    assert all(
        (site / name).is_file() for name in (outcome.document["report"], *outcome.document["artefacts"])
    )
    record = json.loads((site / outcome.document["record"]).read_text("utf-8"))
    assert "me" in json.dumps(record) and len(outcome.out.splitlines()) < 15


def commissioned(site, *arguments, answers):
    return subprocess.run(
        [PROGRAM, "commission", "hall.toml", *arguments],
        input="\n".join(answers), capture_output=True, text=True, cwd=site, check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_a_wrong_answer_is_asked_for_again(site):
    """The keyboard ends before all is answered, so nothing is written."""
    answers = ["bay-crane", "350", "six", "2000", "6.2±x", "6.2±0.1"]
    ended = commissioned(site, answers=answers)
    assert ended.returncode == 130, ended.stderr
    assert ended.stderr.endswith("Error: Standard input ended before an answer; give it by an option.\n")
    assert "plant.m2: must be a number" in ended.stderr
    assert "write NAME=VALUE±UNCERTAINTY" in ended.stderr
    assert "L2, rope from hook to payload, in m (or as 6.2±0.1) [1.5]" in ended.stderr
    assert sorted(one.name for one in site.iterdir()) == ["run.csv"]


@pytest.mark.slow
def test_answers_are_kept_where_the_log_is_not_there(site):
    answers = ["bay-crane", "", "", "6.2±0.1", *[""] * 8, "nun.csv"]
    ended = commissioned(site, answers=answers)
    assert ended.returncode == 130 and "There is no log nun.csv; name its file" in ended.stderr
    assert read_spec(site / "hall.toml").plant.parameters["L1"] == 6.2
    assert "Most like which" not in commissioned(site, answers=[]).stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "reason"),
    [(("--swing", "nun.csv"), "There is no log nun.csv"), (("--export", "plk"), "unknown format 'plk'")],
)
def test_what_is_not_there_is_refused_before_anything_is_written(site, option, reason):
    refused = commissioned(site, "--preset", "bay-crane", "--yes", *option, answers=[])
    assert refused.returncode == 2 and reason in refused.stderr
    assert not (site / "hall.toml").exists()
