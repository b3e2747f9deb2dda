"""Table of comma-separated values (RFC 4180): one line per cycle, with all derivatives.

::

    time_s,position_mm,velocity_mm_per_s,acceleration_mm_per_s2,jerk_mm_per_s3
    0.000,0.0,0.0,0.0,0.0
    0.001,1.5e-05,…

Units are the axis's own; where there are several axes, each column begins with the axis's name. Times are
exact decimals and other numbers the shortest text that reads back to the same double (at most 17 digits).
Positions of an axis that counts in ``counts`` are whole numbers: the absolute position rounded half to even.
The text is UTF-8 without byte-order mark, its lines end in a line feed.

Reading takes what editors and spreadsheets do to such a file (byte-order mark, quotes, carriage returns,
blank lines at the end, columns in another order) and refuses what changes its meaning.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from decimal import Decimal

import numpy as np

from gen_profile.errors import ExportError
from gen_profile.profile import Array, Profile, SampledProfile, grid_times
from gen_profile.units import AXIS_UNITS, COUNTS, AxisScale
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.setpoints import (
    AxisTable,
    axis_table,
    is_count,
    motion_of,
    plausible_cycle_time,
    sampled,
)

TIME = "time_s"
# quantity → what follows the axis unit in its column's name
QUANTITIES = {"position": "", "velocity": "_per_s", "acceleration": "_per_s2", "jerk": "_per_s3"}
GRID_TOLERANCE = 1e-9  # relative, of a time

_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the motion, sampled at the target's cycle time.

    Raises
    ------
    ExportError
        A position does not fit the axis's counts, or there are too many samples.
    """
    motion = sampled(profile, target, target.cycle_time, "export.cycle_time")
    table = axis_table(motion, target.axes)
    columns = [_time_texts(len(table.position), target.cycle_time)]
    for number, axis in enumerate(target.axes):
        for quantity in QUANTITIES:
            values = getattr(table, quantity)[:, number].tolist()
            whole = quantity == "position" and axis.unit == COUNTS
            columns.append(
                [str(int(value)) for value in values] if whole else [repr(value) for value in values]
            )
    lines = [",".join(_header(target.axes)), *map(",".join, zip(*columns, strict=True))]
    return (File(filename=f"{target.name}.csv", content=("\n".join(lines) + "\n").encode("utf-8")),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Read the table; the cycle time is the one its times show.

    Raises
    ------
    ExportError
        The text is no such table, was cut off, or is in other units than the target's.
    """
    rows = _rows(_text(content))
    first = next(rows, None)
    if first is None:
        raise ExportError("The CSV file is empty; export it again.")
    order = _column_order(first[1], target.axes)
    numbered = list(rows)
    while numbered and not any(cell.strip() for cell in numbered[-1][1]):
        numbered.pop()
    if len(numbered) < 2:
        raise ExportError(
            f"The CSV file holds {len(numbered)} samples, a motion needs 2 or more; export it again."
        )
    lines = [line for line, _ in numbered]
    values = np.array([_numbers(line, cells, first[1]) for line, cells in numbered])[:, order]
    cycle_time = _cycle_time(values[:, 0], lines)
    by_axis = values[:, 1:].reshape(len(values), len(target.axes), len(QUANTITIES))
    position, velocity, acceleration, jerk = np.moveaxis(by_axis, 2, 0)
    _check_counts(position, target.axes, lines)
    table = AxisTable(
        cycle_time=cycle_time, position=position, velocity=velocity, acceleration=acceleration, jerk=jerk
    )
    return motion_of(table, target.axes)


def _header(axes: Sequence[AxisScale]) -> list[str]:
    return [
        TIME,
        *(_column(axis, quantity, axis.unit, len(axes)) for axis in axes for quantity in QUANTITIES),
    ]


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


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and cells."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        raise ExportError(
            f"line {reader.line_num}: not comma-separated values ({error}); export it again."
        ) from error


def _column_order(found: Sequence[str], axes: Sequence[AxisScale]) -> list[int]:
    """Where each expected column stands; the header must hold exactly those."""
    names = [name.strip() for name in found]
    expected = _header(axes)
    if len(names) == 1 and len(re.split(r"[;\t]", names[0])) > 1:
        raise ExportError(
            "line 1: columns are separated by semicolons or tabs, not commas: a spreadsheet rewrote it; "
            "export it again and do not save it from the spreadsheet."
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
        raise ExportError(f"line 1: column {missing[0]} is missing; export the table again.")
    extra = [name for name in names if name not in expected]
    if extra or len(names) != len(expected):
        raise ExportError(f"line 1: {_unexpected(names, extra)}; remove it or export the table again.")
    return [names.index(name) for name in expected]


def _unexpected(names: Sequence[str], extra: Sequence[str]) -> str:
    if extra:
        return f"column {extra[0]!r} is not one of this target's"
    return f"column {next(name for name in names if names.count(name) > 1)} stands there twice"


def _numbers(line: int, cells: Sequence[str], header: Sequence[str]) -> list[float]:
    if len(cells) != len(header):
        raise ExportError(
            f"line {line}: {len(cells)} cells instead of {len(header)}; the file was damaged or rewritten "
            "with decimal commas, export it again."
        )
    numbers = [float(cell) if _NUMBER.fullmatch(cell) else math.nan for cell in cells]
    for number, cell, name in zip(numbers, cells, header, strict=True):
        if not math.isfinite(number):
            raise ExportError(
                f"line {line}: {name.strip()} holds {cell[:40]!r}, which is no finite number; "
                "export the table again."
            )
    return numbers


def _cycle_time(times: Array, lines: Sequence[int]) -> float:
    """Step of the times, which must rise from 0 in equal steps."""
    if times[0] != 0.0:
        raise ExportError(f"line {lines[0]}: times must rise from 0 in equal steps; export the table again.")
    step = plausible_cycle_time(float(times[1]), lines[1])
    grid = grid_times(len(times) - 1, step)
    wrong = np.flatnonzero(np.abs(times - grid) > GRID_TOLERANCE * grid)
    if wrong.size:
        row = int(wrong[0])
        raise ExportError(
            f"line {lines[row]}: time {times[row]:.15g} s stands where {grid[row]:.15g} s is due: "
            "a line is missing or times were edited; export the table again."
        )
    return step


def _check_counts(position: Array, axes: Sequence[AxisScale], lines: Sequence[int]) -> None:
    for column, axis in enumerate(axes):
        values = position[:, column]
        wrong = np.flatnonzero(~is_count(values)) if axis.unit == COUNTS else ()
        for row in map(int, wrong):
            raise ExportError(
                f"line {lines[row]}: axis {axis.name}: {values[row]:.15g} is no whole 32-bit count; "
                "export the table again."
            )
