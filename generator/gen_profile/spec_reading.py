"""From TOML text, presets and ``KEY=VALUE`` overrides to a `Spec`, with every fault of the text in one error."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import attrs
from cattrs import Converter
from cattrs.errors import ClassValidationError, ForbiddenExtraKeysError, IterableValidationError

from gen_profile import spec as s
from gen_profile.errors import OutputError, SpecError
from gen_profile.plants.plant import Plant
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.suggestion import suggestion
from gen_profile.units import UNITS

Table = dict[str, Any]


def read_spec(path: Path, overrides: Sequence[str] = ()) -> s.Spec:
    """Read a TOML file.

    Raises
    ------
    OutputError
        The file cannot be read.
    SpecError
        The text is no TOML, or its content has faults: all of them are listed.
    """
    try:
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        raise OutputError(f"Cannot read the spec {path}: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise SpecError(f"{path}: not UTF-8 text (byte {error.start}); save the spec as UTF-8.") from error
    return parse_spec(text, overrides, str(path))


def parse_spec(text: str, overrides: Sequence[str] = (), source: str = "spec") -> s.Spec:
    """Read TOML text, apply overrides such as ``plant.L1=0.5`` and validate the whole."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{source}: not valid TOML: {error}.") from error
    if not document and not overrides:
        raise SpecError(f"{source}: the spec is empty; it must state at least [plant] type and [move].")
    for override in overrides:
        _override(document, override)
    return spec_from_dict(document)


def presets() -> dict[str, str]:
    """Every preset's name with its summary (the first comment line of its TOML file), sorted."""
    folder = files("gen_profile") / "presets"
    texts = {item.name.removesuffix(".toml"): item.read_text("utf-8") for item in folder.iterdir()}
    return {name: text.partition("\n")[0].lstrip("# ") for name, text in sorted(texts.items())}


def preset_spec(name: str, overrides: Sequence[str] = ()) -> s.Spec:
    """Read a preset by name."""
    if name not in presets():
        raise SpecError(f"--preset: unknown preset {name!r}{suggestion(name, presets())}.")
    return parse_spec((files("gen_profile") / "presets" / f"{name}.toml").read_text("utf-8"), overrides, name)


def spec_from_dict(document: Mapping[str, Any]) -> s.Spec:
    """Validate nested plain values, as TOML or a manifest holds them.

    Raises
    ------
    SpecError
        With one sentence for every fault found.
    """
    faults: list[str] = []
    tables = _with_defaults(document, faults)
    plant = _plant_of(tables["plant"], faults)
    if plant is not None:
        tables["plant"] = _plant_table(tables["plant"], plant, faults)
        tables["axis"] = _axis_table(tables["axis"], plant, faults)
        _check_uncertain(tables, plant, faults)
    else:
        tables["plant"], tables["axis"] = {"type": "", "parameters": {}}, {}
    tables["move"] = _move_table(tables["move"], plant, faults)
    tables["check"] = _check_table(tables["check"], tables["move"], plant, faults)
    _refine_choices(tables, faults)
    spec: s.Spec | None = None
    try:
        spec = _CONVERTER.structure(tables, s.Spec)
    except ClassValidationError as error:
        faults.extend(fault for fault in _sentences(error, "") if not _said(fault, faults))
    if spec is None or faults:
        raise SpecError(*sorted(set(faults), key=faults.index))
    return spec


# ── from what a person writes to the tables that mirror the classes ──────────────────────────────────────────


_TABLES = ("plant", "move", "actuator", "robustness", "cost", "limits", "check", "axis", "export", "can")


def _with_defaults(document: Mapping[str, Any], faults: list[str]) -> Table:
    """Give the document every table; a table that is none becomes a fault and an empty one."""
    tables: Table = {"name": "profile", **{table: {} for table in _TABLES}}
    for key in ("plant", "move"):
        if key not in document:
            faults.append(f"{key}: the spec must state [{key}]; a real machine has no default here.")
    for key, value in document.items():
        if key in _TABLES and not isinstance(value, Mapping):
            faults.append(f"{key}: must be a table, found {_found(value)}.")
        else:
            tables[key] = dict(value) if isinstance(value, Mapping) else value
    if tables["cost"].get("sway_scale") == "auto":
        del tables["cost"]["sway_scale"]
    if tables["robustness"].get("uncertain") and "method" not in tables["robustness"]:
        tables["robustness"]["method"] = "sensitivity"
    return tables


