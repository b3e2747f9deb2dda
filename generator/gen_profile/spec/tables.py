"""From what a person writes to the classes of `gen_profile.spec.model`.

Here stands how things may be stated, and whatever the machine fills in: its parameters, axes and loads.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import attrs

from gen_profile.plants.machine_file import MachineFile, plant_of_file, read_machine_file
from gen_profile.plants.plant import Coordinate, Parameter, Plant
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.spec.can import read_data_sheet
from gen_profile.spec.external_fmu import KEYS as FMU_KEYS
from gen_profile.spec.external_fmu import external_fmu
from gen_profile.spec.model import (
    RESIDUAL_SHARE,
    AxisSpec,
    CheckSpec,
    DurationBounds,
    MoveSpec,
    PlantSpec,
    Spec,
    Sway,
)
from gen_profile.spec.rules import broken_rules
from gen_profile.spec.stacks import StacksSpec, stacks_of
from gen_profile.spec.structure import MISFIT, Faults, Structurer, kinds_of, place
from gen_profile.spec.values import NONE, Bounds, Distance, Duration, Positive, Rising, Words, between
from gen_profile.support.errors import SpecError
from gen_profile.support.phrase import Phrase
from gen_profile.support.private_folder import agree
from gen_profile.support.suggestion import found, listed, meant, suggestion

Table = dict[str, Any]

TABLES = tuple(name for name in kinds_of(Spec) if name != "name")
REQUIRED = ("plant", "move")
FILE_KEYS = ("file", "file_sha256")
MOVE_KEYS = ("distance", "start", "target", "duration", "free", "initial", "final_velocity")
CHECK_KEYS = [*(name for name in kinds_of(CheckSpec) if name not in ("foreign", "default")), *FMU_KEYS]
PLACEHOLDER_DURATION = 1.0  # s, until the shortest duration is found
COUNTS_AND_METRES = Annotated[
    tuple[Positive, Positive],
    Words("must be a number, or two: counts and the metres (or rad) that they make, such as [65536, 0.04]"),
]


def structure(document: Mapping[str, Any], folder: Path) -> Spec:
    """Make a spec of what its tables state.

    Without a known machine, names of parameters, axes and loads cannot be judged; everything else is.

    Parameters
    ----------
    document : mapping
        Nested plain values.
    folder : Path
        What files that the spec names are relative to.

    Raises
    ------
    SpecError
        With all faults.
    """
    faults = Faults()
    for key in REQUIRED:
        if key not in document:
            faults.add(key, "the spec must state [{key}]; a real machine has no default here", key=key)
    plain = Structurer(faults)
    written = {key: dict(plain.fit(document.get(key, {}), Mapping, key, NONE)) for key in TABLES}
    file, plant = _machine(written["plant"], folder, faults)
    _drives_file(written["can"], folder, faults)
    _misplaced(document, plant, faults)
    structurer = Structurer(faults, _names(plant) if plant else NONE)
    move = _move(written["move"], plant, structurer)
    if written["robustness"].get("uncertain"):
        written["robustness"].setdefault("method", "sensitivity")
    if written["cost"].get("sway_scale") == "auto":
        del written["cost"]["sway_scale"]
    if plant:
        _by_axis(written["limits"], written["can"], plant)
    typed = {
        "plant": _plant(written["plant"], file, plant, structurer),
        "move": move,
        "check": _check(written["check"], move, plant, folder, structurer),
        "axis": _axis(written["axis"], plant, structurer),
    }
    if "path" in document:
        stated = stacks_of(written["path"], folder, structurer)
        typed["path"] = structurer.fit(stated, StacksSpec, "path", None)
    else:
        del written["path"]
    spec: Spec = structurer.fit({**document, **written, **typed}, Spec, "")
    for fault in broken_rules(spec, plant):
        faults.add(*fault)
    faults.raise_any()
    return spec


def _misplaced(document: Mapping[str, Any], plant: Plant | None, faults: Faults) -> None:
    """Tell where a key belongs that stands in another table, or in none."""
    parameters = plant.nominal() if plant else {}
    keys: dict[str, Collection[str]] = {
        "plant": ["type", *FILE_KEYS, *parameters],
        "move": MOVE_KEYS,
        "check": CHECK_KEYS,
        "path": [*kinds_of(StacksSpec), "profile", "file"],
    }
    kinds = kinds_of(Spec).items()
    keys |= {name: kinds_of(kind) for name, kind in kinds if attrs.has(kind) and name not in keys}
    inner = {name: document[name] for name in keys if isinstance(document.get(name), Mapping)}
    for table, content in {"": document, **inner}.items():
        for key in content:
            homes = [f"{name}.{key}" for name, own in keys.items() if key in own]
            if key in parameters and table in ("robustness", "check"):
                homes = [f"{table}.uncertain.{key}"]
            if homes and key not in (keys[table] if table else ("name", *TABLES)):
                faults.add(place(table, key), "unknown key; did you mean {names}?", names=listed(homes))


def _machine(table: Table, folder: Path, faults: Faults) -> tuple[MachineFile | None, Plant | None]:
    """Find the machine, in the file that the user wrote or by its type."""
    type_, name, sha256 = (table.get(key) for key in ("type", *FILE_KEYS))
    if table.keys().isdisjoint(FILE_KEYS):
        try:
            if isinstance(type_, str):
                return None, find_plant(type_)
            hint = suggestion("", plant_types())
            faults.add(
                "plant.type", "must name a machine, found {found}{hint}", found=found(type_), hint=hint
            )
        except KeyError:
            name, hint = repr(str(type_)[:60]), suggestion(str(type_), plant_types())
            faults.add("plant.type", "unknown machine {name}{hint}", name=name, hint=hint)
    elif not isinstance(name, str):
        faults.add("plant.file", "must name a Python file, found {found}", found=found(name))
    elif not isinstance(sha256, str | None):
        faults.add("plant.file_sha256", "must be text, found {found}", found=found(sha256))
    else:
        try:
            file = read_machine_file(folder / name, sha256)
            agree(file.sha256)
            plant = plant_of_file(file)
        except SpecError as error:
            faults.add("plant.file", str(error).removeprefix("plant.file: ").removesuffix("."))
            return None, None
        if table.get("type", plant.type) != plant.type:
            template = "{name} holds a machine of type {type}, found {found}"
            faults.add("plant.type", template, name=file.name, type=repr(plant.type), found=found(type_))
        return file, plant
    return None, None


def _drives_file(table: Table, folder: Path, faults: Faults) -> None:
    """Put the file that ``can.eds`` names in the place of its name."""
    name, sha256 = table.pop("eds", None), table.pop("eds_sha256", None)
    if name is None and sha256 is None:
        return
    if not isinstance(name, str):
        faults.add("can.eds", "must name an EDS or DCF, such as drive.eds, found {found}", found=found(name))
        return
    if not isinstance(sha256, str | None):
        faults.add("can.eds_sha256", "must be text, found {found}", found=found(sha256))
        return
    try:
        table["eds"] = sheet = read_data_sheet(folder / name)
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", error)
        faults.add("can.eds", "{path} cannot be read ({problem})", path=folder / name, problem=problem)
        return
    if sha256 not in {None, sheet.sha256}:
        faults.add("can.eds", "{path} is another file than was exported for", path=folder / name)


def _names(plant: Plant) -> dict[str, dict[str, Any]]:
    """List the names that a spec may state something of, and what, where that depends on the machine."""
    swing = [q.name for q in plant.unactuated]
    live: tuple[Parameter | Coordinate, ...] = (*plant.parameters, *plant.actuated[1:])
    return {
        "axis": dict.fromkeys(axis.name for axis in plant.actuated),
        "load": dict.fromkeys(plant.loads),
        "coordinate": dict.fromkeys([*swing, *(f"{name}.rate" for name in swing)]),
        "parameter": dict.fromkeys(plant.nominal()),
        "span": {p.name: _span_within(p) for p in plant.parameters},
        "rate": dict.fromkeys(known.name for known in live),
        "live": {known.name: _live_within(known) for known in live},
    }


def _span_within(parameter: Parameter) -> Any:
    """Say what the ends of a parameter's range may be."""
    low, high = parameter.lower, parameter.upper
    end = Annotated[float, Bounds(least=low, most=high)]
    template = "must be two rising numbers from {low:g} to {high:g} {unit}"
    words = Words(template, low=low, high=high, unit=parameter.unit)
    return Annotated[tuple[end, end], Rising(), words]


