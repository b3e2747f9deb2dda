"""Robustness as a picture, like a shaper's sensitivity plot: a curve of every method, or a map of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.charts.figure import HEADROOM, INK, ceiling
from gen_profile.charts.method_styles import method_styles
from gen_profile.charts.picture import in_ink, picture
from gen_profile.comparison.robustness import Robustness
from gen_profile.errors import OutputError

LEVELS = 13
COLUMNS = 4  # of maps
EDGE: dict[str, Any] = {"colors": INK, "linewidths": 2.2}


def draw(found: Robustness, path: Path) -> None:
    """Draw residual sway over one or two parameters, and where it passes the limit.

    Raises
    ------
    OutputError
        The file cannot be written, or no method has a motion.
    """
    if not found.residual:
        raise OutputError("plot: no method has a motion for this move; ask for no picture to see why.")
    if len(found.errors) == 1:
        with picture(path, found.spec.name, (9.0, 6.0)) as figure:
            _curves(figure.subplots(), found)
            figure.suptitle(_title(found))
        return
    count = len(found.residual)
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    size = (3.6 * columns + 1.2, 3.2 * rows + 0.8)
    with picture(path, found.spec.name, size) as figure:
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        _maps(figure, axes, found)
        figure.suptitle(_title(found))


def _title(found: Robustness) -> str:
    load = found.spec.machine().end_load_name
    return f"{found.spec.name}: residual sway of the {load} on machines that are not as specified"


def _curves(axis: Any, found: Robustness) -> None:
    ((name, errors),) = found.errors.items()
    styles = method_styles(found.residual)
    for method in found.residual:
        axis.plot(100.0 * errors, 1e3 * found.end_load(method), label=method, **in_ink(styles[method]))
    limit = 1e3 * found.tolerance
    axis.axhline(limit, color=INK, linewidth=1.2, label="limit")
    _mark_stated(axis.axvspan, found, name)
    highest = max(float(found.end_load(method).max()) for method in found.residual)
    axis.set(
        xlabel=_label(found, name),
        ylabel=f"residual sway of the {found.spec.machine().end_load_name} (mm)",
        xlim=(100.0 * errors[0], 100.0 * errors[-1]),
        ylim=(0.0, ceiling(1e3 * highest, limit)),
    )
    axis.grid(alpha=0.3)
    axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize="small", handlelength=3.5)


def _maps(figure: Any, axes: Any, found: Robustness) -> None:
    (x, across), (y, upwards) = found.errors.items()
    levels = np.linspace(0.0, 1e3 * HEADROOM * found.tolerance, LEVELS)
    flat = axes.ravel()
    for axis, method in zip(flat, found.residual, strict=False):
        sway = 1e3 * found.end_load(method).T
        filled = axis.contourf(100.0 * across, 100.0 * upwards, sway, levels, cmap="viridis_r", extend="max")
        if sway.min() < 1e3 * found.tolerance < sway.max():
            axis.contour(100.0 * across, 100.0 * upwards, sway, [1e3 * found.tolerance], **EDGE)
        axis.set_title(method)
    for axis in flat[: len(found.residual)][-axes.shape[1] :]:  # the lowest of every column
        axis.set_xlabel(_label(found, x))
        axis.tick_params(labelbottom=True)
    for axis in axes[:, 0]:
        axis.set_ylabel(_label(found, y))
    for axis in flat[len(found.residual) :]:
        axis.set_visible(False)
    bar = figure.colorbar(filled, ax=axes, label="residual sway (mm); black: the limit")
    bar.ax.axhline(1e3 * found.tolerance, color=INK, linewidth=2.2)


def _mark_stated(span: Any, found: Robustness, name: str) -> None:
    """Shade the range that the spec states."""
    stated = found.spec.robustness.uncertain.get(name)
    if stated is not None:
        span(-100.0 * stated, 100.0 * stated, color="0.92", zorder=0, label="stated range")


def _label(found: Robustness, name: str) -> str:
    nominal = found.spec.plant.parameters[name]
    (unit,) = (known.unit for known in found.spec.machine().parameters if known.name == name)
    return f"{name} off {nominal:g} {unit} by (%)"