def _plant_of(table: Table, faults: list[str]) -> Plant | None:
    type_ = table.get("type")
    if not isinstance(type_, str):
        if table:
            faults.append(f"plant.type: must name a machine, found {_found(type_)}{suggestion('', plant_types())}.")
        return None
    try:
        return find_plant(type_)
    except KeyError:
        faults.append(f"plant.type: unknown machine {type_!r}{suggestion(type_, plant_types())}.")
        return None


def _plant_table(table: Table, plant: Plant, faults: list[str]) -> Table:
    """Complete the parameters with the type's nominal values and hold them to its bounds."""
    values = plant.nominal()
    for key, value in table.items():
        if key == "type":
            continue
        if key not in values:
            faults.append(f"plant.{key}: unknown key{suggestion(key, ['type', *values])}.")
        elif (number := _number(value)) is None:
            faults.append(f"plant.{key}: must be a finite number, found {_found(value)}.")
        else:
            values[key] = number
    for parameter in plant.parameters:
        value = values[parameter.name]
        if not parameter.lower <= value <= parameter.upper:
            faults.append(
                f"plant.{parameter.name}: must lie between {parameter.lower:g} and {parameter.upper:g} "
                f"{parameter.unit}, found {value:g}."
            )
    defaults = tuple(name for name in values if name not in table)
    return {"type": plant.type, "parameters": values, "defaults": defaults}


def _axis_table(table: Table, plant: Plant, faults: list[str]) -> Table:
    """Give every axis its table; a machine with one axis may leave its name out."""
    names = [axis.name for axis in plant.actuated]
    if len(names) == 1 and names[0] not in table:
        table = {names[0]: table}
    faults.extend(f"axis.{key}: unknown key{suggestion(key, names)}." for key in table if key not in names)
    complete: Table = {}
    for axis in plant.actuated:
        given = table.get(axis.name, {})
        if not isinstance(given, Mapping):
            faults.append(f"axis.{axis.name}: must be a table, found {_found(given)}.")
            given = {}
        unit = given.get("unit", axis.unit)
        if isinstance(unit, str) and unit in UNITS and UNITS[unit][0] != axis.unit:
            faults.append(f"axis.unit: {unit!r} does not measure axis {axis.name!r}, which moves in {axis.unit}.")
        complete[axis.name] = {"unit": axis.unit, **given}
    return complete


def _move_table(table: Table, plant: Plant | None, faults: list[str]) -> Table:
    """Turn ``distance`` into start and target."""
    axes = len(plant.actuated) if plant else 1
    table = dict(table)
    if table.get("duration") == "minimum":
        faults.append('move.duration: "minimum" is not supported yet; state the duration in s.')
        table["duration"] = 1.0
    if "distance" in table:
        if "start" in table or "target" in table:
            faults.append("move.distance: state either distance, or start and target, not both.")
        distance = _per_axis(table.pop("distance"), axes, "move.distance", faults)
        table |= {"start": [0.0] * axes, "target": distance}
    elif "target" in table:
        table["start"] = _per_axis(table.get("start", 0.0), axes, "move.start", faults)
        table["target"] = _per_axis(table["target"], axes, "move.target", faults)
    elif table:
        faults.append("move.distance: required; state distance, or start and target.")
        table |= {"start": [0.0] * axes, "target": [1.0] * axes}
    if table and table.get("start") == table.get("target"):
        faults.append("move.distance: must not be zero on every axis.")
    return table or {"start": [0.0] * axes, "target": [1.0] * axes, "duration": 1.0}


