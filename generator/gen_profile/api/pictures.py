"""A result as a picture."""

from pathlib import Path

from gen_profile.presentation.charts.plot import Drawn, Picture, picture
from gen_profile.presentation.charts.plot import plot as _plot
from gen_profile.spec.arguments import as_path


def plot(result: Drawn, path: Path | str | None = None, *, every: bool = False) -> Picture | None:
    """Draw a result: a machine, a motion, its sway, a check, a comparison, a swing, a proof.

    Parameters
    ----------
    result : Spec, Plan, Design, Profile, Check, Judgement, Comparison, Robustness, Identification, SwingLog
        or Deployment
    path : Path or str, optional
        Of a PNG, SVG or PDF file. Without one the picture is returned, for a notebook to show.
    every : bool, optional
        Draw the curves of all methods of a comparison, not only of the most telling ones.

    Raises
    ------
    SpecError
        There is no picture of what is given.
    OutputError
        The file cannot be written, Matplotlib is not installed, or there is nothing to draw.

    Examples
    --------
    >>> gp.plot(gp.plan(gp.preset_spec("paper")), "motion.svg")
    """
    if path is None:
        return picture(result, every=every)
    _plot(result, as_path(path), every=every)
    return None
