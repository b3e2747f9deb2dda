"""The dialects of `csv_table`: what stands around the numbers, and how they are separated and written.

============ ========= ======= ======== ====================================================================
dialect      separator decimal line end around the numbers
============ ========= ======= ======== ====================================================================
rfc4180      ``,``     ``.``   LF       a header with names and units
excel-de     ``;``     ``,``   CR LF    the same; opens by a double click where the comma is the decimal sign
sew          ``;``     ``.``   CR LF    the number of points before them: curve point table of MOVI-C
kollmorgen   ``;``     ``.``   CR LF    ``CYCLIC;NO;`` … ``TABLE_END;;`` and SPLINE: cam import of the KAS IDE
lenze        tab       ``.``   CR LF    nothing: Cam Loader, which wants the file renamed to ``.txt``
============ ========= ======= ======== ====================================================================

The last three hold pairs of time and one quantity of one axis, and as many as the importer takes. They are
built after the vendors' public manuals and not tried on their tools.
"""

import csv
import io
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.setpoints import MAX_SAMPLES

Row = tuple[int, list[str]]
"""Line number and cells."""


@attrs.frozen(kw_only=True)
class CsvDialect:
    """How a table is written.

    Attributes
    ----------
    separator, decimal, line_end : str
    header : bool
        Whether the first line names the columns; otherwise each line is a pair.
    opening, closing : sequence of str
        Lines before and after the points; ``{}`` stands for their number.
    mark : str
        Ends each line of a point.
    least, most : int
        Points that the importer takes.
    """

    separator: str
    decimal: str = "."
    line_end: str = "\r\n"
    header: bool = False
    opening: Sequence[str] = ()
    closing: Sequence[str] = ()
    mark: str = ""
    least: int = 2
    most: int = MAX_SAMPLES


_TEXT = Path(__file__).with_suffix(".toml").read_text("utf-8")
DIALECTS = {name: CsvDialect(**row) for name, row in tomllib.loads(_TEXT).items()}


def write(dialect: CsvDialect, header: Sequence[str], columns: Sequence[Sequence[str]]) -> str:
    """Put texts of numbers, column by column, into lines."""
    points = len(columns[0])
    lines = [line.format(points) for line in dialect.opening]
    lines += [dialect.separator.join(header)] * dialect.header
    if dialect.decimal != ".":
        columns = [[text.replace(".", dialect.decimal) for text in column] for column in columns]
    lines += [dialect.separator.join(cells) + dialect.mark for cells in zip(*columns, strict=True)]
    return dialect.line_end.join([*lines, *dialect.closing, ""])


def read(dialect: CsvDialect, text: str) -> list[Row]:
    """Split into rows of cells, the header among them where the dialect has one, decimals with a point.

    Raises
    ------
    ExportError
        What stands around the points is missing, or the text is no table.
    """
    rows = list(_rows(text, dialect.separator))
    while rows and not any(cell.strip() for cell in rows[-1][1]):
        rows.pop()
    if not dialect.header:
        rows = _inner(dialect, rows)
    if dialect.decimal != ".":
        points = rows[1:] if dialect.header else rows
        rows[len(rows) - len(points) :] = [(line, [_point(cell) for cell in cells]) for line, cells in points]
    return rows


def _point(cell: str) -> str:
    """Turn a decimal comma into a point; a point there would be a separator of thousands, and stays wrong."""
    return cell.replace(".", "thousands ").replace(",", ".")


def _inner(dialect: CsvDialect, rows: list[Row]) -> list[Row]:
    """Take off what stands around the points."""
    ends = len(rows) - len(dialect.closing)
    points = rows[len(dialect.opening) : ends]
    around = rows[: len(dialect.opening)] + rows[max(ends, 0) :]
    due = [line.format(len(points)) for line in (*dialect.opening, *dialect.closing)]
    for (line, cells), expected in zip(around, due, strict=False):
        if dialect.separator.join(cells).strip() != expected:
            raise ExportError(
                f"line {line}: {dialect.separator.join(cells)[:40]!r} stands where {expected!r} is due; "
                "points are missing or the file is of another dialect, export it again."
            )
    if len(rows) < len(due):
        raise ExportError("The CSV file breaks off; export it again.")
    if not dialect.mark:
        return points
    for line, cells in points:
        if not cells or cells[-1].strip() != dialect.mark[1:]:  # none on an empty line
            raise ExportError(f"line {line}: {dialect.mark[1:]} is missing; export the table again.")
    return [(line, cells[:-1]) for line, cells in points]


def _rows(text: str, separator: str) -> Iterator[Row]:
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator)
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        raise ExportError(
            f"line {reader.line_num}: not comma-separated values ({error}); export it again."
        ) from error
