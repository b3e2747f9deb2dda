"""Pictures on disk, by Matplotlib, which is an extra."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

from gen_profile.artefacts.writing import deliver, require_place
from gen_profile.charts.figure import Dash, Style
from gen_profile.errors import OutputError

# suffix → metadata that keeps the clock out of the file
METADATA: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
DASHES: dict[Dash, str] = {"solid": "-", "dash": "--", "dot": ":"}


def require_drawable(path: Path) -> None:
    """Find out whether a picture can be drawn, before time goes into what it shows.

    Raises
    ------
    OutputError
        Matplotlib is not installed, the file's suffix is none of a picture, or it cannot be written.
    """
    if path.suffix.lower() not in METADATA:
        raise OutputError(f"plot {path}: name a file that ends in {', '.join(METADATA)}.")
    if find_spec("matplotlib") is None:
        raise OutputError("plot needs Matplotlib: pip install 'gen-profile[plot]'.")
    require_place(path)


@contextmanager
def picture(path: Path, salt: str, size: tuple[float, float]) -> Iterator[Any]:
    """Give an empty figure, and write it when all is drawn.

    Parameters
    ----------
    path : Path
    salt : str
        What ids inside an SVG are made from; they would be random otherwise.
    size : (float, float)
        Width and height in inches.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    import matplotlib  # noqa: PLC0415  # an extra

    matplotlib.use("Agg")
    from matplotlib import pyplot  # noqa: PLC0415

    figure = pyplot.figure(figsize=size, layout="constrained")
    try:
        yield figure
        suffix, drawn = path.suffix.lower(), BytesIO()
        with matplotlib.rc_context({"svg.hashsalt": salt}):
            figure.savefig(drawn, format=suffix[1:], dpi=110, metadata=METADATA[suffix])
    finally:
        pyplot.close(figure)
    deliver(path, drawn.getvalue())


def in_ink(style: Style) -> dict[str, Any]:
    """Say in Matplotlib's words how a curve looks."""
    return {"color": style.colour, "linestyle": DASHES[style.dash], "linewidth": style.width}
