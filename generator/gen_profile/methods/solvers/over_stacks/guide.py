"""Ways in plan view around what a hoist cannot lift loads over: a route, and on which sides loads pass.

A body is outside a rectangle exactly if some line parts them. Which one does at which time is read off a
course that is known, the route at first: a line past a corner then turns with the load that passes it, and
programs stay convex (X. Zhang, A. Liniger and F. Borrelli, Optimization-based collision avoidance, IEEE
Trans. Control Syst. Technol. 29, 2021, state the condition; here the lines are fixed for each program).
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.spec.plan_view import Area, StraightWay

DIRECTIONS = 64  # of lines that part bodies from areas
SAMPLES = 401  # of a guide
INSIDE = 0.1  # m, within an area, from which on a guide is taken to be above it

Place = tuple[float, float]
Numbers = NDArray[np.intp]


@attrs.frozen(kw_only=True, eq=False)
class Guide:
    """About where bodies are, as shares of the duration pass.

    Attributes
    ----------
    route : tuple of (x, y)
        Corners of the way in plan view, m, start and target included.
    places : (samples, bodies, 2) array
        At even shares of the duration, m.
    window : float
        Share of the duration by which bodies may be early or late.
    """

    route: tuple[Place, ...]
    places: Array
    window: float

    def going(self, places: Array, window: float) -> "Guide":
        """Take places of bodies at other even times, (times, bodies, 2)."""
        times = np.linspace(0.0, 1.0, len(places))
        share = np.linspace(0.0, 1.0, SAMPLES)
        bodies = range(places.shape[1])
        even = [[np.interp(share, times, places[:, body, k]) for k in range(2)] for body in bodies]
        return attrs.evolve(self, places=np.array(even).transpose(2, 0, 1), window=window)

    def crosses(self, area: Area) -> bool:
        """Whether the route leads through an area."""
        return any(blocks(area, *leg) for leg in pairwise(self.route))

    def lines(self, area: Area, body: int, rises: float, falls: float) -> tuple[Array, Array]:
        """Choose the line beyond which a body stays at every sample: (samples, 2) normals, and offsets.

        A body at q is beyond it where ``normal · q ≤ offset``.

        Parameters
        ----------
        area : Area
        body : int
        rises, falls : float
            Shares of the duration until and from which it has to be beside the area; what comes between
            counts for nothing.
        """
        outward, level = parting(area)
        beyond = self.places[:, body] @ outward.T - level
        inside = np.flatnonzero(beyond.max(axis=1) < -INSIDE)
        chosen = np.zeros(len(beyond), dtype=np.intp)
        if not len(inside):
            chosen = self._steadily(beyond)
        else:
            first, last = int(inside[0]), int(inside[-1])
            middle = min(max(first, round((rises + falls) / 2.0 * (len(beyond) - 1))), last)
            chosen[:first] = self._steadily(beyond[:first]) if first else 0
            chosen[first:middle] = chosen[max(first - 1, 0)]
            chosen[last + 1 :] = self._steadily(beyond[last + 1 :]) if last + 1 < len(beyond) else 0
            chosen[middle : last + 1] = chosen[min(last + 1, len(beyond) - 1)]
        return -outward[chosen], -level[chosen]

    def _steadily(self, beyond: Array) -> Numbers:
        """Take the lines that bodies are farthest beyond all the time while they may be early or late."""
        late = round(self.window * (SAMPLES - 1))
        padded = np.pad(beyond, ((late, late), (0, 0)), mode="edge")
        least = np.lib.stride_tricks.sliding_window_view(padded, 2 * late + 1, axis=0).min(axis=2)
        return np.asarray(np.argmax(least, axis=1))


def parting(area: Area) -> tuple[Array, Array]:
    """Lines that touch an area: (directions, 2) normals outwards, and how far along each the area reaches."""
    angles = 2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
    outward = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 15)
    kept = np.ones(DIRECTIONS, dtype=bool)
    level = np.zeros(DIRECTIONS)
    for axis, ends in enumerate((area.x, area.y)):
        for sign, end in ((1.0, ends[1]), (-1.0, -ends[0])):
            towards = outward[:, axis] * sign > 0.0
            if math.isinf(end):
                kept &= ~towards
            else:
                level = level + np.where(towards, sign * outward[:, axis] * end, 0.0)
    return outward[kept], level[kept]


def blocks(area: Area, start: Place, target: Place) -> bool:
    """Whether a straight way leads through an area, not only along its edge."""
    length = math.dist(start, target)
    if not length:
        return area.holds(start)
    span = StraightWay.between(start, target).span(area)
    return span is not None and span[0] < length - 1e-9 and span[1] > 1e-9


def guide_along(route: tuple[Place, ...], times: Sequence[float], bodies: int, window: float) -> Guide:
    """Go along a route, all bodies alike, from rest to rest on every leg, by its share of the times."""
    reached = np.concatenate([[0.0], np.cumsum(times)]) / max(sum(times), 1e-9)
    share, points = np.linspace(0.0, 1.0, SAMPLES), np.array(route)
    leg = np.clip(np.searchsorted(reached, share, side="right") - 1, 0, len(route) - 2)
    passed = ((share - reached[leg]) / np.maximum(np.diff(reached)[leg], 1e-9))[:, None]
    smooth = passed**3 * (10.0 - 15.0 * passed + 6.0 * passed**2)
    places = points[leg] + smooth * np.diff(points, axis=0)[leg]
    return Guide(route=route, places=np.repeat(places[:, None], bodies, axis=1), window=window)