def _per_axis(value: Any, axes: int, path: str, faults: list[str]) -> list[float]:
    values = value if isinstance(value, list) else [value] * axes
    numbers = [_number(item) for item in values]
    if None in numbers:
        faults.append(f"{path}: must be a finite number, found {_found(values[numbers.index(None)])}.")
        return [1.0] * axes
    if len(numbers) != axes:
        faults.append(f"{path}: must hold one number per axis ({axes}), found {len(numbers)}.")
        return [1.0] * axes
    return [number for number in numbers if number is not None]


def _check_table(table: Table, move: Table, plant: Plant | None, faults: list[str]) -> Table:
    """Give every load its limit: one number holds for all, a table names loads."""
    longest = max(abs(b - a) for a, b in zip(move["start"], move["target"], strict=True))
    loads = plant.loads if plant else ()
    table = dict(table)
    given = table.pop("residual_sway", None)
    default = given is None
    if default:
        given = s.RESIDUAL_SHARE * longest if longest else 1.0
    if isinstance(given, Mapping):
        faults.extend(
            f"check.residual_sway.{key}: unknown load{suggestion(key, loads)}." for key in given if key not in loads
        )
        end = given.get(loads[-1] if loads else "", s.RESIDUAL_SHARE * longest)
        limits = {load: given.get(load, end) for load in loads}
    else:
        limits = dict.fromkeys(loads, given)
        if (number := _number(given)) is None or number <= 0.0:
            faults.append(f"check.residual_sway: must be a finite number greater than 0, found {_found(given)}.")
            limits = {}
    return {**table, "residual_sway": limits, "default": default}


def _check_uncertain(tables: Table, plant: Plant, faults: list[str]) -> None:
    uncertain = tables["robustness"].get("uncertain", {})
    if not isinstance(uncertain, Mapping):
        faults.append(f"robustness.uncertain: must be a table such as {{ L1 = 0.2 }}, found {_found(uncertain)}.")
        tables["robustness"]["uncertain"] = {}
        return
    values = tables["plant"]["parameters"]
    for key in uncertain:
        if key not in values:
            faults.append(f"robustness.uncertain.{key}: unknown parameter{suggestion(key, values)}.")
        elif values[key] == 0.0:
            faults.append(f"robustness.uncertain.{key}: its nominal value is 0, so a relative range is empty.")


def _refine_choices(tables: Table, faults: list[str]) -> None:
    """Rules that tie several keys together."""
    actuator, robustness, cost = tables["actuator"], tables["robustness"], tables["cost"]
    lag = actuator.get("type", "ideal") == "first-order"
    if lag and "tau" not in actuator:
        faults.append('actuator.tau: required with type = "first-order" (time constant in s).')
    if not lag and "tau" in actuator:
        faults.append('actuator.tau: only with type = "first-order"; remove it or set the type.')
    if cost.get("effort") == "reference" and not lag:
        faults.append(
            'cost.effort: "reference" weighs the reference of a lagging drive (eq. 6); '
            'set actuator.type = "first-order" with tau, or choose "jerk" or "snap".'
        )
    if robustness.get("method") == "sensitivity" and not robustness.get("uncertain"):
        faults.append('robustness.uncertain: required with method = "sensitivity", such as { L1 = 0.2 }.')


def _override(document: Table, override: str) -> None:
    """Set a dotted key; the value is TOML where it parses as TOML, else text."""
    key, equals, text = override.partition("=")
    path = [part.strip() for part in key.split(".")]
    if not equals or not all(path):
        raise SpecError(f"--set {override}: write KEY=VALUE, such as --set plant.L1=0.5.")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    table = document
    for depth, part in enumerate(path[:-1]):
        inner = table.setdefault(part, {})
        if not isinstance(inner, dict):
            raise SpecError(f"--set {override}: {'.'.join(path[: depth + 1])} is a value, not a table.")
        table = inner
    if path == ["move", "distance"]:
        table.pop("start", None)
        table.pop("target", None)
    elif path in (["move", "start"], ["move", "target"]):
        table.pop("distance", None)
    table[path[-1]] = value


