"""The comparison as a picture."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.errors import OutputError
from gen_profile.workflows.compare import Comparison

SAMPLES = 1500
AFTERMATH = 0.5  # of the move's duration, shown after its end
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


def draw(comparison: Comparison, path: Path) -> None:
    """Draw acceleration and sway of every method over time, nominal and perturbed, and its worst residual.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    import matplotlib  # noqa: PLC0415  # an extra

    matplotlib.use("Agg")
    from matplotlib import pyplot  # noqa: PLC0415

    figure, axes = pyplot.subplots(4, 1, figsize=(9, 11), layout="constrained", height_ratios=[2, 2, 2, 1.3])
    try:
        _fill(axes, comparison)
        figure.suptitle(f"{comparison.spec.name}: {comparison.spec.plant.type}")
        with matplotlib.rc_context({"svg.hashsalt": comparison.spec.name}):  # else ids are random
            figure.savefig(path, dpi=120, metadata=METADATA[path.suffix.lower()])
    except OSError as error:
        raise OutputError(f"--plot {path}: cannot write the picture: {error.strerror or error}.") from error
    finally:
        pyplot.close(figure)


def _fill(axes: Any, comparison: Comparison) -> None:
    """Draw into four axes: acceleration, nominal sway, perturbed sway, and worst residuals as bars."""
    tried = [(row.method, row.trial, row.figures) for row in comparison.rows if row.trial]
    motion, nominal, perturbed, bars = axes
    worst = [figures["sway_residual_worst_m"] for _, _, figures in tried]
    for color, (method, trial, _) in enumerate(tried):
        duration = trial.motion.duration
        times = np.linspace(0.0, duration + min(AFTERMATH * duration, trial.watch), SAMPLES)
        responses = trial.swing.at(times)
        after = [np.abs(response.sway[times >= duration, -1]).max() for response in responses]
        motion.plot(times, trial.motion.derivative(times, 2)[:, 0], color=f"C{color}", label=method)
        nominal.plot(times, 1e3 * responses[0].sway[:, -1], color=f"C{color}")
        perturbed.plot(times, 1e3 * responses[int(np.argmax(after))].sway[:, -1], color=f"C{color}")
    limit = 1e3 * list(comparison.spec.check.residual_sway.values())[-1]
    load = comparison.spec.machine().loads[-1]
    motion.set(ylabel="acceleration (m/s²)")
    motion.legend(loc="upper right", fontsize="small")
    nominal.set(ylabel=f"{load} sway (mm),\nnominal machine")
    perturbed.set(ylabel=f"{load} sway (mm),\nworst machine", xlabel="time (s)")
    for axis in (motion, nominal, perturbed):
        axis.axvline(comparison.spec.move.duration, color="0.7", linewidth=0.8)
        axis.grid(alpha=0.3)
        axis.margins(x=0.0)
    bars.barh(
        [method for method, _, _ in tried],
        [1e3 * value for value in worst],
        color=[f"C{k}" for k in range(len(tried))],
    )
    bars.axvline(limit, color="k", linestyle="--", label=f"limit {limit:.3g} mm")
    bars.invert_yaxis()
    bars.legend(loc="lower right")
    bars.set(xlabel=f"worst residual sway of the {load} (mm)")
