"""From what a person writes to tables nested as the classes of `gen_profile.spec.model` are.

Here stands whatever needs to know the machine (its parameters, axes and loads), or several keys at once.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import attrs

from gen_profile.errors import SpecError
from gen_profile.plants.machine_file import MachineFile, plant_of_file, read_machine_file
from gen_profile.plants.plant import Coordinate, Plant
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.spec.can import CanSpec
from gen_profile.spec.can_table import can_table
from gen_profile.spec.check_table import KEYS as CHECK_KEYS
from gen_profile.spec.check_table import check_table
from gen_profile.spec.external_fmu import KEYS as FOREIGN_KEYS
from gen_profile.spec.model import (
    ActuatorSpec,
    CostSpec,
    ExportSpec,
    LimitsSpec,
    PlannerSpec,
    RobustnessSpec,
    SolverSpec,
    Spec,
)
from gen_profile.spec.planner_table import planner_table
from gen_profile.spec.structure import Faults, Table, finite, found, place
from gen_profile.suggestion import listed, meant, suggestion
from gen_profile.units import UNITS

TABLES = tuple(field.name for field in attrs.fields(Spec) if field.name != "name")
REQUIRED = ("plant", "move")
FILE_KEYS = ("file", "file_sha256")
DEFAULT_NAME = "profile"
PLACEHOLDER_DURATION = 1.0  # s, until the shortest duration is found
LARGEST_ANGLE = 1.4  # rad, of a load at the start
SHORTEST_MOVE = 1e-12  # m (or rad); squares of what is smaller come near to what floats can hold
FLAT = {
    "actuator": ActuatorSpec,
    "robustness": RobustnessSpec,
    "cost": CostSpec,
    "solver": SolverSpec,
    "limits": LimitsSpec,
    "export": ExportSpec,
    "can": CanSpec,
    "planner": PlannerSpec,
}
SMALL_SWING = 1e-3  # m (or rad), to compare forces with


def complete(document: Mapping[str, Any], folder: Path, faults: Faults) -> Table:
    """Fill in what depends on the machine; where something is wrong, note it and put a harmless value.

    Files that the spec names are relative to `folder`.

    Without a known machine, names of parameters, axes and loads cannot be judged; everything else is.
    """
    for key in REQUIRED:
        if key not in document:
            faults.add(key, f"the spec must state [{key}]; a real machine has no default here")
    tables = {"name": DEFAULT_NAME, **document, **{key: _table(document, key, faults) for key in TABLES}}
    tables["actuator"] = _actuator(tables["actuator"], faults)
    tables["cost"] = _cost(tables["cost"], tables["actuator"], faults)
    own = not tables["plant"].keys().isdisjoint(FILE_KEYS)
    file, plant = (
        _own_machine(tables["plant"], folder, faults) if own else (None, _machine(tables["plant"], faults))
    )
    _misplaced(document, plant, faults)
    tables["plant"] = {"file": file, **_plant(tables["plant"], plant, faults)}
    tables["move"] = _move(tables["move"], plant, faults)
    _still_at_speed(tables["move"], tables, plant, faults)
    tables["robustness"] = _robustness(tables["robustness"], tables["plant"].get("parameters"), faults)
    tables["check"] = check_table(tables, plant, folder, faults)
    tables["limits"] = _limits(tables["limits"], tables["move"], plant, faults)
    tables["axis"] = _axis(tables["axis"], plant, faults)
    _check_columns(tables["export"].get("csv_columns"), faults)
    tables["can"] = can_table(tables["can"], plant, faults)
    tables["planner"] = planner_table(tables["planner"], plant, faults)
    return tables


def _misplaced(document: Mapping[str, Any], plant: Plant | None, faults: Faults) -> None:
    """Tell where a key belongs that stands in another table, or in none."""
    keys: dict[str, Collection[str]] = {
        "plant": ["type", *FILE_KEYS, *(plant.nominal() if plant else ())],
        "move": MOVE_KEYS,
        "check": [*CHECK_KEYS, *FOREIGN_KEYS],
        **{name: [field.name for field in attrs.fields(class_)] for name, class_ in FLAT.items()},
    }
    stated = {"": document} | {
        name: document[name] for name in keys if isinstance(document.get(name), Mapping)
    }
    for table, content in stated.items():
        for key in content:
            homes = [f"{name}.{key}" for name, own in keys.items() if key in own]
            if plant and key in plant.nominal() and table in ("robustness", "check"):
                homes = [f"{table}.uncertain.{key}"]
            if homes and key not in (keys[table] if table else ("name", *TABLES)):
                faults.add(place(table, key), f"unknown key; did you mean {listed(homes)}?")


def _table(document: Mapping[str, Any], key: str, faults: Faults) -> Table:
    value = document.get(key, {})
    if isinstance(value, Mapping):
        return dict(value)
    faults.add(key, f"must be a table, found {found(value)}")
    return {}


def _own_machine(table: Table, folder: Path, faults: Faults) -> tuple[MachineFile | None, Plant | None]:
    """Load the machine that the user wrote, and take the keys that name its file out of the table."""
    name, sha256 = table.pop("file", None), table.pop("file_sha256", None)
    if not isinstance(name, str):
        faults.add("plant.file", f"must name a Python file, found {found(name)}")
        return None, None
    if not isinstance(sha256, str | None):
        faults.add("plant.file_sha256", f"must be text, found {found(sha256)}")
        return None, None
    try:
        file = read_machine_file(folder / name, sha256)
        plant = plant_of_file(file)
    except SpecError as error:
        faults.add("plant.file", str(error).removeprefix("plant.file: ").removesuffix("."))
        return None, None
    type_ = table.get("type", plant.type)
    if type_ != plant.type:
        faults.add("plant.type", f"{file.name} holds a machine of type {plant.type!r}, found {found(type_)}")
    return file, plant


def _machine(table: Table, faults: Faults) -> Plant | None:
    type_ = table.get("type")
    if not isinstance(type_, str):
        faults.add("plant.type", f"must name a machine, found {found(type_)}{suggestion('', plant_types())}")
        return None
    try:
        return find_plant(type_)
    except KeyError:
        faults.add("plant.type", f"unknown machine {type_[:60]!r}{suggestion(type_, plant_types())}")
        return None


def _plant(table: Table, plant: Plant | None, faults: Faults) -> Table:
    """Complete the parameters with the type's nominal values and hold them to its bounds."""
    if plant is None:
        return {"type": ""}
    nominal = plant.nominal()
    given = {key: value for key, value in table.items() if key != "type"}
    for key in given:
        if key not in nominal:
            faults.add(place("plant", key), f"unknown key{suggestion(key, ['type', *nominal])}")
    values: dict[str, float] = {}
    for parameter in plant.parameters:
        value = given.get(parameter.name, parameter.nominal)
        number = finite(value)
        if number is None or not parameter.lower <= number <= parameter.upper:
            faults.add(
                f"plant.{parameter.name}",
                f"must be a number from {parameter.lower:g} to {parameter.upper:g} {parameter.unit}, "
                f"found {found(value)}",
            )
        values[parameter.name] = parameter.nominal if number is None else number
    return {
        "type": plant.type,
        "parameters": values,
        "defaults": [name for name in nominal if name not in given],
    }


