"""A route in plan view around what the hoist cannot lift loads over, from corner to corner."""

import heapq
import math
from collections.abc import Sequence
from itertools import pairwise, product

from gen_profile.methods.solvers.over_stacks.bay import Bay, bay_of
from gen_profile.methods.solvers.over_stacks.guide import Place, blocks, guide_along
from gen_profile.spec.model import Spec
from gen_profile.spec.plan_view import EVERYWHERE, Area

TURN = 0.3  # s that a corner of a route is taken to cost
SHORTER = 0.05  # of the time of both axes, that counts beside the slower one's
EARLY = 0.06  # share of the duration, by which loads may be early or late on a route


def way_of(spec: Spec, reserve: float = 0.0) -> Bay:
    """State the straight way over stacks, or one around what the hoist is too low for."""
    straight = bay_of(spec, reserve)
    if len(straight.axes.along) == 1 or straight.needed <= straight.top:
        return straight
    move, axes = spec.move, straight.axes.along
    start, target = ((end[axes[0]], end[axes[1]]) for end in (move.start, move.target))
    bodies = len(straight.plant.bodies)
    plain = bay_of(spec, reserve, guide_along((start, target), (1.0,), bodies, 0.0))
    areas = [zone.area for zone in plain.zones if plain.is_wall(zone)]
    if any(area.holds(end) for area in areas for end in (start, target)):
        return straight
    along, across = (spec.limits.of(axis) for axis in axes)
    route = route_around(
        areas,
        start,
        target,
        speeds=(along.velocity or 1.0, across.velocity or 1.0),
        travels=[along.travel or EVERYWHERE, across.travel or EVERYWHERE],
    )
    if route is None:
        return straight
    around = bay_of(spec, reserve, guide_along(route, plain.legs(route), bodies, EARLY))
    return around if around.needed <= around.top else straight


def route_around(
    areas: Sequence[Area], start: Place, target: Place, speeds: Place, travels: Sequence[Place]
) -> tuple[Place, ...] | None:
    """Find the quickest way of straight legs from corner to corner, at these speeds of both axes.

    Areas count as soon as the way leads through them, so that few corners are tried.

    Parameters
    ----------
    areas : sequence of Area
    start, target : (x, y)
        m.
    speeds : (x, y)
        m/s.
    travels : two of (from, to)
        Within which corners are, m.

    Returns
    -------
    tuple of (x, y), or None
        None where there is no way.
    """
    counted: list[Area] = []
    while True:
        route = _shortest(counted, start, target, speeds, travels)
        if route is None:
            return None
        met = [area for area in areas if any(blocks(area, *leg) for leg in pairwise(route))]
        if not met:
            return route
        if all(area in counted for area in met):
            return None
        counted += [area for area in met if area not in counted]


def _shortest(
    areas: Sequence[Area], start: Place, target: Place, speeds: Place, travels: Sequence[Place]
) -> tuple[Place, ...] | None:
    """Search corners of areas for the quickest way."""
    corners = [corner for area in areas for corner in product(area.x, area.y)]
    within = [
        one
        for one in corners
        if all(low <= at <= high for at, (low, high) in zip(one, travels, strict=True))
        and not any(area.holds(one) for area in areas)
    ]
    points = [start, target, *within]
    queue: list[tuple[float, int, tuple[int, ...]]] = [(0.0, 0, (0,))]
    known = {0: 0.0}
    while queue:
        taken, last, way = heapq.heappop(queue)
        if last == 1:
            return tuple(points[number] for number in way)
        if taken > known[last]:
            continue
        for number, point in enumerate(points):
            legs = [abs(a - b) / speed for a, b, speed in zip(point, points[last], speeds, strict=True)]
            later = taken + max(legs) + SHORTER * sum(legs) + TURN
            if later >= known.get(number, math.inf) or any(
                blocks(area, points[last], point) for area in areas
            ):
                continue
            known[number] = later
            heapq.heappush(queue, (later, number, (*way, number)))
    return None
