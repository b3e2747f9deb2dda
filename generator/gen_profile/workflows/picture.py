"""Pictures on disk, by Matplotlib, which is an extra."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gen_profile.errors import OutputError

# suffix → metadata that keeps the clock out of the file
METADATA: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def require_drawable(path: Path) -> None:
    """Find out whether a picture can be drawn, before time goes into what it shows.

    Raises
    ------
    OutputError
        Matplotlib is not installed, or the file's suffix is none of a picture.
    """
    if path.suffix.lower() not in METADATA:
        raise OutputError(f"--plot {path}: name a file that ends in {', '.join(METADATA)}.")
    if find_spec("matplotlib") is None:
        raise OutputError("--plot needs Matplotlib: pip install 'gen-profile[plot]'.")


@contextmanager
def picture(path: Path, salt: str, **layout: Any) -> Iterator[tuple[Any, Any]]:
    """Give a figure with its axes, and write it when all is drawn.

    Parameters
    ----------
    path : Path
    salt : str
        What ids inside an SVG are made from; they would be random otherwise.
    layout
        As `matplotlib.pyplot.subplots` takes it.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    import matplotlib  # noqa: PLC0415  # an extra

    matplotlib.use("Agg")
    from matplotlib import pyplot  # noqa: PLC0415

    figure, axes = pyplot.subplots(layout="constrained", **layout)
    try:
        yield figure, axes
        with matplotlib.rc_context({"svg.hashsalt": salt}):
            figure.savefig(path, dpi=110, metadata=METADATA[path.suffix.lower()])
    except OSError as error:
        raise OutputError(f"--plot {path}: cannot write the picture: {error.strerror or error}.") from error
    finally:
        pyplot.close(figure)
