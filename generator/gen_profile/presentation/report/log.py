"""A log of what the machine really did: a table with named columns.

::

    time_s;cart_position_mm;payload_sway_mm;hook_angle_deg
    0,000;0,0;0,2;0,01

Columns are called as those of the exported CSV or of a stream's log, in one of some languages: a position
may leave its axis out where there is one only, a sway or an angle its load where the end load is meant. Units
stand behind the quantity, with an underscore, a space, in brackets, or in the row below; without one an axis
counts in its own unit, and everything else in SI units. Columns are separated by semicolons, tabs or commas;
where not by commas, a decimal comma is understood, too. Columns of other names are left alone.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import attrs

from gen_profile.motion.profile import Array, read_only
from gen_profile.spec.model import Spec
from gen_profile.studies.identification.log_clock import TIME_UNITS
from gen_profile.studies.identification.log_columns import read_columns, require_samples
from gen_profile.studies.identification.log_table import SPELLINGS, LogTable, read_table, read_text
from gen_profile.studies.identification.measurements import SI_UNITS, require_angle
from gen_profile.support.errors import OutputError
from gen_profile.support.units import COUNTS, UNITS
from gen_profile_exporters.modulo import unwrapped

# what loggers in some countries write, `gen-profile stream --log` among them: in English, German, French,
# Italian and Spanish; the longest first: a part of one could be taken for another
WORDS = {
    **dict.fromkeys(
        ("position_actual", "actual_position", "istposition", "position", "posizione"), "position"
    ),
    **dict.fromkeys(("posición", "actual", "weg"), "position"),
    **dict.fromkeys(("time", "zeit", "temps", "tempo", "tiempo"), "time"),
    **dict.fromkeys(("sway", "auslenkung", "oscillation", "oscillazione", "oscilación"), "sway"),
    **dict.fromkeys(("angle", "winkel", "angolo", "ángulo"), "angle"),
}
_COLUMN = re.compile(
    r"(?:(?P<owner>\S.*?)[ _.])?(?P<quantity>" + "|".join(WORDS) + r")"
    rf"(?:[ _]?[\[(]?(?P<unit>s|ms|us|ns|m|mm|um|rad|deg|counts|{'|'.join(SPELLINGS)})[\])]?)?",
    re.IGNORECASE,
)
# only where a person says so: in a file's own names a number may be a sensor's
_COUNTED = re.compile(r"(?P<meaning>.+_)(?P<step>[0-9]*\.?[0-9]+) ?(?P<unit>[a-z]+)", re.IGNORECASE)


@attrs.frozen(kw_only=True, eq=False)
class MeasuredLog:
    """Signals of a machine, sampled at the same times.

    Attributes
    ----------
    source : str
        Name of the file.
    times : (samples,) array
        s, rising.
    positions, sways, angles : mapping of str to (samples,) array
        By axis or load, in m (or rad).
    ignored : tuple of str
        Columns of other names.
    notes : tuple of str
        What was repaired as it was read.
    """

    source: str
    times: Array = attrs.field(converter=read_only)
    positions: Mapping[str, Array]
    sways: Mapping[str, Array]
    angles: Mapping[str, Array]
    ignored: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@attrs.frozen(kw_only=True)
class _Column:
    """What a column holds, and what its numbers are divided by; None for times whose unit is not stated."""

    quantity: str
    owner: str
    divisor: float | None


def read_log(path: Path, spec: Spec, columns: str | None = None) -> MeasuredLog:
    """Read a log of a spec's machine.

    Parameters
    ----------
    path : Path
    spec : Spec
    columns : str, optional
        Which column holds what, as in ``time_ms=Zeit,payload_sway_mm=4``; by their names by default. A
        number before a unit is the size of one count, ``hook_angle_0.09deg``.

    Raises
    ------
    OutputError
        The file cannot be read, or is no such table.
    """
    return parse_log(read_text(path, "measured"), path.name, spec, columns)


def parse_log(text: str, source: str, spec: Spec, columns: str | None = None) -> MeasuredLog:
    """Read a table's text.

    Parameters
    ----------
    text : str
    source : str
        Name of the file, for errors.
    spec : Spec
    columns : str, optional
        See `read_log`.

    Raises
    ------
    OutputError
        It is no such table.
    """
    where = f"measured {source}"
    table = read_table(text, where)
    head, known = _known_columns(table, spec, where, columns)
    known.sort(key=lambda pair: pair[1].quantity != "time")
    places = [place for place, _ in known]
    read = read_columns(table, head, places, known[0][1].divisor)
    times = read.times
    signals = {
        (column.quantity, column.owner): values / (column.divisor or 1.0)
        for (_, column), values in zip(known[1:], read.values.T, strict=True)
    }
    require_samples(where, len(times), read.notes)
    by_quantity: dict[str, dict[str, Array]] = {"position": {}, "sway": {}, "angle": {}}
    for (quantity, owner), values in signals.items():
        if quantity == "angle":
            require_angle(values)
        by_quantity[quantity][owner] = read_only(
            _continuous(values, owner, spec) if quantity == "position" else values
        )
    return MeasuredLog(
        source=source,
        times=times,
        positions=by_quantity["position"],
        sways=by_quantity["sway"],
        angles=by_quantity["angle"],
        notes=read.notes,
        ignored=tuple(name for place, name in enumerate(table.rows[head]) if place not in places),
    )


def _known_columns(
    table: LogTable, spec: Spec, where: str, columns: str | None
) -> tuple[int, list[tuple[int, _Column]]]:
    """Find the row of names, and the places of columns of this machine with what they hold."""
    if columns is None:
        head = _head(table, ())
        names = list(table.rows[head])
        titles = {name: _with_unit(table, head, place) for place, name in enumerate(names)}
        by_name = {name: _column(title, spec, where) for name, title in titles.items()}
        known = {name: column for name, column in by_name.items() if column is not None}
        places = [names.index(name) for name in known]
    else:
        chosen = _chosen(columns)
        head, names = _head(table, chosen.values()), list(chosen)
        known = {meaning: _required(meaning, spec, where) for meaning in chosen}
    _require(known, names, spec, where)
    if columns is not None:
        places = [table.place(head, column) for column in chosen.values()]
        known = {
            meaning: _required(_in_stated_unit(meaning, table.unit(head, place), where), spec, where)
            for meaning, place in zip(chosen, places, strict=True)
        }
    return head, list(zip(places, known.values(), strict=True))


def _in_stated_unit(meaning: str, unit: str, where: str) -> str:
    """Put the unit that a column's name states behind what it is chosen for, where that tells none."""
    match = _COLUMN.fullmatch(meaning)
    if match is None or match["unit"] or not unit:
        return meaning
    if not _COLUMN.fullmatch(f"time_{unit}"):
        template = (
            "{where}: the column of {meaning} is in {unit}, which measures no {quantity}; choose "
            "another one, or say the unit behind the meaning if the name is wrong."
        )
        raise OutputError(template, where=where, meaning=meaning, unit=unit, quantity=match["quantity"])
    return f"{meaning}_{unit}"


