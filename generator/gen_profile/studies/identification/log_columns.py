"""Columns of numbers out of a logger's table: its clock read, and small faults repaired and told.

What is harmless is done whatever its share: rows without a value are left out, clocks go on that pass
midnight, what was logged twice counts once, and of several runs in one file the longest is taken. Of rows
that are wrong (no number, the time of another, late) a log may hold `SHARE`; beyond that it is refused, with
the first place of each fault and its cure.
"""

import math
import re
from array import array
from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.log_clock import LATEST, seconds_of, unit_of, unwrapped
from gen_profile.studies.identification.log_table import MISSING, LogTable
from gen_profile.support.errors import OutputError
from gen_profile.support.phrase import Phrase, joined
from gen_profile.support.suggestion import number_meant

LEAST_SAMPLES = 16
LISTED = "{first}; {others}"
SHARE = 0.05  # of a log's rows that may be wrong
MOST_MISSING = 0.5  # of a log's rows that may hold no value
GREATEST = 1e12  # counts: beyond it a logger wrote rubbish
LEAVE_EMPTY = "; leave the cell empty where nothing was measured"
AS_ISO = "; write dates as 2026-11-27 10:00:00"
AT_ONCE = 4096  # rows that are read together where all hold plain numbers
SHUFFLED = 0.125  # backward steps per row, from which on rows are in no order
LATE = 2.0  # usual steps, within which a clock goes on that was set back
FAR = 20.0  # usual steps that a gap between runs has at least
LONGEST_GAP = 0.5  # of what was logged: over a longer one the swings cannot be counted


_WHOLE = re.compile(r"[+-]?\d+(?:[eE][+-]?\d+)?")


@attrs.frozen(kw_only=True, eq=False)
class LogColumns:
    """What a logger measured, in the order of its times.

    Attributes
    ----------
    times : (samples,) array
        s, rising; from the first where the clock counts from a date.
    values : (samples, columns) array
        As they were logged.
    notes : tuple of str
        What was repaired, or taken to be meant; a clause each.
    """

    times: Array
    values: Array
    notes: tuple[str, ...]


@attrs.frozen(kw_only=True)
class _Fault:
    """Rows that are wrong: how many, a refusal with the first place, and what is done about them."""

    count: int
    refusal: str
    note: str


