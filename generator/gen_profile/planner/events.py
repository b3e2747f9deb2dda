"""The events that a planner block keeps for an operator's screen: from its outputs, and in words."""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gen_profile.errors import SpecError
from gen_profile.planner.chebyshev import Array
from gen_profile.suggestion import number_meant

KEPT = 16
COLUMNS = ("time_s", "code", "value")
WORDS = {  # {:g} is the event's value
    10: "disabled; the axis stands or is led at {:g}",
    11: "the axis stands, at {:g}",
    12: "the axis moves, from {:g}",
    13: "the axis is braked at once, from {:g}: the load swings",
    20: "no command: the axis stops, or stands",
    21: "commanded to move to {:g}",
    22: "a stick is followed, at first {:g} per second",
    23: "held by an override of 0",
    24: "goes on after a hold",
    32: "a motion to the target was planned, which takes {:g} s",
    33: "a stop without sway was planned, which takes {:g} s",
    34: "a motion to the stick's velocity was planned, after which the axis can stand in {:g} s",
    41: "a command to a position was refused, replaced or stopped before its end",
    42: "a stick is no longer followed",
    43: "another target replaced the one before its end",
    50: "no error any more",
    51: "error 1: the task's cycle time is not that of the block",
    52: "error 2: a live parameter was out of its range for too long",
    53: "error 3: the target or the stick's velocity was no number, or the target out of its range",
    54: "error 4: the axis's position or velocity was no number",
    55: "error 5: override or velocity limit was out of its range for too long",
    56: "error 6: a target was given while a stick was followed",
    57: "error 7: the axis was too far from its setpoint, at {:g}",
    58: "error 8: a blocked interval lies in the way",
    59: "error 9: no motion was found that leaves as little sway as is allowed",
    60: "the load will not sway",
    61: "the load may sway: a live parameter changed on the way",
    62: "the load may sway: after a quick stop or a take-over it is unknown how it swings",
    63: "not ready: no live parameters taken over yet",
    64: "nothing is promised while disabled",
    65: "the load may sway: what the stated errors leave has added up to more than is allowed",
    66: "the load sways, as the sensor shows",
    70: "the target is reached, at {:g}",
}


class Event(NamedTuple):
    """What happened in a planner block: time in s, code, and a value in the unit of the code's words."""

    time: float
    code: int
    value: float

    @property
    def words(self) -> str:
        """Put it into words."""
        known = WORDS.get(self.code, "an event {code} that is not known here")
        return f"{self.time:.3f} s: {known.format(self.value, code=self.code)}"


def events_of(outputs: Sequence[str], issued: Array) -> Iterator[Event]:
    """Find the events in a block's outputs.

    Parameters
    ----------
    outputs : sequence of str
        Their names.
    issued : (cycles, outputs) array

    Raises
    ------
    SpecError
        The block keeps none.
    """
    if "nEvents" not in outputs:
        raise SpecError("events: the block keeps none; state planner.events = true and write it anew.")
    places = {
        name: [outputs.index(f"{name}[{k}]") for k in range(KEPT)]
        for name in ("aEventTime", "aEventCode", "aEventValue")
    }
    known = 0
    for row in issued:
        count = int(row[outputs.index("nEvents")])
        for number in range(max(known, count - KEPT), count):
            time, code, value = (float(row[where[number % KEPT]]) for where in places.values())
            yield Event(time, int(code), value)
        known = count


def read_events(text: str) -> list[Event]:
    """Read a table of events, such as a controller's screen saves, sorted by time.

    Parameters
    ----------
    text : str
        CSV with the columns of `COLUMNS`.

    Raises
    ------
    SpecError
        With the line and the cure.
    """
    rows = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    if missing := [name for name in COLUMNS if name not in (rows.fieldnames or ())]:
        raise SpecError(
            f"events: there is no column {missing[0]}; the first line must be {','.join(COLUMNS)}."
        )
    events = []
    for row in rows:
        cells = [text for text in row.values() if isinstance(text, str)]  # those beyond the names in a list
        try:
            time, code, value = (float(row[name] or "") for name in COLUMNS)
        except ValueError:
            time, code, value = math.nan, math.nan, math.nan
        if None in row or not (math.isfinite(time) and code.is_integer()):
            hint = next(filter(None, map(number_meant, cells)), "")
            raise SpecError(
                f"events, line {rows.line_num}: a time, a whole number and a value are wanted, "
                f"found {','.join(cells)!r}{hint}."
            )
        events.append(Event(time, int(code), value))
    return sorted((event for event in events if event.code), key=lambda event: event.time)
