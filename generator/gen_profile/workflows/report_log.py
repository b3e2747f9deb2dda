"""A log of what the machine really did: a table with named columns.

::

    time_s;cart_position_mm;payload_sway_mm;hook_angle_deg
    0,000;0,0;0,2;0,01

Columns are called as those of the exported CSV: a position may leave its axis out where there is only one, a
sway or an angle its load where the end load is meant. Units stand behind the quantity, with an underscore, a
space or in brackets; without one an axis counts in its own unit, and everything else in SI units. Columns are
separated by semicolons, tabs or commas; where not by commas, a decimal comma is understood, too. Columns of
other names are left alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import attrs
import numpy as np

from gen_profile.errors import OutputError
from gen_profile.log_table import LogTable, decoded, read_table
from gen_profile.profile import Array, read_only
from gen_profile.spec import Spec
from gen_profile.units import COUNTS, UNITS

LEAST_SAMPLES = 16
MOST_BYTES = 200_000_000
_COLUMN = re.compile(
    r"(?:(?P<owner>\S.*?)[ _.])?(?P<quantity>time|position|sway|angle)"
    r"(?:[ _]?[\[(]?(?P<unit>s|ms|m|mm|um|rad|deg|counts)[\])]?)?",
    re.IGNORECASE,
)
_SI = {"sway": "m", "angle": "rad"}


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
    """

    source: str
    times: Array = attrs.field(converter=read_only)
    positions: Mapping[str, Array]
    sways: Mapping[str, Array]
    angles: Mapping[str, Array]
    ignored: tuple[str, ...] = ()


@attrs.frozen(kw_only=True)
class _Column:
    """What a column holds, and what its numbers are divided by."""

    quantity: str
    owner: str
    divisor: float


def read_log(path: Path, spec: Spec) -> MeasuredLog:
    """Read a log of a spec's machine.

    Raises
    ------
    OutputError
        The file cannot be read, or is no such table.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise OutputError(
                f"--measured {path}: more than {MOST_BYTES // 10**6} MB; cut the move out of it."
            )
        text = decoded(path.read_bytes())
    except OSError as error:
        raise OutputError(f"--measured: cannot read {path}: {error.strerror}.") from error
    return parse_log(text, path.name, spec)


def parse_log(text: str, source: str, spec: Spec) -> MeasuredLog:
    """Read a table's text.

    Parameters
    ----------
    text : str
    source : str
        Name of the file, for errors.
    spec : Spec

    Raises
    ------
    OutputError
        It is no such table.
    """
    table = read_table(text, f"--measured {source}")
    names = list(table.rows[0])
    columns = {name: _column(name, spec, source) for name in names}
    known = {name: column for name, column in columns.items() if column is not None}
    _require(known, names, spec, source)
    places = {name: names.index(name) for name in known}
    numbers = _numbers(table, places, source)
    signals = {
        (column.quantity, column.owner): numbers[:, place] / column.divisor
        for place, column in enumerate(known.values())
    }
    times = signals.pop(("time", ""))
    if len(times) < LEAST_SAMPLES:
        raise OutputError(f"--measured {source}: needs at least {LEAST_SAMPLES} samples, found {len(times)}.")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        raise OutputError(
            f"--measured {source}: the times must rise from row to row, and do not after "
            f"{times[back[0]]:.6g} s."
        )
    by_quantity: dict[str, dict[str, Array]] = {"position": {}, "sway": {}, "angle": {}}
    for (quantity, owner), values in signals.items():
        by_quantity[quantity][owner] = read_only(values)
    return MeasuredLog(
        source=source,
        times=times,
        positions=by_quantity["position"],
        sways=by_quantity["sway"],
        angles=by_quantity["angle"],
        ignored=tuple(name for name in names if name not in known),
    )


def _column(name: str, spec: Spec, source: str) -> _Column | None:
    """Tell what a column holds from its name; None where it is somebody else's."""
    found = _COLUMN.fullmatch(name)
    if found is None:
        return None
    owner, quantity, unit = found["owner"] or "", found["quantity"].lower(), (found["unit"] or "").lower()
    if quantity == "time":
        seconds = {"": 1.0, "s": 1.0, "ms": 1e3}
        return (
            _Column(quantity="time", owner="", divisor=seconds[unit])
            if unit in seconds and not owner
            else None
        )
    plant = spec.machine()
    if quantity == "position":
        owners = [axis.name for axis in plant.actuated]
        owner = owner or (owners[0] if len(owners) == 1 else "")
    else:
        owners = list(plant.loads)
        owner = owner or (owners[-1] if plant.directions == 1 else "")
    if owner not in owners:
        return None
    si = plant.actuated[owners.index(owner)].unit if quantity == "position" else _SI[quantity]
    divisor = _divisor(spec, owner if quantity == "position" else "", unit or "", si)
    if divisor is None:
        raise OutputError(f"--measured {source}: column {name!r} is in {unit}, which does not measure it.")
    return _Column(quantity=quantity, owner=owner, divisor=divisor)


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


def _require(known: Mapping[str, _Column], names: Sequence[str], spec: Spec, source: str) -> None:
    """Hold the columns to what a comparison needs: a time, and something that was measured, each once."""
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise OutputError(f"--measured {source}: two columns are called {twice!r}; rename one.")
    held = [(column.quantity, column.owner) for column in known.values()]
    for name, column in known.items():
        if held.count((column.quantity, column.owner)) > 1:
            raise OutputError(
                f"--measured {source}: column {name!r} is there twice, in two units; remove one."
            )
    plant = spec.machine()
    examples = f"{plant.actuated[0].name}_position, {plant.loads[-1]}_sway, {plant.loads[-1]}_angle"
    if ("time", "") not in held:
        raise OutputError(f"--measured {source}: there is no column time_s; found {', '.join(names)[:200]}.")
    if len(held) < 2:
        raise OutputError(
            f"--measured {source}: there is no column of this machine ({examples}, with units behind "
            f"such as _mm or _deg); found {', '.join(names)[:200]}."
        )


def _numbers(table: LogTable, places: Mapping[str, int], source: str) -> Array:
    values = np.empty((len(table.rows) - 1, len(places)))
    for row in range(1, len(table.rows)):
        for column, (name, place) in enumerate(places.items()):
            value = values[row - 1, column] = table.number(row, place)
            if math.isnan(value):
                held = table.cell(row, place)[:40]
                raise OutputError(
                    f"--measured {source}, row {row + 1}: {name} holds {held!r}, which is no number."
                )
    return values