@attrs.frozen(kw_only=True, eq=False)
class _Log:
    """Rows that hold numbers: the first column their times, and where in the table each stands."""

    table: LogTable
    numbers: Array
    rows: NDArray[np.intp]
    faults: tuple[_Fault, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def times(self) -> Array:
        return np.asarray(self.numbers[:, 0])

    def taken(self, index: NDArray[np.intp], *, note: str = "", fault: _Fault | None = None) -> "_Log":
        """Keep some rows, in an order, and say why."""
        return attrs.evolve(
            self,
            numbers=self.numbers[index],
            rows=self.rows[index],
            notes=(*self.notes, *([note] if note else [])),
            faults=(*self.faults, *([fault] if fault else [])),
        )

    def line(self, index: int) -> int:
        """Line of a sample in the file."""
        return self.table.rows.line(int(self.rows[index]))


def read_columns(
    table: LogTable, head: int, places: Sequence[int], per_second: float | None = None
) -> LogColumns:
    """Read columns of numbers, the first of which are times, below a row.

    What stands above the first time is passed over, and rows in which a logger left a cell empty.

    Parameters
    ----------
    table : LogTable
    head : int
        Row of the columns' names.
    places : sequence of int
    per_second : float or None
        How many of the clock's units make a second, if it is known.

    Raises
    ------
    OutputError
        More rows are wrong than `SHARE`, or numbers with decimal commas stand between commas.
    """
    below = range(head + table.is_head(head), len(table.rows))
    first = next((row for row in below if not math.isnan(table.seconds(row, places[0]))), below.start)
    _require_separate(table, head, first)
    log = _read(table, head, places, first)
    rows = len(log.rows) + sum(fault.count for fault in log.faults)
    log = _in_order(
        _evenly_told(_clock(log, dated=math.isnan(table.number(first, places[0])), said=per_second))
    )
    if sum(fault.count for fault in log.faults) > SHARE * rows:
        raise OutputError(*(fault.refusal for fault in log.faults))
    notes = (*(fault.note for fault in log.faults), *log.notes)
    return LogColumns(times=log.times, values=log.numbers[:, 1:], notes=notes)


def require_samples(source: str, count: int, notes: Sequence[str]) -> None:
    """Refuse, by an `OutputError`, what is too short for a swing, and tell what was left out of it."""
    if count < LEAST_SAMPLES:
        left_out: str = Phrase(" ({notes})", notes=joined(LISTED, notes)) if notes else ""
        template = "{source}: a swing needs at least {least} samples, found {count}{left_out}."
        raise OutputError(template, source=source, least=LEAST_SAMPLES, count=count, left_out=left_out)


def _read(table: LogTable, head: int, places: Sequence[int], first: int) -> _Log:
    """Read all rows that hold numbers, and count those that do not."""
    limits = np.array([LATEST, *([GREATEST] * (len(places) - 1))])
    values, rows, missing, wrong = array("d"), array("L"), array("L"), list[tuple[int, int]]()
    for start in range(first, len(table.rows), AT_ONCE):
        block = range(start, min(start + AT_ONCE, len(table.rows)))
        plain = table.block(block, places)
        if plain is not None and (np.abs(plain) <= limits).all():
            values.frombytes(plain.tobytes())
            rows.extend(block)
            continue
        for row in block:
            held = [table.cell(row, place) for place in places]
            if not all(held):
                continue
            here = [table.seconds(row, places[0]), *(table.number(row, place) for place in places[1:])]
            bad = [place for place, fits in zip(places, np.abs(here) <= limits, strict=True) if not fits]
            if not bad:
                values.extend(here)
                rows.append(row)
            elif all(table.cell(row, place).lower() in MISSING for place in bad):
                missing.append(row)
            else:
                garbled = (place for place in bad if table.cell(row, place).lower() not in MISSING)
                wrong.append((row, next(garbled)))
    faults, notes = list[_Fault](), list[str]()
    if missing:
        template = "{count} rows without a value, the first in row {row}, are left out"
        note = Phrase(template, count=len(missing), row=table.rows.line(missing[0]))
        if len(missing) > MOST_MISSING * (len(rows) + len(missing)):
            place = next(place for place in places if table.cell(missing[0], place).lower() in MISSING)
            faults.append(
                _Fault(count=len(missing), refusal=_no_number(table, head, missing[0], place), note=note)
            )
        else:
            notes.append(note)
    if wrong:
        template = "{count} rows that hold no number, the first of them row {row}, are left out"
        note = Phrase(template, count=len(wrong), row=table.rows.line(wrong[0][0]))
        faults.append(_Fault(count=len(wrong), refusal=_no_number(table, head, *wrong[0]), note=note))
    return _Log(
        table=table,
        numbers=np.array(values).reshape(-1, len(places)),
        rows=np.array(rows, dtype=np.intp),
        faults=tuple(faults),
        notes=tuple(notes),
    )


def _no_number(table: LogTable, head: int, row: int, place: int) -> str:
    """Say that a cell holds no number."""
    text, name = table.cell(row, place), Phrase("column {number}", number=place + 1)
    hint: str = LEAVE_EMPTY if text.lower() in MISSING else number_meant(text)
    if not math.isnan(table.number(row, place)):
        hint = Phrase(", as it is beyond {most:g}", most=GREATEST)
    if not hint and text[:1].isdecimal() and any(mark in text for mark in ":/"):
        hint = AS_ISO
    template = "{source}, row {row}: {name} holds {text!r}, which is no number of a log{hint}."
    called = table.cell(head, place) if table.is_head(head) else name
    line = table.rows.line(row)
    return Phrase(template, source=table.source, row=line, name=called, text=text[:40], hint=hint)


def _clock(log: _Log, *, dated: bool, said: float | None) -> _Log:
    """Give times in s, by the unit that is stated or that they show."""
    times, begins_anew = unwrapped(log.times, of_day=dated)
    notes = list(log.notes)
    if begins_anew:
        template = "the clock began anew {count} times, as at midnight, and goes on"
        notes.append(Phrase(template, count=begins_anew))
    per_second, unit, since = (1.0, "s", True) if dated else unit_of(times)
    if said is not None and not dated:
        per_second, unit = said, "s"
    if unit != "s":
        notes.append(Phrase("times, of which no unit is stated, are taken as {unit}", unit=unit))
    if since and len(times):
        times = times - times[0]
    numbers = np.column_stack([times / per_second, log.numbers[:, 1:]])
    return attrs.evolve(log, numbers=numbers, notes=tuple(notes))


def _evenly_told(log: _Log) -> _Log:
    """Spread samples evenly that share their times, where a clock tells whole seconds only."""
    first = np.flatnonzero(np.diff(log.times, prepend=np.nan) != 0.0)
    counts = np.diff(first, append=len(log.times))
    whole = counts[1:-1]
    if (
        len(whole) < 3
        or np.median(whole) < 2.0
        or np.ptp(whole) > 1
        or (np.diff(log.times[first]) <= 0.0).any()
    ):
        return log
    if all(np.ptp(log.numbers[at : at + 2], axis=0).max() == 0.0 for at in first[1:-1].tolist()):
        return log  # each was written twice
    kept = np.arange(first[1], first[-1])
    apart = (log.times[first[-1]] - log.times[first[1]]) / len(kept)
    numbers = log.numbers[kept].copy()
    numbers[:, 0] = log.times[first[1]] + apart * np.arange(len(kept))
    template = "times are given to {step:.3g} s only, so samples are taken to be {apart:.4g} s apart"
    note = Phrase(template, step=float(np.median(np.diff(log.times[first]))), apart=float(apart))
    return attrs.evolve(log, numbers=numbers, rows=log.rows[kept], notes=(*log.notes, note))


def _in_order(log: _Log) -> _Log:
    """Let times rise: without what is there twice, of one run, and sorted."""
    log = _one_run(_sorted(_once(log)))
    late = np.flatnonzero(log.times < np.maximum.accumulate(log.times)) if len(log.times) else np.empty(0)
    if len(late):
        template = "{count} rows that come late, the first of them row {row}, are put in their place"
        note = Phrase(template, count=len(late), row=log.line(late[0]))
        fault = _Fault(count=len(late), refusal=_not_rising(log, int(late[0])), note=note)
        log = log.taken(np.argsort(log.times, kind="stable"), fault=fault)
    again = np.flatnonzero(np.diff(log.times) == 0.0) + 1
    if len(again):
        template = "{count} rows with the time of another, the first of them row {row}, are left out"
        note = Phrase(template, count=len(again), row=log.line(again[0]))
        fault = _Fault(count=len(again), refusal=_not_rising(log, int(again[0])), note=note)
        log = log.taken(np.delete(np.arange(len(log.times)), again), fault=fault)
    return log


def _once(log: _Log) -> _Log:
    """Leave out rows that repeat another in all numbers."""
    if np.diff(np.sort(log.times)).all():
        return log
    _, kept = np.unique(log.numbers, axis=0, return_index=True)
    if len(kept) == len(log.times):
        return log
    again = np.delete(np.arange(len(log.times)), kept)
    template = "{count} rows that were logged twice, the first of them again in row {row}, count once"
    note = Phrase(template, count=len(again), row=log.line(again[0]))
    return log.taken(np.sort(kept), note=note)


def _sorted(log: _Log) -> _Log:
    """Sort rows that are in no order, or in the opposite one."""
    if not len(log.times) or (np.diff(log.times) < 0.0).sum() <= SHUFFLED * len(log.times):
        return log
    return log.taken(np.argsort(log.times, kind="stable"), note="the rows are sorted by their times")


def _one_run(log: _Log) -> _Log:
    """Take the longest run: clocks go on from one to the next neither back, nor over a long gap."""
    times = log.times
    if len(times) < 3:
        return log
    steps = np.diff(times)
    usual = float(np.median(np.abs(steps)))
    back = [at for at in np.flatnonzero(steps < 0.0).tolist() if _is_set_back(times, at, usual)]
    forward = np.where(steps > 0.0, steps, 0.0)
    logged = float(forward[forward <= FAR * usual].sum())
    long = np.flatnonzero(forward > max(FAR * usual, LONGEST_GAP * logged)).tolist()
    if not back and not long:
        return log
    ends = np.array([0, *(at + 1 for at in sorted({*back, *long})), len(times)])
    longest = int(np.argmax(np.diff(ends)))
    begin, end = int(ends[longest]), int(ends[longest + 1])
    template = "of {count} runs in one file the longest is taken, rows {first} to {last}"
    count, first, last = len(ends) - 1, log.line(begin), log.line(end - 1)
    note = Phrase(template, count=count, first=first, last=last)
    return log.taken(np.arange(begin, end), note=note)


def _is_set_back(times: Array, at: int, usual: float) -> bool:
    """Tell whether from a sample on a clock goes on as usual, though earlier; a row comes late alone."""
    after = times[at + 1 :]
    again = int(np.argmax(after > times[at])) if (after > times[at]).any() else len(after)
    steps = np.diff(after[: again + 1])
    return again > 1 and bool(((steps > 0.0) & (steps <= LATE * usual)).all())


def _not_rising(log: _Log, index: int) -> str:
    template = (
        "{source}, row {row}: the times must rise from row to row, and {after:.9g} follows {before:.9g}; "
        "sort the rows, remove those that come twice, or cut the log where the clock was set back."
    )
    before, after = float(log.times[index - 1]), float(log.times[index])
    return Phrase(template, source=log.table.source, row=log.line(index), after=after, before=before)


def _require_separate(table: LogTable, head: int, first: int) -> None:
    """Refuse numbers whose decimal commas separate columns, too: there are more of them than names."""
    names = sum(map(bool, table.rows[head]))
    cells = [cell for cell in (table.rows[first] if first < len(table.rows) else ()) if cell]
    numbers = [cell for cell in cells if math.isnan(seconds_of(cell))]  # and no times of day
    whole = all(_WHOLE.fullmatch(cell) for cell in numbers)
    fractions = len(cells) == 2 * names or any(cell.startswith("0") and len(cell) > 1 for cell in numbers)
    if table.rows.separator == "," and table.is_head(head) and len(cells) > names > 1 and whole and fractions:
        template = (
            "{source}, row {row}: holds {count} numbers below {names} names; where decimals have commas, "
            "separate columns by semicolons or tabs."
        )
        line = table.rows.line(first)
        raise OutputError(template, source=table.source, row=line, count=len(cells), names=names)
