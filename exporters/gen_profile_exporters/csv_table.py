"""Table of comma-separated values: one line per cycle.

::

    time_s,position_mm,velocity_mm_per_s,acceleration_mm_per_s2,jerk_mm_per_s3
    0.000,0.0,0.0,0.0,0.0
    0.001,1.5e-05,…

Units are the axis's own; where there are several axes, each column begins with the axis's name. Times are
exact decimals and other numbers the shortest text that reads back to the same double (at most 17 digits).
Positions of an axis that counts in ``counts`` are whole numbers: the absolute position rounded half to even.
The text is UTF-8 without byte-order mark. Separators and line ends are those of the dialect (`csv_dialects`).

``export.csv_columns`` chooses the columns. Velocity without position is for speed-controlled drives: they are
taken to interpolate linearly between the setpoints, so the replayed position is the trapezoidal sum.

Reading takes what editors and spreadsheets do to such a file (byte-order mark, quotes, carriage returns,
blank lines at the end, columns in another order) and refuses what changes its meaning.
"""

import math
import re
from collections.abc import Sequence
from decimal import Decimal
from itertools import product

import numpy as np

from gen_profile.motion.profile import Array, Profile, SampledProfile, grid_times
from gen_profile.support.errors import ExportError
from gen_profile.support.units import AXIS_UNITS, COUNTS, AxisScale, require_one_way
from gen_profile_exporters import csv_dialects, setpoints
from gen_profile_exporters.csv_dialects import DIALECTS, CsvDialect, Row
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.modulo import least, require_short_steps, turn_counts, unwrapped, wrapped

TIME = "time_s"
# quantity → what follows the axis unit in its column's name
QUANTITIES = {"position": "", "velocity": "_per_s", "acceleration": "_per_s2", "jerk": "_per_s3"}
GRID_TOLERANCE = 1e-9  # relative, of a time

GREATEST = 1e100  # of any cell: its differences over a cycle squared must stay finite
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the motion, sampled at the target's cycle time.

    Raises
    ------
    ExportError
        A position does not fit the axis's counts, there are too many samples, or the dialect holds fewer axes
        or quantities.
    """
    dialect = _dialect(target)
    motion = setpoints.sampled(profile, target, target.cycle_time, "export.cycle_time", dialect.most)
    if len(motion.position) < dialect.least:
        raise ExportError(
            f"export.csv_dialect: {target.export.csv_dialect} needs {dialect.least} points or more, the "
            f"motion has {len(motion.position)}; lower export.cycle_time."
        )
    table = setpoints.axis_table(motion, target.axes)
    for number, axis in enumerate(target.axes):
        if axis.modulo is not None:
            if axis.unit == COUNTS:
                turn_counts(axis)  # whole ones, as places within it are written as such
            require_short_steps(table.position[:, number], axis.modulo, axis, target.cycle_time)
            table.position[:, number] = wrapped(table.position[:, number], axis.modulo)
    columns = [_time_texts(len(table.position), target.cycle_time)]
    for number, axis in enumerate(target.axes):
        for quantity in target.export.csv_columns:
            values = getattr(table, quantity)[:, number].tolist()
            whole = quantity == "position" and axis.unit == COUNTS
            columns.append(
                [str(int(value)) for value in values] if whole else [repr(value) for value in values]
            )
    text = csv_dialects.write(dialect, _header(target), columns)
    return (File(f"{target.name}.csv", text.encode("utf-8")),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Read the table; the cycle time is the one its times show.

    Raises
    ------
    ExportError
        The text is no such table, was cut off, or is in other units or another dialect than the target's.
    """
    dialect = _dialect(target)
    text = _text(content)
    rows = csv_dialects.read(dialect, text)
    if not rows:
        raise ExportError("The CSV file is empty; export it again.")
    header = rows.pop(0)[1] if dialect.header else _header(target)
    order = _column_order(header, target)
    if len(rows) < 2:
        raise ExportError(
            f"The CSV file holds {len(rows)} samples, a motion needs 2 or more; export it again."
        )
    return _motion(rows, header, order, target)


def _motion(
    rows: Sequence[Row], header: Sequence[str], order: Sequence[int], target: Target
) -> SampledProfile:
    lines = [line for line, _ in rows]
    values = np.array([_numbers(line, cells, header) for line, cells in rows])[:, order]
    cycle_time = _cycle_time(values[:, 0], lines)
    by_axis = values[:, 1:].reshape(len(values), len(target.axes), len(target.export.csv_columns))
    columns = dict(zip(target.export.csv_columns, np.moveaxis(by_axis, 2, 0), strict=True))
    factor = np.array([axis.factor for axis in target.axes])
    if "position" in columns:
        _check_counts(columns["position"], target.axes, lines)
        columns["position"] = _continuous(columns["position"], target, lines)
    else:
        columns["position"] = _integrated(
            columns["velocity"], cycle_time, setpoints.in_axis_units(np.array(target.start), factor)
        )
    return setpoints.motion_of(setpoints.AxisTable(cycle_time=cycle_time, **columns), target.axes)


def _continuous(position: Array, target: Target, lines: Sequence[int]) -> Array:
    """Unwrap the positions of a modulo axis."""
    position = position.copy()
    for number, (axis, start) in enumerate(zip(target.axes, target.start, strict=True)):
        turn, places = axis.modulo, position[:, number]
        if turn is None:
            continue
        for row in map(int, np.flatnonzero(wrapped(places, turn) != places)):
            end = least(turn) + turn
            outside = f"{places[row]:.15g} lies outside {least(turn):g} to {end:g} (axis.modulo)"
            raise _altered(lines[row], f"axis {axis.name}: {outside}")
        position[:, number] = unwrapped(places, turn, start * axis.factor)
    return position


