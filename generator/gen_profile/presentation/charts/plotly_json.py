"""Figures as the JSON that Plotly draws; Plotly takes texts for markup, so they are escaped."""

import math
from html import escape
from typing import Any

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.presentation.charts import figure as parts

EVEN = 1e-12  # of the last time, by which even steps may differ
DIGITS = 6  # of a curve's largest value: finer than any screen, and a third of the bytes
SHADE = "rgba(120,130,140,0.16)"
HATCHES: dict[parts.Dash, str] = {"solid": "", "dash": "/", "dot": ".", "points": ""}
HATCHED = {"fillmode": "overlay", "size": 6, "solidity": 0.2}
DASHED = {"color": parts.LIMIT, "dash": "dash", "width": 1.2}


def figure_json(figure: parts.Figure) -> dict[str, Any]:
    """Nest plain values for a page's script: the legend's entries, and data and layout of every panel."""
    return {
        "legend": [
            {
                "name": name,
                "colour": style.colour,
                "dash": style.dash,
                "shown": style.shown,
                "fill": style.fill,
            }
            for name, style in figure.styles.items()
        ],
        "panels": [_panel(panel) for panel in figure.panels],
    }


def _panel(panel: parts.Panel | parts.Bars | parts.Map) -> dict[str, Any]:
    match panel:
        case parts.Panel():
            return _curves(panel)
        case parts.Bars():
            return _bars(panel)
        case parts.Map():
            return _map(panel)


def _curves(panel: parts.Panel) -> dict[str, Any]:
    layout = _labels(panel.x_label, panel.y_label)
    layout["shapes"] = [*map(_band, panel.bands), *map(_level, panel.levels)]
    if panel.decades is not None:
        greatest = math.log10(max(float(line.y.max()) for line in panel.lines))
        layout["yaxis"] |= {
            "type": "log",
            "range": [greatest - panel.decades, greatest + 0.2],
            "dtick": 1,
            "exponentformat": "power",
        }
    elif panel.span is not None:
        layout["yaxis"] |= {"range": list(panel.span)}
    if panel.even:
        layout["xaxis"] |= {"constrain": "domain"}
        layout["yaxis"] |= {"scaleanchor": "x", "constrain": "domain"}
        layout["hovermode"] = "closest"
    return {"data": [_trace(line) for line in panel.lines], "layout": layout}


def _bars(panel: parts.Bars) -> dict[str, Any]:
    shown = np.minimum(panel.values, panel.end)
    layout = _labels(panel.x_label, "")
    layout["xaxis"] |= {"range": [0, panel.end]}
    layout["yaxis"] |= {"autorange": "reversed", "dtick": 1, "tickfont": {"size": 10}}  # all names
    layout["shapes"] = [_shape("line", (panel.limit, panel.limit), (0, 1), yref="paper", line=DASHED)]
    bars = {
        "type": "bar",
        "orientation": "h",
        "x": rounded(shown),
        "y": [escape(name) for name in panel.names],
        "text": [escape(text) for text in panel.texts],
        "textposition": "auto",
        "hoverinfo": "y+text",
        "marker": {
            "color": [style.colour for style in panel.styles],
            "pattern": {"shape": [HATCHES[style.dash] for style in panel.styles], **HATCHED},
        },
    }
    return {"data": [bars], "layout": {**layout, "hovermode": "closest"}}


def _map(panel: parts.Map) -> dict[str, Any]:
    grid = {"x": rounded(panel.x), "y": rounded(panel.y), "z": [rounded(row) for row in panel.values]}
    end = panel.headroom * panel.limit
    bar = {"title": {"text": escape(panel.unit)}, "thickness": 12, "outlinewidth": 0, "dtick": panel.limit}
    colours = {"zmin": 0.0, "zmax": end, "colorscale": "Viridis", "reversescale": True, "colorbar": bar}
    if panel.cells:
        data = [{"type": "heatmap", **grid, **colours}]
    else:
        step = {"start": 0.0, "end": end, "size": end / parts.SHADES}
        limit = {"start": panel.limit, "end": panel.limit, "size": end, "coloring": "none"}
        ink = {"line": {"color": parts.INK, "width": 2.2}, "showscale": False, "hoverinfo": "skip"}
        data = [
            {"type": "contour", **grid, "contours": step, "line": {"width": 0}, **colours},
            {"type": "contour", **grid, "contours": limit, **ink},
        ]
    layout = {**_labels(panel.x_label, panel.y_label), "hovermode": "closest"}
    if panel.frame is not None:
        layout["shapes"] = [_frame(panel.frame, parts.PAPER, "solid"), _frame(panel.frame, parts.INK, "dot")]
    return {"data": data, "layout": layout}


def _labels(x: str, y: str) -> dict[str, Any]:
    return {"xaxis": {"title": {"text": escape(x)}}, "yaxis": {"title": {"text": escape(y)}}}


def rounded(values: Array) -> list[float | None]:
    """Round to `DIGITS` of the largest value; negative zeros become zeros, and what is no number None."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    numbers: list[float] = (np.round(values, decimals) + 0.0).tolist()
    if not np.isnan(values).any():
        return [*numbers]
    return [None if math.isnan(number) else number for number in numbers]


def _trace(line: parts.Line) -> dict[str, Any]:
    style = line.style
    look: dict[str, Any] = {"line": {"color": style.colour, "width": style.width, "dash": style.dash}}
    if style.dash == "points":
        look = {"marker": {"color": style.colour, "size": 2.0 * style.width}}
    if style.fill:
        look = {"line": {"width": 0}, "fill": "toself", "fillcolor": style.colour, "opacity": style.fill}
        look["hoverinfo"] = "skip"
    return {
        "type": "scatter",
        "mode": "markers" if "marker" in look else "lines",
        "name": escape(line.name),
        "meta": line.name,
        **_abscissa(line.x),
        "y": rounded(line.y),
        **look,
        "visible": style.shown,
    }


def _abscissa(x: Array) -> dict[str, Any]:
    """Write even steps as such: most curves have them, and the page is half as large."""
    if len(x) > 2 and np.ptp(np.diff(x)) <= EVEN * np.abs(x).max():
        return {"x0": float(x[0]), "dx": float(x[-1] - x[0]) / (len(x) - 1)}
    return {"x": rounded(x)}


def _shape(kind: str, x: tuple[float, float], y: tuple[float, float], **look: Any) -> dict[str, Any]:
    return {"type": kind, "x0": x[0], "x1": x[1], "y0": y[0], "y1": y[1], **look}


def _band(band: parts.Band) -> dict[str, Any]:
    edge = {"width": 1, "color": parts.FRAME, "dash": "dot"} if band.low == band.high else {"width": 0}
    look = {"yref": "paper", "layer": "below", "fillcolor": SHADE, "line": edge}
    return _shape("rect", (band.low, band.high), (0, 1), **look)


def _frame(frame: tuple[float, float], colour: str, dash: parts.Dash) -> dict[str, Any]:
    width, height = frame
    line = {"width": 1.2, "color": colour, "dash": dash}
    return _shape("rect", (-width, width), (-height, height), line=line)


def _level(level: parts.Level) -> dict[str, Any]:
    across = "paper" if level.between is None else "x"
    return _shape("line", level.between or (0, 1), (level.value, level.value), xref=across, line=DASHED)
