import importlib
from collections.abc import Iterator
from types import ModuleType

import numpy as np
import pytest
from fmu.slave import FMU2LoggedModel, FMU2LoggedSlave, open_slave
from system_parts import missing

from gen_profile.motion.profile import Profile
from gen_profile.plants.plant import Plant
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import PlantFmu, plant_fmu
from gen_profile_fmu.running.cosimulation import PlantCosimulation


@pytest.fixture(scope="session")
def ecos() -> ModuleType:
    """Give Ecos, whose wheel takes Threading Building Blocks from the system."""
    try:
        return importlib.import_module("ecospy")
    except OSError as error:
        missing(f"Threading Building Blocks (Debian package libtbb12): {error}")


@pytest.fixture(scope="session")
def crane() -> Plant:
    return find_plant("double-pendulum-crane")


@pytest.fixture
def fmu(crane: Plant) -> PlantFmu:
    return plant_fmu(crane)


@pytest.fixture
def slave(fmu: PlantFmu) -> Iterator[FMU2LoggedSlave]:
    with open_slave(fmu) as started:
        yield started


@pytest.fixture
def exchange(fmu: PlantFmu) -> Iterator[FMU2LoggedModel]:
    with open_slave(fmu, FMU2LoggedModel) as started:
        yield started


@pytest.fixture
def cosimulation(crane: Plant) -> Iterator[PlantCosimulation]:
    with PlantCosimulation(crane) as open_cosimulation:
        yield open_cosimulation


@pytest.fixture(scope="session")
def quintic() -> Profile:
    """0.3 m in 3 s, at rest at both ends."""
    distance, duration = 0.3, 3.0
    shape = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * distance / duration ** np.arange(6)
    return Profile(
        knots=[0.0, duration], coefficients=shape.reshape(1, 6, 1), target=[distance], method="quintic"
    )