def column_meanings(text: str, source: str, spec: Spec) -> list[tuple[str, str]]:
    """List the columns of a table: their names, and what they hold as far as their names tell.

    Parameters
    ----------
    text, source, spec
        See `parse_log`.

    Returns
    -------
    list of (str, str)
        Such as ``("Last [mm]", "payload_sway_mm")``; the second is empty where a name tells nothing.

    Raises
    ------
    OutputError
        It is no table.
    """
    where = f"measured {source}"
    table = read_table(text, where)
    head = _head(table, ())
    return [
        (name if table.is_head(head) else "", _meaning(_with_unit(table, head, place), spec, where))
        for place, name in enumerate(table.rows[head])
    ]


def _meaning(name: str, spec: Spec, where: str) -> str:
    """Write what a column holds in the words of `read_log`."""
    try:
        match, column = _COLUMN.fullmatch(name), _column(name, spec, where)
    except OutputError:  # in a unit of something else, which `parse_log` tells
        return ""
    if match is None or column is None:
        return ""
    return "_".join(filter(None, (column.owner, column.quantity, _unit(match))))


def _chosen(columns: str) -> dict[str, str]:
    """Read ``time_ms=Zeit,payload_sway_mm=4``: what is meant, and the column that holds it."""
    pairs = [part.partition("=") for part in columns.split(",")]
    if not all(meaning.strip() and column.strip() for meaning, _, column in pairs):
        template = (
            "columns {columns!r}: write MEANING=COLUMN for each, such as time_ms=Zeit,payload_sway_mm=4."
        )
        raise OutputError(template, columns=columns)
    return {meaning.strip(): column.strip() for meaning, _, column in pairs}


def _required(meaning: str, spec: Spec, where: str) -> _Column:
    counted = _COUNTED.fullmatch(meaning)
    plain = counted["meaning"] + counted["unit"] if counted else meaning
    column, step = _column(plain, spec, where), float(counted["step"]) if counted else 1.0
    if column is None or step == 0.0:
        plant = spec.machine()
        template = (
            "columns: {meaning!r} is no quantity of this machine; write time_s, {axis}_position, "
            "{load}_sway or {load}_angle, with a unit behind such as _mm or _deg."
        )
        raise OutputError(template, meaning=meaning, axis=plant.actuated[0].name, load=plant.loads[-1])
    return attrs.evolve(column, divisor=(column.divisor or 1.0) / step)


