"""Shapers that are deployed: designed, written, checked and named by the command line."""

import json
from typing import get_args

import attrs
import numpy as np
import pytest
from command_line import error_of, run_here

from gen_profile.methods.shapers.base_moves import BASES
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.methods.solvers.plan import plan
from gen_profile.methods.solvers.shortest import timed
from gen_profile.spec.model import SolverSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.spec.values import ShaperName
from gen_profile.support.errors import InfeasibleProblem

SIX_SECONDS = ("--set", "move.duration=6.0")  # longer than any delay
LOOSE = ("--set", "check.residual_sway=0.1")  # what matters is that the sway found is the shaper's own


def test_the_spec_knows_the_same_names_as_the_tables():
    assert set(get_args(ShaperName)) == set(SHAPERS)
    assert set(get_args(attrs.fields_dict(attrs.resolve_types(SolverSpec))["base"].type)) == set(BASES)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPERS)
def test_every_shaper_is_designed_written_and_checked(tmp_path, name):
    outcome = run_here("--method", name, *SIX_SECONDS, *LOOSE, "--export", "plc", "--out", tmp_path, "--json")
    assert outcome.code == 0, outcome.err
    document = outcome.document
    assert (document["solver"]["status"], document["solver"]["method"]) == ("shaped", name)
    assert document["solver"]["cost"] is None
    manifest = json.loads((tmp_path / "manifest.json").read_text("utf-8"))
    assert manifest["spec"]["solver"] == {"method": name, "base": "quintic"}
    for figure, scenario in zip(
        ("sway_residual_peak_m", "sway_residual_peak_perturbed_m"),
        document["check"]["scenarios"],
        strict=False,
    ):
        bound = 2.0 * document["check"]["error_bound_m"]
        assert scenario["residual_peak_m"] == pytest.approx(document["figures"][figure], abs=bound)


def test_what_is_deployed_is_what_others_found(tmp_path):
    """ZVD on the paper's crane, with a quintic: physics found without this project (test_compare has all)."""
    figures = run_here("--method", "zvd", "--out", tmp_path, "--json").document["figures"]
    assert figures["acceleration_max_m_per_s2"] == pytest.approx(0.706, abs=5e-4)
    assert figures["jerk_max_m_per_s3"] == pytest.approx(20.79, rel=1e-3)
    assert figures["sway_residual_peak_perturbed_m"] == pytest.approx(1.627e-3, rel=2e-3)


def test_a_shaped_design_is_told_in_words_and_its_check_may_fail(tmp_path):
    outcome = run_here("--method", "zvd", "--set", "solver.base=septic", "--out", tmp_path)
    assert outcome.code == 0
    assert "zvd shaper, fed with a septic move" in outcome.out
    refused = run_here("--method", "nzv", "--out", tmp_path / "new")
    assert refused.code == 4
    assert not (tmp_path / "new").exists()
    assert "L1 +20 %" in refused.err or "L1 -20 %" in refused.err


def test_a_shaped_artefact_is_checked_again_from_its_manifest(tmp_path):
    run_here("--method", "zvd", "--out", tmp_path)
    found = run_here("check", tmp_path / "paper.csv", "--json")
    assert found.code == 0
    assert found.document["artefact"]["manifest"] == "matches"


def test_where_a_shaper_does_not_apply_one_sentence_says_so(tmp_path):
    assert "the 3hump-ei shaper's delay is" in error_of(
        "--method", "3hump-ei", "--set", "move.duration=2.0", "--out", tmp_path / "new", code=3
    )
    assert "damping ratio" in error_of(
        "--method", "zv", "--preset", "flexible-joint", "--set", "plant.c=1", "--out", tmp_path, code=3
    )
    assert "solver.method" in error_of("--method", "zdv", "--out", tmp_path)
    assert "limits.jerk" in error_of("--method", "zv", "--set", "solver.base=jerk-limited", "--out", tmp_path)


def test_the_shortest_shaped_move_keeps_its_limits_and_a_shorter_one_does_not():
    spec = timed(
        preset_spec("paper", ["solver.method=zvd", "move.duration=minimum", "limits.acceleration=0.5"])
    )
    found = plan(spec)
    assert found.solution is None
    assert 0.495 < found.figures["acceleration_max_m_per_s2"] <= 0.5
    assert spec.move.duration / 1e-3 == pytest.approx(round(spec.move.duration / 1e-3))
    shorter = attrs.evolve(spec, move=attrs.evolve(spec.move, duration=spec.move.duration - 2e-3))
    with pytest.raises(InfeasibleProblem, match=r"limits\.acceleration: 0\.5 is allowed"):
        plan(shorter)


def test_several_axes_make_one_shaped_move():
    motion = plan(preset_spec("gantry-crane", ["solver.method=zvd"])).evaluation.motion
    times = np.linspace(0.0, motion.duration, 11)
    position = motion(times).position
    assert position[:, 0] == pytest.approx(3.0 * position[:, 1], abs=1e-12)


def test_a_move_in_little_more_than_the_delay_is_refused_with_a_duration_that_can_be_driven():
    """Not with the delay itself, which would leave a jump; the axes need no implausible acceleration."""
    stated = []
    for duration in (0.9, 1.2981):
        spec = preset_spec("slosh-tank", ["solver.method=zvd", f"move.duration={duration}"])
        with pytest.raises(InfeasibleProblem, match=r"too little time to move\. No less than") as caught:
            plan(spec)
        stated.append(caught.value.reasons[0].allowed)
    assert stated[0] == stated[1] > 1.4
    spec = preset_spec("slosh-tank", ["solver.method=zvd", f"move.duration={stated[0]}"])
    times = np.linspace(0.0, stated[0], 1001)
    assert np.abs(plan(spec).command(times).acceleration).max() <= 200.0
