"""The verdict's numbers: what the error bound covers."""

import numpy as np
import pytest

from gen_profile.assurance.verification.cosimulation import beyond_equations, judge
from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.profile import sample
from gen_profile.spec.reading import preset_spec

SPEC = preset_spec("paper", ["robustness={}", "cost.sway_weight=0"])


@pytest.fixture(scope="module")
def setpoints():
    return sample(plan(SPEC).evaluation.command, 0.01)


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


def test_waves_beyond_the_linear_theory_are_warned_of():
    spec = preset_spec("slosh-tank", ["plant.h=0.2"])  # up to a tenth: 20 mm nominal, 16 mm at the lower fill
    machines = scenarios(spec)
    low = [swaying(np.arange(0.0, 4.0, 0.05), rise, 0.0) for rise in (0.0155, 0.0155, 0.0155)]
    assert list(beyond_equations(spec, machines, low)) == []
    high = [*low[:2], swaying(np.arange(0.0, 4.0, 0.05), 0.018, 0.0)]
    (warning,) = beyond_equations(spec, machines, high)
    assert "(h -20 %)" in warning and "hold up to 16 mm" in warning
