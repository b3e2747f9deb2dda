"""Figures as a page draws them while a knob is turned: one abscissa for all curves of a panel."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.clearance import line_of
from gen_profile.motion.profile import Array
from gen_profile.presentation.charts.figure import Figure, Panel
from gen_profile.presentation.charts.plotly_json import rounded
from gen_profile.presentation.charts.side_view import side_view, standing_on
from gen_profile.spec.model import Spec

MOST = 2000  # points of a curve, of which a screen shows fewer still


def curves_json(figure: Figure) -> list[dict[str, Any]]:
    """Nest plain values of every panel that holds curves."""
    return [_panel(panel) for panel in figure.panels if isinstance(panel, Panel)]


def _panel(panel: Panel) -> dict[str, Any]:
    x = panel.lines[0].x
    rows = [line.y if line.x is x else np.interp(x, line.x, line.y) for line in panel.lines]
    kept = _kept(rows)
    return {
        "title": panel.title,
        "x_label": panel.x_label,
        "y_label": panel.y_label,
        "x": rounded(x[kept]),
        "curves": [
            {
                "name": line.name,
                "colour": line.style.colour,
                "dash": line.style.dash,
                "width": line.style.width,
                "y": rounded(row[kept]),
            }
            for line, row in zip(panel.lines, rows, strict=True)
        ],
        "levels": [{"value": level.value, "between": level.between} for level in panel.levels],
        "bands": [[band.low, band.high] for band in panel.bands],
        "decades": panel.decades,
        "span": panel.span,
    }


def side_json(spec: Spec, places: Array) -> dict[str, Any]:
    """Nest plain values of ways over stacks, seen from the side, and of the stacks.

    Parameters
    ----------
    spec : Spec
        With a path over stacks.
    places : (machines, samples, bodies, 3) array
        As `side_view` takes them.
    """
    panel, path, line = side_view(spec, places), spec.path, line_of(spec)
    assert path is not None
    shown, first = standing_on(path, line), len(path.stacks)

    def obstacles(rows: Sequence[tuple[float, ...]], before: int) -> list[dict[str, Any]]:
        """List those that are in the load's way: how the spec states them, and where they are along it."""
        return [
            {"number": number, "row": row, "shown": shown[before + number]}
            for number, row in enumerate(rows)
            if before + number in shown
        ]

    return {
        "title": panel.title,
        "x_label": panel.x_label,
        "y_label": panel.y_label,
        "lines": [
            {"name": line.name, **attrs.asdict(line.style), "x": rounded(line.x), "y": rounded(line.y)}
            for line in panel.lines
        ],
        "way": line.way,
        "stacks": obstacles(path.stacks, 0),
        "overhead": obstacles(path.overhead, first),
    }


def _kept(rows: Sequence[Array]) -> Any:
    """Choose the points to draw: all, or of every stretch of a long log those where a curve turns."""
    count = len(rows[0])
    if count <= MOST:
        return slice(None)
    stretches = np.array_split(np.arange(count), MOST // (2 * len(rows)))
    choices = product(stretches, rows, (np.argmin, np.argmax))
    return np.unique([0, count - 1, *(stretch[turn(row[stretch])] for stretch, row, turn in choices)])
