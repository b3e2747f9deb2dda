"""FMUs of every kind, for tests that hold for all of them."""

from __future__ import annotations

from functools import cache
from itertools import cycle

import attrs
import numpy as np

from gen_profile.motion.profile import Profile
from gen_profile.planner.design import planner_block
from gen_profile.plants.plant import Plant
from gen_profile.spec.reading import preset_spec
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.contents import Model, plant_model, profile_model, system_model
from gen_profile_fmu.model.planner import planned_system_model, planner_model
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance

INPUTS = {f"plant-{kind.value}": kind for kind in InputKind}
KINDS = (*INPUTS, "profile", "system")  # of any plant
ALL_KINDS = (*KINDS, "planner", "planned-system")
PAIRS = [*zip(ALL_KINDS, cycle(Version), strict=False)]  # every kind, and in turn either version


PLANNED = preset_spec(
    "paper",
    limits={"velocity": 0.5, "acceleration": 1.0, "jerk": 20.0, "travel": (-1.0, 1.0)},
    planner={"live": {"L1": (0.4, 0.5)}},
    export={"cycle_time": 0.01},
)


@cache
def planner_text() -> str:
    return planner_block(PLANNED).text


@cache
def _planner() -> Model:
    return planner_model("paper planner", planner_text(), {"": "cart"}, tuple(PLANNED.planner.live))


def machine_of(plant: Plant, **changes: float) -> PlantInstance:
    return PlantInstance(plant=plant, parameters={**plant.nominal(), **changes})


@cache
def motion(axes: int) -> Profile:
    """Two pieces per axis from 0.1, with a jump of the acceleration between them."""
    distance = 0.3 / np.arange(1.0, axes + 1.0)
    first = np.array([0.0, 0.0, 4.0 / 9.0])[:, None] * distance
    rest = np.array([0.25, 2.0 / 3.0, -4.0 / 9.0, 8.0 / 81.0])[:, None] * distance
    coefficients = np.zeros((2, 4, axes))
    coefficients[0, :3], coefficients[1] = first, rest
    coefficients[:, 0] += 0.1
    end = coefficients[1].T @ 1.5 ** np.arange(4.0)
    return Profile(knots=[0.0, 0.75, 2.25], coefficients=coefficients, target=end, method="test")


@cache
def model_of(kind: str, plant: Plant, profile: Profile | None = None) -> Model:
    profile = profile or motion(len(plant.actuated))
    if kind == "profile":
        return profile_model("paper profile", plant.actuated, profile)
    if kind == "planner":
        return _planner()
    if kind == "planned-system":
        machine = machine_of(plant)
        live = tuple(PLANNED.planner.live)
        return planned_system_model("paper planned", planner_text(), machine, {"": "cart"}, live)
    if kind == "system":
        return system_model("paper system", machine_of(plant), profile)
    machine = attrs.evolve(machine_of(plant), tau=0.1 if kind == "plant-velocity" else 0.0)
    return plant_model(machine, INPUTS[kind])
