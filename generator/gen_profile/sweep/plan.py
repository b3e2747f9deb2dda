"""From what was asked for to a sweep that makes sense, before any work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gen_profile.artefacts.manifest import versions
from gen_profile.errors import SpecError
from gen_profile.sweep.case import Recipe
from gen_profile.sweep.grid import Grid
from gen_profile.sweep.store import Store
from gen_profile_exporters.registry import find_exporter


def prepare(
    spec_text: tuple[str, str, Path],
    overrides: Sequence[str],
    grid: Grid,
    formats: Sequence[str],
    folder: Path,
) -> Store:
    """Say what is to be swept, once it makes sense.

    Parameters
    ----------
    spec_text : (str, str, Path)
        TOML of the spec, where it comes from, and the folder that its files are relative to.
    overrides : sequence of str
        Of the spec, the same in all cases.
    grid : Grid
    formats : sequence of str
    folder : Path
        To write to.

    Raises
    ------
    SpecError
        The spec is faulty, or no value of some axis fits it.
    """
    for name in formats:
        find_exporter(name)
    text, source, spec_folder = spec_text
    recipe = Recipe(
        text=text,
        overrides=tuple(overrides),
        source=source,
        folder=str(spec_folder.absolute()),
        formats=tuple(dict.fromkeys(formats)),
        versions=versions(),
    )
    spec = recipe.spec({})
    for axis in grid.axes:
        _require_some(recipe, axis.key, axis.values)
    return Store(folder=folder, name=spec.name, grid=grid, recipe=recipe, spec_sha256=spec.sha256())


def _require_some(recipe: Recipe, key: str, values: Sequence[Any]) -> None:
    """Tell a mistyped key from values of which some do not do."""
    faults = []
    for value in values:
        try:
            recipe.spec({key: value})
        except SpecError as error:
            faults.append(error)
        else:
            return
    raise faults[0]