def _live_within(known: Parameter | Coordinate) -> Any:
    """Say what the ends of a range at run time may be; a rule judges by how little the first is too small."""
    low = Annotated[float, Bounds(least=min(0.0, known.lower))]
    high = Annotated[float, Bounds(above=known.lower, most=known.upper)]
    template = "must be two rising numbers from {low:g} to {high:g}, found {found}"
    words = Words(template, low=known.lower, high=known.upper)
    return Annotated[tuple[low, high], Rising(strict=True), words]


def _plant(table: Table, file: MachineFile | None, plant: Plant | None, structurer: Structurer) -> PlantSpec:
    """Complete the parameters with the type's nominal values."""
    if plant is None:
        return PlantSpec(type="")
    stated = {key: one for key, one in table.items() if key not in FILE_KEYS}
    given = structurer.known(stated, ["type", *plant.nominal()], "plant")
    values = {}
    for parameter in plant.parameters:
        name, value = parameter.name, given.get(parameter.name, parameter.nominal)
        bounds = Bounds(least=parameter.lower, most=parameter.upper)
        kind = Annotated[float, bounds, _bounds_in_words(parameter, value)]
        values[name] = structurer.fit(value, kind, f"plant.{name}", parameter.nominal)
    defaults = tuple(name for name in values if name not in given)
    return PlantSpec(type=plant.type, file=file, parameters=values, defaults=defaults)


