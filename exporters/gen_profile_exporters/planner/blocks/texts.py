"""The texts of the blocks, with the sizes of their arrays put in."""

import re
from pathlib import Path

FOLDER = Path(__file__).parent
SIDES = 12  # of a polygon


def linear_programme(name: str, *, slots: int, rows: int) -> str:
    """Write the block of linear programmes.

    Parameters
    ----------
    name : str
        Of the block.
    slots, rows : int
        That a programme has at most; two rows of each pair.
    """
    lengths = {
        "slot": slots,
        "entry": rows * slots,
        "row": rows,
        "pair": max(1, rows // 2),
        "bound": 4 * (slots + 2),
        "side": SIDES * max(1, rows // 2),
        "schur": rows * rows,
        "band": 4 * (slots + 2),
        "wide": slots + 2,
    }
    last = {f"last_{array}": length - 1 for array, length in lengths.items()}
    return filled("linear_programme", linear_programme=name, slots=slots, wide=slots + 2, rows=rows, **last)


def filled(part: str, **values: str | int) -> str:
    """Read a block's text and put in what it leaves open, as ``@name``."""
    text = (FOLDER / f"{part}.st").read_text("ascii")
    return re.sub(r"@([a-z_]+)", lambda hole: str(values[hole[1]]), text)
