"""Tables that loggers write: columns between semicolons, tabs or commas, decimals with points or commas."""

import codecs
import csv
import errno
import math
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.log_archive import table_in
from gen_profile.studies.identification.log_clock import seconds_of
from gen_profile.support.bounded_file import read_bounded
from gen_profile.support.errors import OutputError
from gen_profile.support.phrase import Phrase
from gen_profile.support.suggestion import finite_number, suggestion

SEPARATORS = ";\t,"  # the first that half of all lines hold: where it is no comma, that is a decimal sign
MOST_BYTES = 1 << 27
MOST_SEEN = 10_000  # lines of a file, spread over it, which tell what stands between its columns
# units as loggers write them, in brackets or behind a name, and what they are called here
SPELLINGS = {"°": "deg", "degree": "deg", "degrees": "deg", "grad": "deg", "radian": "rad", "radians": "rad"}
SPELLINGS |= {"°/s": "deg/s", "dps": "deg/s"}
SPELLINGS |= {"sec": "s", "seconds": "s", "sek": "s", "µs": "us", "μs": "us", "µm": "um", "μm": "um"}
TIMES = {"millis": "ms", "millisec": "ms", "milliseconds": "ms", "msec": "ms", "micros": "us"}
TIMES |= {"microseconds": "us", "usec": "us", "nanos": "ns", "nanoseconds": "ns", "nsec": "ns"}
SPELLINGS |= TIMES
_BRACKETED = re.compile(r".*[\[(]\s*([^\[\]()]+?)\s*[\])]")
_BEHIND = re.compile(rf".+[_ ](ms|us|ns|s|rad|deg|mm|um|dps|{'|'.join(TIMES)})", re.IGNORECASE)
# what is a unit, and no remark, though it may be one that nothing here is measured in
_UNIT = re.compile(r".*[/^²³·].*|[kmµ]?[VAWNg]|kg|t|%|k?Hz|m?bar|°C|K|min|h|ms|us|ns|s|rad|deg|m|mm|um")
_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_SPACED = re.compile(rf"\s*{_NUMBER}(?:\s+{_NUMBER})+\s*")
# what loggers write where they have no value
MISSING = {
    "nan",
    "+nan",
    "-nan",
    "na",
    "n/a",
    "#n/a",
    "#num!",
    "null",
    "none",
    "-",
    "--",
    "inf",
    "+inf",
    "-inf",
}
ARCHIVE = b"PK\x03\x04"  # what a workbook (xlsx) or another archive begins with
# what a file begins with that is no text, and what to do about it
OTHERS = {
    b"\xd0\xcf\x11\xe0": "an old workbook (xls): open it and save the sheet as CSV",
    b"PAR1": "a Parquet table: convert it to CSV",
    b"\x1f\x8b": "compressed (gzip): unpack it",
    b"MDF ": "an MDF measurement: export its signals as CSV",
}


@attrs.frozen(kw_only=True)
class LogTable:
    """A table's cells, without blanks around them; rows may differ in length.

    Attributes
    ----------
    rows : sequence of sequence of str
        Of what is no blank line; at least one. It tells each one's line in the file, too.
    decimal_comma : bool
        Whether a comma may stand for a decimal point.
    source : str
        Where it comes from, for errors.
    """

    rows: "_Rows"
    decimal_comma: bool
    source: str

    def cell(self, row: int, place: int) -> str:
        """Text of a cell; empty where the row, or the table, ends before."""
        cells = self.rows[row] if row < len(self.rows) else ()
        return cells[place] if place < len(cells) else ""

    def number(self, row: int, place: int) -> float:
        """Value of a cell; NaN where it holds no finite number."""
        text = self.cell(row, place)
        comma = self.decimal_comma or _COMMA.fullmatch(text)  # which a cell in quotes may hold, too
        return finite_number(text.replace(",", ".") if comma else text)

    def block(self, rows: range, places: Sequence[int]) -> Array | None:
        """Read cells of many rows at once where all are plain numbers, (rows, places); else None."""
        lines = self.rows.lines[rows.start : rows.stop]
        if self.decimal_comma:
            lines = [line.replace(",", ".") for line in lines]
        between = None if self.rows.separator == " " else self.rows.separator
        try:
            values = np.loadtxt(lines, delimiter=between, usecols=places, comments=None, ndmin=2)
        except ValueError:
            return None
        return values if np.isfinite(values).all() else None

    def seconds(self, row: int, place: int) -> float:
        """Time of a cell: a number, a date or a time of day (see `seconds_of`), in s; else NaN."""
        value = self.number(row, place)
        return seconds_of(self.cell(row, place)) if math.isnan(value) else value

    def head(self, columns: Collection[str]) -> int:
        """Find the row of these columns' names; where all are numbers, the last above values and units."""
        if names := {column for column in columns if not column.isdecimal()}:
            return next((row for row, cells in enumerate(self.rows) if names & set(cells)), 0)
        places, above = [int(column) - 1 for column in columns], list[int]()
        for row in range(len(self.rows)):
            if len(self.rows[row]) <= max(places, default=0):
                continue
            cells = [self.cell(row, place) for place in places]
            if self._holds_values(row, places):
                return above[-1] if above else row
            units = above and all(not cell or _UNIT.fullmatch(_spelt(cell)) for cell in cells)
            if any(cells) and not units:
                above.append(row)
        return above[0] if above else 0

    def _holds_values(self, row: int, places: Sequence[int], *, alone: bool = False) -> bool:
        """Tell whether cells hold times, values or what stands for none, and not all of them that.

        Where one is empty the next row decides: a remark with a date, such as when a trace was recorded, is
        followed by none.
        """
        known = [place for place in places if not math.isnan(self.seconds(row, place))]
        others = {self.cell(row, place).lower() for place in places if place not in known}
        if not known or not others <= {"", *MISSING}:
            return False
        return alone or "" not in others or self._holds_values(row + 1, places, alone=True)

    def place(self, head: int, column: str) -> int:
        """Find a column by its name in a row of names, or by its number from 1.

        Raises
        ------
        OutputError
            There is none.
        """
        names = self.rows[head] if self.is_head(head) else []
        if column in names:
            return names.index(column)
        if column.isdecimal() and 1 <= int(column) <= len(self.rows[head]):
            return int(column) - 1
        hint: str = Phrase("; there are {rows}, without names.", rows=len(self.rows[head]))
        if names:
            hint = suggestion(column, names)
        raise self._fault("{source}: there is no column {column!r}{hint}", column=column, hint=hint)

    def unit(self, head: int, place: int) -> str:
        """Read a column's unit off its name or off the cell below that; empty where neither tells one."""
        if not self.is_head(head):
            return ""
        name = self.cell(head, place)
        match = _BRACKETED.fullmatch(name) or _BEHIND.fullmatch(name)
        named = match[1] if match else name if name.lower() in TIMES else self.cell(head + 1, place)
        unit = _spelt(named)
        return unit if _UNIT.fullmatch(unit) and not unit[0].isdecimal() else ""

    def is_head(self, row: int) -> bool:
        """Tell whether a row holds more than numbers."""
        return any(math.isnan(self.number(row, place)) for place in range(len(self.rows[row])))

    def _fault(self, template: str, **values: object) -> OutputError:
        return OutputError(template, source=self.source, **values)


