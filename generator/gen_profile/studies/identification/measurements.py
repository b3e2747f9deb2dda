"""What can be measured on a machine: parameters by tape or scale, periods by stopwatch, a logged swing.

Every uncertainty is one standard deviation.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import attrs
import numpy as np

from gen_profile.motion.profile import Array, read_only
from gen_profile.studies.identification.log_clock import TIME_UNITS
from gen_profile.studies.identification.log_columns import SHARE, read_columns, require_samples
from gen_profile.studies.identification.log_signal import (
    about_one_axis,
    axis_note,
    jumps,
    likely_columns,
    refuse_spectrum,
    resolution,
    same_sensor,
)
from gen_profile.studies.identification.log_table import LogTable, read_table
from gen_profile.support.errors import OutputError, SpecError
from gen_profile.support.phrase import Phrase
from gen_profile.support.summary import Sampled
from gen_profile.support.units import units_of

_NUMBER = r"[+-]?[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?"
_VALUE = rf"({_NUMBER})\s*(?:±|\+-|\+/-)\s*({_NUMBER})"
GREATEST = 1e9  # s, swings or SI units of any reading
FINEST = 1e-9  # of a value, to which no instrument reads it
SI_UNITS = {"angle": "rad", "sway": "m", "rate": "rad/s"}  # of what may be logged of a load
SI_UNITS |= {"acceleration": "m/s²"}
ACCELERATIONS = {"m/s²": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "mm/s²": 1e3, "mm/s^2": 1e3, "g": 1.0 / 9.80665}
OF_SENSORS = ("rate", "acceleration")  # which a sensor measures along axes of its own


@attrs.frozen(kw_only=True)
class DirectReading:
    """A parameter read off a tape, a scale or a data sheet, in SI units."""

    parameter: str
    value: float
    uncertainty: float


@attrs.frozen(kw_only=True)
class Period:
    """How long one free swing takes.

    Attributes
    ----------
    mode : int
        1 for the slowest mode.
    seconds, uncertainty : float
        Of one period.
    """

    mode: int
    seconds: float
    uncertainty: float


@attrs.frozen(kw_only=True, eq=False, repr=False)
class SwingLog(Sampled):
    """A free swing, logged while the axes stood still.

    Attributes
    ----------
    times : (samples,) array
        s, rising; not necessarily evenly spaced.
    values : (samples,) array
        Of one output of one load in the SI unit, which may be off by what drifts slowly.
    quantity : str
        ``"angle"`` or ``"sway"``, as `gen_profile.plants.plant.Outputs` defines them, ``"rate"`` of the
        angle, as a gyroscope on the load measures it, or ``"acceleration"`` of the sway, without gravity.
    load : str
    notes : tuple of str
        What was repaired as it was read, or taken to be meant.
    resolution : float
        Least step between different values as they were read, as of an encoder that counts.
    logged : int
        Samples that were read, of which `averaged` may have made fewer.
    start_time : float
        Time of the first one in s, as it was logged.
    """

    times: Array = attrs.field(converter=read_only)
    values: Array = attrs.field(converter=read_only)
    quantity: str
    load: str
    notes: tuple[str, ...] = ()
    resolution: float = attrs.field()
    logged: int = attrs.field()
    start_time: float = 0.0

    @resolution.default
    def _resolution(self) -> float:
        return resolution(self.values)

    @logged.default
    def _logged(self) -> int:
        return len(self.times)

    @property
    def unit(self) -> str:
        """Of the values."""
        return SI_UNITS[self.quantity]

    def averaged(self, width: float, most: int) -> SwingLog:
        """Take the means of what was logged within every so many seconds, so many of them at most.

        Averages of a small swing are a swing of the same frequency and damping; noise they have less of, and
        hum of the mains hardly any.
        """
        bins = (self.times / width).astype(np.int64)
        _, first = np.unique(bins, return_index=True)
        ends = np.append(first, len(bins))[: most + 1]
        counts, last = np.diff(ends), int(ends[-1])
        means = [np.add.reduceat(signal[:last], ends[:-1]) / counts for signal in (self.times, self.values)]
        return attrs.evolve(self, times=means[0] - means[0][0], values=means[1])


Measurement = DirectReading | Period | SwingLog


def parse_reading(text: str, option: str = "measured") -> DirectReading:
    """Read ``L1=0.47±0.005``, given by an option of some name.

    Raises
    ------
    SpecError
    """
    match = re.fullmatch(rf"\s*(\w+)\s*=\s*{_VALUE}\s*", text)
    if match is None:
        comma = _decimal_points(text)
        raise SpecError(
            f"{option} {text!r}: write NAME=VALUE±UNCERTAINTY, such as L1=0.47±0.005 (or +-){comma}."
        )
    name, value, uncertainty = match.groups()
    spread = _spread(f"{option} {text!r}", float(value), float(uncertainty))
    return DirectReading(parameter=name, value=float(value), uncertainty=spread)


def parse_period(text: str) -> Period:
    """Read ``17.3±0.2/10``: ten swings in 17.3 s; ``2:0.70±0.01`` is one swing of the second mode.

    Raises
    ------
    SpecError
    """
    match = re.fullmatch(rf"\s*(?:([0-9]+)\s*:)?\s*{_VALUE}\s*(?:/\s*([0-9]+))?\s*", text)
    if match is None:
        raise SpecError(
            f"period {text!r}: write SECONDS±UNCERTAINTY, such as 1.73±0.02, or 17.3±0.2/10 for ten "
            f"swings, or 2:0.70±0.01 for the second mode (+- will do for ±){_decimal_points(text)}."
        )
    mode, seconds, uncertainty, swings = match.groups()
    where, total = f"period {text!r}", float(seconds)
    count = _positive(where, "number of swings", float(swings or 1))
    return Period(
        mode=int(_positive(where, "mode", float(mode or 1))),
        seconds=_positive(where, "time", total) / count,
        uncertainty=_spread(where, total, float(uncertainty)) / count,
    )


def _decimal_points(text: str) -> str:
    """Continue a sentence about a reading with decimal commas."""
    pointed = re.sub(r"(?<=[0-9]),(?=[0-9])", ".", text)
    return f"; write decimal points: {pointed}" if pointed != text else ""


def parse_swing(
    text: str,
    source: str,
    *,
    columns: tuple[str, str] | None,
    per_second: float | None,
    per_unit: float | None,
    after: float | None,
    quantity: str,
    load: str,
    one_direction: bool = True,
) -> SwingLog:
    """Read a log: two columns of a table, below their names and whatever else stands there.

    Rows in which the logger left one of the two empty are left out; repairs stand in the log's notes.
    Of a sensor with axes x, y and z on a load that swings in one direction all are taken: it may lie askew.

    Parameters
    ----------
    text : str
    source : str
        Where it comes from, for errors.
    columns : (str, str) or None
        Of time, and of the value: names, or numbers from 1; by default those whose names tell it, or the
        first two. Dates and times are given in s from the first.
    per_second : float or None
        How many of the time's unit make a second; None for what the column's name says, or the times show.
    per_unit : float or None
        How many of the value's unit make an SI unit; None for what the column's name says, or one.
    after : float or None
        Time in s from which on the axes stood still; earlier rows are left out. None for all, also those
        before 0, where a trigger was.
    quantity, load : str
        What the value is; see `SwingLog`.
    one_direction : bool
        Whether the machine swings in one direction only.

    Raises
    ------
    OutputError
        The table cannot be read.
    """
    cells = read_table(text, source)
    chosen = likely_columns(cells, quantity) if columns is None else columns
    head = cells.head(chosen)
    time, place = (cells.place(head, column) for column in chosen)
    refuse_spectrum(cells, head, time)
    per_second = per_second or _per_stated(cells, head, time, "time", TIME_UNITS)
    per_unit = per_unit or _per_stated(cells, head, place, quantity, signal_units(quantity)) or 1.0
    sensor = one_direction and quantity in OF_SENSORS
    places = same_sensor(cells, head, place) if sensor else (place,)
    read = read_columns(cells, head, (time, *places), per_second)
    notes, values = list(read.notes), read.values[:, 0]
    if columns is None and chosen != ("1", "2"):
        template = "the times are those of column {time}, the values those of column {value}"
        notes.insert(0, Phrase(template, time=chosen[0], value=chosen[1]))
    if len(places) > 1 and len(read.times) > 1:
        values, axis, share = about_one_axis(read.values, places.index(place))
        notes.append(axis_note(cells.cell(head, place), axis, share))
    values = values / per_unit
    return cut_swing(
        read.times, values, source, after=after, quantity=quantity, load=load, notes=tuple(notes)
    )


def _per_stated(
    cells: LogTable, head: int, place: int, measured: str, units: Mapping[str, float]
) -> float | None:
    """Say how many of the unit that a column states make an SI unit; None where it states none."""
    name, unit = cells.cell(head, place), cells.unit(head, place)
    if unit and unit not in units:
        others = [other for other in SI_UNITS if unit in signal_units(other)]
        cure: str = "name another column"
        if others:
            cure = Phrase("take it for a log of the {quantity} (signal)", quantity=others[0])
        template = (
            "{source}: column {name!r} is in {unit}, which measures no {measured}; {cure}, or state the "
            "unit if the name is wrong."
        )
        raise OutputError(template, source=cells.source, name=name, unit=unit, measured=measured, cure=cure)
    return units[unit] if unit else None


def signal_units(quantity: str) -> Mapping[str, float]:
    """List the units that a quantity may be logged in, and how many of them make an SI unit."""
    return ACCELERATIONS if quantity == "acceleration" else units_of(SI_UNITS[quantity])


def cut_swing(
    times: Array,
    values: Array,
    source: str,
    *,
    after: float | None,
    quantity: str,
    load: str,
    notes: tuple[str, ...] = (),
) -> SwingLog:
    """Leave out of a log what was logged before the axes stood still, and single samples that jump.

    Parameters
    ----------
    times, values : (samples,) arrays
        s, and SI units.
    source : str
        Where it comes from, for errors.
    after : float or None
        Time in s from which on the axes stood still; None for the whole log.
    quantity, load : str
        What the value is; see `SwingLog`.
    notes : tuple of str
        What was repaired before.

    Raises
    ------
    OutputError
        What is left is no swing.
    """
    if after is not None:
        times, values = times[times >= after], values[times >= after]
    elif len(times) and times[0] < 0.0 < times[-1]:
        template = (
            "the log begins {before:.4g} s before its time 0; if the axes moved till then, leave that "
            "out (after)"
        )
        notes = (*notes, Phrase(template, before=-float(times[0])))
    require_samples(source, len(times), notes)
    beside = jumps(times, values, resolution(values))
    if 0 < len(beside) <= SHARE * len(times):
        template = "{count} samples that jump aside, the first at {time:.4g} s, are left out"
        notes = (*notes, Phrase(template, count=len(beside), time=float(times[beside[0]])))
        times, values = np.delete(times, beside), np.delete(values, beside)
    start_time = float(times[0])
    return SwingLog(
        times=times - start_time,
        values=values,
        quantity=quantity,
        load=load,
        notes=notes,
        start_time=start_time,
    )


def require_angle(values: Array) -> None:
    """Refuse, by a `SpecError`, angles in rad that go over more than half a turn, as degrees do."""
    if (span := float(np.ptp(values))) > np.pi:
        raise SpecError(
            "unit: the log's angle goes over {span:.3g} rad, more than half a turn; is it in deg?", span=span
        )


def _positive(where: str, what: str, value: float) -> float:
    if not value > 0.0:
        raise SpecError(f"{where}: the {what} must be greater than 0.")
    if value > GREATEST:
        raise SpecError(f"{where}: the {what} must be {GREATEST:g} at most.")
    return value


def _spread(where: str, value: float, uncertainty: float) -> float:
    """Hold an uncertainty to what an instrument may have."""
    if abs(value) > GREATEST:
        raise SpecError(f"{where}: the value must be {GREATEST:g} at most.")
    if 0.0 < uncertainty < FINEST * abs(value):
        raise SpecError(f"{where}: nothing is measured to {uncertainty:g} of {value:g}; state what is known.")
    return _positive(where, "uncertainty", uncertainty)
