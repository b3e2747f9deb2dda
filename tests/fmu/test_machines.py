"""FMUs of every machine against our own tight integration of its equations."""

from types import SimpleNamespace

import numpy as np
import pytest
from fmu.drivers import Instance, cosimulate
from fmu.hoisting_pendulum import PLANT as WINCH
from fmu.kinds import model_of, motion
from generator.lagrangian_machines import MACHINES, Lagrange

from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.plants.registry import BUILT_IN, find_plant
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.variables import variable_name

PLANTS = [*(find_plant(name) for name in BUILT_IN), WINCH]


@pytest.fixture(params=PLANTS, ids=lambda plant: plant.type)
def plant(request):
    return request.param


@pytest.mark.slow
@pytest.mark.parametrize("version", Version)
def test_a_system_moves_as_its_equations_say(plant, version):
    axes = len(plant.actuated)
    profile = motion(axes)
    times = np.linspace(0.0, 3.0, 301)
    (exact,) = PlantSimulation(plant, profile, [plant.nominal()], 3.0).at(times)
    instance = Instance(cached_fmu(model_of("system", plant, profile), version), version, exchange=False)
    instance.begin({})
    sways = [f"sway.{variable_name(load)}" for load in plant.loads]
    names = [*sways, *(f"{axis.name}.position" for axis in plant.actuated)]
    found = cosimulate(instance, times, lambda *_: None, names)
    instance.close()
    size = np.abs(exact.sway).max()
    assert size > 1e-4
    # limits of PlantSimulation's dense output where the acceleration jumps
    np.testing.assert_allclose(found[:, :-axes], exact.sway, rtol=0.0, atol=2e-5 * size)
    np.testing.assert_allclose(found[:, -axes:], exact.position, rtol=0.0, atol=1e-12)


def swinging(plant):
    """Start values for an undamped machine: mild for every mode."""
    undamped = dict.fromkeys(MACHINES[plant.type][2], 0.0)
    return {
        **undamped,
        **{f"{axis.name}.{what}": 1.5 for axis in plant.actuated for what in ("start", "setpoint")},
        **{q.name: 0.3 / (1 + i) for i, q in enumerate(plant.unactuated)},
        **{f"{q.name}.rate": 0.2 for q in plant.unactuated},
    }


@pytest.mark.parametrize(
    ("type_", "version"),
    [*((type_, Version.FMI2) for type_ in MACHINES), ("double-pendulum-crane", Version.FMI3)],
)
def test_free_swing_keeps_the_energy(type_, version):
    plant = find_plant(type_)
    fmu = cached_fmu(model_of("plant-setpoint", plant), version)
    instance = Instance(fmu, version, exchange=False)
    values = swinging(plant)
    instance.begin(values)
    energy = cosimulate(instance, np.linspace(0.0, 10.0, 201), lambda *_: None, ["energy"])
    still = Instance(fmu, version, exchange=False)
    still.begin({name: value for name, value in values.items() if name.endswith(("start", "setpoint"))})
    swing = energy[0] - still.read("energy")
    for opened in (instance, still):
        opened.close()
    assert swing > 0.0
    assert np.ptp(energy) < 1e-7 * swing


@pytest.mark.parametrize("type_", MACHINES)
def test_places_and_energy_are_those_of_the_moving_masses(type_):
    """Along a motion, from the states that the FMU tells."""
    lagrange = Lagrange(type_)
    plant = lagrange.plant
    q = [*(q.name for q in plant.unactuated), *(f"{axis.name}.position" for axis in plant.actuated)]
    dq = [
        *(f"{q.name}.rate" for q in plant.unactuated),
        *(f"{axis.name}.velocity" for axis in plant.actuated),
    ]
    seen = [f"position.{body}.{direction}" for body in plant.bodies for direction in "xyz"]
    fmu = cached_fmu(model_of("plant-setpoint", plant), Version.FMI2)
    instance = Instance(fmu, Version.FMI2, exchange=False)
    instance.begin({f"{axis.name}.start": 0.7 for axis in plant.actuated})

    def moves(_, time):
        place = 0.7 + 0.1 * (1.0 - np.cos(3.0 * time))
        instance.write({f"{axis.name}.setpoint": place for axis in plant.actuated})

    rows = cosimulate(instance, np.linspace(0.0, 2.0, 41), moves, [*q, *dq, *seen, "energy"])
    instance.close()
    p = SimpleNamespace(**plant.nominal())
    assert np.abs(rows[:, len(q) : len(q) + len(dq)]).max(axis=0).min() > 0.01
    for row in rows:
        angles, rates, places, energy = np.split(row, np.cumsum([len(q), len(dq), len(seen)]))
        masses = MACHINES[type_][0](angles, p)[0][: len(plant.bodies)]
        radius = p.R if type_ == "flexible-joint" else 1.0  # there on the unit circle
        expected = radius * np.concatenate([place for _, place in masses])
        np.testing.assert_allclose(places, expected, rtol=0.0, atol=1e-13 * (1.0 + np.abs(expected).max()))
        if type_ != "slosh-tank":  # whose masses are 1 there
            assert energy[0] == pytest.approx(lagrange.energy(angles, rates, plant.nominal()), rel=1e-12)


def test_a_machine_without_bodies_has_neither_places_nor_energy():
    names = {variable.name for variable in model_of("system", WINCH).variables.variables}
    assert "energy" not in names
    assert not [name for name in names if name.startswith("position.")]


def test_setpoints_that_stand_still_leave_every_machine_at_rest(plant):
    instance = Instance(
        cached_fmu(model_of("plant-setpoint", plant), Version.FMI2), Version.FMI2, exchange=False
    )
    instance.begin({f"{axis.name}.{what}": 0.7 for axis in plant.actuated for what in ("start", "setpoint")})
    names = [f"sway.{variable_name(load)}" for load in plant.loads]
    found = cosimulate(instance, np.linspace(0.0, 1.0, 11), lambda *_: None, names)
    instance.close()
    np.testing.assert_allclose(found, 0.0, atol=1e-12)
