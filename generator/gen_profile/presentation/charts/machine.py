"""A drawing of a machine with the names that its spec uses: axes, angles and lengths, and their signs.

All is found from the machine's own picture: what moves with an axis or a coordinate, and which line grows
with which parameter.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Shape
from gen_profile.plants.looks import body_size, drawings, pose_of
from gen_profile.plants.plant import Plant
from gen_profile.presentation.charts.figure import FRAME, INK, PALETTE
from gen_profile.presentation.charts.picture import plain, write

SWING = 0.35  # rad (or m) of every swinging coordinate
TURN = 0.6  # rad of an axis that turns
STEP = 1e-3  # of an axis or a parameter, to see what moves or grows
VISIBLE = 0.1  # of the picture's size, that a way is drawn from
TURNED = 0.1  # rad of a line, likewise
ROUND = 0.02  # of a line's length, by which it may change as it turns
APART = 9.0  # points between what is drawn and its name
AXIS, ANGLE = PALETTE[0], PALETTE[1]
LINES = {"rope": 1.4, "spring": 1.4, "frame": 3.0, "rail": 1.0}  # widths by kind


@attrs.frozen(kw_only=True, eq=False)
class MachineView:
    """A machine from one side: as it swings, and with each axis moved and each coordinate at rest.

    Attributes
    ----------
    drawing : Drawing
        Its frames: all coordinates swung; each axis a step on; each swinging coordinate at 0.
    plant : Plant
    grown : mapping of str to (points, 2) array
        The places at rest where a parameter is a step greater.
    """

    drawing: Drawing
    plant: Plant
    grown: Mapping[str, Array]

    @property
    def size(self) -> float:
        """Width or height in m, whichever is greater."""
        return float(np.ptp(self.drawing.points[0], axis=0).max())

    def moved(self) -> Iterator[tuple[str, int, Array]]:
        """Find which point each axis moves, and the direction: the first, or where it hangs, the last."""
        points = self.drawing.points
        shapes = self.drawing.shapes
        bodies = [shape.points[0] for shape in shapes if shape.size != (0.0, 0.0)]
        bodies += [point for shape in shapes for point in shape.points if shape.kind == "frame"]
        for frame, axis in enumerate(self.plant.actuated, start=1):
            way = points[frame] - points[0]
            moving = [point for point in bodies if np.linalg.norm(way[point]) > 0.1 * STEP]
            if moving:
                point = moving[-1] if moving[0] in self.hanging() else moving[0]
                yield axis.name, point, way[point] / np.linalg.norm(way[point])

    def hanging(self) -> list[int]:
        """List the points of the machine's bodies, the lowest one last."""
        loads = [shape.points[0] for shape in self.drawing.shapes if shape.kind in {"hook", "load"}]
        return loads[-len(self.plant.bodies) :]

    def swung(self) -> Iterator[tuple[str, int, Array]]:
        """Find which point each swinging coordinate moves first, and where that is without it."""
        points, first = self.drawing.points, 1 + len(self.plant.actuated)
        for number, coordinate in enumerate(self.plant.unactuated, start=first):
            without = points[number]
            away = np.linalg.norm(points[0] - without, axis=1)
            rotated = [end for start, end in self.pieces() if _turn(points[0], without, start, end) > TURNED]
            if rotated:
                yield coordinate.name, rotated[0], without[rotated[0]]
            elif away.max() > VISIBLE * self.size:
                point = int((away > 0.99 * away.max()).argmax())
                yield coordinate.name, point, without[point]

    def pieces(self) -> Iterator[tuple[int, int]]:
        """List the pieces of the lines that hold something: the points at their ends."""
        for shape in self.drawing.shapes:
            if shape.kind in {"rope", "spring", "frame"}:
                yield from pairwise(shape.points)

    def lengths(self) -> Iterator[tuple[str, tuple[int, int]]]:
        """Name the lines that grow with parameters, and with axes, as much as these do."""
        rest = self.drawing.rest
        others = {axis.name: rest[frame] for frame, axis in enumerate(self.plant.actuated, start=1)}
        for start, end in self.pieces():
            length = np.linalg.norm(rest[0][end] - rest[0][start])
            names = [
                name
                for name, places in {**self.grown, **others}.items()
                if np.isclose(np.linalg.norm(places[end] - places[start]) - length, STEP, rtol=0.05)
            ]
            if names and names[0] in self.grown:
                yield " + ".join(names), (start, end)