def _head(table: LogTable, chosen: Collection[str]) -> int:
    """Find the row of names, chosen or known ones, below what a logger wrote above it."""
    if chosen:
        return table.head(chosen)
    for row, cells in enumerate(table.rows):
        if sum(_COLUMN.fullmatch(cell) is not None for cell in cells) > 1:
            return row
        if row > 0 and table.is_head(row - 1) and not table.is_head(row):
            break
    return 0


def _with_unit(table: LogTable, head: int, place: int) -> str:
    """Read a column's name, with the unit that stands in the row below behind it, where the name has none."""
    name, unit = table.cell(head, place), table.cell(head + 1, place).strip("[]() ")
    match = _COLUMN.fullmatch(name)
    if match is None or match["unit"] or not _COLUMN.fullmatch(f"time_{unit}"):
        return name
    return f"{name}_{unit}"


def _unit(match: re.Match[str]) -> str:
    """Call the unit of a column's name as it is called here; empty where there is none."""
    unit = (match["unit"] or "").lower()
    return SPELLINGS.get(unit, unit)


def _column(name: str, spec: Spec, where: str) -> _Column | None:
    """Tell what a column holds from its name; None where it is of none here."""
    match = _COLUMN.fullmatch(name)
    if match is None:
        return None
    owner, unit = match["owner"] or "", _unit(match)
    quantity = WORDS[match["quantity"].lower()]
    if quantity == "time":
        known = unit in ("", *TIME_UNITS) and not owner
        return _Column(quantity="time", owner="", divisor=TIME_UNITS.get(unit)) if known else None
    plant = spec.machine()
    if quantity == "position":
        owners = [axis.name for axis in plant.actuated]
        owner = owner or (owners[0] if len(owners) == 1 else "")
    else:
        owners = list(plant.loads)
        owner = owner or (owners[-1] if plant.directions == 1 else "")
    if owner not in owners:
        return None
    si = plant.actuated[owners.index(owner)].unit if quantity == "position" else SI_UNITS[quantity]
    divisor = _divisor(spec, owner if quantity == "position" else "", unit or "", si)
    if divisor is None:
        template = "{where}: column {name!r} is in {unit}, which does not measure it."
        raise OutputError(template, where=where, name=name, unit=unit)
    return _Column(quantity=quantity, owner=owner, divisor=divisor)


def _continuous(position: Array, axis: str, spec: Spec) -> Array:
    """Unwrap a modulo axis, from as near as can be to where the move starts."""
    number, scale = next((k, scale) for k, scale in enumerate(spec.axis_scales()) if scale.name == axis)
    if scale.modulo is None:
        return position
    return unwrapped(position, scale.modulo / abs(scale.factor), float(spec.move.start[number]))


def _divisor(spec: Spec, axis: str, unit: str, si: str) -> float | None:
    """Find how many of a column's unit make one SI unit; negative where the axis counts the other way."""
    sign = 1.0
    if axis:
        scale = next(scale for scale in spec.axis_scales() if scale.name == axis)
        if unit in ("", scale.unit):
            return scale.factor
        if unit == COUNTS:
            return scale.counts_per_si
        sign = math.copysign(1.0, scale.factor)
    if not unit:
        return 1.0
    if unit not in UNITS or UNITS[unit][0] != si:
        return None
    return sign * UNITS[unit][1]


def _require(known: Mapping[str, _Column], names: Sequence[str], spec: Spec, where: str) -> None:
    """Hold the columns to what a comparison needs: a time, and something that was measured, each once."""
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise OutputError("{where}: two columns are called {twice!r}; rename one.", where=where, twice=twice)
    held = [(column.quantity, column.owner) for column in known.values()]
    for name, column in known.items():
        if held.count((column.quantity, column.owner)) > 1:
            raise OutputError(
                "{where}: column {name!r} is there twice, in two units; remove one.", where=where, name=name
            )
    plant = spec.machine()
    examples = f"{plant.actuated[0].name}_position, {plant.loads[-1]}_sway, {plant.loads[-1]}_angle"
    if ("time", "") not in held:
        template = (
            "{where}: there is no column time_s (or time_ms); found {names}; name the column of "
            "times, as columns time_s=1 does."
        )
        raise OutputError(template, where=where, names=", ".join(names)[:200])
    if len(held) < 2:
        template = (
            "{where}: there is no column of this machine ({examples}, with units behind such as "
            "_mm or _deg); found {names}."
        )
        raise OutputError(template, where=where, examples=examples, names=", ".join(names)[:200])
