"""The way of the loads over what stands there, from the side, and from above."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from gen_profile.dynamics.evaluation.clearance import line_of
from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.motion.profile import Array
from gen_profile.presentation.charts.figure import FRAME, LIMIT, PALETTE, Figure, Line, Panel, Style
from gen_profile.spec.model import Spec
from gen_profile.spec.plan_view import StraightWay
from gen_profile.spec.stacks import StacksSpec, path_axes
from gen_profile.support.phrase import Phrase

SAMPLES = 400  # of a way
COLUMNS = 240  # of the region that bodies sweep
STANDING = Style(colour=FRAME, fill=0.55)
ROOM = 1.0  # m above the highest that is shown
SIDE = (
    "From the side. Shaded: what the load covers on its way, on any machine of the ranges. Dashed: the "
    "clearance; a load that stands within it at the start or the target is lifted out."
)
ABOVE = "From above, likewise."
Box = tuple[float, float, float]  # from, to, and top or underside, in m
PARTS = 40  # of a way around something, of which each is nearly straight
ASIDE = 0.05  # m off the straight way, from which on it is none
CORNERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
AROUND = Style(colour=FRAME, dash="dot", width=1.2)
KEPT_OUT = Style(colour=LIMIT, dash="dash", width=1.2)


def path_figure(spec: Spec, evaluation: MotionEvaluation) -> Figure:
    """Draw the way of the loads of all machines of a motion over what stands there."""
    times = np.linspace(0.0, evaluation.motion.duration, SAMPLES)
    places = np.asarray(evaluation.swing.bodies(times))
    panels, caption = [side_view(spec, places)], SIDE
    if spec.path is not None and len(evaluation.motion.target) == 3:
        panels.append(plan_view(spec, places))
        caption = f"{SIDE} {ABOVE}"
    return Figure(caption, panels)


def on_line(spec: Spec, places: Array) -> Array:
    """Turn places of bodies (x, y, z in the last axis) into those along the way of a path and heights."""
    return np.stack([line_of(spec).along(places[..., :2]), places[..., 2]], axis=-1)


def side_view(spec: Spec, places: Array) -> Panel:
    """Draw what stands there, and ways of bodies over it.

    Parameters
    ----------
    spec : Spec
        With a path over stacks.
    places : (machines, samples, bodies, 3) array
        m; of the nominal machine first.
    """
    path, bodies, line = spec.path, spec.machine().bodies, line_of(spec)
    assert path is not None
    ways, beside = on_line(spec, places) + np.array([0.0, path.rail]), gone_around(spec, places)
    on_way = standing_on(path, line)
    standing, overhead = _split(path, {k: box for k, box in on_way.items() if k not in beside})
    heights = [top for *_, top in (*standing, *overhead)]
    floor = min([0.0, float(ways[..., 1].min()), *heights])
    ceiling = ROOM + max([float(ways[..., 1].max()) + path.load[-1], *heights])
    bottoms = {k: ceiling if k >= len(path.stacks) else floor for k in beside}
    lines = [Line("stacks", *_box(low, high, floor, top), STANDING) for low, high, top in standing]
    lines += [Line("overhead", *_box(a, b, height, ceiling), STANDING) for a, b, height in overhead]
    for k, bottom in bottoms.items():
        left, right, height = on_way[k]
        lines.append(Line("gone around", *_box(left, right, bottom, min(height, ceiling)), AROUND))
    looks = _looks(path, bodies)
    for number, (body, (size, colour)) in enumerate(zip(bodies, looks, strict=True)):
        seen = (line.extent(*size[:2]), size[2])
        name = Phrase("swept by the {body}", body=body)
        lines.append(Line(name, *swept(ways[:, :, number], seen), Style(colour=colour, fill=0.2)))
    wider = standing_on(path, line, path.clearances)
    kept_out, hanging = _split(path, {k: box for k, box in wider.items() if k not in beside})
    if kept_out:
        lines.append(Line("clearance", *skyline(kept_out, floor), KEPT_OUT))
    lines += [Line("clearance", *_box(low, high, ceiling, under), KEPT_OUT) for low, high, under in hanging]
    for number, (body, (size, colour)) in enumerate(zip(bodies, looks, strict=True)):
        name = Phrase("middle of the {body}, nominal", body=body)
        lines.append(
            Line(name, ways[0, :, number, 0], ways[0, :, number, 1], Style(colour=colour, width=1.8))
        )
        ends = Style(colour=colour, dash="dot", width=1.2)
        name = Phrase("{body} at start and target", body=body)
        seen = (line.extent(*size[:2]), size[2])
        lines += [Line(name, *_around(ways[0, sample, number], seen), ends) for sample in (0, -1)]
    one = len(spec.move.target) == 2
    label = "place along the trolley (m)" if one else "place along the way in plan view (m)"
    return Panel("Over the stacks", "height (m)", lines, x_label=label, even=True)


def plan_view(spec: Spec, places: Array) -> Panel:
    """Draw what stands there and what bodies cover, from above.

    Parameters
    ----------
    spec : Spec
        With a path over stacks, and of two horizontal axes.
    places : (machines, samples, bodies, 3) array
        m; of the nominal machine first.
    """
    path, bodies = spec.path, spec.machine().bodies
    assert path is not None
    edges = [
        edge for number in range(len(path.obstacles)) for edge in path.area(number).y if np.isfinite(edge)
    ]
    y = [*edges, float(places[..., 1].min()), float(places[..., 1].max())]
    hall = (min(y) - ROOM, max(y) + ROOM)  # as far as bands are drawn
    names, sideways = ["stacks"] * len(path.stacks) + ["overhead"] * len(path.overhead), path.clearances[0]
    lines, straight = [], is_straight(spec, places)
    for around, style in ((0.0, STANDING), (sideways, KEPT_OUT)):
        for number, name in enumerate(names):
            area = path.area(number).widened(around, around)
            width = np.clip(area.y, *hall)
            lines.append(Line("clearance" if around else name, *_box(*area.x, *width), style))
    for number, (body, (size, colour)) in enumerate(zip(bodies, _looks(path, bodies), strict=True)):
        ends = Style(colour=colour, dash="dot", width=1.2)
        way, half = places[:, :, number, :2], np.array(size[:2]) / 2.0
        name = Phrase("swept by the {body}", body=body)
        x, y = _covered(way, half, 1 if straight else PARTS).T
        lines.append(Line(name, x, y, Style(colour=colour, fill=0.2)))
        name = Phrase("middle of the {body}, nominal", body=body)
        lines.append(Line(name, way[0, :, 0], way[0, :, 1], Style(colour=colour, width=1.8)))
        name = Phrase("{body} at start and target", body=body)
        lines += [Line(name, *_around(way[0, sample], size[:2]), ends) for sample in (0, -1)]
    names = [axis.name for axis in spec.machine().actuated]
    axes = path_axes(spec.machine(), spec.plant.parameters)
    assert axes is not None
    x_label, y_label = (f"{names[axis]} (m)" for axis in axes.along)
    return Panel("From above", y_label, lines, x_label=x_label, even=True)


def _covered(way: Array, half: Array, parts: int) -> Array:
    """Outline what a box covers, (points, 2), by hulls of so many parts of its way; NaN is behind each.

    They turn the same way round, so that they are one shape where they overlap.
    """
    ends = np.linspace(0, way.shape[1] - 1, parts + 1).astype(np.intp)
    hulls: list[Array] = []
    for first, last in pairwise(ends.tolist()):
        corners = (way[:, first : last + 1, None] + half * CORNERS).reshape(-1, 2)
        hulls += [corners[ConvexHull(corners).vertices] if half.all() else way[0, first : last + 1]]
        hulls += [np.full((1, 2), np.nan)]
    return np.concatenate(hulls)


def is_straight(spec: Spec, places: Array) -> bool:
    """Whether nominal bodies (machines, samples, bodies, 3) stay on the straight way in plan view."""
    (x, y), line = line_of(spec).way, places[0, ..., :2]
    aside = (line - line[0]) @ np.array([-y, x])
    return bool(np.abs(aside).max() <= ASIDE)


def gone_around(spec: Spec, places: Array) -> frozenset[int]:
    """Tell what on the straight way no nominal body is over or below, as the way leads around it.

    Parameters
    ----------
    spec : Spec
    places : (machines, samples, bodies, 3) array
        m.
    """
    path, count = spec.path, places.shape[2]
    assert path is not None
    if is_straight(spec, places):
        return frozenset()
    met: set[int] = set()
    for body in range(count):
        x, y, _ = places[0, :, body].T
        wide, deep, _ = path.size(body, count)
        areas = (path.area(k).widened(wide / 2.0, deep / 2.0) for k in range(len(path.obstacles)))
        met |= {k for k, area in enumerate(areas) if (area.outside(x, y) < 0.0).any()}
    return frozenset(standing_on(path, line_of(spec))) - met


def _looks(path: StacksSpec, bodies: Sequence[str]) -> list[tuple[tuple[float, float, float], str]]:
    """Choose size and colour of every body."""
    count = len(bodies)
    return [(path.size(number, count), PALETTE[count - 1 - number]) for number in range(count)]


def standing_on(
    path: StacksSpec, way: StraightWay, clearances: tuple[float, float] = (0.0, 0.0)
) -> dict[int, tuple[float, float, float]]:
    """Tell what is in a load's way, as it meets it: from and to along the way, and height, by number.

    Parameters
    ----------
    path : StacksSpec
    way : Line
        In plan view.
    clearances : (float, float)
        To the sides and upwards, that are counted as parts of what stands there.
    """
    (wide, deep, _), (sideways, above), found = path.size(0, 1), clearances, {}
    for number, (*_, height) in enumerate(path.obstacles):
        span = way.span(path.area(number).widened(wide / 2.0 + sideways, deep / 2.0 + sideways))
        if span is None:
            continue
        half = min(way.extent(wide, deep) / 2.0, (span[1] - span[0]) / 2.0)
        up = above if number < len(path.stacks) else -above
        found[number] = (span[0] + half, span[1] - half, height + up)
    return found


def _split(path: StacksSpec, found: Mapping[int, Box]) -> tuple[list[Box], list[Box]]:
    """Part what stands from what is overhead."""
    count = len(path.stacks)
    return [one for k, one in found.items() if k < count], [one for k, one in found.items() if k >= count]


def swept(ways: Array, size: tuple[float, float]) -> tuple[Array, Array]:
    """Outline what boxes cover on their ways, from their lowest to their highest in every column.

    Parameters
    ----------
    ways : (machines, samples, 2) array
        m, of their middles.
    size : (float, float)
        Width and height in m.
    """
    wide, high = size
    x, z = ways[..., 0], ways[..., 1]
    columns = np.linspace(x.min() - wide / 2.0, x.max() + wide / 2.0, COLUMNS)[:, None, None]
    reach = wide / 2.0 + 1e-9
    begin, way = x[:, :-1], np.where(np.diff(x) == 0.0, 1e-12, np.diff(x))
    # between which shares of its way from sample to sample a box is in a column
    ends = np.sort(np.stack([(columns - reach - begin) / way, (columns + reach - begin) / way]), axis=0)
    first, last = np.maximum(ends[0], 0.0), np.minimum(ends[1], 1.0)
    heights = np.stack([z[:, :-1] + share * np.diff(z) for share in (first, last)])
    inside = first <= last
    lowest = np.where(inside, heights, np.inf).min(axis=(0, 2, 3)) - high / 2.0
    highest = np.where(inside, heights, -np.inf).max(axis=(0, 2, 3)) + high / 2.0
    kept, places = np.isfinite(lowest), columns[:, 0, 0]
    return (
        np.concatenate([places[kept], places[kept][::-1]]),
        np.concatenate([lowest[kept], highest[kept][::-1]]),
    )


def skyline(boxes: Sequence[Box], floor: float) -> tuple[Array, Array]:
    """Outline boxes (from, to, top), overlaps merged."""
    edges = sorted({edge for low, high, _ in boxes for edge in (low, high)})
    points: list[tuple[float, float]] = [(edges[0], floor)]
    for low, high in pairwise(edges):
        height = max((top for a, b, top in boxes if a <= low and high <= b), default=floor)
        points += [(low, height), (high, height)]
    xs, zs = np.array([*points, (edges[-1], floor)]).T
    return xs, zs


def _box(left: float, right: float, bottom: float, top: float) -> tuple[Array, Array]:
    return np.array([left, left, right, right, left]), np.array([bottom, top, top, bottom, bottom])


def _around(middle: Array, size: Sequence[float]) -> tuple[Array, Array]:
    (x, z), (wide, high) = middle, size
    return _box(x - wide / 2.0, x + wide / 2.0, z - high / 2.0, z + high / 2.0)
