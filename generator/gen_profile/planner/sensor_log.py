"""Tables that people write for a planner block; a log of sensors, cycle by cycle what it is given of them."""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import SENSOR, BlockAxis
from gen_profile.support.errors import SpecError

TIME, VALUE = "time_s", "value"
Row = Mapping[str, Any]


def read_rows(text: str, what: str, required: Sequence[str]) -> tuple[list[str], Iterator[tuple[int, Row]]]:
    """Split a table whose lines end in any system's way.

    Parameters
    ----------
    text : str
    what : str
        It is, for errors.
    required : sequence of str
        Columns that it must have.

    Returns
    -------
    names : list of str
        Of its columns.
    rows : iterator of (int, mapping)
        Each one's last line in the file, and its cells as `csv.DictReader` gives them.

    Raises
    ------
    SpecError
        A column is missing, or there twice; while rows are taken, too: it is no table.
    """
    table = csv.DictReader(io.StringIO(text, newline=None), skipinitialspace=True)

    def rows() -> Iterator[tuple[int, Row]]:
        try:
            table.fieldnames = [name.strip() for name in table.fieldnames or ()]
            yield table.line_num, {}
            for row in table:
                yield table.line_num, row
        except csv.Error as error:
            raise SpecError(f"{what}, line {table.line_num + 1}: it is no table ({error}).") from error

    found = rows()
    next(found)  # the names
    names = list(table.fieldnames or ())
    if missing := [name for name in required if name not in names]:
        raise SpecError(
            f"{what}: there is no column {missing[0]}; the first line must name {', '.join(required)}, "
            "with commas between."
        )
    if twice := [name for name in names if names.count(name) > 1]:
        raise SpecError(f"{what}: two columns are called {twice[0]!r}.")
    return names, found


@attrs.frozen(kw_only=True, eq=False)
class SensorLog:
    """What sensors showed, and when the controller got it.

    Attributes
    ----------
    axes : sequence of BlockAxis
        Along which they measure.
    times, values : (samples,) and (samples, axes) arrays
        s, rising, and in the sensor's unit. A value holds until the next; after the last there is no news.
    """

    axes: Sequence[BlockAxis]
    times: Array
    values: Array

    def cycles(self, cycle: float) -> int:
        """Count the cycles, of so many seconds, until there is no more news."""
        return math.ceil(float(self.times[-1]) / cycle - 1e-9) + 1

    def given(self, rows: Array, inputs: Mapping[str, float], first: int, cycle: float) -> Array:
        """Put what is known in some cycles, from the first one on, into rows of a block's inputs."""
        times = (np.arange(first, first + len(rows)) + 1e-9) * cycle
        sample = np.searchsorted(self.times, times, side="right") - 1
        rows_read, names = rows.copy(), list(inputs)
        for axis, shown in zip(self.axes, self.values.T, strict=True):
            value, valid = (names.index(axis.of(name)) for name in SENSOR[:2])
            rows_read[:, value] = shown[np.maximum(sample, 0)]
            rows_read[:, valid] = (sample >= 0) & (times < self.times[-1] + cycle)
        return rows_read


def read_sensor_log(text: str, axes: Sequence[BlockAxis]) -> SensorLog:
    """Read a log for a block with a sensor along these axes.

    Parameters
    ----------
    text : str
        CSV with the columns ``time_s, value``; of several axes one value each: ``value_x``.
    axes : sequence of BlockAxis

    Raises
    ------
    SpecError
        With the line and the cure; or there is no axis.
    """
    if not axes:
        raise SpecError("sensor: the block has none; state planner.sensor in the spec that it is written of.")
    columns = [TIME, *(axis.of(VALUE) for axis in axes)]
    _, rows = read_rows(text, "sensor", columns)
    readings = []
    for line, row in rows:
        try:
            readings.append([float(row[name] or "") for name in columns])
        except ValueError:
            raise SpecError(f"sensor, line {line}: {' and '.join(columns)} must be numbers.") from None
        if not (readings[-2][0] if readings[1:] else 0.0) <= readings[-1][0] < math.inf:
            raise SpecError(f"sensor, line {line}: time_s must rise from 0 or later on; sort the rows.")
    if not readings:
        raise SpecError(f"sensor: there is no row; write one such as 0.0{',0.01' * len(axes)}.")
    times, *values = np.array(readings).T
    return SensorLog(axes=axes, times=times, values=np.stack(values, axis=1))
