"""The compiled loop over an FMU's own functions, against the same runs one by one."""

import resource

import numpy as np
import pytest
from fmu.drivers import Instance, cosimulate
from fmu.kinds import model_of

from gen_profile.errors import CosimulationError
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.fmu_files import Version
from gen_profile_fmu.many_runs import ManyRuns
from gen_profile_fmu.plant_fmu import cached_fmu

CRANE = find_plant("double-pendulum-crane")
TIMES = np.arange(0.0, 2.0001, 0.01)
INPUTS = {"cart.setpoint_acceleration": np.sin(3.0 * TIMES[:-1])}
OUTPUTS = ("sway.hook", "sway.payload")


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture
def many(version):
    with ManyRuns(cached_fmu(model_of("plant-acceleration", CRANE), version), version) as runs:
        yield runs


def test_gives_the_peaks_of_every_run(many, version):
    parameters = {"L1": np.array([0.4, 0.5, 0.6]), "m2": np.array([0.1, 0.2, 0.3])}
    found = many.peaks(TIMES, INPUTS, parameters, OUTPUTS, since=1.0)
    for row, length, mass in zip(found, *parameters.values(), strict=True):
        fmu = cached_fmu(model_of("plant-acceleration", CRANE), version)
        instance = Instance(fmu, version, exchange=False)
        instance.begin({"L1": length, "m2": mass})
        values = INPUTS["cart.setpoint_acceleration"]

        def before(time, _, instance=instance, values=values):
            instance.write({"cart.setpoint_acceleration": values[round(time / 0.01)]})

        seen = cosimulate(instance, TIMES, before, OUTPUTS)
        np.testing.assert_array_equal(row, np.abs(seen[100:]).max(axis=0))
        instance.close()


def test_runs_do_not_depend_on_those_before(many):
    lengths = np.array([0.3, 0.9, 0.3])
    first, _, again = many.peaks(TIMES, INPUTS, {"L1": lengths}, OUTPUTS)
    np.testing.assert_array_equal(first, again)


def test_a_system_needs_no_inputs(version):
    with ManyRuns(cached_fmu(model_of("system", CRANE), version), version) as runs:
        found = runs.peaks(TIMES, {}, {"tau": np.array([0.0, 0.1])}, ("cart.velocity",))
    assert found[0, 0] == pytest.approx(0.2, rel=1e-3)
    assert found[1, 0] < found[0, 0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameters": {"L3": np.ones(1)}}, "no variable 'L3'"),
        ({"parameters": {"L1": np.array([0.5, -1.0])}}, r"could not go on in run 1, with {'L1': -1.0}"),
        ({"parameters": {"L1": np.ones(2), "L2": np.ones(3)}}, "parameters of many runs differ in length"),
        ({"inputs": {"cart.setpoint_acceleration": np.ones(3)}}, "inputs of many runs differ in length"),
        ({"times": np.array([0.0, 0.0, 0.1]), "inputs": {}}, "could not go on in run 0"),
    ],
)
def test_refusals_are_sentences(many, changes, message):
    given = {"times": TIMES, "inputs": INPUTS, "parameters": {"L1": np.ones(1)}, **changes}
    with pytest.raises(CosimulationError, match=message):
        many.peaks(outputs=OUTPUTS, **given)


def test_memory_stays_flat(many):
    parameters = {"L1": np.linspace(0.4, 0.6, 200)}
    many.peaks(TIMES, INPUTS, parameters, OUTPUTS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(20):
        many.peaks(TIMES, INPUTS, parameters, OUTPUTS)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2000  # KiB, of 4000 runs
