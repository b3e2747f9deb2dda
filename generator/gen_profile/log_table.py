"""Tables that loggers write: columns between semicolons, tabs or commas, decimals with points or commas."""

from __future__ import annotations

import codecs
import csv
import math
from collections.abc import Sequence
from datetime import UTC, datetime

import attrs

from gen_profile.errors import OutputError

SEPARATORS = ";\t,"  # the first that half of all lines hold: where it is no comma, that is a decimal sign


@attrs.frozen(kw_only=True)
class LogTable:
    """A table's cells, without blanks around them; rows may differ in length.

    Attributes
    ----------
    rows : sequence of sequence of str
        Of what is no blank line; at least one.
    decimal_comma : bool
        Whether a comma may stand for a decimal point.
    """

    rows: Sequence[Sequence[str]]
    decimal_comma: bool

    def cell(self, row: int, place: int) -> str:
        """Text of a cell; empty where the row ends before."""
        cells = self.rows[row]
        return cells[place] if place < len(cells) else ""

    def number(self, row: int, place: int) -> float:
        """Value of a cell; NaN where it holds no finite number."""
        text = self.cell(row, place)
        try:
            value = float(text.replace(",", ".") if self.decimal_comma else text)
        except ValueError:
            return math.nan
        return value if math.isfinite(value) else math.nan

    def seconds(self, row: int, place: int) -> float:
        """Time of a cell: a number, or a date and time as of ISO 8601, which is told in s; else NaN."""
        value = self.number(row, place)
        if not math.isnan(value):
            return value
        try:
            moment = datetime.fromisoformat(self.cell(row, place).replace(",", "."))
        except ValueError:
            return math.nan
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def decoded(content: bytes) -> str:
    """Decode what a logger wrote: UTF-16 or UTF-8 if it is, else Windows' Western European."""
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
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise OutputError(f"{source}: the log is empty.")
    separator = next(
        (known for known in SEPARATORS if 2 * sum(known in line for line in lines) >= len(lines)), ","
    )
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    except csv.Error as error:
        raise OutputError(f"{source}: it is no table ({error}).") from error
    return LogTable(rows=rows, decimal_comma=separator != ",")
