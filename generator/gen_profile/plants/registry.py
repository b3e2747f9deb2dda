"""The machines by name: the project's own, and those of entry-point group ``gen_profile.plants``.

A family of machines differs in a number, which ends the type: ``mass-spring-chain-3``.
"""

from __future__ import annotations

import re
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import cast

from gen_profile.errors import SpecError
from gen_profile.plants.plant import Plant
from gen_profile.plants.soundness import faults_of
from gen_profile.plugins import CURE, load_plugin

# type → (module that holds PLANT, summary); modules load only when their machine is asked for
BUILT_IN: dict[str, tuple[str, str]] = {
    "double-pendulum-crane": (
        "gen_profile.plants.double_pendulum_crane",
        "cart, hook and payload on two ropes",
    ),
    "flexible-joint": ("gen_profile.plants.flexible_joint", "arm behind a torsion spring on a driven hub"),
    "gantry-crane": (
        "gen_profile.plants.gantry_crane",
        "bridge and trolley, and a payload that swings in both directions",
    ),
    "single-pendulum-crane": (
        "gen_profile.plants.single_pendulum_crane",
        "cart with a hoist, and a payload on the rope",
    ),
    "slosh-tank": (
        "gen_profile.plants.slosh_tank",
        "liquid in a rectangular tank that is moved along its length",
    ),
    "tower-crane": (
        "gen_profile.plants.tower_crane",
        "slewing jib with a trolley, and a payload that swings along and across it",
    ),
}
# family → (module whose `member` makes a machine of a number, a number to show, its summary)
FAMILIES: dict[str, tuple[str, int, str]] = {
    "mass-spring-chain": (
        "gen_profile.plants.mass_spring_chain",
        2,
        "springs and masses behind a driven axis, 2 of each (or another number: it ends the type)",
    ),
}
GROUP = "gen_profile.plants"


def plant_types() -> dict[str, str]:
    """Every known type with its summary, sorted; of a family one member."""
    known = {entry.name: f"from {entry.value}" for entry in entry_points(group=GROUP)}
    known |= {name: summary for name, (_, summary) in BUILT_IN.items()}
    known |= {f"{family}-{number}": summary for family, (_, number, summary) in FAMILIES.items()}
    return dict(sorted(known.items()))


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
        return cast(Plant, import_module(BUILT_IN[type_][0]).PLANT)
    family, _, number = type_.rpartition("-")
    if family in FAMILIES and re.fullmatch("[1-9][0-9]{0,3}", number):
        return cast(Plant, import_module(FAMILIES[family][0]).member(int(number)))
    for entry in entry_points(group=GROUP, name=type_):
        return _plant_of(entry)
    raise KeyError(type_)


def _plant_of(entry: EntryPoint) -> Plant:
    """Take another distribution's machine, if it is sound."""
    plant = load_plugin(entry, Plant, "plant.type:")
    if faults := faults_of(plant):
        raise SpecError(f"plant.type: {entry.name!r}: {entry.value}: {'; '.join(faults)}; {CURE}")
    return plant
