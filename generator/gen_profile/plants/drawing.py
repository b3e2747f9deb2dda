"""A machine as a drawing: points that move, and shapes that connect them.

All points are in metres, x to the right and y up. Arrays of points are ``(frames, points, 2)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Literal

import attrs
import numpy as np

from gen_profile.motion.profile import Array

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


@attrs.frozen(kw_only=True, eq=False)
class Pose:
    """A machine's coordinates over the frames.

    Attributes
    ----------
    outputs : callable
        The machine's, `gen_profile.plants.plant.Plant.outputs`.
    parameters : mapping of str to float
    q_a : (frames, m) array
    q_u : (frames, n_u) array
    size : float
        Half width of a trolley in m, the same for all machines that are to be compared.
    """

    outputs: Callable[[Sequence[Any], Sequence[Any], SimpleNamespace], Any]
    parameters: Mapping[str, float]
    q_a: Array
    q_u: Array
    size: float

    @property
    def p(self) -> SimpleNamespace:
        """Parameters as attributes."""
        return SimpleNamespace(**self.parameters)

    def at_rest(self) -> Pose:
        """Stop the swinging, and leave the axes where they are."""
        return attrs.evolve(self, q_u=np.zeros_like(self.q_u))

    def loads(self) -> tuple[Array, Array]:
        """Sway and height of every load, (loads, frames) arrays in m."""
        outputs = self.outputs(list(self.q_u.T), list(self.q_a.T), self.p)
        frames = len(self.q_a)
        sway, height = (
            np.array([np.broadcast_to(np.asarray(one, dtype=np.float64), frames) for one in values])
            for values in (outputs.sway, outputs.height)
        )
        return sway, height


def drawn(title: str, pose: Pose, points: Callable[[Pose], Array], *shapes: Shape) -> Drawing:
    """Draw moving points twice: as the machine swings, and as if it did not."""
    return Drawing(title=title, points=points(pose), rest=points(pose.at_rest()), shapes=shapes)


def travel(positions: Array, beyond: float) -> tuple[float, float]:
    """Find the ends of a rail that is longer than the way on it."""
    return float(positions.min()) - beyond, float(positions.max()) + beyond


def level(pose: Pose) -> tuple[Array, Array]:
    """Move the trolley with the first axis along a level rail."""
    return pose.q_a[:, 0], np.zeros(len(pose.q_a))


def hanging(
    title: str, pose: Pose, *, trolley: Callable[[Pose], tuple[Array, Array]], columns: slice = slice(None)
) -> Drawing:
    """Draw a trolley from the side, with loads on ropes below one another.

    Parameters
    ----------
    title : str
    pose : Pose
    trolley : callable
        Gives x and y of the ropes' upper end, (frames,) arrays in m.
    columns : slice
        Which of the outputs hang there.
    """
    size = pose.size
    way = np.array(trolley(pose)).T
    first, last = way[way[:, 0].argmin()], way[way[:, 0].argmax()]
    along = last - first if last[0] > first[0] else np.array([1.0, 0.0])
    beyond = 3.0 * size * along / np.linalg.norm(along)

    def points(pose: Pose) -> Array:
        sway, height = (values[columns] for values in pose.loads())
        x, y = trolley(pose)
        loads = [(x - s, y + h) for s, h in zip(sway, height, strict=True)]
        return stacked(first - beyond, last + beyond, (x, y), *loads, frames=len(x))

    chain = range(2, 3 + len(pose.loads()[0][columns]))
    hooks = [Shape(kind="hook", points=[point], size=(0.5 * size, 0.5 * size)) for point in chain[1:-1]]
    return drawn(
        title,
        pose,
        points,
        Shape(kind="rail", points=[0, 1]),
        Shape(kind="plumb", points=chain),
        Shape(kind="rope", points=chain),
        Shape(kind="body", points=[2], size=(1.2 * size, 0.6 * size)),
        *hooks,
        Shape(kind="load", points=[chain[-1]], size=(size, size)),
    )
