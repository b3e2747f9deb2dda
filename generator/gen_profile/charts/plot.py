"""A result as a picture in a file, whichever result it is."""

from __future__ import annotations

from pathlib import Path

from gen_profile.charts import comparison, identification, robustness
from gen_profile.charts.picture import require_drawable
from gen_profile.comparison.compare import Comparison
from gen_profile.comparison.robustness import Robustness
from gen_profile.identification.identify import Identification


def plot(result: Comparison | Robustness | Identification, path: Path | str) -> None:
    """Draw a comparison, robustness curves, or a fitted swing.

    Parameters
    ----------
    result : Comparison, Robustness or Identification
    path : Path or str
        Of a PNG, SVG or PDF file.

    Raises
    ------
    OutputError
        The file cannot be written, Matplotlib is not installed, or there is nothing to draw.
    """
    path = Path(path)
    require_drawable(path)
    match result:
        case Comparison():
            comparison.draw(result, path)
        case Robustness():
            robustness.draw(result, path)
        case Identification():
            identification.draw(result, path)
        case _:
            raise TypeError(f"There is no picture of a {type(result).__name__}.")
