"""The keys of ``[check]`` that name an external FMU, and which of its variables are what."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import attrs

from gen_profile.plants.plant import Plant
from gen_profile.spec.model import FED_RATES, ExternalFmu
from gen_profile.spec.structure import MISFIT, Faults, Structurer, kinds_of
from gen_profile.spec.values import NONE, Pattern, Words
from gen_profile.support.bounded_file import read_bounded
from gen_profile.support.private_folder import agree
from gen_profile.support.units import units_of

KEYS = ("fmu", "fmu_sha256", "input", "output", "parameters", "units", "time_limit", "step")
INPUTS = tuple(FED_RATES)
TIME_LIMIT = 60.0  # s
FILE = Annotated[
    str,
    Pattern(r"(?is).+\.fmu", "the name of an FMU"),
    Words("must name an FMU, such as customer.fmu, found {found}"),
]


def external_fmu(
    check: dict[str, Any], plant: Plant | None, folder: Path, structurer: Structurer
) -> ExternalFmu | None:
    """Take the keys of an external FMU out of the table ``[check]``.

    Parameters
    ----------
    check : dict
        Loses these keys.
    plant : Plant or None
    folder : Path
        What the FMU's file name is relative to.
    structurer : Structurer
    """
    given = {key: check.pop(key) for key in KEYS if key in check}
    if not given or plant is None:
        return None
    name = structurer.fit(given.get("fmu"), FILE, "check.fmu")
    if name is MISFIT:
        return None
    input_, inputs = _inputs(given.get("input"), plant, structurer)
    kinds, limit = kinds_of(ExternalFmu), given.get("time_limit", TIME_LIMIT)
    foreign = ExternalFmu(
        name=Path(name).name,
        path=folder / name,
        sha256=_sha256(folder / name, given.get("fmu_sha256"), structurer.faults),
        input=input_,
        inputs=inputs,
        sway=_sway(given.get("output"), plant, structurer),
        parameters=structurer.fit(given.get("parameters", {}), kinds["parameters"], "check.parameters", {}),
        time_limit=structurer.fit(limit, kinds["time_limit"], "check.time_limit", TIME_LIMIT),
        step=structurer.fit(given.get("step"), kinds["step"], "check.step", None),
    )
    return attrs.evolve(foreign, units=_units(given.get("units", {}), foreign, plant, structurer))


def _units(table: Any, foreign: ExternalFmu, plant: Plant, structurer: Structurer) -> Mapping[str, str]:
    """Read the units of variables, each one that measures what the variable is meant to."""
    fitting = {name: (si, *units_of(si)) for name, si in foreign.si_units(plant).items()}
    choices = {name: Literal.__getitem__(tuple(dict.fromkeys(units))) for name, units in fitting.items()}
    of_variables = attrs.evolve(structurer, names={"variable": choices})
    units: Mapping[str, str] = of_variables.fit(table, kinds_of(ExternalFmu)["units"], "check.units", NONE)
    return units


def _sha256(path: Path, stated: Any, faults: Faults) -> str:
    try:
        actual = hashlib.sha256(read_bounded(path)).hexdigest()
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", error)
        faults.add("check.fmu", "{path} cannot be read ({problem})", path=path, problem=problem)
        return ""
    if stated is not None and stated != actual:
        faults.add("check.fmu", "{path} is not the FMU that was checked with; its SHA-256 differs", path=path)
    else:
        agree(actual)
    return actual


def _inputs(table: Any, plant: Plant, structurer: Structurer) -> tuple[str, tuple[str, ...]]:
    """Read which quantity goes in, and the variable of each axis."""
    if not isinstance(table, Mapping) or len(table) != 1 or next(iter(table)) not in INPUTS:
        template = 'must name the inputs by one of {names}, such as {{ acceleration = "u" }}'
        structurer.faults.add("check.input", template, names=", ".join(INPUTS))
        return INPUTS[0], ()
    ((quantity, names),) = table.items()
    axes = len(plant.actuated)
    words = Words("must name one variable of the FMU per axis ({axes})", axes=axes)
    one_per_axis: Any = Annotated[tuple.__class_getitem__((str,) * axes), words]
    listed = [names] if isinstance(names, str) else names
    return quantity, structurer.fit(listed, one_per_axis, f"check.input.{quantity}", ())


def _sway(table: Any, plant: Plant, structurer: Structurer) -> Mapping[str, str]:
    """Read the variable of each load's sway; a single one is the end load's."""
    names = table.get("sway") if isinstance(table, Mapping) and set(table) == {"sway"} else None
    if isinstance(names, str):
        return {plant.loads[-1]: names}
    if not isinstance(names, Mapping) or not names or not all(isinstance(one, str) for one in names.values()):
        problem = 'must name the sway of the end load or of loads by name, such as { sway = "load.dx" }'
        structurer.faults.add("check.output", problem)
        return {}
    sway: Mapping[str, str] = structurer.fit(names, kinds_of(ExternalFmu)["sway"], "check.output.sway")
    return sway
