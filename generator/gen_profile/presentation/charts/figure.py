"""Figures of curves, whatever draws them: `plotly_json` for pages, `picture` for files.

A figure is a group of panels under one legend. Every panel is a plot of its own, so that a narrow screen can
put them below one another; panels of one figure zoom together where their horizontal axis is the same.
"""

from collections.abc import Sequence
from typing import ClassVar, Literal

import attrs

from gen_profile.motion.profile import Array

FRAME, LIMIT, INK, PAPER = "#6b7680", "#b3261e", "#17212b", "#fff"
HEADROOM = 3.0  # limits up to which values differ in colour, as the worst would hide the others
SHADES = 12

# told apart by the colour-blind: M. Okabe, K. Ito, Color universal design, 2008; black for what matters most
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5c3e", "#8c8c8c")

Dash = Literal["solid", "dash", "dot", "points"]


def beside_limit(highest: float, limit: float) -> tuple[float, float]:
    """Choose the ends of an axis that shows values from 0 to the highest beside their limit."""
    return 0.0, max(min(1.05 * highest, HEADROOM * limit), 1.2 * limit)


@attrs.frozen(kw_only=True)
class Style:
    """How a curve looks.

    Attributes
    ----------
    colour : str
    dash : str
    width : float
        In pixels; of points the radius.
    shown : bool
        Whether it is drawn before it is asked for.
    fill : float
        Opacity of what a closed curve goes around; 0 where only the curve is drawn.
    """

    colour: str = PALETTE[0]
    dash: Dash = "solid"
    width: float = 1.6
    shown: bool = True
    fill: float = 0.0


PLAIN = Style()


@attrs.frozen(eq=False)
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


@attrs.frozen
class Level:
    """A horizontal line, such as a limit, over a range of x or the whole width."""

    value: float
    between: tuple[float, float] | None = None


@attrs.frozen
class Band:
    """A range on the horizontal axis; one of no width is a line."""

    low: float
    high: float


@attrs.frozen(eq=False)
class Panel:
    """A plot.

    Attributes
    ----------
    title, y_label : str
    lines : sequence of Line
    x_label : str
    levels : sequence of Level
    bands : sequence of Band
    decades : float or None
        Of a logarithmic vertical axis, counted down from the greatest value; None for a linear one.
    span : (float, float) or None
        Ends of the vertical axis; None for one that shows everything.
    even : bool
        Whether a unit is as long on both axes.
    """

    title: str
    y_label: str
    lines: Sequence[Line]
    x_label: str = "time (s)"
    levels: Sequence[Level] = ()
    bands: Sequence[Band] = ()
    decades: float | None = None
    span: tuple[float, float] | None = None
    even: bool = False


@attrs.frozen(kw_only=True, eq=False)
class Bars:
    """A number of each method, side by side.

    Attributes
    ----------
    title, x_label : str
    values : (n,) array
        Not negative.
    names : sequence of str
    styles : sequence of Style
        Of which a bar has the colour, and the dash as a hatch.
    texts : sequence of str
        Beside the bars.
    limit : float
        Above 0; the axis ends at `HEADROOM` times this.
    """

    title: str
    x_label: str
    values: Array
    names: Sequence[str]
    styles: Sequence[Style]
    texts: Sequence[str]
    limit: float
    y_label: ClassVar[str] = "method"
    lines: ClassVar[Sequence[Line]] = ()
    even: ClassVar[bool] = False

    @property
    def end(self) -> float:
        """Where the axis ends."""
        return min(1.1 * max(float(self.values.max()), self.limit), HEADROOM * self.limit)


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
        Not negative; what is no number is left white.
    limit : float
        Above 0. Where the values pass it, there is a line; the colours end at `headroom` times this.
    frame : (float, float) or None
        Half-width and half-height of a frame around the origin.
    cells : bool
        Whether the values are those of cells around the points, not of the points themselves.
    """

    title: str
    x_label: str
    y_label: str
    unit: str
    x: Array
    y: Array
    values: Array
    limit: float
    frame: tuple[float, float] | None = None
    cells: bool = False
    headroom: float = HEADROOM
    lines: ClassVar[Sequence[Line]] = ()
    even: ClassVar[bool] = False


@attrs.frozen(eq=False)
class Figure:
    """Panels under one legend, which names the curves.

    Attributes
    ----------
    caption : str
    panels : sequence of Panel, Bars or Map
    columns : int
        In which a file shows the panels; pages choose for themselves.
    """

    caption: str
    panels: Sequence[Panel | Bars | Map]
    columns: int = 2
    kind = "figure"

    @property
    def styles(self) -> dict[str, Style]:
        """How the curves look, by name."""
        return {line.name: line.style for panel in self.panels for line in panel.lines}
