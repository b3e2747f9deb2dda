"""FMUs of every machine against our own tight integration of its equations."""

import numpy as np
import pytest
from fmu.drivers import Instance, cosimulate
from fmu.hoisting_pendulum import PLANT as WINCH
from fmu.kinds import model_of, motion

from gen_profile.plants.registry import BUILT_IN, find_plant
from gen_profile.response import Swing
from gen_profile_fmu.fmu_files import Version
from gen_profile_fmu.plant_fmu import cached_fmu

PLANTS = [*(find_plant(name) for name in BUILT_IN), WINCH]


@pytest.fixture(params=PLANTS, ids=lambda plant: plant.type)
def plant(request):
    return request.param


@pytest.mark.parametrize("version", Version)
def test_a_system_moves_as_its_equations_say(plant, version):
    axes = len(plant.actuated)
    profile = motion(axes)
    times = np.linspace(0.0, 3.0, 301)
    (exact,) = Swing(plant, profile, [plant.nominal()], 3.0).at(times)
    instance = Instance(cached_fmu(model_of("system", plant, profile), version), version, exchange=False)
    instance.begin({})
    names = [*(f"sway.{load}" for load in plant.loads), *(f"{axis.name}.position" for axis in plant.actuated)]
    found = cosimulate(instance, times, lambda *_: None, names)
    instance.close()
    size = np.abs(exact.sway).max()
    assert size > 1e-4
    # limits of Swing's dense output where the acceleration jumps
    np.testing.assert_allclose(found[:, :-axes], exact.sway, rtol=0.0, atol=2e-5 * size)
    np.testing.assert_allclose(found[:, -axes:], exact.position, rtol=0.0, atol=1e-12)


def test_setpoints_that_stand_still_leave_every_machine_at_rest(plant):
    instance = Instance(
        cached_fmu(model_of("plant-setpoint", plant), Version.FMI2), Version.FMI2, exchange=False
    )
    instance.begin({f"{axis.name}.{what}": 0.7 for axis in plant.actuated for what in ("start", "setpoint")})
    names = [f"sway.{load}" for load in plant.loads]
    found = cosimulate(instance, np.linspace(0.0, 1.0, 11), lambda *_: None, names)
    instance.close()
    np.testing.assert_allclose(found, 0.0, atol=1e-12)
