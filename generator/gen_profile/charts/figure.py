"""Figures of curves, as the JSON that Plotly draws.

A figure is a group of panels under one legend. Every panel is a plot of its own, so that a narrow screen can
put them below one another; panels of one figure zoom together where their horizontal axis is the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any, ClassVar, Literal

import attrs
import numpy as np

from gen_profile.motion.profile import Array

EVEN = 1e-12  # of the last time, by which even steps may differ
DIGITS = 6  # of a curve's largest value: finer than any screen, and a third of the bytes
SHADE, FRAME, LIMIT, INK, PAPER = "rgba(120,130,140,0.16)", "#6b7680", "#b3261e", "#17212b", "#fff"
HEADROOM = 3.0  # limits up to which values are told apart, lest the worst ones hide the others
SHADES = 12

# told apart by the colour-blind: M. Okabe, K. Ito, Color universal design, 2008; black for what matters most
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5c3e", "#8c8c8c")

Dash = Literal["solid", "dash", "dot"]


def ceiling(highest: float, limit: float) -> float:
    """Choose where an axis ends that shows values up to the highest beside their limit."""
    return max(min(1.05 * highest, HEADROOM * limit), 1.2 * limit)


@attrs.frozen(kw_only=True)
class Style:
    """How a curve looks.

    Attributes
    ----------
    colour : str
    dash : str
    width : float
        In pixels.
    shown : bool
        Whether it is drawn before anybody asks for it.
    """

    colour: str = PALETTE[0]
    dash: Dash = "solid"
    width: float = 1.6
    shown: bool = True


PLAIN = Style()


@attrs.frozen(kw_only=True, eq=False)
class Line:
    """A curve.

    Attributes
    ----------
    name : str
        In the legend; curves of one name are shown and hidden together.
    x, y : (n,) arrays
    style : Style
    """

    name: str
    x: Array
    y: Array
    style: Style = PLAIN


@attrs.frozen(kw_only=True)
class Level:
    """A horizontal line with its name, such as a limit, over a range of x or the whole width."""

    value: float
    name: str = ""
    between: tuple[float, float] | None = None


@attrs.frozen(kw_only=True)
class Band:
    """A range on the horizontal axis; one of no width is a line."""

    low: float
    high: float


@attrs.frozen(kw_only=True, eq=False)
class Panel:
    """A plot.

    Attributes
    ----------
    title : str
    x_label, y_label : str
    lines : sequence of Line
    levels : sequence of Level
    bands : sequence of Band
    decades : float or None
        Of a logarithmic vertical axis, counted down from the greatest value; None for a linear one.
    ceiling : float or None
        Where a vertical axis that begins at 0 ends; None for one that shows everything.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    levels: Sequence[Level] = ()
    bands: Sequence[Band] = ()
    decades: float | None = None
    ceiling: float | None = None

    def to_plotly(self) -> dict[str, Any]:
        """Write traces and layout; Plotly takes texts for markup, so they are escaped."""
        layout: dict[str, Any] = {
            "xaxis": {"title": {"text": escape(self.x_label)}},
            "yaxis": {"title": {"text": escape(self.y_label)}},
            "shapes": [*map(_band, self.bands), *map(_level, self.levels)],
        }
        if self.decades is not None:
            greatest = math.log10(max(float(line.y.max()) for line in self.lines))
            layout["yaxis"] |= {
                "type": "log",
                "range": [greatest - self.decades, greatest + 0.2],
                "dtick": 1,
                "exponentformat": "power",
            }
        elif self.ceiling is not None:
            layout["yaxis"] |= {"range": [0, self.ceiling]}
        return {"data": [_trace(line) for line in self.lines], "layout": layout}