MOVE_KEYS = ("distance", "start", "target", "duration", "initial", "final_velocity")


def _move(table: Table, plant: Plant | None, faults: Faults) -> Table:
    """Turn ``distance`` into start and target."""
    for key in [key for key in table if key not in (*MOVE_KEYS, "shortest")]:
        faults.add(place("move", key), f"unknown key{suggestion(key, MOVE_KEYS)}")
        del table[key]
    axes = [axis.name for axis in plant.actuated] if plant else None
    start, target = table.pop("start", None), table.pop("target", None)
    end = "distance" if "distance" in table else "target"
    if end == "distance":
        if start is not None or target is not None:
            faults.add("move.distance", "state either distance, or start and target, not both")
        start, target = None, _per_axis(table.pop("distance"), axes, "move.distance", faults)
    elif target is not None:
        target = _per_axis(target, axes, "move.target", faults)
    else:
        if start is None:
            faults.add("move.distance", "required, but missing; state distance, or start and target")
        else:
            faults.add("move.target", "required beside start, but missing")
        start, target = None, [1.0] * len(axes or "1")
    axes = axes or [str(number) for number, _ in enumerate(target, start=1)]
    still = [0.0] * len(axes)
    start = _per_axis(still if start is None else start, axes, "move.start", faults)
    speed = _per_axis(table.pop("final_velocity", still), axes, "move.final_velocity", faults)
    initial = _initial(table.pop("initial", {}), plant, faults)
    if start == target and not any(speed) and not any(initial.values()):
        faults.add("move.distance", "must not be zero on every axis")
    if any(0.0 < abs(end - begin) < SHORTEST_MOVE for begin, end in zip(start, target, strict=True)):
        faults.add("move.distance", f"must be zero, or at least {SHORTEST_MOVE:g} m (or rad)")
    for key, values in (("start", start), (end, target)):
        for axis, value in zip(plant.actuated if plant else (), values, strict=False):
            if not axis.lower <= value <= axis.upper:
                cure = "; a distance begins at 0, so state start and target" * (key == "distance")
                faults.add(f"move.{key}", f"{axis.name} must be {_between(axis)}, found {value:g}{cure}")
    duration, shortest = _duration(table, faults)
    ends = {"start": start, "target": target, "initial": initial, "final_velocity": speed}
    return {**table, **duration, **ends, "shortest": shortest}