def _spelt(unit: str) -> str:
    """Call a unit as it is called here, without brackets around it."""
    bare = unit.strip("[]() ")
    return SPELLINGS.get(bare.lower(), bare)


def read_text(path: Path, option: str) -> str:
    """Read what a logger wrote.

    Raises
    ------
    OutputError
        The file cannot be read, or is no text.
    """
    try:
        content = read_bounded(path, MOST_BYTES)
    except OSError as error:
        if error.errno == errno.EFBIG:
            raise OutputError(
                f"{option} {path}: more than {MOST_BYTES >> 20} MiB; cut the move out of it."
            ) from error
        raise OutputError(f"{option}: cannot read the log {path}: {error.strerror}.") from error
    return decoded(content, f"{option} {path}")


def decoded(content: bytes, source: str) -> str:
    """Decode what a logger wrote, in a workbook or archive, too: UTF-16 or UTF-8, else Western European.

    Raises
    ------
    OutputError
        It is no text.
    """
    if content.startswith(ARCHIVE):
        content = table_in(content, source, MOST_BYTES)
    for mark, words in OTHERS.items():
        if content.startswith(mark):
            raise OutputError("{source}: this is {words}.", source=source, words=words)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def read_table(text: str, source: str) -> LogTable:
    """Split a text into cells.

    Parameters
    ----------
    text : str
    source : str
        Where it comes from, for errors.

    Raises
    ------
    OutputError
        It is empty, or no table.
    """
    rows = _Rows(text, source)
    lines = rows.lines
    if not lines:
        raise OutputError("{source}: the log is empty.", source=source)
    seen = lines[:: math.ceil(len(lines) / MOST_SEEN)]
    common = (known for known in SEPARATORS if 2 * sum(known in line for line in seen) >= len(seen))
    rows.separator = next(common, ",")
    if rows.separator == "," and 2 * sum(_SPACED.fullmatch(line) is not None for line in seen) >= len(seen):
        rows.separator = " "
    return LogTable(rows=rows, decimal_comma=rows.separator != ",", source=source)


class _Rows(Sequence[Sequence[str]]):
    """Lines that are split when they are asked for: all cells at once take ten times the text's memory."""

    def __init__(self, text: str, source: str) -> None:
        self.lines = [line for line in text.splitlines() if line.strip()]
        self.separator, self._text, self._source = ",", text, source
        self._split: tuple[int, list[str]] = (-1, [])  # the row that was asked for last

    def __len__(self) -> int:
        return len(self.lines)

    def line(self, row: int) -> int:
        """Count a row's line in the file from 1, blank ones, too."""
        lines = enumerate(self._text.splitlines(), 1)
        return [number for number, line in lines if line.strip()][row]

    def __getitem__(self, row: Any) -> Any:
        if row != self._split[0]:
            line = self.lines[row]
            try:
                cells = (
                    line.split()
                    if self.separator == " "
                    else next(csv.reader([line], delimiter=self.separator))
                )
            except csv.Error as error:
                template = "{source}, row {row}: it is no table ({problem})."
                raise OutputError(template, source=self._source, row=self.line(row), problem=error) from error
            self._split = (row, [cell.strip() for cell in cells])
        return self._split[1]
