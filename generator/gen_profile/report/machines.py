"""What every machine looks like.

A picture is made of one machine's coordinates over the frames of an animation. One that nobody drew is drawn
from its outputs: loads that hang are drawn as hanging, others as blocks that trail.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.plants.plant import Plant
from gen_profile.profile import Array
from gen_profile.report.drawing import Drawing, Shape, stacked

BODY = 0.05  # half width of a trolley, as a share of the picture's size
SURFACE = 17  # points of a liquid's surface
ODD = (1, 3)  # half waves of the slosh tank's modes along the tank


@attrs.frozen(kw_only=True, eq=False)
class Pose:
    """A machine's coordinates over the frames.

    Attributes
    ----------
    plant : Plant
    parameters : mapping of str to float
    q_a : (frames, m) array
    q_u : (frames, n_u) array
    size : float
        Half width of a trolley in m, the same for all machines that are to be compared.
    """

    plant: Plant
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
        outputs = self.plant.outputs(list(self.q_u.T), list(self.q_a.T), self.p)
        frames = len(self.q_a)
        sway, height = (
            np.array([np.broadcast_to(np.asarray(one, dtype=np.float64), frames) for one in values])
            for values in (outputs.sway, outputs.height)
        )
        return sway, height


Points = Callable[[Pose], Array]


def body_size(plant: Plant, parameters: Mapping[str, float], q_a: Array) -> float:
    """Choose how large a trolley is drawn, from how far a machine reaches and moves, in m."""
    still = np.zeros((len(q_a), len(plant.unactuated)))
    _, height = Pose(plant=plant, parameters=parameters, q_a=q_a, q_u=still, size=0.0).loads()
    ways = [np.ptp(way) for way, axis in zip(q_a.T, plant.actuated, strict=True) if axis.unit == "m"]
    return BODY * float(max([np.abs(height).max(), *ways]))


def drawings(pose: Pose) -> tuple[Drawing, ...]:
    """Draw a machine from every side that shows something.

    Parameters
    ----------
    pose : Pose
        Over the frames of the animation.
    """
    known = PICTURES.get(pose.plant.type)
    return known(pose) if known else _from_outputs(pose)


def _drawing(title: str, pose: Pose, points: Points, *shapes: Shape) -> Drawing:
    return Drawing(title=title, points=points(pose), rest=points(pose.at_rest()), shapes=shapes)


def _travel(positions: Array, beyond: float) -> tuple[float, float]:
    """Find the ends of a rail that is longer than the way on it."""
    return float(positions.min()) - beyond, float(positions.max()) + beyond


def _hanging(
    title: str, pose: Pose, *, trolley: Callable[[Pose], tuple[Array, Array]], columns: slice = slice(None)
) -> Drawing:
    """Draw a trolley from the side, with loads on ropes below one another."""
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

    count = len(pose.plant.loads[columns])
    chain = range(2, 3 + count)
    hooks = [Shape(kind="hook", points=[point], size=(0.5 * size, 0.5 * size)) for point in chain[1:-1]]
    return _drawing(
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


def _crane(pose: Pose) -> tuple[Drawing, ...]:
    return (_hanging("from the side", pose, trolley=_level),)


def _level(pose: Pose) -> tuple[Array, Array]:
    """Move the trolley with the first axis along a level rail."""
    return pose.q_a[:, 0], np.zeros(len(pose.q_a))


def _gantry(pose: Pose) -> tuple[Drawing, ...]:
    """Draw trolley and load from the side, along x, and with the bridge from above."""
    x, y = pose.q_a.T
    size = pose.size
    (left, right), (near, far) = _travel(x, 3.0 * size), _travel(y, 3.0 * size)

    def above(pose: Pose) -> Array:
        (x, y), (sway_x, sway_y) = pose.q_a.T, pose.loads()[0]
        return stacked(
            (left, near),
            (right, near),
            (left, far),
            (right, far),
            (x, near),
            (x, far),
            (x, y),
            (x - sway_x, y - sway_y),
            frames=len(x),
        )

    return (
        _hanging("from the side", pose, trolley=_level, columns=slice(0, 1)),
        _drawing(
            "from above",
            pose,
            above,
            Shape(kind="rail", points=[0, 1]),
            Shape(kind="rail", points=[2, 3]),
            Shape(kind="frame", points=[4, 5]),
            Shape(kind="body", points=[6], size=(size, size)),
            Shape(kind="rope", points=[6, 7]),
            Shape(kind="load", points=[7], size=(0.7 * size, 0.7 * size)),
        ),
    )


def _tower(pose: Pose) -> tuple[Drawing, ...]:
    """Draw the jib from above, and trolley and load along it."""
    reach, size = 1.1 * float(pose.q_a[:, 1].max()), pose.size

    def above(pose: Pose) -> Array:
        (slew, radius), (radial, tangential) = pose.q_a.T, pose.loads()[0]
        along, across = np.stack([np.cos(slew), np.sin(slew)]), np.stack([-np.sin(slew), np.cos(slew)])
        load = (radius - radial) * along - tangential * across
        return stacked(
            tuple(-0.25 * reach * along),
            tuple(reach * along),
            (0.0, 0.0),
            tuple(radius * along),
            tuple(load),
            frames=len(slew),
        )

    return (
        _drawing(
            "from above",
            pose,
            above,
            Shape(kind="frame", points=[0, 1]),
            Shape(kind="body", points=[2], size=(1.5 * size, 1.5 * size)),
            Shape(kind="rope", points=[3, 4]),
            Shape(kind="hook", points=[3], size=(0.8 * size, 0.8 * size)),
            Shape(kind="load", points=[4], size=(size, size)),
        ),
        _hanging(
            "along the jib",
            pose,
            trolley=lambda pose: (pose.q_a[:, 1], np.zeros(len(pose.q_a))),
            columns=slice(0, 1),
        ),
    )


def _joint(pose: Pose) -> tuple[Drawing, ...]:
    """Draw hub and arm from above; where the arm would be if it were stiff is drawn as its plumb line."""
    reach = pose.p.R

    def above(pose: Pose) -> Array:
        arm = pose.q_a[:, 0] - pose.q_u[:, 0]
        tip = reach * np.cos(arm), reach * np.sin(arm)
        return stacked((0.0, 0.0), tip, frames=len(arm))

    return (
        _drawing(
            "from above",
            pose,
            above,
            Shape(kind="plumb", points=[0, 1]),
            Shape(kind="frame", points=[0, 1]),
            Shape(kind="hook", points=[0], size=(0.1 * reach, 0.1 * reach)),
            Shape(kind="load", points=[1], size=(BODY * reach, BODY * reach)),
        ),
    )


def _rail(pose: Pose) -> tuple[Drawing, ...]:
    """Draw loads that do not hang as blocks behind the axis, one after the other."""
    linear = pose.plant.actuated[0].unit == "m"
    count = len(pose.plant.loads)
    way = float(np.ptp(pose.q_a[:, 0])) if linear else 0.0
    most = float(np.abs(pose.loads()[0]).max())
    apart = max(way, 3.0 * most) / count
    size = 0.25 * apart

    def points(pose: Pose) -> Array:
        sway, _ = pose.loads()
        place = pose.q_a[:, 0] if linear else np.zeros(len(pose.q_a))
        blocks = [(place - number * apart - s, 0.0) for number, s in enumerate(sway, start=1)]
        low = float(place.min()) - (count + 0.5) * apart
        high = float(place.max()) + 0.5 * apart
        ground = [(low, -size), (high, -size)]
        return stacked(*ground, (place, 0.0), *blocks, frames=len(place))

    chain = range(2, 3 + count)
    return (
        _drawing(
            "from the side",
            pose,
            points,
            Shape(kind="rail", points=[0, 1]),
            *(Shape(kind="spring", points=[point, point + 1]) for point in chain[:-1]),
            Shape(kind="body", points=[2], size=(size, size)),
            *(Shape(kind="load", points=[point], size=(size, size)) for point in chain[1:]),
        ),
    )


def _tank(pose: Pose) -> tuple[Drawing, ...]:
    """Draw the tank with the liquid: each mode is a cosine along it, and as high at the wall as it says."""
    a, h = pose.p.a, pose.p.h
    height = 1.35 * h
    along = np.linspace(0.0, 1.0, SURFACE)

    def points(pose: Pose) -> Array:
        place = pose.q_a[:, 0]
        heights = [
            4.0 * a / (odd * np.pi) ** 2 * np.sin(theta) for odd, theta in zip(ODD, pose.q_u.T, strict=True)
        ]
        surface = [
            (
                place + (share - 0.5) * a,
                h + sum(rise * np.cos(odd * np.pi * share) for odd, rise in zip(ODD, heights, strict=True)),
            )
            for share in along
        ]
        left, right = place - 0.5 * a, place + 0.5 * a
        corners = [(left, height), (left, 0.0), (right, 0.0), (right, height)]
        low, high = _travel(place, 0.6 * a)
        return stacked((low, 0.0), (high, 0.0), *corners, *surface, frames=len(place))

    surface = range(6, 6 + SURFACE)
    return (
        _drawing(
            "from the side",
            pose,
            points,
            Shape(kind="rail", points=[0, 1]),
            Shape(kind="plumb", points=[surface[0], surface[-1]]),
            Shape(kind="liquid", points=[3, *surface, 4]),
            Shape(kind="frame", points=[2, 3, 4, 5]),
        ),
    )


def _from_outputs(pose: Pose) -> tuple[Drawing, ...]:
    """Draw a machine that nobody drew: its first axis, and its loads as they hang or trail."""
    _, height = pose.at_rest().loads()
    if not np.abs(height).max() > 0.0:
        return _rail(pose)
    columns = slice(0, len(pose.plant.loads) - pose.plant.directions + 1)
    return (_hanging("from the side", pose, trolley=_suspension, columns=columns),)


def _suspension(pose: Pose) -> tuple[Array, Array]:
    """Find where the first load hangs from: above its place at rest, where the machine tells places."""
    if not pose.plant.bodies:
        turning = pose.plant.actuated[0].unit == "rad"
        return (0.0 * pose.q_a[:, 0], 0.0 * pose.q_a[:, 0]) if turning else _level(pose)
    rest = pose.at_rest()
    x, _, z = rest.plant.mechanics(list(rest.q_u.T), list(rest.q_a.T), rest.p).place[0]
    _, height = rest.loads()
    places = stacked((x, z - height[0]), frames=len(rest.q_a))[:, 0]
    return places[:, 0], places[:, 1]


PICTURES: dict[str, Callable[[Pose], tuple[Drawing, ...]]] = {
    "double-pendulum-crane": _crane,
    "flexible-joint": _joint,
    "gantry-crane": _gantry,
    "single-pendulum-crane": _crane,
    "slosh-tank": _tank,
    "tower-crane": _tower,
}
