"""The machines by name: the project's own, and those of entry-point group ``gen_profile.plants``."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
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
        When no machine has that name.
    """
    if type_ in BUILT_IN:
        return cast("Plant", import_module(BUILT_IN[type_][0]).PLANT)
    for entry in entry_points(group=GROUP, name=type_):
        return cast("Plant", entry.load())
    raise KeyError(type_)
