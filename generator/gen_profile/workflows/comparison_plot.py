"""The comparison as a picture: the paper's figures 2 to 5 for all methods, and their worst residuals."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.errors import OutputError
from gen_profile.profile import Array
from gen_profile.report.figures import HEADROOM
from gen_profile.workflows.compare import Comparison, Row
from gen_profile.workflows.picture import picture
from gen_profile.workflows.report_figures import end_load_sway
from gen_profile.workflows.spectrum import DECADES, natural_frequencies, spectrum

SAMPLES = 1500
AFTERMATH = 0.5  # of the move's duration, shown after its end
FREQUENCIES = 600
ORDERS = ("position ({})", "velocity ({}/s)", "acceleration ({}/s²)", "jerk ({}/s³)")

Styles = Mapping[str, Mapping[str, Any]]


def draw(comparison: Comparison, path: Path) -> None:
    """Draw the motion of the first axis, its spectrum, the end load's sway, and the worst residuals.

    Raises
    ------
    OutputError
        The file cannot be written, or no method has a motion.
    """
    if not comparison.rows:
        raise OutputError("--plot: no method has a motion for this move; compare without --plot to see why.")
    with picture(path, comparison.spec.name, nrows=4, ncols=2, figsize=(15, 16)) as (figure, axes):
        advised = {advice.method for advice in comparison.recommended.values()}
        look = styles([row.method for row in comparison.rows], advised)
        _reference(axes[:, 0], comparison, look)
        _spectrum(axes[0, 1], comparison, look)
        _sway(axes[1:3, 1], comparison, look)
        _residuals(axes[3, 1], comparison, look)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=7)
        figure.suptitle(f"{comparison.spec.name}: {comparison.spec.plant.type}")


def styles(methods: Sequence[str], advised: Collection[str | None] = ()) -> Styles:
    """Draw optimal motions solid, shapers dashed, and those recommended thick."""
    import matplotlib  # noqa: PLC0415

    optimal = [method for method in methods if method.startswith("optimal")]
    shapers = [method for method in methods if method not in optimal]
    found = {}
    for kind, dashes, palette in ((optimal, "-", "tab10"), (shapers, "--", "Dark2")):
        colours = [*matplotlib.color_sequences[palette], "black"]
        for index, method in enumerate(kind):
            width = 2.4 if method in advised else 1.2
            colour = colours[index % len(colours)]
            found[method] = {"color": colour, "linestyle": dashes, "linewidth": width}
    return found


def _times(row: Row) -> Array:
    duration = row.trial.motion.duration
    return np.linspace(0.0, duration + min(AFTERMATH * duration, row.trial.watch), SAMPLES)


def _reference(axes: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw position, velocity, acceleration and jerk of the first axis (the paper's figure 2)."""
    first = comparison.spec.machine().actuated[0]
    for order, (axis, label) in enumerate(zip(axes, ORDERS, strict=True)):
        for row in comparison.rows:
            times = np.linspace(0.0, row.trial.motion.duration, SAMPLES)
            values = row.trial.motion.derivative(times, order)[:, 0]
            axis.plot(times, values, label=row.method, **styles[row.method])
        axis.set(ylabel=f"{first.name} " + label.format(first.unit), xlabel="time (s)")
        _dress(axis)


def _spectrum(axis: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw the spectrum of the acceleration, and where the machines' natural frequencies lie (figure 3)."""
    natural = natural_frequencies(comparison.spec, comparison.rows[0].trial.machines)
    frequencies = natural.span(FREQUENCIES)
    highest = 0.0
    for row in comparison.rows:
        magnitude = spectrum(row.trial.motion, frequencies)
        highest = max(highest, float(magnitude.max()))
        axis.semilogy(frequencies, magnitude, **styles[row.method])
    for low, high in zip(natural.lowest, natural.highest, strict=True):
        axis.axvspan(low, high, color="0.88", zorder=0)
    for frequency in natural.nominal:
        axis.axvline(frequency, color="0.4", linewidth=0.8, zorder=1)
    first = comparison.spec.machine().actuated[0]
    axis.set(
        xlabel="frequency (rad/s); natural ones marked, with their ranges",
        ylabel=f"spectrum of the acceleration ({first.unit}/s)",
        ylim=(highest * 10.0**-DECADES, 1.5 * highest),
    )
    _dress(axis)


def _sway(axes: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw the end load's sway on the nominal machine and on the worst one (figures 4 and 5)."""
    load = comparison.spec.machine().end_load_name
    for row in comparison.rows:
        times = _times(row)
        sways = [end_load_sway(comparison.spec, response) for response in row.trial.swing.at(times)]
        standing = times >= row.trial.motion.duration
        worst = max(sways, key=lambda sway: np.abs(sway[standing]).max())
        for axis, sway in zip(axes, (sways[0], worst), strict=True):
            axis.plot(times, 1e3 * sway, **styles[row.method])
    for axis, machine in zip(axes, ("nominal machine", "each method's worst machine"), strict=True):
        for duration in {row.trial.motion.duration for row in comparison.rows}:
            axis.axvline(duration, color="0.7", linewidth=0.8, zorder=0)
        axis.set(ylabel=f"{load} sway (mm), {machine}", xlabel="time (s)")
        _dress(axis)


def _residuals(axis: Any, comparison: Comparison, styles: Styles) -> None:
    """Draw worst residuals as bars, beside the limit."""
    limit = 1e3 * list(comparison.spec.check.residual_sway.values())[-1]
    methods = [row.method for row in comparison.rows]
    worst = np.array([1e3 * row.figures["sway_residual_worst_m"] for row in comparison.rows])
    end = min(1.1 * max(worst.max(), limit), HEADROOM * limit)
    axis.barh(methods, worst, color=[styles[method]["color"] for method in methods])
    for place, value in enumerate(worst):
        axis.text(min(value, 0.88 * end), place, f" {value:.3g}", va="center", fontsize="small")
    axis.axvline(limit, color="k", linestyle=":", label=f"limit {limit:.3g} mm")
    axis.invert_yaxis()
    axis.legend(loc="lower right")
    load = comparison.spec.machine().end_load_name
    axis.set(xlabel=f"worst residual sway of the {load} (mm)", xlim=(0.0, end))


def _dress(axis: Any) -> None:
    axis.grid(alpha=0.3)
    axis.margins(x=0.0)
