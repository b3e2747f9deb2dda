"""Tower crane: a slewing jib, a trolley on it, and a payload on a rope that swings in both directions.

In the frame that turns with the jib (radial, tangential, up) the payload hangs at

    (x, y, z) = (r − L sin θr cos θt, −L sin θt, −L cos θr cos θt)

with r the trolley's radius and α the slew angle: the angles of a universal joint, singular only where the
rope is horizontal, positive when the load trails. Its acceleration in that frame is

    (ẍ − 2 α̇ ẏ − α̈ y − α̇² x,  ÿ + 2 α̇ ẋ + α̈ x − α̇² y,  z̈)

and d'Alembert's principle along e_r = ∂(x, y, z)/∂θr / L and e_t = ∂(x, y, z)/∂θt / L, with a viscous moment
c on the rope's angular velocity relative to the jib, gives the two equations, divided by m L:

    e_r = (−cos θr cos θt, 0, sin θr cos θt),   e_t = (sin θr sin θt, −cos θt, cos θr sin θt)
    L cos²θt θ̈r = −g e_r,z + 2 L sin θt cos θt θ̇r θ̇t − c cos²θt θ̇r / (m L) − e_r · (frame + input)
    L θ̈t        = −g e_t,z − L sin θt cos θt θ̇r² − c θ̇t / (m L) − e_t · (frame + input)
    frame = (−2 α̇ ẏ − α̇² x,  2 α̇ ẋ − α̇² y),   input = (r̈ − α̈ y,  α̈ x)

A steady slew alone pulls the load outward, α̇² x, which only the trolley can answer.
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Pose, Shape, drawn, hanging, stacked
from gen_profile.plants.gantry_crane import outputs  # the payload hangs on the same joint
from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Parameter, Plant, Vector


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the payload's equations of motion (module docstring)."""
    (theta_r, theta_t), (rate_r, rate_t) = q_u, dq_u
    (_, radius), (slew_rate, radius_rate) = q_a, dq_a
    sr, cr, st, ct = np.sin(theta_r), np.cos(theta_r), np.sin(theta_t), np.cos(theta_t)
    damping = p.c / (p.m * p.L)
    x, y = radius - p.L * sr * ct, -p.L * st
    dx = radius_rate + p.L * (sr * st * rate_t - cr * ct * rate_r)
    dy = -p.L * ct * rate_t
    frame_x = -2.0 * slew_rate * dy - slew_rate**2 * x
    frame_y = 2.0 * slew_rate * dx - slew_rate**2 * y
    return Equations(
        M_uu=[[p.L * ct**2, 0.0], [0.0, p.L]],
        M_au=[[cr * ct * y, -sr * st * y - ct * x], [-cr * ct, sr * st]],
        K_u=[-p.g * sr * ct, -p.g * cr * st],
        G_u=[
            2.0 * p.L * st * ct * rate_r * rate_t - damping * ct**2 * rate_r + cr * ct * frame_x,
            -p.L * st * ct * rate_r**2 - damping * rate_t - sr * st * frame_x + ct * frame_y,
        ],
    )


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place the payload below the trolley; at a slew angle of 0 the jib points along x."""
    output, (slew, radius) = outputs(q_u, q_a, p), q_a
    along, across = radius - output.sway[0], -output.sway[1]
    x = along * np.cos(slew) - across * np.sin(slew)
    y = along * np.sin(slew) + across * np.cos(slew)
    return Mechanics(mass=[p.m], place=[(x, y, output.height[0])], gravity=p.g)


def picture(pose: Pose) -> tuple[Drawing, ...]:
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
        drawn(
            "from above",
            pose,
            above,
            Shape(kind="frame", points=[0, 1]),
            Shape(kind="body", points=[2], size=(1.5 * size, 1.5 * size)),
            Shape(kind="rope", points=[3, 4]),
            Shape(kind="hook", points=[3], size=(0.8 * size, 0.8 * size)),
            Shape(kind="load", points=[4], size=(size, size)),
        ),
        hanging(
            "along the jib",
            pose,
            trolley=lambda pose: (pose.q_a[:, 1], np.zeros(len(pose.q_a))),
            columns=slice(0, 1),
        ),
    )


PLANT = Plant(
    type="tower-crane",
    summary="slewing jib with a trolley, and a payload that swings along and across it",
    parameters=(
        Parameter("m", "kg", "payload mass", nominal=1000.0, lower=1e-4, upper=1e6, essential=True),
        Parameter("L", "m", "rope", nominal=10.0, lower=1e-2, upper=200.0, essential=True),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
        Parameter("c", "N m s/rad", "damping at the trolley", nominal=0.0, lower=0.0, upper=1e9),
    ),
    actuated=(Coordinate(name="slew", unit="rad"), Coordinate(name="trolley", unit="m", lower=0.0)),
    unactuated=(Coordinate(name="theta_r", unit="rad"), Coordinate(name="theta_t", unit="rad")),
    loads=("payload-radial", "payload-tangential"),
    directions=2,
    equations=equations,
    outputs=outputs,
    bodies=("payload",),
    mechanics=mechanics,
    picture=picture,
)
