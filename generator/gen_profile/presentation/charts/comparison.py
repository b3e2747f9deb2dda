"""All methods beside one another: the paper's figures 2 to 5, and their worst residuals."""

from collections.abc import Iterator, Mapping, Sequence

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.phrases import machine, number
from gen_profile.dynamics.evaluation.scenarios import extremes
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.presentation.charts import curves
from gen_profile.presentation.charts.figure import Band, Bars, Figure, Level, Line, Panel, Style
from gen_profile.presentation.charts.method_styles import method_styles
from gen_profile.studies.comparison.candidates import own_method
from gen_profile.studies.comparison.compare import Comparison
from gen_profile.support.errors import OutputError

SAMPLES = 500  # of each curve
PAPERS = ("nzv", "zvd")  # the shapers that the paper compares with
VARIANTS = ("optimal-range", "optimal-order1", "optimal-order2")
OUTLYING = 10.0  # times the middle peak, beyond which a curve may leave its axes, as it flattens the others
ROOM = 1.05  # of what is drawn


def comparison_figure(comparison: Comparison, every: bool = False) -> Figure:
    """Draw the motion of an axis under every method, its spectrum, the end load, and worst residuals.

    Curves of the most telling methods are shown at first, of all methods where `every` says so.

    Raises
    ------
    OutputError
        No method has a motion.
    """
    if not comparison.rows:
        raise OutputError("plot: no method has a motion for this move; compare without a picture to see why.")
    styles = compared_styles(comparison, every)
    motions = {row.method: row.evaluation.motion for row in comparison.rows}
    caption = (
        "Optimal motions solid, shapers dashed, extra-insensitive ones dotted, "
        "bars hatched alike; recommended ones thick. "
        "Dashed in red: limits. Behind the spectrum: natural frequencies, with their ranges."
    )
    spectra = curves.spectrum_panel(comparison.spec, comparison.rows[0].evaluation, motions, styles)
    sways, residuals = _sways(comparison, styles), _residuals(comparison, styles)
    return Figure(caption, [*_motion(comparison, styles), spectra, *sways, residuals])


def compared_styles(comparison: Comparison, every: bool = False) -> dict[str, Style]:
    """Draw the spec's own and the recommended methods thick, and show the most telling ones, or all."""
    methods = [row.method for row in comparison.rows]
    advised = {own_method(comparison.spec), *(advice.method for advice in comparison.recommended.values())}
    styles = method_styles(methods, thick=advised)
    hidden = {*SHAPERS, *VARIANTS} - {*advised, *PAPERS}
    if every or hidden.issuperset(methods):
        hidden = set()
    return {method: attrs.evolve(style, shown=method not in hidden) for method, style in styles.items()}


def _motion(comparison: Comparison, styles: Mapping[str, Style]) -> Iterator[Panel]:
    """Draw position, velocity, acceleration and jerk of that axis (the paper's figure 2)."""
    column = comparison.leading
    first = comparison.spec.machine().actuated[column]
    for order, (quantity, unit) in enumerate(curves.ORDERS):
        lines = [
            curves.derivative_line(
                row.method, row.evaluation.motion, order, column, styles[row.method], SAMPLES
            )
            for row in comparison.rows
        ]
        visible = [line for line in lines if line.style.shown]
        shown = _without_outliers(visible)
        yield Panel(
            f"{quantity} of {first.name}",
            f"{quantity.lower()} ({unit.format(first.unit)})",
            lines,
            levels=tuple(curves.near_limits(comparison.spec, column, order, shown or curves.extent(visible))),
            span=shown,
        )


def _sways(comparison: Comparison, styles: Mapping[str, Style]) -> Iterator[Panel]:
    """Draw the end load on the nominal machine, and on both that are off most (figures 4 and 5)."""
    spec, rows = comparison.spec, comparison.rows
    plant, last = spec.machine(), max(row.evaluation.motion.duration for row in rows)
    evaluations = {row.method: row.evaluation for row in rows}
    ends = {method: one.motion.duration + one.watch for method, one in evaluations.items()}
    responses = {
        method: one.swing.at(np.linspace(0.0, ends[method], SAMPLES)) for method, one in evaluations.items()
    }
    signs = (1.0, -1.0) if plant.directions == 1 else (1.0,)  # the sway in two directions is a length
    for index in extremes(spec):
        lines = [
            Line(method, one[index].times, 1e3 * curves.end_load_sway(spec, one[index]), styles[method])
            for method, one in responses.items()
        ]
        visible = [line for line in lines if line.style.shown]
        span = _without_outliers(visible)
        low, high = span or curves.extent(visible)
        levels = [(1e3 * spec.check.residual_sway[plant.loads[-1]], (last, max(ends.values())))]
        if spec.limits.sway is not None:
            levels.append((1e3 * spec.limits.sway, (0.0, last)))
        yield Panel(
            f"Sway of the {plant.end_load_name}, {machine(rows[0].evaluation.machines[index].name)}",
            "sway (mm)",
            lines,
            levels=[
                Level(sign * value, between)
                for value, between in levels
                for sign in signs
                if 2.0 * low <= sign * value <= 2.0 * high
            ],
            bands=[Band(last, last)],
            span=span,
        )


def _residuals(comparison: Comparison, styles: Mapping[str, Style]) -> Bars:
    worst = np.array([1e3 * row.figures["sway_residual_worst_m"] for row in comparison.rows])
    load = comparison.spec.machine().end_load_name
    return Bars(
        title=f"Worst residual sway of the {load} over all machines",
        x_label="worst residual sway (mm)",
        values=worst,
        names=[row.method for row in comparison.rows],
        styles=[styles[row.method] for row in comparison.rows],
        texts=[number(value) for value in worst.tolist()],
        limit=1e3 * list(comparison.spec.check.residual_sway.values())[-1],
    )


def _without_outliers(lines: Sequence[Line]) -> tuple[float, float] | None:
    """End an axis where most curves do; None where none goes far beyond."""
    peaks = [float(np.abs(line.y).max()) for line in lines]
    end = OUTLYING * float(np.median(peaks))
    low, high = curves.extent(lines)
    return (ROOM * max(low, -end), ROOM * min(high, end)) if max(peaks) > end > 0.0 else None