def _between(axis: Coordinate) -> str:
    """Say where an axis may be."""
    limits = {"at least": axis.lower, "at most": axis.upper}
    return " and ".join(f"{word} {at:g} {axis.unit}" for word, at in limits.items() if math.isfinite(at))


def _duration(table: Table, faults: Faults) -> tuple[Table, bool]:
    """Tell whether the duration is to be found; its place is then held by a number."""
    if "shortest" in table:
        faults.add("move.shortest", 'unknown key; write duration = "minimum"')
    duration = table.get("duration")
    if not isinstance(duration, str):
        return {}, False
    if duration != "minimum":
        near = "; did you mean 'minimum'?" * bool(meant(duration, ["minimum"]))
        faults.add(
            "move.duration", f'must be a number of seconds, or "minimum", found {found(duration)}{near}'
        )
    return {"duration": PLACEHOLDER_DURATION}, duration == "minimum"


def _initial(table: Any, plant: Plant | None, faults: Faults) -> Table:
    """Hold what swings at the start to the machine's coordinates, and to angles that a taut rope can have."""
    where = "move.initial"
    if not isinstance(table, Mapping):
        faults.add(where, f"must be a table such as {{ theta1 = 0.05 }}, found {found(table)}")
        return {}
    units = {q.name: q.unit for q in plant.unactuated} if plant else {}
    names = [*units, *(f"{name}.rate" for name in units)]
    values: dict[str, float] = {}
    for key, value in table.items():
        number = finite(value)
        if plant and key not in names:
            faults.add(place(where, key), f"unknown coordinate{suggestion(key, names)}")
        elif number is None:
            faults.add(place(where, key), f"must be a finite number, found {found(value)}")
        elif units.get(key) == "rad" and abs(number) > LARGEST_ANGLE:
            faults.add(place(where, key), f"must be from -{LARGEST_ANGLE:g} to {LARGEST_ANGLE:g} rad")
        else:
            values[key] = number
    return {name: values[name] for name in names if name in values} if plant else values


def _still_at_speed(move: Table, tables: Table, plant: Plant | None, faults: Faults) -> None:
    """Refuse to end at a speed at which the loads do not hang still, as on a turning jib."""
    if plant is None or not any(move["final_velocity"]):
        return
    named = SimpleNamespace(**tables["plant"]["parameters"])
    still = [0.0] * len(plant.unactuated)

    def pull(q_u: list[float], dq_a: list[float]) -> float:
        terms = plant.equations(q_u, still, move["target"], dq_a, named)
        return max(abs(float(k + g)) for k, g in zip(terms.K_u, terms.G_u, strict=True))

    swung = [SMALL_SWING for _ in still]
    if pull(still, move["final_velocity"]) > 1e-9 * pull(swung, [0.0] * len(plant.actuated)):
        faults.add("move.final_velocity", "the load does not hang still while the axes move so; end at rest")


