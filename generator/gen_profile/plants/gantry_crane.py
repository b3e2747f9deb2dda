"""Gantry crane: a bridge in x, a trolley in y, and a payload on a rope that swings in both directions.

The payload hangs at (x − L sin θx cos θy, y − L sin θy, −L cos θx cos θy): the angles of a universal joint,
which are singular only where the rope is horizontal. Both are positive when the load trails a positive
acceleration. Lagrange's equations with a viscous moment c on the rope's angular velocity, divided by m L:

    L cos²θy θ̈x = −g sin θx cos θy + 2 L sin θy cos θy θ̇x θ̇y − c cos²θy θ̇x / (m L) + ẍ cos θx cos θy
    L θ̈y        = −g cos θx sin θy − L sin θy cos θy θ̇x² − c θ̇y / (m L) − ẍ sin θx sin θy + ÿ cos θy

(H.-H. Lee, Modeling and control of a three-dimensional overhead crane, 1998, with angles that trail.)
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Pose, Shape, drawn, hanging, level, stacked, travel
from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant, Vector


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the payload's equations of motion (module docstring)."""
    # the rope feels the trolley's acceleration only
    (theta_x, theta_y), (rate_x, rate_y) = q_u, dq_u
    sx, cx, sy, cy = np.sin(theta_x), np.cos(theta_x), np.sin(theta_y), np.cos(theta_y)
    damping = p.c / (p.m * p.L)
    return Equations(
        M_uu=[[p.L * cy**2, 0.0], [0.0, p.L]],
        M_au=[[-cx * cy, sx * sy], [0.0, -cy]],
        K_u=[-p.g * sx * cy, -p.g * cx * sy],
        G_u=[
            2.0 * p.L * sy * cy * rate_x * rate_y - damping * cy**2 * rate_x,
            -p.L * sy * cy * rate_x**2 - damping * rate_y,
        ],
    )


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Sway of the payload in both directions, its height below the trolley, and the rope's two angles."""
    theta_x, theta_y = q_u
    height = -p.L * np.cos(theta_x) * np.cos(theta_y)
    return Outputs(
        sway=[p.L * np.sin(theta_x) * np.cos(theta_y), p.L * np.sin(theta_y)],
        height=[height, height],
        angle=[theta_x, theta_y],
    )


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place the payload below the trolley."""
    output, (x, y) = outputs(q_u, q_a, p), q_a
    return Mechanics(
        mass=[p.m], place=[(x - output.sway[0], y - output.sway[1], output.height[0])], gravity=p.g
    )


def picture(pose: Pose, side: slice = slice(0, 1)) -> tuple[Drawing, ...]:
    """Draw trolley and loads from the side, along x, and with the bridge from above.

    Parameters
    ----------
    pose : Pose
    side : slice
        Which of the outputs are seen from the side.
    """
    x, y = pose.q_a.T[:2]
    size = pose.size
    (left, right), (near, far) = travel(x, 3.0 * size), travel(y, 3.0 * size)

    def above(pose: Pose) -> Array:
        (x, y), sway = pose.q_a.T[:2], pose.loads()[0]
        loads = [(x - sway_x, y - sway_y) for sway_x, sway_y in zip(sway[::2], sway[1::2], strict=True)]
        return stacked(
            (left, near),
            (right, near),
            (left, far),
            (right, far),
            (x, near),
            (x, far),
            (x, y),
            *loads,
            frames=len(x),
        )

    chain = range(6, 7 + len(pose.loads()[0]) // 2)
    return (
        hanging("from the side", pose, trolley=level, columns=side),
        drawn(
            "from above",
            pose,
            above,
            Shape(kind="rail", points=[0, 1]),
            Shape(kind="rail", points=[2, 3]),
            Shape(kind="frame", points=[4, 5]),
            Shape(kind="body", points=[6], size=(size, size)),
            Shape(kind="rope", points=chain),
            *(Shape(kind="hook", points=[point], size=(0.5 * size, 0.5 * size)) for point in chain[1:-1]),
            Shape(kind="load", points=[chain[-1]], size=(0.7 * size, 0.7 * size)),
        ),
    )


PLANT = Plant(
    type="gantry-crane",
    summary="bridge and trolley, and a payload that swings in both directions",
    parameters=(
        Parameter("m", "kg", "payload mass", nominal=1000.0, lower=1e-4, upper=1e6, essential=True),
        Parameter("L", "m", "rope", nominal=5.0, lower=1e-2, upper=200.0, essential=True),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
        Parameter("c", "N m s/rad", "damping at the trolley", nominal=0.0, lower=0.0, upper=1e9),
    ),
    actuated=(Coordinate(name="x", unit="m"), Coordinate(name="y", unit="m")),
    unactuated=(Coordinate(name="theta_x", unit="rad"), Coordinate(name="theta_y", unit="rad")),
    loads=("payload-x", "payload-y"),
    directions=2,
    equations=equations,
    outputs=outputs,
    bodies=("payload",),
    mechanics=mechanics,
    picture=picture,
)
