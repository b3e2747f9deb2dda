"""The machines by name: the project's own, and those of entry-point group ``gen_profile.plants``."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import cast

from gen_profile.errors import SpecError
from gen_profile.plants.plant import Plant

# type → (module that holds PLANT, summary); modules load only when their machine is asked for
BUILT_IN: dict[str, tuple[str, str]] = {
    "double-pendulum-crane": (
        "gen_profile.plants.double_pendulum_crane",
        "cart, hook and payload on two ropes",
    ),
}
GROUP = "gen_profile.plants"


def plant_types() -> dict[str, str]:
    """Every known type with its summary, sorted."""
    known = {entry.name: f"from {entry.value}" for entry in entry_points(group=GROUP)}
    known |= {name: summary for name, (_, summary) in BUILT_IN.items()}
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
    for entry in entry_points(group=GROUP, name=type_):
        return _plant_of_plugin(entry)
    raise KeyError(type_)


def _plant_of_plugin(entry: EntryPoint) -> Plant:
    cure = "update or uninstall the package that provides it."
    try:
        plant = entry.load()
    except Exception as error:
        raise SpecError(
            f"plant.type: {entry.name!r} cannot be loaded from {entry.value} ({error}); {cure}"
        ) from error
    if not isinstance(plant, Plant):
        raise SpecError(
            f"plant.type: {entry.name!r}: {entry.value} is no gen_profile.plants.plant.Plant; {cure}"
        )
    return plant
