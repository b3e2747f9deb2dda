"""The compiled loop over an FMU's own functions, against the same runs one by one."""

import resource

import numpy as np
import pytest
from fmu.drivers import Instance, cosimulate
from fmu.kinds import model_of

from gen_profile.plants.registry import find_plant
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.running.many_runs import ManyRuns

CRANE = find_plant("double-pendulum-crane")
TIMES = np.arange(0.0, 2.0001, 0.01)
INPUTS = {"cart.setpoint_acceleration": np.sin(3.0 * TIMES[:-1])}
OUTPUTS = ("sway.hook", "sway.payload")


@pytest.fixture
def many():
    with ManyRuns(fmu_of("plant-acceleration")) as runs:
        yield runs


def fmu_of(kind):
    return cached_fmu(model_of(kind, CRANE), Version.FMI2)


def one_by_one(times, values, parameters, since):
    """Greatest magnitudes in one run, without the loop."""
    instance = Instance(fmu_of("plant-acceleration"), Version.FMI2, exchange=False)
    instance.begin(parameters, start=times[0])
    held = dict(zip(times[:-1].tolist(), values, strict=True))
    seen = cosimulate(
        instance, times, lambda time, _: instance.write({"cart.setpoint_acceleration": held[time]}), OUTPUTS
    )
    instance.close()
    return np.abs(seen[times >= since]).max(axis=0)


def test_gives_the_peaks_of_every_run(many):
    parameters = {"L1": np.array([0.4, 0.5, 0.6]), "m2": np.array([0.1, 0.2, 0.3])}
    found = many.peaks(TIMES, INPUTS, parameters, OUTPUTS, since=1.0)
    for row, length, mass in zip(found, *parameters.values(), strict=True):
        values = INPUTS["cart.setpoint_acceleration"]
        expected = one_by_one(TIMES, values, {"L1": length, "m2": mass}, since=1.0)
        np.testing.assert_array_equal(row, expected)


def test_runs_may_have_their_own_inputs_and_times(many):
    """As for jitter and latency; a parameter of their own they need not have."""
    random = np.random.default_rng(5)
    times = TIMES + 0.002 * random.random((3, len(TIMES)))
    inputs = random.normal(size=(3, len(TIMES) - 1))
    found = many.peaks(times, {"cart.setpoint_acceleration": inputs}, {}, OUTPUTS)
    for row, points, values in zip(found, times, inputs, strict=True):
        np.testing.assert_array_equal(row, one_by_one(points, values, {}, since=0.0))
    shared = many.peaks(TIMES, {"cart.setpoint_acceleration": inputs}, {"L1": np.array([0.5])}, OUTPUTS)
    assert shared.shape == (3, 2)


def test_one_run_needs_nothing_of_its_own(many):
    (found,) = many.peaks(TIMES, INPUTS, {}, OUTPUTS)
    values = INPUTS["cart.setpoint_acceleration"]
    np.testing.assert_array_equal(found, one_by_one(TIMES, values, {}, since=0.0))


@pytest.mark.parametrize("workers", [2, 5])
def test_workers_find_the_same_whatever_their_number(many, workers):
    parameters = {"L1": np.linspace(0.4, 0.6, 23)}
    alone = many.peaks(TIMES, INPUTS, parameters, OUTPUTS)
    with ManyRuns(fmu_of("plant-acceleration"), workers=workers) as together:
        np.testing.assert_array_equal(together.peaks(TIMES, INPUTS, parameters, OUTPUTS), alone)
        lengths = np.full(23, 0.5)
        lengths[[7, 20]] = [-1.0, -2.0]
        with pytest.raises(CosimulationError, match=r"in run 7, counted from 0: L1 must .* found -1\."):
            together.peaks(TIMES, INPUTS, {"L1": lengths}, OUTPUTS)


def test_runs_do_not_depend_on_those_before(many):
    lengths = np.array([0.3, 0.9, 0.3])
    first, _, again = many.peaks(TIMES, INPUTS, {"L1": lengths}, OUTPUTS)
    np.testing.assert_array_equal(first, again)


def test_a_system_needs_no_inputs():
    with ManyRuns(fmu_of("system")) as runs:
        found = runs.peaks(TIMES, {}, {"tau": np.array([0.0, 0.1])}, ("cart.velocity",))
    assert found[0, 0] == pytest.approx(0.2, rel=1e-3)
    assert found[1, 0] < found[0, 0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameters": {"L3": np.ones(1)}}, "no variable 'L3'"),
        ({"parameters": {"L1": np.array([0.5, -1.0])}}, r"go on in run 1, .*: L1 must lie .*, found -1\."),
        ({"parameters": {"L1": np.ones(2), "L2": np.ones(3)}}, "parameters of many runs differ in length"),
        ({"inputs": {"cart.setpoint_acceleration": np.ones(3)}}, "inputs of many runs differ in length"),
        (
            {"inputs": {"cart.setpoint_acceleration": np.ones((2, 200)), "theta1": np.ones((3, 200))}},
            "inputs of many runs differ",
        ),
        ({"times": np.tile(TIMES, (3, 1)), "parameters": {"L1": np.ones(2)}}, r"are of \[2, 3\] runs"),
        ({"times": np.array([0.0, 0.0, 0.1]), "inputs": {}}, "run 0, .*: The step size must be positive"),
    ],
)
def test_refusals_are_sentences(many, changes, message):
    given = {"times": TIMES, "inputs": INPUTS, "parameters": {"L1": np.ones(1)}, **changes}
    with pytest.raises(CosimulationError, match=message):
        many.peaks(outputs=OUTPUTS, **given)


def test_memory_stays_flat(many):
    parameters = {"L1": np.linspace(0.4, 0.6, 200), "max_step": np.full(200, 0.01)}
    inputs = {name: np.tile(values, (200, 1)) for name, values in INPUTS.items()}
    many.peaks(TIMES, inputs, parameters, OUTPUTS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(20):
        many.peaks(TIMES, inputs, parameters, OUTPUTS)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2000  # KiB, of 4000 runs
