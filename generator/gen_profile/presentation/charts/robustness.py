"""Robustness, like a shaper's sensitivity plot: a curve of every method, or a map of each."""

from collections.abc import Mapping

from gen_profile.presentation.charts.figure import (
    HEADROOM,
    Band,
    Figure,
    Level,
    Line,
    Map,
    Panel,
    Style,
    beside_limit,
)
from gen_profile.presentation.charts.method_styles import method_styles
from gen_profile.studies.comparison.robustness import Robustness
from gen_profile.support.errors import OutputError
from gen_profile.support.phrase import Phrase

COLUMNS = 4  # of maps


def robustness_figure(curves: Robustness) -> Figure:
    """Draw residual sway over one or two parameters, and where it passes the limit.

    Raises
    ------
    OutputError
        No method has a motion.
    """
    if not curves.residual:
        raise OutputError("plot: no method has a motion for this move; ask for no picture to see why.")
    if len(curves.errors) > 1:
        return maps_figure(curves)
    return curves_figure(dict.fromkeys(curves.errors, curves), method_styles(curves.residual))


def curves_figure(curves: Mapping[str, Robustness], styles: Mapping[str, Style]) -> Figure:
    """Draw curves over the errors of some parameters, each by its name."""
    return Figure(
        "Shaded: the range that the spec states; dashed in red: what is allowed.",
        [_curves(name, one, styles) for name, one in curves.items()],
    )


def maps_figure(grid: Robustness) -> Figure:
    """Draw a map of every method over two parameters."""
    (across, x), (upwards, y) = grid.errors.items()
    stated = grid.spec.robustness.uncertain
    framed = across in stated and upwards in stated
    most = max(float(grid.fraction(method).max()) for method in grid.residual)
    template = "{method} over {across} and {upwards}"
    panels = [
        Map(
            title=Phrase(template, method=method, across=across, upwards=upwards),
            x_label=_off(grid, across),
            y_label=_off(grid, upwards),
            unit="%",
            x=100.0 * x,
            y=100.0 * y,
            values=100.0 * grid.fraction(method).T,
            limit=100.0,
            headroom=min(HEADROOM, max(1.0, most)),
            frame=(100.0 * stated[across], 100.0 * stated[upwards]) if framed else None,
        )
        for method in grid.residual
    ]
    dotted = "; dotted: the ranges that the spec states" if framed else ""
    caption = (
        f"How much of its allowed residual sway the load takes up that takes most, where {across} and "
        f"{upwards} are off at once. Thick line: all of it{dotted}."
    )
    return Figure(caption, panels, columns=min(COLUMNS, len(grid.residual)))


def _curves(name: str, curve: Robustness, styles: Mapping[str, Style]) -> Panel:
    spec, limit = curve.spec, 1e3 * curve.tolerance
    stated = spec.robustness.uncertain.get(name)
    lines = [
        Line(method, 100.0 * curve.errors[name], 1e3 * curve.end_load(method), styles[method])
        for method in curve.residual
    ]
    return Panel(
        Phrase("Residual sway of the {load} over {name}", load=spec.machine().end_load_name, name=name),
        "residual sway (mm)",
        lines,
        x_label=_off(curve, name),
        levels=[Level(limit)],
        bands=[Band(-100.0 * stated, 100.0 * stated)] if stated else [],
        span=beside_limit(max(float(line.y.max()) for line in lines), limit),
    )


def _off(curve: Robustness, name: str) -> str:
    nominal, unit = curve.spec.plant.parameters[name], curve.spec.machine().units[name]
    return Phrase("{name} off {nominal:g} {unit} by (%)", name=name, nominal=nominal, unit=unit)
