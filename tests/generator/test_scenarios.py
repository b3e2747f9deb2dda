"""The machines that a motion is tried on."""

from itertools import product

import pytest

from gen_profile.dynamics.evaluation.scenarios import named, scenarios
from gen_profile.spec.reading import preset_spec


def machines(uncertain):
    overrides = [f"robustness.uncertain={uncertain}"] if uncertain else ["robustness={}"]
    spec = preset_spec("paper", overrides)
    return spec.plant.parameters, scenarios(spec)


def test_without_uncertainty_there_is_one_machine():
    nominal, found = machines("")
    assert [machine.name for machine in found] == ["nominal"]
    assert found[0].parameters == nominal


def test_one_uncertain_parameter_gives_both_ends():
    nominal, found = machines("{L1 = 0.2}")
    assert [machine.name for machine in found] == ["nominal", "L1 +20 %", "L1 -20 %"]
    assert [machine.parameters["L1"] for machine in found] == pytest.approx([0.47, 0.564, 0.376])
    for machine in found[1:]:
        assert {**machine.parameters, "L1": nominal["L1"]} == nominal


def test_the_upper_corner_comes_second_then_all_corners_then_each_alone():
    nominal, found = machines("{L1 = 0.2, m2 = 0.125}")
    assert [machine.name for machine in found] == [
        "nominal",
        "m2 +12.5 %, L1 +20 %",
        "m2 +12.5 %, L1 -20 %",
        "m2 -12.5 %, L1 +20 %",
        "m2 -12.5 %, L1 -20 %",
        "m2 +12.5 %",
        "m2 -12.5 %",
        "L1 +20 %",
        "L1 -20 %",
    ]
    assert found[2].parameters["L1"] == pytest.approx(0.8 * nominal["L1"])
    assert found[2].parameters["m2"] == pytest.approx(1.125 * nominal["m2"])


def test_every_corner_of_three_parameters_is_there_once():
    nominal, found = machines("{L1 = 0.2, m2 = 0.1, L2 = 0.05}")
    assert len(found) == 1 + 8 + 6
    corners = {
        tuple(round(machine.parameters[name] / nominal[name], 12) for name in ("L1", "m2", "L2"))
        for machine in found
    }
    assert len(corners) == len(found)
    assert set(product((1.2, 0.8), (1.1, 0.9), (1.05, 0.95))) <= corners


def test_names_hold_no_more_digits_than_can_be_read():
    assert named(preset_spec("paper"), "L1", 0.303225) == "L1 -35.48 %"
