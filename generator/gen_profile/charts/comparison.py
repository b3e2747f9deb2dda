"""The comparison as a picture: the paper's figures 2 to 5 for all methods, and their worst residuals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.charts.curves import end_load_sway, near_limits
from gen_profile.charts.figure import HEADROOM, LIMIT, Style
from gen_profile.charts.method_styles import method_styles
from gen_profile.charts.picture import in_ink, picture
from gen_profile.comparison.compare import ComparedMethod, Comparison
from gen_profile.errors import OutputError
from gen_profile.evaluation.phrases import machine, number
from gen_profile.evaluation.scenarios import extremes
from gen_profile.evaluation.spectrum import DECADES, natural_frequencies, spectrum
from gen_profile.motion.profile import Array

SAMPLES = 1500
AFTERMATH = 0.5  # of the move's duration, shown after its end
FREQUENCIES = 600
ORDERS = ("position ({})", "velocity ({}/s)", "acceleration ({}/s²)", "jerk ({}/s³)")
NEAR, ROOM = 2.0, 1.05  # times what curves take up, up to which a limit is drawn; what is shown beyond it
OUTLYING = 10.0  # times the middle peak, beyond which a curve may leave its axes, lest it flatten the others

Styles = Mapping[str, Style]


def draw(comparison: Comparison, path: Path) -> None:
    """Draw the motion of the first axis, its spectrum, the end load's sway, and the worst residuals.

    Raises
    ------
    OutputError
        The file cannot be written, or no method has a motion.
    """
    if not comparison.rows:
        raise OutputError("plot: no method has a motion for this move; compare without a picture to see why.")
    advised = {advice.method for advice in comparison.recommended.values()}
    styles = method_styles([row.method for row in comparison.rows], thick=advised)
    with picture(path, comparison.spec.name, (15.0, 19.0)) as figure:
        axes = _places(figure, len(extremes(comparison.spec)))
        _reference(axes[:4], comparison, styles)
        _spectrum(axes[4], comparison, styles)
        _sway(axes[5:-1], comparison, styles)
        _residuals(axes[-1], comparison, styles)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=7, handlelength=3.5)
        figure.suptitle(f"{comparison.spec.name}: {comparison.spec.plant.type}")


def _places(figure: Any, machines: int) -> list[Any]:
    """Lay out four panels of the motion, one of its spectrum, one for every machine, and one below all."""
    left = ["position", "velocity", "acceleration", "jerk"]
    right = ["spectrum", *(f"sway {index}" for index in range(machines))]
    right += right[-1:] * (len(left) - len(right))
    mosaic = [*zip(left, right, strict=True), ("residuals", "residuals")]
    axes = figure.subplot_mosaic(mosaic)
    return [axes[name] for name in (*left, *dict.fromkeys(right), "residuals")]


def _times(row: ComparedMethod) -> Array:
    duration = row.evaluation.motion.duration
    return np.linspace(0.0, duration + min(AFTERMATH * duration, row.evaluation.watch), SAMPLES)


def _reference(axes: Sequence[Any], comparison: Comparison, styles: Styles) -> None:
    """Draw position, velocity, acceleration and jerk of the first axis (the paper's figure 2)."""
    first = comparison.spec.machine().actuated[0]
    for order, (axis, label) in enumerate(zip(axes, ORDERS, strict=True)):
        for row in comparison.rows:
            times = np.linspace(0.0, row.evaluation.motion.duration, SAMPLES)
            values = row.evaluation.motion.derivative(times, order)[:, 0]
            axis.plot(times, values, label=row.method, **in_ink(styles[row.method]))
        axis.set(ylabel=f"{first.name} " + label.format(first.unit), xlabel="time (s)")
        _dress(axis)
        _mark(axis, [level.value for level in near_limits(comparison.spec, 0, order, inf)])


def _spectrum(axis: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw the spectrum of the acceleration, and where the machines' natural frequencies lie (figure 3)."""
    natural = natural_frequencies(comparison.spec, comparison.rows[0].evaluation.machines)
    frequencies = natural.span(FREQUENCIES)
    highest = 0.0
    for row in comparison.rows:
        magnitude = spectrum(row.evaluation.motion, frequencies)
        highest = max(highest, float(magnitude.max()))
        axis.semilogy(frequencies, magnitude, **in_ink(styles[row.method]))
    for low, high in zip(natural.lowest, natural.highest, strict=True):
        axis.axvspan(low, high, color="0.88", zorder=0)
    for frequency in natural.nominal:
        axis.axvline(frequency, color="0.4", linewidth=0.8, zorder=1)
    first = comparison.spec.machine().actuated[0]
    where = " at the target" if natural.varying else ""
    axis.set(
        xlabel=f"frequency (rad/s); natural ones{where} marked, with their ranges",
        ylabel=f"spectrum of the acceleration ({first.unit}/s)",
        ylim=(highest * 10.0**-DECADES, 1.5 * highest),
    )
    axis.grid(alpha=0.3)
    axis.margins(x=0.0)


def _sway(axes: Sequence[Any], comparison: Comparison, styles: Styles) -> None:
    """Draw the end load's sway on the nominal machine, and on both that are off most (figures 4 and 5)."""
    spec = comparison.spec
    for row in comparison.rows:
        times = _times(row)
        responses = row.evaluation.swing.at(times)
        for axis, index in zip(axes, extremes(spec), strict=True):
            sway = 1e3 * end_load_sway(spec, responses[index])
            axis.plot(times, sway, label=row.method, **in_ink(styles[row.method]))
    machines = comparison.rows[0].evaluation.machines
    for axis, index in zip(axes, extremes(spec), strict=True):
        for duration in {row.evaluation.motion.duration for row in comparison.rows}:
            axis.axvline(duration, color="0.7", linewidth=0.8, zorder=0)
        who = machine(machines[index].name) if index else "nominal machine"
        axis.set(ylabel=f"{spec.machine().end_load_name} sway (mm)", xlabel="time (s)")
        axis.set_title(who, fontsize="medium")
        _dress(axis)
        if spec.limits.sway is not None:
            _mark(axis, [1e3 * spec.limits.sway, -1e3 * spec.limits.sway])


def _residuals(axis: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw worst residuals as bars, beside the limit; what the axis cannot hold has an arrow."""
    limit = 1e3 * list(comparison.spec.check.residual_sway.values())[-1]
    methods = [row.method for row in comparison.rows]
    worst = np.array([1e3 * row.figures["sway_residual_worst_m"] for row in comparison.rows])
    end = min(1.1 * max(worst.max(), limit), HEADROOM * limit)
    axis.barh(methods, worst, color=[styles[method].colour for method in methods])
    for place, value in enumerate(worst):
        arrow = "" if value <= end else "▸ "
        axis.text(min(value, end), place, f" {arrow}{number(value)}", va="center", fontsize="small")
    axis.axvline(limit, color="k", linestyle=":")
    axis.invert_yaxis()
    load = comparison.spec.machine().end_load_name
    allowed = f"dotted: {number(limit)} mm are allowed"
    axis.set(xlabel=f"worst residual sway of the {load} over all machines (mm); {allowed}", xlim=(0.0, end))


def _dress(axis: Any) -> None:
    """Draw a grid, and end the axis where most methods do."""
    axis.grid(alpha=0.3)
    axis.margins(x=0.0)
    peaks = [float(np.abs(line.get_ydata()).max()) for line in axis.get_lines() if line.get_label()[0] != "_"]
    if peaks:
        end = OUTLYING * float(np.median(peaks))
        low, high = axis.get_ylim()
        axis.set_ylim(max(low, -end), min(high, end))


def _mark(axis: Any, limits: Iterable[float]) -> None:
    """Draw limits that curves come near on their side, and make room for them."""
    low, high = axis.get_ylim()
    for limit in limits:
        if NEAR * low <= limit <= NEAR * high:
            axis.axhline(limit, color=LIMIT, linewidth=1.0, linestyle="--", zorder=1)
            low, high = min(low, ROOM * limit), max(high, ROOM * limit)
    axis.set_ylim(low, high)
