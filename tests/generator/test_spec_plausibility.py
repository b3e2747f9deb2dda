"""Impossible values are refused, implausible ones reported, and ordinary ones left alone."""

import pytest
from command_line import run_here

from gen_profile.spec.plausibility import plausibility_warnings
from gen_profile.spec.reading import preset_spec, presets
from gen_profile.support.errors import SpecError

CRANE = "double-pendulum-crane"
QUAY = ("plant.L1=50", "plant.m1=9000", "plant.m2=40000")


@pytest.mark.parametrize("name", presets())
def test_presets_are_in_no_doubt(name):
    assert plausibility_warnings(preset_spec(name)) == ()


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("paper", ("plant.L1=0.2", "move.distance=0.1", "move.duration=0.8")),
        ("paper", ("limits.velocity=2", "limits.acceleration=20", "limits.sway=0.1")),
        ("paper", ("move.distance=-0.3", "check.residual_sway=0.01", "can.start_tolerance=0.005")),
        (CRANE, (*QUAY, "move.distance=200", "move.duration=40", "check.residual_sway=0.3")),
        (CRANE, (*QUAY, "move.distance=30", "move.duration=17", "limits.velocity=10")),
        (CRANE, ("move.duration='minimum'", "limits.acceleration=0.5", "limits.sway=0.5")),
        ("gantry-crane", ("move.distance=[12.0, 0.3]",)),
        ("tower-crane", ("limits.axis.slew.velocity=0.1", "move.duration=200")),
        ("flexible-joint", ("move.distance=12", "move.duration=1", "limits.velocity=60")),
        ("flexible-joint", ("move.distance=14", "move.duration=6", "axis.unit=deg", "axis.modulo=360")),
        ("mass-spring-chain", ("move.distance=0.01", "check.residual_sway=0.0001")),
    ],
)
def test_machines_from_the_laboratory_to_the_quay_are_in_no_doubt(name, overrides):
    assert plausibility_warnings(preset_spec(name, overrides)) == ()


@pytest.mark.parametrize(
    ("name", "override", "place", "cure"),
    [
        ("paper", "check.residual_sway=20", "check.residual_sway", "did you mean 0.02?"),
        (CRANE, "check.residual_sway={ hook = 20 }", "check.residual_sway.hook", "did you mean 0.02?"),
        ("slosh-tank", "check.residual_sway=20", "check.residual_sway", "did you mean 0.02?"),
        ("paper", "limits.velocity=1000", "limits.velocity", "did you mean 1?"),
        (CRANE, "move.distance=8000", "move.duration", "did you mean 8 m?"),
        (CRANE, "move.duration=0.014", "move.duration", "did you mean 14 s?"),
        (CRANE, "move={ distance=50, duration=0.3 }", "move.duration", "allow more time, or move less."),
        (CRANE, "move.final_velocity=500", "move.final_velocity", "did you mean 0.5?"),
        (CRANE, "limits.sway=250", "limits.sway", "did you mean 0.25?"),
        ("mass-spring-chain", "limits.sway=49", "limits.sway", "did you mean 0.049?"),
        (
            "gantry-crane",
            "limits.axis.x.acceleration=20000",
            "limits.axis.x.acceleration",
            "did you mean 20?",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(name, override, place, cure):
    with pytest.raises(SpecError) as refused:
        preset_spec(name, [override])
    (sentence,) = str(refused.value).splitlines()
    assert sentence.startswith(f"{place}: ")
    assert sentence.endswith(cure)


@pytest.mark.parametrize(
    ("name", "override", "place", "cure"),
    [
        (CRANE, "move.distance=800", "move.duration", "did you mean 0.8 m?"),
        (CRANE, "move.duration=14000", "move.duration", "did you mean 14?"),
        ("flexible-joint", "move.distance=90", "move.duration", "did you mean 1.571 rad?"),
        ("flexible-joint", "move={ distance=14, duration=6 }", "move.distance", "did you mean 0.2443 rad?"),
        ("paper", "limits.acceleration=800", "limits.acceleration", "did you mean 0.8?"),
        ("paper", "actuator={ type='first-order', tau=67 }", "actuator.tau", "did you mean 0.067?"),
        ("paper", "can.start_tolerance=1", "can.start_tolerance", "did you mean 0.001?"),
        ("paper", "check.residual_sway=0.2", "check.residual_sway", "state less."),
        ("bay-crane", "plant.m1=350000", "plant.m1", "did you mean 350?"),
        ("bay-crane", "limits.travel=[0.0, 40000.0]", "limits.travel", "did you mean 40?"),
        ("bay-crane", "planner.live_rate={ L1 = 100 }", "planner.live_rate.L1", "did you mean 0.1?"),
        ("paper", "move={ distance=0.9, duration=0.5 }", "move.duration", "allow more than 0.5 s."),
    ],
)
def test_what_is_hardly_meant_is_told(name, override, place, cure):
    warnings = plausibility_warnings(preset_spec(name, [override]))
    assert any(sentence.startswith(f"{place}: ") and sentence.endswith(cure) for sentence in warnings)


@pytest.mark.slow
def test_a_doubt_is_told_once_and_is_among_the_warnings_of_the_check(tmp_path):
    implausible = ("--set", "can.start_tolerance=1")
    outcome = run_here("--preset", "paper", *implausible, "--out", tmp_path, "--json")
    (said,) = (line for line in outcome.err.splitlines() if line.startswith("Warning: "))
    assert outcome.code == 0
    assert [f"Warning: {warning}" for warning in outcome.document["check"]["warnings"]] == [said]
    assert said.startswith("Warning: can.start_tolerance: 1 m are more than half of the move")


def test_a_limit_that_nobody_typed_is_no_slip():
    """The payload's default is 1 % of the move, which is far for so short a rope."""
    spec = preset_spec("paper", ["check.residual_sway={ hook = 0.06 }", "move.distance=33"])
    assert dict(spec.check.residual_sway) == {"hook": 0.06, "payload": 0.33}
    assert not any("payload" in warning for warning in plausibility_warnings(spec))
