"""Runs of the co-simulation: what it takes, what it returns, and how it refuses."""

import logging

import attrs
import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmu.caches import share_zig
from fmu.hoisting_pendulum import PLANT as WINCH

from gen_profile.motion.profile import SampledProfile, sample
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.running import instances
from gen_profile_fmu.running.cosimulation import PlantCosimulation


@pytest.fixture
def setpoints(quintic):
    return sample(quintic, 0.01)


def test_samples_every_cycle_and_then_every_output_step(cosimulation, crane, setpoints):
    response = cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.3, output_step=0.001)
    np.testing.assert_allclose(response.times[:301], setpoints.times, rtol=0.0, atol=0.0)
    np.testing.assert_allclose(response.times[300:], 3.0 + 0.001 * np.arange(301), rtol=1e-14)
    assert response.position.shape == response.velocity.shape == (601, 1)
    assert response.sway.shape == response.angle.shape == (601, 2)
    np.testing.assert_allclose(response.position[:301], setpoints.position, rtol=0.0, atol=1e-15)
    assert (response.position[300:] == setpoints.position[-1]).all()
    steps = np.diff(setpoints.position, axis=0) / 0.01
    np.testing.assert_allclose(response.velocity[1:301], steps, rtol=0.0, atol=1e-12)
    assert (response.velocity[301:] == 0.0).all()


@pytest.mark.parametrize("output_step", [None, 0.02])
def test_never_steps_longer_than_a_cycle(cosimulation, crane, setpoints, output_step):
    response = cosimulation.run(
        setpoints, crane.nominal(), max_step=1e-3, settle=0.3, output_step=output_step
    )
    np.testing.assert_allclose(np.diff(response.times), 0.01, rtol=1e-9)
    assert len(response.times) == 331


def test_fmpy_takes_the_same_steps(cosimulation, crane, setpoints):
    given = {"tau": 0.02, "max_step": 1e-3, "settle": 0.3, "output_step": 0.003}
    compiled, stepped = (
        cosimulation.run(setpoints, crane.nominal(), **given, by_fmpy=by_fmpy) for by_fmpy in (False, True)
    )
    for field in attrs.fields(type(compiled)):
        np.testing.assert_array_equal(getattr(compiled, field.name), getattr(stepped, field.name))


def test_is_what_fmpy_simulates_from_the_archive(crane, cosimulation, setpoints):
    """The same archive, run by FMPy's own loop with its own reading of inputs, gives the same numbers."""
    p = {**crane.nominal(), "L1": 0.55}
    response = cosimulation.run(setpoints, p, tau=0.02, max_step=1e-3, settle=0.0)
    # FMPy sets at the beginning of a step the input of that time: the next setpoint is due one step earlier
    ahead = np.array(
        list(zip(setpoints.times, [*setpoints.position[1:, 0], setpoints.position[-1, 0]], strict=True)),
        dtype=[("time", float), ("cart.setpoint", float)],
    )
    result = fmpy.simulate_fmu(
        str(plant_fmu(crane).archive),
        start_values={"L1": 0.55, "tau": 0.02},
        input=ahead,
        output=["cart.position", "sway.payload", "angle.hook"],
        stop_time=3.0,
        output_interval=0.01,
        step_size=0.01,
    )
    assert len(result) == 301
    np.testing.assert_allclose(result["cart.position"], response.position[:, 0], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(result["sway.payload"], response.sway[:, 1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(result["angle.hook"], response.angle[:, 0], rtol=0.0, atol=1e-12)


def test_runs_do_not_touch_each_other(cosimulation, crane, setpoints):
    def run(**changes):
        return cosimulation.run(setpoints, {**crane.nominal(), **changes}, max_step=1e-3, settle=1.0)

    first = run()
    assert np.abs(run(L1=0.6).sway - first.sway).max() > 1e-4
    again = run()
    assert (again.sway == first.sway).all()
    assert (again.position == first.position).all()


def test_two_cosimulations_do_not_touch_each_other(cosimulation, crane, setpoints):
    expected = cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=1.0)
    with PlantCosimulation(crane) as other:
        other.run(setpoints, {**crane.nominal(), "m1": 3.0}, tau=0.2, max_step=1e-2, settle=0.0)
        found = cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=1.0)
    assert (found.sway == expected.sway).all()
    cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.0)


