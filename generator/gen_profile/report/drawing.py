"""A machine as a drawing: points that move, and shapes that connect them.

All points are in metres, x to the right and y up. Arrays of points are ``(frames, points, 2)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import attrs
import numpy as np

from gen_profile.profile import Array

Kind = Literal["rail", "rope", "spring", "plumb", "frame", "body", "load", "hook", "liquid"]


@attrs.frozen(kw_only=True)
class Shape:
    """A line through points, or a body around a single one.

    Attributes
    ----------
    kind : str
        ``rail``, ``rope``, ``spring`` and ``frame`` are lines, ``plumb`` is one through the places at rest;
        ``liquid`` is an area; ``body``, ``load`` and ``hook`` stand around one point each.
    points : sequence of int
        Which of the drawing's.
    size : (float, float)
        Half width and half height of a body, in m.
    """

    kind: Kind
    points: Sequence[int]
    size: tuple[float, float] = (0.0, 0.0)


@attrs.frozen(kw_only=True, eq=False)
class Drawing:
    """A machine seen from one side.

    Attributes
    ----------
    title : str
        From where it is seen.
    points : (frames, points, 2) array
        Where they are.
    rest : (frames, points, 2) array
        Where they were if nothing swung, the axes being where they are.
    shapes : sequence of Shape
    """

    title: str
    points: Array
    rest: Array
    shapes: Sequence[Shape]


def stacked(*points: Array | Sequence[Array | float], frames: int) -> Array:
    """Put points, each a pair of coordinates over the frames, into one ``(frames, points, 2)`` array."""
    columns = [[np.broadcast_to(np.asarray(value, dtype=np.float64), frames) for value in p] for p in points]
    return np.moveaxis(np.array(columns), 2, 0)