def _integrated(velocity: Array, cycle_time: float, start: Array) -> Array:
    """Positions of a drive that interpolates linearly between velocities."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = 0.5 * cycle_time * (velocity[1:] + velocity[:-1])
        return np.concatenate([start[None], start + np.cumsum(steps, axis=0)])


def _dialect(target: Target) -> CsvDialect:
    dialect = DIALECTS[target.export.csv_dialect]
    if not dialect.header and (len(target.axes) > 1 or len(target.export.csv_columns) > 1):
        raise ExportError(
            f"export.csv_dialect: {target.export.csv_dialect} holds one quantity of one axis; set "
            'export.csv_columns = ["position"], and take another dialect for '
            "several axes."
        )
    for axis in () if dialect.header else target.axes:
        what = f"a cam of export.csv_dialect = {target.export.csv_dialect} is interpolated through its ends"
        require_one_way(axis, what, "take another dialect, or leave axis.modulo out")
    return dialect


def _header(target: Target) -> list[str]:
    axes = target.axes
    by_axis = product(axes, target.export.csv_columns)
    return [TIME, *(_column(axis, quantity, axis.unit, len(axes)) for axis, quantity in by_axis)]


def _column(axis: AxisScale, quantity: str, unit: str, axes: int) -> str:
    prefix = "" if axes == 1 else f"{axis.name}_"
    return f"{prefix}{quantity}_{unit}{QUANTITIES[quantity]}"


def _time_texts(samples: int, cycle_time: float) -> list[str]:
    cycle = Decimal(repr(cycle_time))
    return [format(k * cycle, "f") for k in range(samples)]


def _text(content: bytes) -> str:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ExportError(
            f"The CSV file is not UTF-8 text (byte {error.start}); save it as UTF-8 or export it again."
        ) from error
    if text and not text.endswith(("\n", "\r")):
        line = len(text.splitlines())
        raise ExportError(
            f"line {line}: the CSV file breaks off without a line end; copy it whole or export it again."
        )
    return text


def _column_order(heads: Sequence[str], target: Target) -> list[int]:
    """Where each expected column stands; the header must hold exactly those."""
    names = [name.strip() for name in heads]
    axes, expected = target.axes, _header(target)
    if len(names) == 1 and len(re.split(r"[;\t]", names[0])) > 1:
        raise ExportError(
            "line 1: columns are separated by semicolons or tabs, not commas: a spreadsheet rewrote it, or "
            "it is of another export.csv_dialect; export it again and do not save it from the spreadsheet."
        )
    for axis in axes:
        for quantity in QUANTITIES:
            for unit in AXIS_UNITS:
                other = _column(axis, quantity, unit, len(axes))
                if unit != axis.unit and other in names:
                    raise ExportError(
                        f"line 1: column {other} is in {unit}, but axis {axis.name} counts in {axis.unit}; "
                        "check it against the spec that it was exported with, or export it again."
                    )
    missing = [name for name in expected if name not in names]
    if missing:
        raise ExportError(
            f"line 1: column {missing[0]} is missing; export the table again, or name in export.csv_columns "
            "what it holds."
        )
    extra = [name for name in names if name not in expected]
    if extra or len(names) != len(expected):
        raise ExportError(f"line 1: {_unexpected(names, extra)}; remove it or export the table again.")
    return [names.index(name) for name in expected]


def _unexpected(names: Sequence[str], extra: Sequence[str]) -> str:
    if extra:
        return f"column {extra[0]!r} is not one of this target's"
    return f"column {next(name for name in names if names.count(name) > 1)} appears twice"


def _numbers(line: int, cells: Sequence[str], header: Sequence[str]) -> list[float]:
    if len(cells) != len(header):
        raise ExportError(
            f"line {line}: {len(cells)} cells instead of {len(header)}; the file was damaged or rewritten "
            "with decimal commas, export it again."
        )
    numbers = [float(cell) if _NUMBER.fullmatch(cell) else math.nan for cell in cells]
    for number, cell, name in zip(numbers, cells, header, strict=True):
        if not abs(number) <= GREATEST:
            wrong = f"{cell[:40]!r}, which is no finite number of a motion"
            raise _altered(line, f"{name.strip()} holds {wrong}")
    return numbers


def _cycle_time(times: Array, lines: Sequence[int]) -> float:
    """Step of the times, which must rise from 0 in equal steps."""
    if times[0] != 0.0:
        raise _altered(lines[0], "times must rise from 0 in equal steps")
    step = setpoints.plausible_cycle_time(float(times[1]), lines[1])
    grid = grid_times(len(times) - 1, step)
    wrong = np.flatnonzero(np.abs(times - grid) > GRID_TOLERANCE * grid)
    if wrong.size:
        row = int(wrong[0])
        place = f"time {times[row]:.15g} s stands where {grid[row]:.15g} s is due"
        raise _altered(lines[row], f"{place}: a line is missing or times were edited")
    return step


def _check_counts(position: Array, axes: Sequence[AxisScale], lines: Sequence[int]) -> None:
    for column, axis in enumerate(axes):
        values = position[:, column]
        wrong = np.flatnonzero(~setpoints.is_count(values)) if axis.unit == COUNTS else ()
        for row in map(int, wrong):
            raise _altered(lines[row], f"axis {axis.name}: {values[row]:.15g} is no whole 32-bit count")


def _altered(line: int, what: str) -> ExportError:
    """Say what is wrong in a line of a table."""
    return ExportError(f"line {line}: {what}; export the table again.")