def _per_axis(value: Any, axes: Sequence[str] | None, where: str, faults: Faults) -> list[float]:
    """One finite number per axis; a machine with one axis may leave the brackets out."""
    values = value if isinstance(value, list) else [value]
    if axes is not None and len(values) != len(axes):
        faults.add(where, f"must hold one number per axis ({', '.join(axes)}), found {len(values)}")
        return [1.0] * len(axes)
    numbers = [finite(item) for item in values]
    for item, number in zip(values, numbers, strict=True):
        if number is None:
            faults.add(where, f"must be a finite number, found {found(item)}")
    return [1.0 if number is None else number for number in numbers]


def _actuator(table: Table, faults: Faults) -> Table:
    lag = table.get("type") == "first-order"
    if lag and "tau" not in table:
        faults.add("actuator.tau", 'required with type = "first-order" (time constant in s)')
    if not lag and "tau" in table:
        faults.add("actuator.tau", 'only with type = "first-order"; remove it or set the type')
    return table


def _cost(table: Table, actuator: Table, faults: Faults) -> Table:
    if table.get("effort") == "reference" and actuator.get("type") != "first-order":
        faults.add(
            "cost.effort",
            '"reference" weighs the reference of a lagging drive (eq. 6); '
            'set actuator.type = "first-order" with tau, or choose "jerk" or "snap"',
        )
    return {key: value for key, value in table.items() if (key, value) != ("sway_scale", "auto")}


def _robustness(table: Table, parameters: Mapping[str, float] | None, faults: Faults) -> Table:
    """Put the uncertain parameters into the machine's order, so that the spec's order changes nothing."""
    where = "robustness.uncertain"
    uncertain = table.pop("uncertain", {})
    if not isinstance(uncertain, Mapping):
        faults.add(where, f"must be a table such as {{ L1 = 0.2 }}, found {found(uncertain)}")
        uncertain = {}
    if parameters is None:
        parameters = dict.fromkeys(uncertain, 1.0)
    for key in uncertain:
        if key not in parameters:
            faults.add(place(where, key), f"unknown parameter{suggestion(key, parameters)}")
        elif parameters[key] == 0.0:
            faults.add(place(where, key), "its value is 0, so a relative range is empty")
    if table.get("method") in ("sensitivity", "range") and not uncertain:
        faults.add(where, f'required with method = "{table["method"]}", such as {{ L1 = 0.2 }}')
    if table.get("nominal_zero") is True and table.get("method") != "range":
        faults.add("robustness.nominal_zero", 'only with method = "range"; elsewhere it is so anyway')
    if table.get("order") == 2 and table.get("method") == "range":
        faults.add("robustness.order", 'only with method = "sensitivity"')
    ordered = {name: uncertain[name] for name in parameters if name in uncertain}
    return {"method": "sensitivity" if uncertain else "none", **table, "uncertain": ordered}


