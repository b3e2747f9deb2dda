"""What stands where, seen from above: rectangles along a machine's axes, and a straight way past them."""

import math
from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.motion.profile import Array

EVERYWHERE = (-math.inf, math.inf)


@attrs.frozen
class Area:
    """A rectangle in plan view; a machine of one horizontal axis knows no `y`.

    Attributes
    ----------
    x, y : (from, to)
        m.
    """

    x: tuple[float, float]
    y: tuple[float, float] = EVERYWHERE

    def widened(self, x: float, y: float) -> "Area":
        """Move all edges outwards."""
        return Area((self.x[0] - x, self.x[1] + x), (self.y[0] - y, self.y[1] + y))

    def outside(self, x: Array | float, y: Array | float = 0.0) -> Array:
        """Tell how far outside a place is, along the axis along which it is farther; negative within."""
        sides = [self.x[0] - x, x - self.x[1], self.y[0] - y, y - self.y[1]]
        return np.asarray(np.maximum.reduce(np.broadcast_arrays(*sides)))

    def holds(self, place: Sequence[float]) -> bool:
        """Whether a place is within, not at an edge."""
        x, y = place
        return self.x[0] < x < self.x[1] and self.y[0] < y < self.y[1]


@attrs.frozen(kw_only=True)
class StraightWay:
    """A straight way in plan view, both axes in step; of one axis alone, that axis itself.

    Attributes
    ----------
    origin : (x, y)
        m, from where places along it are counted.
    way : (x, y)
        By how much each axis moves as the place along the line grows by 1; of length 1.
    """

    origin: tuple[float, float] = (0.0, 0.0)
    way: tuple[float, float] = (1.0, 0.0)

    @classmethod
    def between(cls, start: Sequence[float], target: Sequence[float]) -> "StraightWay":
        """Lay it from a place to another one, each of one axis or two."""
        if len(start) == 1:
            return cls()
        (x, y), (to_x, to_y) = start, target
        length = math.hypot(to_x - x, to_y - y)
        return cls(origin=(x, y), way=((to_x - x) / length, (to_y - y) / length) if length else (1.0, 0.0))

    def along(self, places: Array) -> Array:
        """Tell how far along the line places are, from x and y in the last axis."""
        return np.asarray((places - np.array(self.origin)) @ np.array(self.way))

    def span(self, area: Area) -> tuple[float, float] | None:
        """Tell between which places along it the line is within an area; none where it goes past."""
        low, high = EVERYWHERE
        for origin, way, (begin, end) in zip(self.origin, self.way, (area.x, area.y), strict=True):
            if way == 0.0:
                if not begin < origin < end:
                    return None
                continue
            ends = sorted(((begin - origin) / way, (end - origin) / way))
            low, high = max(low, ends[0]), min(high, ends[1])
        return (low, high) if low < high else None

    def extent(self, x: float, y: float) -> float:
        """Tell how much of the line a rectangle of a size covers whose middle is on it, in m."""
        parts = [size / abs(way) for size, way in zip((x, y), self.way, strict=True) if way != 0.0]
        return min(parts)