def _bounds_in_words(parameter: Parameter, value: Any) -> Words:
    """Say what a parameter may be, and of a length in mm, or a mass in g, what it is in SI units."""
    low, high, unit = parameter.lower, parameter.upper, parameter.unit
    if unit in {"m", "kg"} and type(value) in {int, float} and high < value <= 1e3 * high:
        template = (
            "must be a number from {low:g} to {high:g} {unit}, found {found}; did you mean {meant:.4g}?"
        )
        return Words(template, low=low, high=high, unit=unit, meant=value / 1e3)
    template = "must be a number from {low:g} to {high:g} {unit}, found {found}"
    return Words(template, low=low, high=high, unit=unit)


def _move(table: Table, plant: Plant | None, structurer: Structurer) -> MoveSpec:
    """Turn ``distance`` into start and target, and say where the axes may be."""
    faults = structurer.faults
    if "shortest" in table:
        faults.add("move.shortest", 'unknown key; write duration = "minimum"')
    table = structurer.known(table, MOVE_KEYS, "move")
    axes = [axis.name for axis in plant.actuated] if plant else None
    start, target, end = table.get("start"), table.get("target"), "target"
    if "distance" in table:
        if start is not None or target is not None:
            faults.add("move.distance", "state either distance, or start and target, not both")
        start, target, end = None, table["distance"], "distance"
    elif target is None:
        if start is None:
            faults.add("move.distance", "required, but missing; state distance, or start and target")
        else:
            faults.add("move.target", "required beside start, but missing")
        start, target = None, [1.0] * len(axes or "1")
    target = _per_axis(target, axes, f"move.{end}", 1.0, structurer)
    axes = axes or [str(number) for number, _ in enumerate(target, start=1)]
    still = [0.0] * len(axes)
    start = _per_axis(still if start is None else start, axes, "move.start", 0.0, structurer)
    for key, values in (("start", start), (end, target)):
        for axis, value in zip(plant.actuated if plant else (), values, strict=False):
            if not axis.lower <= value <= axis.upper:
                cure = "; a distance begins at 0, so state start and target" * (key == "distance")
                template = "{name} must be {form}, found {found:g}{cure}"
                form = between({"at least": axis.lower, "at most": axis.upper}, axis.unit)
                faults.add(f"move.{key}", template, name=axis.name, form=form, found=value, cure=cure)
    kinds, speeds = kinds_of(MoveSpec), table.get("final_velocity", still)
    return MoveSpec(
        start=start,
        target=target,
        free=structurer.fit(table.get("free", []), kinds["free"], "move.free", ()),
        initial=structurer.fit(table.get("initial", {}), kinds["initial"], "move.initial", {}),
        final_velocity=_per_axis(speeds, axes, "move.final_velocity", 0.0, structurer),
        **_duration(table, structurer),
    )


def _duration(table: Table, structurer: Structurer) -> Table:
    """Tell whether the duration is to be found; its place is then held by a number."""
    duration, shortest, bounds = table.get("duration"), False, DurationBounds()
    if "duration" not in table:
        structurer.faults.add("move.duration", "required, but missing")
    elif isinstance(duration, str):
        shortest = duration == "minimum"
        near = Phrase("; did you mean {names}?", names="'minimum'") if meant(duration, ["minimum"]) else ""
        template = 'must be a number of seconds, or "minimum", found {found}{near}'
        if not shortest:
            structurer.faults.add("move.duration", template, found=found(duration), near=near)
        duration = PLACEHOLDER_DURATION
    elif isinstance(duration, Mapping):
        kinds, shortest = kinds_of(DurationBounds), True
        stated = structurer.known(dict(duration), tuple(kinds), "move.duration")
        values = {
            key: structurer.fit(one, kinds[key], f"move.duration.{key}", None) for key, one in stated.items()
        }
        bounds, duration = DurationBounds(**values), PLACEHOLDER_DURATION
    number = structurer.fit(duration, Duration, "move.duration", PLACEHOLDER_DURATION)
    return {"duration": number, "shortest": shortest, "bounds": bounds}