def _turn(points: Array, others: Array, start: int, end: int) -> float:
    """Find the angle in rad between a piece of a line and where it is otherwise."""
    (x, y), (u, v) = points[end] - points[start], others[end] - others[start]
    return float(abs(np.arctan2(x * v - y * u, x * u + y * v)))


def draw_machine(plant: Plant, parameters: Mapping[str, float], path: Path, title: str) -> None:
    """Draw a machine from every side that shows something, with the names of its variables.

    Parameters
    ----------
    plant : Plant
    parameters : mapping of str to float
        SI.
    path : Path
        Of a PNG, SVG or PDF file.
    title : str

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure as Canvas  # noqa: PLC0415  # an extra

    sides_shown = views(plant, parameters)
    canvas = Canvas(figsize=(5.0 * len(sides_shown) + 3.8, 5.0), layout="constrained")
    widths = [5.0] * len(sides_shown) + [3.6]
    *sides, table = canvas.subplots(1, len(widths), width_ratios=widths)
    for axis, view in zip(sides, sides_shown, strict=True):
        _draw(axis, view)
    table.axis("off")
    table.text(0.0, 1.0, plain(_explained(plant, parameters)), va="top", fontsize="small", family="monospace")
    canvas.suptitle(fill(plain(title), round(10 * sum(widths))))
    write(canvas, path, plant.type)


def views(plant: Plant, parameters: Mapping[str, float]) -> list[MachineView]:
    """Look at a machine from every side that shows something."""
    still = np.zeros((1, len(plant.unactuated)))
    at_probe = np.array([plant.probe()[0]])
    reach = float(np.abs(pose_of(plant, parameters, at_probe, still, 0.0).loads()[1]).max()) or 1.0
    places = [
        TURN if axis.unit == "rad" else np.clip(reach, axis.lower, axis.upper) for axis in plant.actuated
    ]
    axes, swings = len(plant.actuated), len(plant.unactuated)
    q_a = np.tile(np.array(places, dtype=np.float64), (1 + axes + swings, 1))
    q_u = np.full((1 + axes + swings, swings), SWING)
    q_a[1 : 1 + axes] += STEP * np.eye(axes)
    q_u[1 + axes :] -= SWING * np.eye(swings)
    size = body_size(plant, parameters, q_a)

    def drawn(changed: Mapping[str, float]) -> tuple[Drawing, ...]:
        return drawings(plant, pose_of(plant, changed, q_a, q_u, size))

    lengths = [one.name for one in plant.parameters if one.unit == "m"]
    grown = {name: drawn({**parameters, name: parameters[name] + STEP}) for name in lengths}
    sides = []
    for number, one in enumerate(drawn(parameters)):
        longer = {name: more[number].rest[0] for name, more in grown.items()}
        sides.append(MachineView(drawing=one, plant=plant, grown=longer))
    return sides


def _draw(axis: Any, view: MachineView) -> None:
    points, rest = view.drawing.points[0], view.drawing.rest[0]
    for shape in view.drawing.shapes:
        _shape(axis, shape, rest if shape.kind == "plumb" else points)
    for name, (start, end) in view.lengths():
        along = points[end] - points[start]
        _name(axis, points[start] + 0.4 * along, name, INK, _left_of(along))
    for name, point, direction in view.moved():
        clear = max((max(s.size) for s in view.drawing.shapes if list(s.points) == [point]), default=0.0)
        begin = points[point] + 1.3 * clear * direction
        end = begin + 0.16 * view.size * direction
        _arrow(axis, begin, end, AXIS)
        _name(axis, end, f"+{name}", AXIS, direction)
    for name, point, without in view.swung():
        meet = sum(other == point for _, other, _ in view.swung()) > 1
        _swing(axis, view, name, point, without, meet=meet)
    loads = [shape for shape in view.drawing.shapes if shape.kind in {"hook", "load"}]
    for body, shape in zip(view.plant.bodies[::-1], loads[::-1], strict=False):
        aside = np.array([0.7, 0.7 if shape.kind == "hook" else -0.7])
        _name(axis, points[shape.points[0]] + shape.size * aside, body, INK, aside)
    axis.set(title=view.drawing.title, aspect="equal")
    axis.margins(0.12)
    axis.axis("off")


def _shape(axis: Any, shape: Shape, points: Array) -> None:
    from matplotlib.patches import Ellipse, Polygon, Rectangle  # noqa: PLC0415  # an extra

    places, (wide, high) = points[list(shape.points)], shape.size
    match shape.kind:
        case "body":
            axis.add_patch(Rectangle(places[0] - shape.size, 2 * wide, 2 * high, color=FRAME, zorder=3))
        case "load" | "hook":
            axis.add_patch(Ellipse(places[0], 2 * wide, 2 * high, color=INK, zorder=3))
        case "liquid":
            axis.add_patch(Polygon(places, color=PALETTE[5], alpha=0.4))
        case "plumb":
            axis.plot(*places.T, color=FRAME, linewidth=0.8, linestyle=":")
        case _:
            axis.plot(*places.T, color=INK, linewidth=LINES[shape.kind])


def _swing(axis: Any, view: MachineView, name: str, point: int, without: Array, *, meet: bool) -> None:
    """Draw the angle about the point that holds the line, or else the way of the point.

    Ways that meet have their names where they begin.
    """
    points = view.drawing.points[0]
    held = [start for start, end in view.pieces() if end == point]
    if held:
        pivot = points[held[0]]
        before, after = without - pivot, points[point] - pivot
        long, length = np.linalg.norm(before), np.linalg.norm(after)
        if abs(long - length) < ROUND * length:
            start, end = (np.arctan2(one[1], one[0]) for one in (before, after))
            turn = np.linspace(start, start + (end - start + np.pi) % (2 * np.pi) - np.pi, 20)
            arc = pivot + 0.62 * length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            axis.plot(*np.array([pivot, without]).T, color=ANGLE, linewidth=0.8, linestyle="--")
            axis.plot(*arc.T, color=ANGLE, linewidth=1.2)
            _arrow(axis, arc[-2], arc[-1], ANGLE)
            _name(axis, arc[0], f"+{name}", ANGLE, arc[0] - arc[2])
            return
    _arrow(axis, without, points[point], ANGLE)
    way = points[point] - without
    if meet:
        _name(axis, without, f"+{name}", ANGLE, _left_of(way) - way)
    else:
        _name(axis, without + 0.5 * way, f"+{name}", ANGLE, _left_of(way))


def _arrow(axis: Any, start: Array, end: Array, colour: str) -> None:
    look = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 1.6}
    axis.annotate("", end, start, arrowprops=look, zorder=4)
    axis.plot(*np.array([start, end]).T, linestyle="none")  # so that the limits know of it


def _left_of(along: Array) -> Array:
    """Turn a direction so that a name beside a line that leads down stands at its left."""
    return np.array([along[1], -along[0]])


def _name(axis: Any, place: Array, text: str, colour: str, towards: Array) -> None:
    """Write a name beside a place, in some direction, clear of it."""
    x, y = towards / np.linalg.norm(towards)
    sides = {"ha": ("right", "center", "left")[round(1.2 * x) + 1]}
    sides["va"] = ("top", "center", "bottom")[round(y) + 1]
    offset = {"xytext": (APART * x, APART * y), "textcoords": "offset points"}
    weight = "normal" if colour == INK else "bold"
    axis.annotate(text, place, **offset, **sides, color=colour, fontweight=weight, zorder=5)


def _explained(plant: Plant, parameters: Mapping[str, float]) -> str:
    """List what the spec calls things: axes, what swings, and parameters with their values."""
    lines = [
        "axes      " + ", ".join(f"{one.name} ({one.unit})" for one in plant.actuated),
        "swinging  " + ", ".join(f"{one.name} ({one.unit})" for one in plant.unactuated),
        "loads     " + ", ".join(plant.loads),
        "",
    ]
    for one in plant.parameters:
        lines += [f"{one.name:<4}{parameters[one.name]:g} {one.unit}", f"    {one.description}"]
    return "\n".join(lines)