@attrs.frozen(kw_only=True, eq=False)
class Map:
    """A quantity over two others, as colours.

    Attributes
    ----------
    title : str
    x_label, y_label : str
    unit : str
        Of the values, beside the scale of colours.
    x : (n,) array
    y : (m,) array
    values : (m, n) array
        Not negative.
    limit : float
        Above 0. Where the values pass it, there is a line; the colours end at `HEADROOM` times this.
    frame : (float, float)
        Half-width and half-height of a frame around the origin.
    """

    title: str
    x_label: str
    y_label: str
    unit: str
    x: Array
    y: Array
    values: Array
    limit: float
    frame: tuple[float, float]
    lines: ClassVar[Sequence[Line]] = ()

    def to_plotly(self) -> dict[str, Any]:
        """Write traces and layout; Plotly takes texts for markup, so they are escaped."""
        grid = {"type": "contour", "x": rounded(self.x), "y": rounded(self.y)}
        grid["z"] = [rounded(row) for row in self.values]
        end = HEADROOM * self.limit
        step = {"start": 0.0, "end": end, "size": end / SHADES}
        bar = {"title": {"text": escape(self.unit)}, "thickness": 12, "outlinewidth": 0, "dtick": self.limit}
        return {
            "data": [
                {
                    **grid,
                    "contours": step,
                    "line": {"width": 0},
                    **{"zmin": 0.0, "zmax": end, "colorscale": "Viridis", "reversescale": True},
                    "colorbar": bar,
                },
                {
                    **grid,
                    "contours": {"start": self.limit, "end": self.limit, "size": end, "coloring": "none"},
                    "line": {"color": INK, "width": 2.2},
                    **{"showscale": False, "hoverinfo": "skip"},
                },
            ],
            "layout": {
                "xaxis": {"title": {"text": escape(self.x_label)}},
                "yaxis": {"title": {"text": escape(self.y_label)}},
                "hovermode": "closest",
                "shapes": [_frame(self.frame, PAPER, "solid"), _frame(self.frame, INK, "dot")],
            },
        }


@attrs.frozen(kw_only=True, eq=False)
class Figure:
    """Panels under one legend, which names the curves.

    Attributes
    ----------
    caption : str
    panels : sequence of Panel or Map
    """

    caption: str
    panels: Sequence[Panel | Map]
    kind = "figure"

    def to_json(self) -> dict[str, Any]:
        """Nest plain values for the page's script."""
        styles = {line.name: line.style for panel in self.panels for line in panel.lines}
        return {
            "legend": [
                {"name": name, "colour": style.colour, "dash": style.dash, "shown": style.shown}
                for name, style in styles.items()
            ],
            "panels": [panel.to_plotly() for panel in self.panels],
        }


def rounded(values: Array) -> list[float]:
    """Round to `DIGITS` of the largest value, and turn negative zeros into zeros."""
    largest = float(np.abs(values).max(initial=0.0))
    decimals = DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    rounded: list[float] = (np.round(values, decimals) + 0.0).tolist()
    return rounded


def _trace(line: Line) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": escape(line.name),
        "meta": line.name,
        **_abscissa(line.x),
        "y": rounded(line.y),
        "line": {"color": line.style.colour, "dash": line.style.dash, "width": line.style.width},
        "visible": line.style.shown,
    }


def _abscissa(x: Array) -> dict[str, Any]:
    """Write even steps as such: most curves have them, and the page is half as large."""
    steps = np.diff(x)
    if np.ptp(steps) <= EVEN * np.abs(x).max():
        return {"x0": float(x[0]), "dx": float(x[-1] - x[0]) / (len(x) - 1)}
    return {"x": rounded(x)}


def _band(band: Band) -> dict[str, Any]:
    edge = {"width": 1, "color": FRAME, "dash": "dot"} if band.low == band.high else {"width": 0}
    return {
        "type": "rect",
        "layer": "below",
        "x0": band.low,
        "x1": band.high,
        "yref": "paper",
        "y0": 0,
        "y1": 1,
        "fillcolor": SHADE,
        "line": edge,
    }


def _frame(frame: tuple[float, float], colour: str, dash: Dash) -> dict[str, Any]:
    width, height = frame
    return {
        "type": "rect",
        "x0": -width,
        "x1": width,
        "y0": -height,
        "y1": height,
        "line": {"width": 1.2, "color": colour, "dash": dash},
    }


def _level(level: Level) -> dict[str, Any]:
    left, right = level.between or (0, 1)
    return {
        "type": "line",
        "xref": "paper" if level.between is None else "x",
        "x0": left,
        "x1": right,
        "y0": level.value,
        "y1": level.value,
        "line": {"color": LIMIT, "dash": "dash", "width": 1.2},
        "label": {"text": escape(level.name), "textposition": "end", "font": {"size": 11, "color": LIMIT}},
    }
