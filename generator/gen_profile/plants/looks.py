"""What a machine looks like.

A machine's own picture stands with its equations. One without a picture is drawn from its outputs: loads that
hang are drawn as hanging, others as blocks that trail.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Pose, Shape, drawn, hanging, level, stacked
from gen_profile.plants.plant import Plant

BODY = 0.05  # half width of a trolley, as a share of the picture's size


def pose_of(plant: Plant, parameters: Mapping[str, float], q_a: Array, q_u: Array, size: float) -> Pose:
    """Gather what a picture of a machine is drawn from."""
    return Pose(outputs=plant.outputs, parameters=parameters, q_a=q_a, q_u=q_u, size=size)


def body_size(plant: Plant, parameters: Mapping[str, float], q_a: Array) -> float:
    """Choose how large a trolley is drawn, from how far a machine reaches and moves, in m."""
    still = np.zeros((len(q_a), len(plant.unactuated)))
    _, height = pose_of(plant, parameters, q_a, still, 0.0).loads()
    ways = [np.ptp(way) for way, axis in zip(q_a.T, plant.actuated, strict=True) if axis.unit == "m"]
    return BODY * float(max([np.abs(height).max(), *ways]))


def drawings(plant: Plant, pose: Pose) -> tuple[Drawing, ...]:
    """Draw a machine from every side that shows something.

    Parameters
    ----------
    plant : Plant
    pose : Pose
        Over the frames of the animation.
    """
    if plant.picture:
        return plant.picture(pose)
    _, height = pose.at_rest().loads()
    if not np.abs(height).max() > 0.0:
        return _rail(plant, pose)
    columns = slice(0, len(plant.loads) - plant.directions + 1)
    return (hanging("from the side", pose, trolley=partial(_suspension, plant), columns=columns),)


def _rail(plant: Plant, pose: Pose) -> tuple[Drawing, ...]:
    """Draw loads that do not hang as blocks behind the axis, one after the other."""
    linear = plant.actuated[0].unit == "m"
    count = len(plant.loads)
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
        drawn(
            "from the side",
            pose,
            points,
            Shape(kind="rail", points=[0, 1]),
            *(Shape(kind="spring", points=[point, point + 1]) for point in chain[:-1]),
            Shape(kind="body", points=[2], size=(size, size)),
            *(Shape(kind="load", points=[point], size=(size, size)) for point in chain[1:]),
        ),
    )


def _suspension(plant: Plant, pose: Pose) -> tuple[Array, Array]:
    """Find where the first load hangs from: above its place at rest, where the machine tells places."""
    if not plant.bodies:
        turning = plant.actuated[0].unit == "rad"
        return (0.0 * pose.q_a[:, 0], 0.0 * pose.q_a[:, 0]) if turning else level(pose)
    rest = pose.at_rest()
    x, _, z = plant.mechanics(list(rest.q_u.T), list(rest.q_a.T), rest.p).place[0]
    _, height = rest.loads()
    places = stacked((x, z - height[0]), frames=len(rest.q_a))[:, 0]
    return places[:, 0], places[:, 1]
