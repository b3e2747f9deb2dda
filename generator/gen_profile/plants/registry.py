"""The machines by name: the project's own, and those of entry-point group ``gen_profile.plants``.

A family of machines differs in a number, which ends the type: ``mass-spring-chain-3``.
"""

import re
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from gen_profile.plants.plant import Plant
from gen_profile.plants.soundness import faults_of
from gen_profile.support.errors import SpecError
from gen_profile.support.plugins import CURE, load_plugin

# a machine's module is named after its type, and loads only when it is asked for
BUILT_IN = (
    *("double-pendulum-crane", "flexible-joint", "gantry-crane", "hall-crane"),
    *("single-pendulum-crane", "slosh-tank", "tower-crane"),
)
FAMILIES = {"mass-spring-chain": 2}  # whose module has a `member` of each number; one of them to show
GROUP = "gen_profile.plants"


def plant_types() -> list[str]:
    """List every known type, sorted; of a family one member."""
    shown = (f"{family}-{number}" for family, number in FAMILIES.items())
    return sorted({*BUILT_IN, *shown, *(entry.name for entry in entry_points(group=GROUP))})


def is_built_in(type_: str) -> bool:
    """Whether a type is one of the project's own."""
    return type_ in BUILT_IN or type_.rpartition("-")[0] in FAMILIES


def find_plant(type_: str) -> Plant:
    """Load a machine.

    Raises
    ------
    KeyError
        No machine has that name.
    SpecError
        Another distribution's machine cannot be loaded.
    """
    if type_ in BUILT_IN:
        return cast(Plant, _module(type_).PLANT)
    family, _, number = type_.rpartition("-")
    if family in FAMILIES and re.fullmatch("[1-9][0-9]{0,3}", number):
        return cast(Plant, _module(family).member(int(number)))
    for entry in entry_points(group=GROUP, name=type_):
        return _plant_of(entry)
    raise KeyError(type_)


def _module(name: str) -> Any:
    return import_module(f"gen_profile.plants.{name.replace('-', '_')}")


def _plant_of(entry: EntryPoint) -> Plant:
    """Take another distribution's machine, if it is sound."""
    plant = load_plugin(entry, Plant, "plant.type:")
    if faults := faults_of(plant):
        raise SpecError(f"plant.type: {entry.name!r}: {entry.value}: {'; '.join(faults)}; {CURE}")
    return plant
