"""A log of a sensor, cycle by cycle what a planner block is given of it."""

import csv
import io
import math
from collections.abc import Mapping
from itertools import pairwise

import attrs
import numpy as np

from gen_profile.errors import SpecError
from gen_profile.planner.chebyshev import Array
from gen_profile.planner.interface import SENSOR

COLUMNS = ("time_s", "value")


@attrs.frozen(kw_only=True, eq=False)
class SensorLog:
    """What a sensor showed, and when the controller got it.

    Attributes
    ----------
    times, values : (samples,) arrays
        s, rising, and in the sensor's unit. A value holds until the next; after the last there is no news.
    """

    times: Array
    values: Array

    def cycles(self, cycle: float) -> int:
        """Count the cycles, of so many seconds, until there is no more news."""
        return math.ceil(float(self.times[-1]) / cycle - 1e-9) + 1

    def given(self, rows: Array, inputs: Mapping[str, float], first: int, cycle: float) -> Array:
        """Put what is known in some cycles, from the first one on, into rows of a block's inputs."""
        times = (np.arange(first, first + len(rows)) + 1e-9) * cycle
        sample = np.searchsorted(self.times, times, side="right") - 1
        value, valid = (list(inputs).index(name) for name in SENSOR[:2])
        rows_read = rows.copy()
        rows_read[:, value] = self.values[np.maximum(sample, 0)]
        rows_read[:, valid] = (sample >= 0) & (times < self.times[-1] + cycle)
        return rows_read


def read_sensor_log(text: str, inputs: Mapping[str, float]) -> SensorLog:
    """Read a log for a block of these inputs.

    Parameters
    ----------
    text : str
        CSV with the columns ``time_s, value``.
    inputs : mapping of str to float
        The block's.

    Raises
    ------
    SpecError
        With the line and the cure; or the block has no sensor.
    """
    if SENSOR[0] not in inputs:
        raise SpecError("sensor: the block has none; state planner.sensor in the spec that it is written of.")
    rows = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    names = [name.strip() for name in rows.fieldnames or ()]
    if missing := [name for name in COLUMNS if name not in names]:
        raise SpecError(
            f"sensor: there is no column {missing[0]}; the first line must be {','.join(COLUMNS)}."
        )
    rows.fieldnames = names
    readings = []
    for row in rows:
        try:
            readings.append([float(row[name] or "") for name in COLUMNS])
        except ValueError:
            raise SpecError(f"sensor, line {rows.line_num}: time_s and value must be numbers.") from None
    if not readings:
        raise SpecError("sensor: there is no row; write one such as 0.0,0.01.")
    times, values = np.array(readings).T
    if not (math.isfinite(times.sum()) and times[0] >= 0.0) or any(
        b < a for a, b in pairwise(times.tolist())
    ):
        raise SpecError("sensor: time_s must rise from 0 or later on.")
    return SensorLog(times=times, values=values)
