"""How far a machine's end load may pass its target, in which directions, and what tells where it is."""

from functools import cache

import attrs
import numpy as np

from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec

SWINGS = 3  # states in which a load is looked at
SWING = 0.2  # rad (or m), of these
SAME = 1e-9  # m
EXACTLY = 0.005  # of what is allowed off nominal, at most
EXACT = 3e-5  # of the way: programs look at collocation points, and loads go by so much farther between them


@attrs.frozen(kw_only=True)
class Direction:
    """A direction in which an axis carries the end load, which is where the axis is, less its sway.

    Attributes
    ----------
    axis : int
    component : int
        Of the end load's sway, among its directions.
    body, coordinate : int
        Which of the machine's bodies the end load is, and of its place: x is 0, y is 1.
    """

    axis: int
    component: int
    body: int
    coordinate: int


@attrs.frozen(kw_only=True)
class BoundedTarget:
    """What the end load may pass by little only.

    Attributes
    ----------
    direction : Direction
    at : float
        Place in m.
    way : float
        Signed distance that the axis goes to it, in m.
    most : float
        m, by which a load may pass it on machines off nominal.
    """

    direction: Direction
    at: float
    way: float
    most: float

    @property
    def sign(self) -> float:
        """Of the way."""
        return 1.0 if self.way > 0.0 else -1.0

    @property
    def tolerance(self) -> float:
        """How exactly, in m, solvers keep to it."""
        return min(EXACT * abs(self.way), EXACTLY * self.most)


@cache
def directions(plant: Plant) -> tuple[Direction, ...]:
    """List the directions in which axes of a machine carry its end load along; none where no body tells.

    Not those of an axis that turns, and not where the sway is something else than a load's way, such as the
    rise of a liquid.
    """
    if not plant.bodies:
        return ()
    (at, p), random = plant.probe(), np.random.default_rng(1)
    q_u = random.uniform(-SWING, SWING, (SWINGS, len(plant.unactuated)))
    q_a = np.array(at) + random.uniform(0.0, SWING, (SWINGS, len(at)))
    states = [*zip(q_u.tolist(), q_a.tolist(), strict=True)]
    sways = np.array([plant.outputs(*state, p).sway for state in states], dtype=np.float64)
    places = np.array([plant.mechanics(*state, p).place for state in states], dtype=np.float64)
    found = []
    for component, sway in enumerate(sways[:, plant.end_load].T):
        for axis in (k for k, one in enumerate(plant.actuated) if one.unit == "m"):
            apart = np.abs(places[:, :, :2] - (q_a[:, axis] - sway)[:, None, None]).max(axis=0)
            if apart.min() < SAME:
                body, coordinate = divmod(int(apart.argmin()), 2)
                found.append(Direction(axis=axis, component=component, body=body, coordinate=coordinate))
    return tuple(found)


def targets(spec: Spec) -> tuple[BoundedTarget, ...]:
    """List what ``limits.overshoot`` keeps the end load from passing; nothing without it.

    After the move loads may sway by ``check.residual_sway`` off nominal, so they may pass it by as much.
    """
    limit, plant, move = spec.limits.overshoot, spec.machine(), spec.move
    if limit is None:
        return ()
    remaining = max(spec.check.residual_sway[load] for load in plant.loads[plant.end_load])
    return tuple(
        BoundedTarget(
            direction=one, at=move.target[one.axis], way=move.distance[one.axis], most=max(limit, remaining)
        )
        for one in directions(plant)
        if move.distance[one.axis]
    )
