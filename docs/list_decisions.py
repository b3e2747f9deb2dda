"""Print the table of decisions of docs/planner-algorithm.md, made from the heading of the planner's block.

python docs/list_decisions.py
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEADING = ROOT / "exporters/gen_profile_exporters/planner/blocks/decisions.st"
TABLE = re.compile(r"(?m)^ {7}command .*\n(?:(?: {7}|@).*\n)+")
CELL = re.compile(r"\S+(?: \S+)*")
NAME = re.compile(r"\b[bcfn][A-Z]\w+")


def rows() -> list[list[str]]:
    """Read the table's rows, its head first: cells go on in the lines below, until both first ones begin."""
    (found,) = TABLE.findall(HEADING.read_text("ascii"))
    lines = [list(CELL.finditer(line)) for line in found.splitlines() if line[0] != "@"]
    columns = [cell.start() for cell in lines[0]]
    laid_out = list[list[str]]()
    for line in lines:
        cells = [""] * len(columns)
        for cell in line:
            nearest = min(range(len(columns)), key=lambda column: abs(columns[column] - cell.start()))
            cells[nearest] = cell[0]
        goes_on = bool(laid_out) and laid_out[-1][0] == "prompt"  # to a prompt stop
        if cells[0] and cells[1] and not goes_on:
            laid_out.append(cells)
        else:
            laid_out[-1] = [
                f"{above} {more}".strip() for above, more in zip(laid_out[-1], cells, strict=True)
            ]
    return laid_out


def table() -> str:
    """Lay the decisions out as a table of Markdown, names of the text as code."""
    head, *below = (f"| {' | '.join(cells)} |" for cells in rows())
    return NAME.sub(r"`\g<0>`", "\n".join([head, "|---" * len(rows()[0]) + "|", *below]))


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
