"""Swinging starts and ends at speed by the command line: checked by the machine's FMU, or refused."""

import re

import pytest
from command_line import error_of, run_here

SWUNG = ("--set", 'move.initial={theta1=0.05, "theta1.rate"=-0.1}')
ONWARD = ("--set", "move.final_velocity=0.1")
LAG = ("--set", "actuator={type='first-order', tau=0.05}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "duration"),
    [(SWUNG, 3.0), (ONWARD, 3.0005), ((*SWUNG, *ONWARD), 3.0005), ((*ONWARD, *LAG), 3.0)],
    ids=["swing", "speed, off the grid", "both, off the grid", "speed with lag"],
)
def test_the_check_begins_and_ends_as_the_spec_says(tmp_path, changes, duration):
    words = (*changes, "--set", f"move.duration={duration}", "--out", tmp_path, "--json")
    outcome = run_here(*words)
    assert outcome.code == 0, outcome.err
    nominal = outcome.document["check"]["scenarios"][0]
    assert nominal["residual_peak_m"] < 2e-6
    again = run_here("check", tmp_path / "paper.csv", "--json")
    assert again.code == 0, again.err
    assert again.document["check"]["error_bound_m"] < 1e-5
    for one, other in zip(
        outcome.document["check"]["scenarios"], again.document["check"]["scenarios"], strict=True
    ):
        assert other["residual_peak_m"] == pytest.approx(one["residual_peak_m"], abs=2e-6)


@pytest.mark.slow
def test_a_motion_that_knows_nothing_of_the_swing_fails(tmp_path):
    """The file of a start at rest, judged by a spec that begins with a swing."""
    run_here("--out", tmp_path)
    assert run_here("check", tmp_path / "paper.csv", "--preset", "paper").code == 0
    assert "sways by" in error_of("check", tmp_path / "paper.csv", "--preset", "paper", *SWUNG, code=4)
    onward = run_here("check", tmp_path / "paper.csv", "--preset", "paper", *ONWARD)
    assert onward.code == 4


REFUSED = [
    ((*ONWARD, "--export", "plc"), 5, r"what plays plc holds the last setpoint"),
    ((*ONWARD, "--export", "csv", "--export", "can"), 5, r"what plays can holds the last setpoint"),
    ((*ONWARD, "--method", "zvd"), 3, r"move\.final_velocity: a shaper moves from rest to rest only"),
    ((*SWUNG, "--method", "zvd"), 3, r"move\.initial: a shaper moves from rest to rest only"),
    (("--set", "move.initial={theta3=0.1}"), 2, r"move\.initial\.theta3: unknown coordinate"),
    (("--set", "move.initial={theta1=2.0}"), 2, r"move\.initial\.theta1: must be from -1\.4 to 1\.4 rad"),
    (("--set", "move.initial={theta1='a'}"), 2, r"move\.initial\.theta1: must be a finite number"),
    (("--set", "move.initial=3"), 2, r"move\.initial: must be a table"),
    ((*ONWARD, "--set", "limits.velocity=0.09"), 2, r"move\.final_velocity: must keep limits\.velocity"),
    (
        ("--preset", "tower-crane", "--set", "move.final_velocity=[0.1, 0.0]"),
        2,
        r"move\.final_velocity: the load does not hang still while the axes move so",
    ),
    (
        ("--preset", "single-pendulum-crane", "--set", "move.final_velocity=[0.0, -1.0]"),
        3,
        r"move\.final_velocity: hoist would be at",
    ),
    (("--set", "move.distance=0.0"), 2, r"move\.distance: must not be zero on every axis"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("words", "code", "sentence"), REFUSED)
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, monkeypatch, words, code, sentence):
    monkeypatch.chdir(tmp_path)
    outcome = run_here(*words)
    assert outcome.code == code, outcome.err
    assert re.search(sentence, outcome.err)
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_a_crane_that_stands_calms_its_load(tmp_path):
    task = ("move.distance=0", "move.initial={theta1=0.1}", "robustness={}", "cost.sway_scale=auto")
    words = (*(word for change in task for word in ("--set", change)), "--out", tmp_path, "--json")
    assert "check.residual_sway: required where no axis moves" in error_of(*words, "--set", "check={}")
    outcome = run_here(*words)
    assert outcome.code == 0, outcome.err
    assert outcome.document["figures"]["sway_residual_peak_m"] < 1e-6
    assert run_here("check", tmp_path / "paper.csv").code == 0


def test_shapers_are_left_out_of_a_comparison_that_begins_with_a_swing():
    document = run_here("compare", *SWUNG, "--set", "robustness={}", "--json").document
    assert {row["method"] for row in document["rows"]} == {
        "optimal-beta0",
        "optimal-beta20",
        "optimal-beta50",
    }
    assert all("from rest to rest" in row["reason"] for row in document["left_out"])
