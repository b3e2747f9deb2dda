"""Residual sway over errors of parameters, against the exact integration of the same machines."""

import csv

import attrs
import numpy as np
import pytest
from command_line import run_here
from pictures import colours

from gen_profile.cli.entry import cli
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.methods.solvers.shape import shaped_motion
from gen_profile.motion.metrics import peak
from gen_profile.presentation.charts.picture import drawn
from gen_profile.presentation.charts.robustness import robustness_figure
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.comparison.robustness import Robustness, error_grid, robustness
from gen_profile.support.errors import SpecError

SPEC = preset_spec("paper")
METHODS = ("--method", "zvd", "--method", "nzv")


def integrated(spec, method, offsets):
    """The same by a step-size controlled integration of the continuous motion."""
    plant, nominal = spec.machine(), spec.plant.parameters
    motion = shaped_motion(spec, method)
    machines = [{**nominal, **{name: nominal[name] * (1.0 + off) for name, off in row}} for row in offsets]
    watch = np.linspace(motion.duration, motion.duration + 4.0, 4001)
    return [peak(found.sway) for found in PlantSimulation(plant, motion, machines, watch[-1]).at(watch)]


def test_a_curve_is_what_integration_finds():
    found = robustness(SPEC, ["L1"], methods=["zvd", "nzv"], points=9)
    (errors,) = found.errors.values()
    np.testing.assert_allclose(errors, np.linspace(-0.3, 0.3, 9), atol=1e-15)
    for method in ("zvd", "nzv"):
        expected = integrated(SPEC, method, [[("L1", error)] for error in errors])
        np.testing.assert_allclose(found.residual[method], expected, rtol=2e-3, atol=5e-6)


def test_a_map_is_what_integration_finds():
    found = robustness(SPEC, ["L1", "m2"], methods=["zvd"], points=3, half_range=0.2)
    for i, first in enumerate(found.errors["L1"]):
        expected = integrated(SPEC, "zvd", [[("L1", first), ("m2", other)] for other in found.errors["m2"]])
        np.testing.assert_allclose(found.residual["zvd"][i], expected, rtol=2e-3, atol=5e-6)


def test_a_lagging_drive_changes_nothing_where_the_setpoints_lead_it():
    lagging = preset_spec("paper", ["actuator.type=first-order", "actuator.tau=0.1"])
    curves = [robustness(spec, methods=["zvd"], points=5).residual["zvd"] for spec in (SPEC, lagging)]
    # watched a second later, two modes add up a little otherwise
    np.testing.assert_allclose(curves[0], curves[1], rtol=2e-3, atol=1e-4)


def crafted(share):
    residual = np.array(share)[:, None] * np.array([0.003, 0.003])
    return Robustness(spec=SPEC, errors={"L1": np.linspace(-0.2, 0.2, 5)}, residual={"x": residual})


@pytest.mark.parametrize(
    ("share", "span"),
    [
        ([1.2, 0.8, 0.0, 0.6, 1.4], (-0.15, 0.15)),
        ([0.9, 0.5, 0.0, 0.5, 0.9], (-0.2, 0.2)),
        ([0.5, 2.0, 0.0, 0.5, 0.9], (-0.05, 0.2)),
        ([0.0, 0.0, 1.1, 0.0, 0.0], None),
    ],
)
def test_the_insensitivity_ends_where_the_first_load_passes_its_limit(share, span):
    found = crafted(share).insensitivity("x")
    assert found == (span and pytest.approx(span))


