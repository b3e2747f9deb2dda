"""The verdict's numbers: what the error bound covers, and which columns contradict one another."""

import attrs
import numpy as np
import pytest

from gen_profile.profile import SampledProfile, sample
from gen_profile.response import Response
from gen_profile.spec_reading import preset_spec
from gen_profile.workflows.planning import plan
from gen_profile.workflows.scenarios import scenarios
from gen_profile.workflows.verification import judge

SPEC = preset_spec("paper", ["robustness={}", "cost.sway_weight=0"])


@pytest.fixture(scope="module")
def setpoints():
    return sample(plan(SPEC).trial.command, 0.01)


def swaying(times, amplitude, phase):
    """Hook and payload in one sine of 10 rad/s each."""
    sway = amplitude * np.sin(10.0 * times[:, None] + np.array([phase, phase + 1.0]))
    zero, two = np.zeros((len(times), 1)), np.zeros((len(times), 2))
    return Response(times=times, position=zero, velocity=zero, q_u=two, dq_u=two, sway=sway, angle=two)


def verdict(setpoints, found, expected):
    return judge(SPEC, setpoints, scenarios(SPEC), [found], [expected])


@pytest.mark.parametrize("phase", np.linspace(0.0, 0.5, 6))
def test_a_peak_between_two_samples_lies_within_the_bound(setpoints, phase):
    found = swaying(np.arange(0.0, 4.0, 0.05), 0.002, phase)
    check = verdict(setpoints, found, found)
    for residual in check.findings[0].residual.values():
        assert residual <= 0.002 <= residual + check.error_bound


def test_the_bound_holds_the_distance_to_the_reference(setpoints):
    times = np.arange(0.0, 4.0, 0.001)
    check = verdict(setpoints, swaying(times, 0.002, 0.1), swaying(times, 0.0021, 0.1))
    assert check.error_bound == pytest.approx(1e-4, rel=0.01)
    assert check.findings[0].residual["payload"] == pytest.approx(0.002, rel=1e-4)


def faults(setpoints):
    found = swaying(np.arange(0.0, 4.0, 0.001), 0.0, 0.0)
    return verdict(setpoints, found, found).faults


def test_columns_that_belong_together_contradict_nothing(setpoints):
    assert faults(setpoints) == ()
    assert faults(attrs.evolve(setpoints, acceleration=None)) == ()
    assert faults(attrs.evolve(setpoints, velocity=None, acceleration=None, jerk=None)) == ()


def test_an_altered_position_contradicts_the_velocities(setpoints):
    position = setpoints.position.copy()
    position[150] *= 1.02
    (fault,) = faults(attrs.evolve(setpoints, position=position))
    assert "velocity at 1.49 s" in fault or "velocity at 1.51 s" in fault


def test_an_altered_velocity_contradicts_the_positions(setpoints):
    velocity = setpoints.velocity.copy()
    velocity[150] *= 1.02
    (fault,) = faults(attrs.evolve(setpoints, velocity=velocity))
    assert fault.startswith("The velocity at 1.5 s contradicts the positions around it by 0.00")


def test_two_setpoints_cannot_contradict_one_another():
    two = SampledProfile(cycle_time=1.0, position=[[0.0], [0.3]], velocity=[[0.0], [9.0]])
    assert faults(two) == ()