# ── plain values to typed ones ───────────────────────────────────────────────────────────────────────────────


def _number(value: Any) -> float | None:
    """A finite float, or None; booleans and texts are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _structure_float(value: Any, _: type) -> float:
    number = _number(value)
    if number is None:
        raise ValueError(f"must be a finite number, found {_found(value)}")
    return number


def _structure_int(value: Any, _: type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"must be a whole number, found {_found(value)}")
    return value


def _structure_str(value: Any, _: type) -> str:
    if not isinstance(value, str):
        raise ValueError(f"must be text, found {_found(value)}")
    return value


def _structure_choice(value: Any, annotation: Any) -> Any:
    allowed = get_args(annotation)
    for choice in allowed:
        if type(choice) is type(value) and choice == value:
            return choice
    words = [str(choice) for choice in allowed]
    hint = suggestion(value, words) if isinstance(value, str) else f" (known: {', '.join(words)})"
    raise ValueError(f"unknown value {_found(value)}{hint}")


def _constrained(annotation: Any) -> Callable[[Any, Any], Any]:
    base, *constraints = get_args(annotation)

    def structure(value: Any, _: Any) -> Any:
        typed = _CONVERTER.structure(value, base)
        for constraint in constraints:
            _enforce(typed, constraint)
        return typed

    return structure


def _enforce(value: Any, constraint: s.Bounds | s.Pattern) -> None:
    if isinstance(constraint, s.Pattern):
        if not re.fullmatch(constraint.expression, value):
            raise ValueError(f"must be {constraint.meaning}, found {_found(value)}")
    elif not (value > constraint.above and constraint.least <= value <= constraint.most):
        words = [
            f"greater than {constraint.above:g}" if math.isfinite(constraint.above) else "",
            f"at least {constraint.least:g}" if math.isfinite(constraint.least) else "",
            f"at most {constraint.most:g}" if math.isfinite(constraint.most) else "",
        ]
        raise ValueError(f"must be {' and '.join(filter(None, words))}, found {value:g}")


def _converter() -> Converter:
    converter = Converter(forbid_extra_keys=True, detailed_validation=True)
    converter.register_structure_hook(float, _structure_float)
    converter.register_structure_hook(int, _structure_int)
    converter.register_structure_hook(bool, lambda value, _: value)
    converter.register_structure_hook(str, _structure_str)
    converter.register_structure_hook_func(lambda a: get_origin(a) is Literal, _structure_choice)
    converter.register_structure_hook_factory(lambda a: get_origin(a) is Annotated, _constrained)
    return converter


_CONVERTER = _converter()


# ── errors to sentences ──────────────────────────────────────────────────────────────────────────────────────


def _sentences(error: BaseException, path: str) -> list[str]:
    """One sentence per leaf of cattrs' tree of errors, each with its spec path."""
    if isinstance(error, ClassValidationError | IterableValidationError):
        with_notes, others = error.group_exceptions()
        sentences = [
            sentence
            for leaf, note in with_notes
            for sentence in _sentences(leaf, _join(path, getattr(note, "name", None), getattr(note, "index", None)))
        ]
        return sentences + [sentence for leaf in others for sentence in _sentences(leaf, path)]
    if isinstance(error, ForbiddenExtraKeysError):
        known = [field.name for field in attrs.fields(error.cl)]
        return [
            f"{_join(path, key)}: unknown key{suggestion(key, known)}." for key in sorted(map(str, error.extra_fields))
        ]
    if isinstance(error, KeyError):
        return [f"{path}: required, but missing."]
    return [f"{path}: {error}."]


def _join(path: str, name: object = None, index: object = None) -> str:
    step = name if name is not None else index
    return f"{path}.{step}".lstrip(".") if step is not None else path


def _said(fault: str, faults: list[str]) -> bool:
    """Whether the tables' own rules already named a fault of the same place."""
    return fault.partition(":")[0] in {known.partition(":")[0] for known in faults}


def _found(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return f"text {value[:60]!r}"
    return f"{value!r}"[:60]
