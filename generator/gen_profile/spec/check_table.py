"""The keys of ``[check]``: what may remain of the sway, and on which machines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import attrs

from gen_profile.plants.plant import Plant
from gen_profile.spec.external_fmu import KEYS as FOREIGN
from gen_profile.spec.external_fmu import external_fmu
from gen_profile.spec.model import RESIDUAL_SHARE, CheckSpec
from gen_profile.spec.structure import Faults, Table, finite, found, place
from gen_profile.suggestion import suggestion

KEYS = [field.name for field in attrs.fields(CheckSpec) if field.name not in ("foreign", "default")]
MOST_CORNERS = 10  # parameters whose ranges have 2¹⁰ corners


def check_table(tables: Table, plant: Plant | None, folder: Path, faults: Faults) -> Table:
    """Complete the table ``[check]``.

    Parameters
    ----------
    tables : dict
        Of the spec; plant, move and robustness are complete.
    plant : Plant or None
    folder : Path
        What the name of a foreign FMU is relative to.
    faults : Faults
    """
    table = dict(tables["check"])
    for key in table:
        if key not in (*KEYS, *FOREIGN):
            faults.add(place("check", key), f"unknown key{suggestion(key, [*KEYS, *FOREIGN])}")
    limits = _residual_sway(table.get("residual_sway"), tables["move"], plant, faults)
    if plant is None:
        return limits
    parameters = tables["plant"]["parameters"]
    uncertain = _uncertain(table.get("uncertain"), parameters, faults)
    for where, shares in (("robustness", tables["robustness"]["uncertain"]), ("check", uncertain or {})):
        _within_bounds(f"{where}.uncertain", shares, plant, parameters, faults)
    spans = _spans(table.get("spans", {}), plant, parameters, faults)
    changed = {*(tables["robustness"]["uncertain"] if uncertain is None else uncertain), *spans}
    if len(changed) > MOST_CORNERS:
        faults.add(
            "check.uncertain",
            f"{len(changed)} parameters have 2^{len(changed)} corners; name at most {MOST_CORNERS} in "
            "check.uncertain, widen theirs, and let check.samples draw",
        )
    given = {key: table[key] for key in ("samples", "seed") if key in table}
    foreign = external_fmu(table, plant, [name for name in parameters if name in changed], folder, faults)
    if foreign is not None and (tables["move"]["initial"] or any(tables["move"]["final_velocity"])):
        faults.add("check.fmu", "judges moves from rest to rest only; remove move.initial and final_velocity")
    return {
        **limits,
        **given,
        "uncertain": uncertain,
        "spans": spans,
        "path": _path(table.get("path", {}), tables["actuator"], faults),
        "foreign": foreign,
    }


def _uncertain(table: Any, parameters: Mapping[str, float], faults: Faults) -> Table | None:
    where = "check.uncertain"
    if table is None:
        return None
    if not isinstance(table, Mapping):
        faults.add(where, f"must be a table such as {{ L1 = 0.2 }}, found {found(table)}")
        return None
    _known(where, table, parameters, faults)
    for name in table:
        if parameters.get(name) == 0.0:
            faults.add(place(where, name), "its value is 0, so a relative range is empty; state check.spans")
    return {name: table[name] for name in parameters if name in table}


def _within_bounds(
    where: str, shares: Mapping[str, Any], plant: Plant, parameters: Mapping[str, float], faults: Faults
) -> None:
    """Refuse relative ranges that reach beyond what the machine takes."""
    for parameter in plant.parameters:
        share, value = finite(shares.get(parameter.name)), parameters[parameter.name]
        if share is None or not 0.0 < share < 1.0 or not parameter.lower <= value <= parameter.upper:
            continue  # or told elsewhere
        for end in (value * (1.0 + sign * share) for sign in (-1.0, 1.0)):
            if not parameter.lower <= end <= parameter.upper:
                bounds = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
                faults.add(place(where, parameter.name), f"reaches {end:.6g}, and the machine takes {bounds}")


def _spans(table: Any, plant: Plant, parameters: Mapping[str, float], faults: Faults) -> Table:
    """Hold absolute ranges to the bounds of the machine."""
    where = "check.spans"
    if not isinstance(table, Mapping):
        faults.add(where, f"must be a table such as {{ c2 = [0.0, 0.02] }}, found {found(table)}")
        return {}
    _known(where, table, parameters, faults)
    spans: Table = {}
    for parameter in plant.parameters:
        if parameter.name not in table:
            continue
        ends = table[parameter.name]
        numbers = [finite(end) for end in ends] if isinstance(ends, list | tuple) else []
        low, high = numbers if len(numbers) == 2 else (None, None)
        if low is None or high is None or not parameter.lower <= low <= high <= parameter.upper:
            bounds = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
            faults.add(place(where, parameter.name), f"must be two rising numbers from {bounds}")
            low = high = parameters[parameter.name]
        spans[parameter.name] = (low, high)
    return spans


def _known(where: str, names: Iterable[str], parameters: Mapping[str, float], faults: Faults) -> None:
    for name in names:
        if name not in parameters:
            faults.add(place(where, name), f"unknown parameter{suggestion(name, parameters)}")


def _path(table: Any, actuator: Table, faults: Faults) -> Any:
    """Hold together what a drive can do; single values are judged elsewhere."""
    if not isinstance(table, Mapping):
        return table
    lag = table.get("lag")
    least = finite(actuator.get("tau", 0.0)) or 0.0
    if isinstance(lag, list | tuple) and len(lag) == 2:
        ends = [finite(end) or 0.0 for end in lag]
        if ends[0] > ends[1]:
            faults.add("check.path.lag", f"must be two rising times in s, found {list(lag)}")
        least = ends[0]
    if table.get("between") == "hold" and least <= 0.0:
        faults.add(
            "check.path.between",
            '"hold" lets the axis leap to each setpoint, which takes a drive with a lag: '
            "state check.path.lag, or actuator.tau",
        )
    return dict(table)


def _residual_sway(given: Any, move: Table, plant: Plant | None, faults: Faults) -> Table:
    """Give every load its limit: one number is for all; in a table, the end load's is the others' default."""
    where = "check.residual_sway"
    in_metres = [axis.unit == "m" for axis in plant.actuated] if plant else [True] * len(move["start"])
    moves = zip(move["start"], move["target"], in_metres, strict=False)
    longest = max((abs(b - a) for a, b, linear in moves if linear), default=0.0)
    idle = move["start"] == move["target"] and not any(move["final_velocity"]) and not move["initial"]
    if given is None and longest == 0.0 and not idle:
        faults.add(where, "required where no axis moves in m; state what may remain, in m")
    usual = RESIDUAL_SHARE * (longest or 1.0)
    stated = given if isinstance(given, Mapping) else {} if given is None else {"": given}
    for load, limit in stated.items():
        at = place(where, load) if load else where
        if load and plant and load not in plant.loads:
            faults.add(at, f"unknown load{suggestion(load, plant.loads)}")
        elif (number := finite(limit)) is None or number <= 0.0:
            faults.add(at, f"must be a finite number greater than 0, found {found(limit)}")
    if plant is None:
        return {"residual_sway": {}}
    rest = stated.get("", stated.get(plant.loads[-1], usual))
    return {
        "residual_sway": {load: stated.get(load, rest) for load in plant.loads},
        "default": given is None,
    }
