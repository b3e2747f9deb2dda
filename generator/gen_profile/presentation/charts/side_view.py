"""The way of the loads over what stands there, from the side."""

from itertools import pairwise

import numpy as np

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.motion.profile import Array
from gen_profile.presentation.charts.figure import FRAME, LIMIT, PALETTE, Figure, Line, Panel, Style
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import StacksSpec
from gen_profile.support.phrase import Phrase

SAMPLES = 400  # of a way
COLUMNS = 240  # of the region that bodies sweep
STANDING = Style(colour=FRAME, fill=0.55)
ROOM = 1.0  # m above the highest that is shown
KEPT_OUT = Style(colour=LIMIT, dash="dash", width=1.2)


def path_figure(spec: Spec, evaluation: MotionEvaluation) -> Figure:
    """Draw the way of the loads of all machines of a motion over what stands there, from the side."""
    times = np.linspace(0.0, evaluation.motion.duration, SAMPLES)
    panel = side_view(spec, np.asarray(evaluation.swing.bodies(times))[..., ::2])
    caption = (
        "From the side. Shaded: what the load covers on its way, on any machine of the ranges. Dashed: the "
        "clearance; a load that stands within it at the start or the target is lifted out."
    )
    return Figure(caption, [panel])


def side_view(spec: Spec, places: Array) -> Panel:
    """Draw what stands there, and ways of bodies over it.

    Parameters
    ----------
    spec : Spec
        With a path over stacks.
    places : (machines, samples, bodies, 2) array
        m, horizontally and above the suspension; of the nominal machine first.
    """
    path, bodies = spec.path, spec.machine().bodies
    assert path is not None
    ways = places + np.array([0.0, path.rail])
    floor = min(0.0, float(ways[..., 1].min()), *(height for *_, height in _all(path)))
    ceiling = ROOM + max(float(ways[..., 1].max()) + path.load[1], *(top for *_, top in _all(path)))
    lines = [Line("stacks", *_box(low, high, floor, top), STANDING) for low, high, top in path.stacks]
    lines += [Line("overhead", *_box(a, b, height, ceiling), STANDING) for a, b, height in path.overhead]
    looks = [
        (path.size(number, len(bodies)), PALETTE[len(bodies) - 1 - number]) for number in range(len(bodies))
    ]
    for number, (body, (size, colour)) in enumerate(zip(bodies, looks, strict=True)):
        name = Phrase("swept by the {body}", body=body)
        lines.append(Line(name, *swept(ways[:, :, number], size), Style(colour=colour, fill=0.2)))
    sideways, above = path.clearances
    lines.append(Line("clearance", *skyline(path, floor), KEPT_OUT))
    for low, high, height in path.overhead:
        around = _box(low - sideways, high + sideways, ceiling, height - above)
        lines.append(Line("clearance", *around, KEPT_OUT))
    for number, (body, (size, colour)) in enumerate(zip(bodies, looks, strict=True)):
        name = Phrase("middle of the {body}, nominal", body=body)
        lines.append(
            Line(name, ways[0, :, number, 0], ways[0, :, number, 1], Style(colour=colour, width=1.8))
        )
        ends = Style(colour=colour, dash="dot", width=1.2)
        name = Phrase("{body} at start and target", body=body)
        lines += [Line(name, *_around(ways[0, sample, number], size), ends) for sample in (0, -1)]
    return Panel("Over the stacks", "height (m)", lines, x_label="place along the trolley (m)", even=True)


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


def skyline(path: StacksSpec, floor: float) -> tuple[Array, Array]:
    """Outline what bodies keep out of: stacks with the clearance around them, overlaps merged."""
    sideways, above = path.clearances
    wide = [(low - sideways, high + sideways, top + above) for low, high, top in path.stacks]
    edges = sorted({edge for low, high, _ in wide for edge in (low, high)})
    points: list[tuple[float, float]] = [(edges[0], floor)]
    for low, high in pairwise(edges):
        height = max((top for a, b, top in wide if a <= low and high <= b), default=floor)
        points += [(low, height), (high, height)]
    xs, zs = np.array([*points, (edges[-1], floor)]).T
    return xs, zs


def _all(path: StacksSpec) -> tuple[tuple[float, float, float], ...]:
    return (*path.stacks, *path.overhead)


def _box(left: float, right: float, bottom: float, top: float) -> tuple[Array, Array]:
    return np.array([left, left, right, right, left]), np.array([bottom, top, top, bottom, bottom])


def _around(middle: Array, size: tuple[float, float]) -> tuple[Array, Array]:
    (x, z), (wide, high) = middle, size
    return _box(x - wide / 2.0, x + wide / 2.0, z - high / 2.0, z + high / 2.0)