def test_errors_stay_within_the_bounds_of_the_machine_and_hold_zero():
    (bound,) = (p.upper for p in SPEC.machine().parameters if p.name == "L1")
    near = attrs.evolve(
        SPEC, plant=attrs.evolve(SPEC.plant, parameters={**SPEC.plant.parameters, "L1": 0.9 * bound})
    )
    errors = error_grid(near, ["L1"])["L1"]
    assert 0.0 in errors and errors[0] == pytest.approx(-0.3) and errors[-1] <= 1.0 / 0.9 - 1.0
    assert len(error_grid(SPEC, ["L1"])["L1"]) == 61
    assert error_grid(SPEC, ["m2"])["m2"][-1] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--parameter", "L3"), "--parameter L3: unknown parameter"),
        (("--parameter", "c1"), "--parameter c1: its value is 0"),
        (("--parameter", "L1", "--parameter", "L2", "--parameter", "m1"), "--parameter: at most two"),
        (("--set", "robustness={}"), "parameter: name one"),
        (("--method", "zvx"), "--method zvx: unknown method; did you mean"),
        (("--plot", "picture.xyz"), "--plot picture.xyz: name a file"),
    ],
)
def test_faults_are_sentences(words, sentence):
    outcome = run_here("robustness", *words)
    assert (outcome.code, len(outcome.errors)) == (2, 1)
    assert outcome.errors[0].startswith(f"Error: {sentence}")


def test_a_sentence_names_the_option_that_a_command_was_given_whoever_calls_it():
    """What stood on the command line of the process decided it."""
    words = ["robustness", "--preset", "paper", "--parameter", "L3"]
    with pytest.raises(SpecError, match=r"^--parameter L3: unknown parameter"):
        cli.main(words, prog_name="gen-profile", standalone_mode=False)


def test_the_command_draws_writes_and_tells(tmp_path):
    files = ("--plot", tmp_path / "curve.png", "--csv", tmp_path / "curve.csv")
    outcome = run_here("robustness", *METHODS, "--method", "zvdd", "--points", "5", *files, "--json")
    assert outcome.code == 0
    document = outcome.document
    assert [row["method"] for row in document["methods"]] == ["zvd", "nzv"]
    assert [row["method"] for row in document["left_out"]] == ["zvdd"]
    assert document["methods"][0]["insensitivity"] == pytest.approx([-0.25, 0.277], abs=0.03)
    with (tmp_path / "curve.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["L1_error"]) for row in rows] == pytest.approx(document["errors"]["L1"])
    peaks = document["methods"][1]["residual_peaks_m"]["payload"]
    assert [float(row["nzv_payload_m"]) for row in rows] == pytest.approx(peaks)
    assert len(colours(tmp_path / "curve.png")[0]) > 50


@pytest.mark.slow
def test_a_map_is_drawn_and_told(tmp_path):
    both = ("--parameter", "L1", "--parameter", "m2", "--points", "3")
    outcome = run_here(
        "robustness", *METHODS, *both, "--plot", tmp_path / "map.png", "--csv", tmp_path / "m.csv"
    )
    assert outcome.code == 0
    assert "worst over L1, m2" in outcome.out and "from … to" not in outcome.out
    assert len((tmp_path / "m.csv").read_text("utf-8").splitlines()) == 10
    assert len(colours(tmp_path / "map.png")[0]) > 50


@pytest.mark.parametrize(("most", "headroom", "step"), [(0.01, 1.0, 20), (1.062, 1.062, 20), (40.0, 3.0, 50)])
def test_the_colours_of_maps_go_as_far_as_there_is_something_to_see(most, headroom, step):
    """Their scale was labelled at odd places, as 35.4 and 70.8."""
    errors = dict.fromkeys(("L1", "m2"), np.linspace(-0.1, 0.1, 3))
    left = np.zeros((3, 3, 2))
    left[2, 0] = most * 0.003
    figure = robustness_figure(Robustness(spec=SPEC, errors=errors, residual={"x": left}))
    assert figure.panels[0].headroom == pytest.approx(headroom)
    _, scale = drawn([figure], "").axes
    np.testing.assert_allclose(np.diff(scale.get_yticks()), step)


def test_nothing_is_drawn_where_no_method_has_a_motion(tmp_path):
    outcome = run_here("robustness", "--method", "zvdd", "--plot", tmp_path / "curve.png")
    assert outcome.code == 2
    assert outcome.errors[-1].startswith("Error: --plot: no method has a motion")


def test_an_unknown_parameter_is_refused_from_python_too():
    with pytest.raises(SpecError, match="unknown parameter"):
        error_grid(SPEC, ["<script>"])
