"""The keys of ``[check]`` that name somebody else's FMU, and which of its variables are what."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gen_profile.plants.plant import Plant
from gen_profile.spec.model import ExternalFmu
from gen_profile.spec.structure import Faults, Table, finite, found, place
from gen_profile.suggestion import suggestion

KEYS = ("fmu", "fmu_sha256", "input", "output", "parameters", "time_limit")
INPUTS = ("acceleration", "velocity", "setpoint")
SUFFIX = ".fmu"
TIME_LIMIT = 60.0  # s


def external_fmu(
    check: Table, plant: Plant | None, uncertain: Sequence[str], folder: Path, faults: Faults
) -> ExternalFmu | None:
    """Take the keys of a foreign FMU out of the table ``[check]``.

    Parameters
    ----------
    check : dict
        Loses these keys.
    plant : Plant or None
    uncertain : sequence of str
        Parameters that the check changes: the FMU must have them.
    folder : Path
        What the FMU's file name is relative to.
    faults : Faults
    """
    given = {key: check.pop(key) for key in KEYS if key in check}
    if not given or plant is None:
        return None
    name = given.get("fmu")
    if not isinstance(name, str) or Path(name).suffix.lower() != SUFFIX:
        faults.add("check.fmu", f"must name an FMU, such as customer{SUFFIX}, found {found(name)}")
        return None
    kind, inputs = _inputs(given.get("input"), plant, faults)
    limit = finite(given.get("time_limit", TIME_LIMIT))
    if limit is None or limit <= 0.0:
        faults.add("check.time_limit", f"must be a positive time in s, found {found(given['time_limit'])}")
    return ExternalFmu(
        name=Path(name).name,
        path=folder / name,
        sha256=_sha256(folder / name, given.get("fmu_sha256"), faults),
        input=kind,
        inputs=inputs,
        sway=_sway(given.get("output"), plant, faults),
        parameters=_parameters(given.get("parameters", {}), plant, uncertain, faults),
        time_limit=limit or TIME_LIMIT,
    )


def _sha256(path: Path, stated: Any, faults: Faults) -> str:
    try:
        actual = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        faults.add("check.fmu", f"{path} cannot be read ({error.strerror})")
        return ""
    if stated is not None and stated != actual:
        faults.add("check.fmu", f"{path} is not the FMU that was checked with; its SHA-256 differs")
    return actual


def _inputs(table: Any, plant: Plant, faults: Faults) -> tuple[str, tuple[str, ...]]:
    """Read which quantity goes in, and the variable of each axis."""
    if not isinstance(table, Mapping) or len(table) != 1 or next(iter(table)) not in INPUTS:
        faults.add(
            "check.input",
            f'must name the inputs by one of {", ".join(INPUTS)}, such as {{ acceleration = "u" }}',
        )
        return INPUTS[0], ()
    ((kind, names),) = table.items()
    listed = [names] if isinstance(names, str) else names
    axes = len(plant.actuated)
    if not isinstance(listed, list | tuple) or len(listed) != axes or not _all_texts(listed):
        faults.add(f"check.input.{kind}", f"must name one variable of the FMU per axis ({axes})")
        return kind, ()
    return kind, tuple(listed)


def _sway(table: Any, plant: Plant, faults: Faults) -> dict[str, str]:
    """Read the variable of each load's sway; a single one is the end load's."""
    names = table.get("sway") if isinstance(table, Mapping) and set(table) == {"sway"} else None
    if isinstance(names, str):
        return {plant.loads[-1]: names}
    if not isinstance(names, Mapping) or not names or not _all_texts(names.values()):
        faults.add(
            "check.output",
            'must name the sway of the end load or of loads by name, such as { sway = "load.dx" }',
        )
        return {}
    for load in names:
        if load not in plant.loads:
            faults.add(place("check.output.sway", load), f"unknown load{suggestion(load, plant.loads)}")
    return {load: names[load] for load in plant.loads if load in names}


def _parameters(table: Any, plant: Plant, uncertain: Sequence[str], faults: Faults) -> dict[str, str]:
    where = "check.parameters"
    if not isinstance(table, Mapping) or not _all_texts(table.values()):
        faults.add(where, f'must be a table such as {{ L1 = "rope" }}, found {found(table)}')
        return {}
    known = [parameter.name for parameter in plant.parameters]
    for key in table:
        if key not in known:
            faults.add(place(where, key), f"unknown parameter{suggestion(key, known)}")
    for key in uncertain:
        if key not in table:
            faults.add(place(where, key), "required, as it is uncertain; name the FMU's variable for it")
    return {name: table[name] for name in known if name in table}


def _all_texts(values: Any) -> bool:
    return all(isinstance(value, str) for value in values)
