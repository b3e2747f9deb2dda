"""Shortest moves, worst cases and second order, from the spec to the verdict."""

import json

import pytest
from command_line import error_of, run_here

RANGE = ("--set", "robustness.method=range", "--set", "cost.sway_weight=0")
BOUND = ("--set", "limits.acceleration=0.7067")


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_the_shortest_duration_ends_on_a_cycle_and_stands_in_the_manifest(tmp_path):
    limits = ("--set", "limits.acceleration=0.4", "--set", 'move.duration="minimum"')
    outcome = run_here(*limits, "--cycle-time", "0.004", "--out", tmp_path, "--json")
    assert outcome.code == 0, outcome.err
    duration = outcome.document["figures"]["duration_s"]
    assert 2.7 < duration < 2.8
    assert duration / 0.004 == pytest.approx(round(duration / 0.004), abs=1e-9)
    assert json.loads((tmp_path / "manifest.json").read_bytes())["spec"]["move"]["duration"] == duration
    assert outcome.document["figures"]["acceleration_max_m_per_s2"] <= 0.4
    assert run_here("check", tmp_path / "paper.csv").code == 0


@pytest.mark.slow
def test_a_range_leaves_less_at_worst_and_more_in_the_middle(tmp_path):
    usual = run_here(*BOUND, "--no-check", "--out", tmp_path, "--json").document
    ranged = run_here(*RANGE, *BOUND, "--out", tmp_path, "--json").document
    assert ranged["check"]["passed"]
    assert ranged["figures"]["sway_residual_worst_m"] < 0.75e-3 < usual["figures"]["sway_residual_worst_m"]
    assert ranged["figures"]["sway_residual_peak_m"] > 1e-4
    bound = ranged["solver"]["worst_case_bound_m"]
    assert 0.69e-3 < bound <= ranged["figures"]["sway_residual_worst_m"]
    assert usual["solver"]["worst_case_bound_m"] is None


@pytest.mark.slow
def test_second_order_is_flatter(tmp_path):
    longer = ("--set", "move.duration=5", "--set", "cost.sway_weight=0", "--out", tmp_path, "--json")
    first = run_here(*longer).document["figures"]
    second = run_here(*longer, "--set", "robustness.order=2").document["figures"]
    assert second["sway_residual_worst_m"] < 0.5 * first["sway_residual_worst_m"]
    assert second["sway_residual_peak_m"] < 1e-6


@pytest.mark.slow
def test_both_methods_write_nearly_the_same(tmp_path):
    documents = [
        run_here("--method", name, "--out", tmp_path, "--json").document for name in ("direct", "indirect")
    ]
    assert [document["solver"]["method"] for document in documents] == ["direct", "indirect"]
    assert documents[0]["solver"]["cost"] == pytest.approx(documents[1]["solver"]["cost"], rel=1e-6)
    assert documents[0]["solver"]["defect"] is None


@pytest.mark.slow
def test_the_shortest_motion_leaves_no_more_sway_than_the_check_allows(tmp_path):
    """Limits alone would let the paper's crane do it in 2.56 s, and one of a shorter rope sway by 3.4 mm."""
    words = ("--set", "limits.acceleration=0.7", "--json", "--out", tmp_path)
    quick = run_here(*words, "--set", "move.duration=2.57")
    assert quick.code == 4
    shortest = run_here(*words, "--set", 'move.duration="minimum"')
    assert shortest.code == 0, shortest.err
    figures = shortest.document["figures"]
    assert 2.57 < figures["duration_s"] < 2.7
    assert 0.0029 < figures["sway_residual_worst_m"] < 0.003


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_where_no_duration_is_calm_enough_the_check_is_blamed(tmp_path):
    changes = ('move.duration="minimum"', "limits.acceleration=0.7", "cost.sway_weight=0")
    words = (word for change in (*changes, "check.residual_sway=1e-12") for word in ("--set", change))
    assert "check.residual_sway: no duration leaves so little sway" in error_of(
        *words, "--out", tmp_path, code=3
    )