def test_goes_on_after_a_failed_run(cosimulation, crane, setpoints):
    with pytest.raises(CosimulationError):
        cosimulation.run(setpoints, {**crane.nominal(), "m1": -1.0}, max_step=1e-3, settle=0.0)
    cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"m1": -1.0}, "m1 must lie between 0.0001 and 1e+06, found -1."),
        ({"L2": float("nan")}, "L2 must be finite"),
        ({"L3": 1.0}, "no parameter L3"),
        ({"m1": None}, "no value of m1"),
    ],
)
def test_refuses_parameters(cosimulation, crane, setpoints, changes, message):
    parameters = {name: value for name, value in {**crane.nominal(), **changes}.items() if value is not None}
    with pytest.raises(CosimulationError) as refusal:
        cosimulation.run(setpoints, parameters, max_step=1e-3, settle=0.0)
    assert message in str(refusal.value)
    assert "double-pendulum-crane" in str(refusal.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tau": -0.1}, "tau must lie between"),
        ({"max_step": 0.0}, "max_step must lie between"),
        ({"settle": -1.0}, "must not be negative"),
        ({"settle": float("inf")}, "must not be negative"),
        ({"output_step": 0.0}, "output step must be positive"),
        ({"output_step": float("nan")}, "output step must be positive"),
    ],
)
def test_refuses_options(cosimulation, crane, setpoints, options, message):
    with pytest.raises(CosimulationError, match=message):
        cosimulation.run(setpoints, crane.nominal(), **{"max_step": 1e-3, "settle": 1.0, **options})


def test_refuses_setpoints_of_other_axes(cosimulation, crane):
    two = SampledProfile(cycle_time=0.01, position=np.zeros((3, 2)))
    with pytest.raises(CosimulationError, match="for 2 axes, but plant double-pendulum-crane has 1"):
        cosimulation.run(two, crane.nominal(), max_step=1e-3, settle=0.0)


@pytest.mark.slow
def test_says_when_the_motion_cannot_be_simulated():
    """A rope of no length swings infinitely fast."""
    reeled_in = SampledProfile(cycle_time=0.01, position=np.array([[0.0, 0.5], [0.1, 0.0], [0.2, 0.0]]))
    with PlantCosimulation(WINCH) as winch, pytest.raises(CosimulationError, match="no longer finite after"):
        winch.run(reeled_in, WINCH.nominal(), max_step=1e-3, settle=0.0)


def test_closes_once_and_says_so(crane, setpoints):
    cosimulation = PlantCosimulation(crane)
    cosimulation.close()
    cosimulation.close()
    with pytest.raises(CosimulationError, match="closed"):
        cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.0)


def test_errors_of_the_fmu_are_logged(cosimulation, crane, setpoints, caplog):
    with caplog.at_level(logging.INFO, "gen_profile_fmu"), pytest.raises(CosimulationError, match="found 0"):
        cosimulation.run(setpoints, {**crane.nominal(), "g": 0.0}, max_step=1e-3, settle=0.0)
    (record,) = caplog.records  # no warning: the exception carries it
    assert (record.name, record.levelno) == ("gen_profile_fmu.running.instances", logging.INFO)
    assert record.getMessage() == "logStatusError: g must lie between 0.1 and 30, found 0."


def test_events_of_the_fmu_are_logged_for_debugging(crane, setpoints, caplog):
    with caplog.at_level(logging.DEBUG, "gen_profile_fmu"), PlantCosimulation(crane) as cosimulation:
        cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.0)
    messages = [record.getMessage().removeprefix("logEvents: ") for record in caplog.records]
    assert messages == ["Instantiated.", "Reset.", "Initialized at time 0 s."]


def test_an_instance_is_kept_for_the_next_of_its_fmu_and_begins_anew(crane, setpoints, monkeypatch):
    loaded = []

    def counted(**named):
        loaded.append(named["modelIdentifier"])
        return FMU2Slave(**named)

    monkeypatch.setattr(instances, "FMU2Slave", counted)
    with PlantCosimulation(WINCH):  # frees what other tests have left
        pass
    loaded.clear()
    found = []
    for plant in (crane, crane, WINCH, crane):
        with PlantCosimulation(plant) as cosimulation:
            if plant is crane:
                found.append(cosimulation.run(setpoints, crane.nominal(), max_step=1e-3, settle=0.1).sway)
                if len(found) == 1:
                    with pytest.raises(CosimulationError):
                        cosimulation.run(setpoints, {**crane.nominal(), "g": 0.0}, max_step=1e-3, settle=0.1)
    assert len(loaded) == 3  # the crane's twice, for the winch came between, and the winch's again
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


@pytest.mark.slow
def test_tells_before_it_compiles(crane, tmp_path, cache, monkeypatch):
    share_zig(cache, tmp_path)
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(tmp_path))
    builds = []
    for _ in range(2):
        with PlantCosimulation(crane, progress=builds.append):
            pass
    assert builds == ["compiling the plant's FMU, once"]


def test_a_library_that_does_not_load_is_a_sentence(crane, monkeypatch):
    fmu = plant_fmu(crane)
    for other, reason in [
        (attrs.evolve(fmu, folder=fmu.folder / "nowhere"), "Cannot find shared library"),
        (attrs.evolve(fmu, guid="another"), "The identity in the model description is not the binary's"),
    ]:
        monkeypatch.setattr("gen_profile_fmu.running.cosimulation.plant_fmu", lambda *_, other=other: other)
        with pytest.raises(CosimulationError, match=reason):
            PlantCosimulation(crane)
