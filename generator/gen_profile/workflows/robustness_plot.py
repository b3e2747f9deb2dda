"""Robustness as a picture, like a shaper's sensitivity plot: a curve of every method, or a map of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.errors import OutputError
from gen_profile.report.figures import HEADROOM, ceiling
from gen_profile.workflows.comparison_plot import styles
from gen_profile.workflows.picture import picture
from gen_profile.workflows.robustness import Robustness

LEVELS = 13
COLUMNS = 4  # of maps


def draw(found: Robustness, path: Path) -> None:
    """Draw residual sway over one or two parameters, and where it passes the limit.

    Raises
    ------
    OutputError
        The file cannot be written, or no method has a motion.
    """
    if not found.residual:
        raise OutputError("--plot: no method has a motion for this move; leave --plot out to see why.")
    if len(found.errors) == 1:
        with picture(path, found.spec.name, figsize=(9, 6)) as (figure, axis):
            _curves(axis, found)
            figure.suptitle(_title(found))
        return
    count = len(found.residual)
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    size = (3.6 * columns + 1.2, 3.2 * rows + 0.8)
    grid = {"nrows": rows, "ncols": columns, "sharex": True, "sharey": True, "squeeze": False}
    with picture(path, found.spec.name, figsize=size, **grid) as (figure, axes):
        _maps(figure, axes, found)
        figure.suptitle(_title(found))


def _title(found: Robustness) -> str:
    load = found.spec.machine().end_load_name
    return f"{found.spec.name}: residual sway of the {load} on machines that are not as specified"


def _curves(axis: Any, found: Robustness) -> None:
    ((name, errors),) = found.errors.items()
    look = styles(list(found.residual))
    for method in found.residual:
        axis.plot(100.0 * errors, 1e3 * found.end_load(method), label=method, **look[method])
    limit = 1e3 * found.tolerance
    axis.axhline(limit, color="black", linestyle=":", label="limit")
    _mark_stated(axis.axvspan, found, name)
    highest = max(float(found.end_load(method).max()) for method in found.residual)
    axis.set(
        xlabel=_label(found, name),
        ylabel=f"residual sway of the {found.spec.machine().end_load_name} (mm)",
        xlim=(100.0 * errors[0], 100.0 * errors[-1]),
        ylim=(0.0, ceiling(1e3 * highest, limit)),
    )
    axis.grid(alpha=0.3)
    axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize="small")


def _maps(figure: Any, axes: Any, found: Robustness) -> None:
    (x, across), (y, upwards) = found.errors.items()
    levels = np.linspace(0.0, 1e3 * HEADROOM * found.tolerance, LEVELS)
    flat = axes.ravel()
    for axis, method in zip(flat, found.residual, strict=False):
        sway = 1e3 * found.end_load(method).T
        filled = axis.contourf(100.0 * across, 100.0 * upwards, sway, levels, cmap="viridis_r", extend="max")
        if sway.min() < 1e3 * found.tolerance < sway.max():
            axis.contour(
                100.0 * across, 100.0 * upwards, sway, [1e3 * found.tolerance], colors="red", linewidths=1.8
            )
        axis.set_title(method)
    for axis in flat[: len(found.residual)][-axes.shape[1] :]:  # the lowest of every column
        axis.set_xlabel(_label(found, x))
        axis.tick_params(labelbottom=True)
    for axis in axes[:, 0]:
        axis.set_ylabel(_label(found, y))
    for axis in flat[len(found.residual) :]:
        axis.set_visible(False)
    bar = figure.colorbar(filled, ax=axes, label="residual sway (mm); red: the limit")
    bar.ax.axhline(1e3 * found.tolerance, color="red", linewidth=1.8)


def _mark_stated(span: Any, found: Robustness, name: str) -> None:
    """Shade the range that the spec states."""
    stated = found.spec.robustness.uncertain.get(name)
    if stated is not None:
        span(-100.0 * stated, 100.0 * stated, color="0.92", zorder=0, label="stated range")


def _label(found: Robustness, name: str) -> str:
    nominal = found.spec.plant.parameters[name]
    (unit,) = (known.unit for known in found.spec.machine().parameters if known.name == name)
    return f"{name} off {nominal:g} {unit} by (%)"
