"""The events that a planner block keeps for an operator's screen: from its outputs, and in words."""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from gen_profile.motion.profile import Array
from gen_profile.planner.sensor_log import read_rows
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import number_meant

KEPT_EVENTS = 16
GREATEST_VALUE = 1e9  # s, and of a code: no block's counts so far
NO_ERROR = 50  # the code of nErrorId 0; those of the others follow
COLUMNS = ("time_s", "code", "value")
_LINES = (Path(__file__).parents[1] / "lists" / "events.txt").read_text("utf-8").splitlines()
# by code; {:g} is the event's value
WORDS = {int(code): words for code, _, words in (line.partition(" ") for line in _LINES)}


class Event(NamedTuple):
    """What happened in a planner block: time in s, code, and a value in the unit of the code's words."""

    time: float
    code: int
    value: float

    @property
    def words(self) -> str:
        """Put it into words."""
        known = WORDS.get(self.code, "an event {code} that is not known here")
        value = round(self.value, 9) + 0.0  # a position that rounding errors keep from 0 is 0, and no −0
        return f"{self.time:.3f} s: {known.format(value, code=self.code)}"


def error_words(number: int) -> str:
    """Say what a planner block's nErrorId means."""
    return WORDS.get(NO_ERROR + number, f"error {number}").partition(", at {")[0]


def require_events(text: str) -> None:
    """Refuse, by a `SpecError`, a block that keeps no events."""
    if not re.search(r"\bnEvents\s*:", text):
        raise SpecError("events: the block keeps none; state planner.events = true and write it anew.")


def events_of(outputs: Sequence[str], issued: Array) -> Iterator[Event]:
    """Find the events in a block's outputs.

    Parameters
    ----------
    outputs : sequence of str
        Their names.
    issued : (cycles, outputs) array

    """
    places = {
        name: [outputs.index(f"{name}[{k}]") for k in range(KEPT_EVENTS)]
        for name in ("aEventTime", "aEventCode", "aEventValue")
    }
    known = 0
    for row in issued:
        count = int(row[outputs.index("nEvents")])
        for number in range(max(known, count - KEPT_EVENTS), count):
            time, code, value = (float(row[where[number % KEPT_EVENTS]]) for where in places.values())
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
    events = []
    for line, row in read_rows(text, "events", COLUMNS)[1]:
        cells = [
            text for name in row for text in (row[name] if name is None else [row[name]]) if text is not None
        ]
        try:
            time, code, value = (float(row[name] or "") for name in COLUMNS)
        except ValueError:
            time, code, value = math.nan, math.nan, math.nan
        sound = max(abs(time), abs(code)) < GREATEST_VALUE and code.is_integer() and math.isfinite(value)
        if None in row or not sound:
            hint = next((hint for text in cells if "point" in (hint := number_meant(text))), "")
            raise SpecError(
                f"events, line {line}: a time, a whole number and a value are wanted, "
                f"found {','.join(cells)!r}{hint}."
            )
        events.append(Event(time, int(code), value))
    return sorted((event for event in events if event.code), key=lambda event: event.time)