def _limits(table: Table, move: Table, plant: Plant | None, faults: Faults) -> Table:
    """Give every axis its table where one has limits of its own, and hold limits against the move."""
    own = table.get("axis", {})
    if not isinstance(own, Mapping):
        faults.add("limits.axis", f"must be a table by axis, found {found(own)}")
        own = {}
    names = [axis.name for axis in plant.actuated] if plant else list(own)
    for key, value in own.items():
        if key not in names:
            faults.add(place("limits.axis", key), f"unknown axis{suggestion(key, names)}")
        elif not isinstance(value, Mapping):
            faults.add(place("limits.axis", key), f"must be a table, found {found(value)}")
    axes = {name: value if isinstance(value := own.get(name, {}), Mapping) else {} for name in names}
    stated = {*table, *(key for limits in axes.values() for key in limits)}
    if move["shortest"] and stated.isdisjoint({"velocity", "acceleration", "jerk"}):
        faults.add("move.duration", '"minimum" needs a limit: state limits.acceleration, or velocity or jerk')
    for column, name in enumerate(names if plant else ()):
        most = finite(axes[name].get("velocity", table.get("velocity")))
        if most is not None and abs(move["final_velocity"][column]) > max(most, 0.0):
            faults.add(
                "move.final_velocity", f"must keep limits.velocity ({most:g}), found {move['final_velocity']}"
            )
        where = f"limits.axis.{name}.travel" if "travel" in axes[name] else "limits.travel"
        travel = axes[name].get("travel", table.get("travel"))
        low, high = map(finite, travel) if isinstance(travel, list) and len(travel) == 2 else (None, None)
        if low is not None and high is not None:
            if low > high:
                faults.add(where, f"must be two rising numbers, such as {[high, low]}, found {travel}")
            for key in ("start", "target"):
                if not low <= move[key][column] <= high:
                    faults.add(where, f"must contain the move's {key}, found {travel}")
    return {**table, "axis": axes if own else {}}


def _axis(table: Table, plant: Plant | None, faults: Faults) -> Table:
    """Give every axis its table; a machine with one axis may leave its name out."""
    if plant is None:
        return {}
    names = [axis.name for axis in plant.actuated]
    if len(names) == 1:
        table = _named(names[0], table, faults)
    for key in table:
        if key not in names:
            faults.add(place("axis", key), f"unknown axis{suggestion(key, names)}")
    complete: Table = {}
    for axis in plant.actuated:
        given = table.get(axis.name, {})
        if not isinstance(given, Mapping):
            faults.add(f"axis.{axis.name}", f"must be a table, found {found(given)}")
            given = {}
        unit = given.get("unit")
        if isinstance(unit, str) and unit in UNITS and UNITS[unit][0] != axis.unit:
            faults.add(
                f"axis.{axis.name}.unit", f"{unit!r} does not measure an axis that moves in {axis.unit}"
            )
        complete[axis.name] = {"unit": axis.unit, **_feed_constant(given, f"axis.{axis.name}", faults)}
    return complete


def _named(axis: str, table: Table, faults: Faults) -> Table:
    """Put what stands there without a name into the table of the only axis."""
    bare = {key: value for key, value in table.items() if key != axis and not isinstance(value, Mapping)}
    own = table.get(axis, {})
    if not bare or not isinstance(own, Mapping):
        return table
    for key in bare.keys() & own.keys():
        faults.add(place("axis", key), f"stands in axis.{axis}, too; state one of them")
    return {**{key: value for key, value in table.items() if key not in bare}, axis: {**bare, **own}}


def _feed_constant(table: Mapping[str, Any], where: str, faults: Faults) -> Table:
    """Take counts and the metres that they make, as gears and encoders state them, for counts per metre."""
    pair = table.get("counts_per_metre")
    if not isinstance(pair, list | tuple):
        return dict(table)
    numbers = [finite(number) or 0.0 for number in pair]
    if len(numbers) != 2 or min(numbers) <= 0.0:
        problem = (
            "must be a number, or two: counts and the metres (or rad) that they make, such as [65536, 0.04]"
        )
        faults.add(f"{where}.counts_per_metre", problem)
        numbers = [1.0, 1.0]
    return {**table, "counts_per_metre": numbers[0] / numbers[1]}


def _check_columns(columns: Any, faults: Faults) -> None:
    """Hold a choice of columns to what can be played; their names are judged elsewhere."""
    where = "export.csv_columns"
    if columns is None:
        return
    if not isinstance(columns, list | tuple):
        faults.add(where, f'must be a list such as ["position", "velocity"], found {found(columns)}')
    elif len(set(map(str, columns))) != len(columns):
        faults.add(where, "names a column twice")
    elif not {"position", "velocity"} & set(map(str, columns)):
        faults.add(where, 'must hold "position" or "velocity": nothing else can be played')