def _per_axis(
    value: Any, axes: Sequence[str] | None, where: str, otherwise: float, structurer: Structurer
) -> tuple[float, ...]:
    """One finite number per axis; a machine with one axis may leave the brackets out."""
    values = value if isinstance(value, list | tuple) else [value]
    harmless = (otherwise,) * len(axes or values)
    if axes is not None and len(values) != len(axes):
        template = "must hold one number per axis ({axes}), such as {example}, found {found}"
        numbers = [one for one in values if isinstance(one, int | float)]
        example = [*numbers, *[0] * len(axes)][: len(axes)]
        stated = len(values) if values is value else found(value)
        structurer.faults.add(where, template, axes=", ".join(axes), example=example, found=stated)
        return harmless
    numbers = [structurer.fit(one, float, where) for one in values]
    if MISFIT in numbers:
        return harmless
    where = where.replace("distance", "target")  # from 0, that is what a distance is
    return tuple(structurer.fit(numbers, tuple[Distance, ...], where, harmless))


def _by_axis(limits: Table, can: Table, plant: Plant) -> None:
    """Give every axis its limits where one has its own, and the only axis the serial number."""
    names, own, serial = [axis.name for axis in plant.actuated], limits.get("axis"), can.get("serial")
    if own and isinstance(own, Mapping):
        limits["axis"] = {**{name: {} for name in names}, **own}
    if len(names) == 1 and isinstance(serial, int):
        can["serial"] = {names[0]: serial}


def _check(table: Table, move: MoveSpec, plant: Plant | None, folder: Path, structurer: Structurer) -> Table:
    """Give every load its limit, and take the keys of an external FMU together."""
    table = structurer.known(table, CHECK_KEYS, "check")
    given = table.pop("residual_sway", None)
    foreign = external_fmu(table, plant, folder, structurer)
    limits = _residual_sway(given, move, plant, structurer)
    return {**table, "residual_sway": limits, "default": given is None, "foreign": foreign}


def _residual_sway(
    given: Any, move: MoveSpec, plant: Plant | None, structurer: Structurer
) -> Mapping[str, float]:
    """Read a limit of all loads, or of some: the end load's is then the others' default."""
    where, kind = "check.residual_sway", kinds_of(CheckSpec)["residual_sway"]
    if given is not None and not isinstance(given, Mapping):
        limit = structurer.fit(given, Sway, where, 1.0)
        return dict.fromkeys(plant.loads if plant else (), limit)
    stated: Mapping[str, float] = structurer.fit(given or {}, kind, where, NONE)
    if plant is None:
        return stated
    longest = move.longest(plant)
    idle = move.start == move.target and move.stops and not move.initial
    if given is None and longest == 0.0 and not idle:
        structurer.faults.add(where, "required where no axis moves in m; state what may remain, in m")
    rest = stated.get(plant.loads[-1], RESIDUAL_SHARE * (longest or 1.0))
    return {load: stated.get(load, rest) for load in plant.loads}


def _axis(table: Table, plant: Plant | None, structurer: Structurer) -> Table:
    """Give every axis its table; a machine with one axis may leave its name out."""
    if plant is None:
        return {}
    if len(plant.actuated) == 1:
        table = _named(plant.actuated[0].name, table, structurer.faults)
    else:
        table = _of_several([axis.name for axis in plant.actuated], table, structurer.faults)
    table = {**{axis.name: {} for axis in plant.actuated}, **table}
    for axis in plant.actuated:
        given = table[axis.name]
        if isinstance(given, Mapping):
            table[axis.name] = {"unit": axis.unit, **_feed_constant(given, f"axis.{axis.name}", structurer)}
    return table


def _named(axis: str, table: Table, faults: Faults) -> Table:
    """Put what stands there without a name into the table of the only axis."""
    bare = {key: value for key, value in table.items() if key != axis and not isinstance(value, Mapping)}
    own = table.get(axis, {})
    if not bare or not isinstance(own, Mapping):
        return table
    for key in sorted(bare.keys() & own.keys()):
        faults.add(place("axis", key), "stands in axis.{axis}, too; state one of them", axis=axis)
    return {**{key: value for key, value in table.items() if key not in bare}, axis: {**bare, **own}}


def _of_several(axes: Sequence[str], table: Table, faults: Faults) -> Table:
    """Refuse what stands there without a name, as it would be of which axis."""
    bare = table.keys() & {*kinds_of(AxisSpec)} - {*axes}
    for key in sorted(bare):
        places = ", ".join(place(place("axis", axis), key) for axis in axes)
        faults.add(place("axis", key), "state it of each axis: {places}", places=places)
    return {key: value for key, value in table.items() if key not in bare}


def _feed_constant(table: Mapping[str, Any], where: str, structurer: Structurer) -> Table:
    """Take counts and the metres that they make, as gears and encoders state them, for counts per metre."""
    pair = table.get("counts_per_metre")
    if not isinstance(pair, list | tuple):
        return dict(table)
    counts, metres = structurer.fit(pair, COUNTS_AND_METRES, f"{where}.counts_per_metre", (1.0, 1.0))
    return {**table, "counts_per_metre": counts / metres}
