"""Tables that people write for a planner block: commas between, and names in the first line."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gen_profile.errors import SpecError

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
        A column is missing; while rows are taken, too: it is no table.
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
    return names, found
