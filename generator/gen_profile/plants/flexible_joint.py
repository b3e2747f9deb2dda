"""Rotary flexible joint: a driven hub, and an arm that a torsion spring ties to it.

α is how far the arm trails the hub, so the arm stands at θ − α. Euler's equation of the arm about the hub's
axis, with a viscous moment c α̇ in the joint:

    J α̈ = −k α − c α̇ + J θ̈

The sway is the arc R α that the arm's tip trails by, measured along its circle. Gravity plays no part: the
arm turns in a horizontal plane. (M. W. Spong, Modeling and control of elastic joint robots, 1987, with the
motor's side driven.)
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Pose, Shape, drawn, stacked
from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant, Vector


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the arm's equation of motion (module docstring)."""
    # the arm feels the hub's acceleration only
    (alpha,), (rate,) = q_u, dq_u
    return Equations(M_uu=[[p.J]], M_au=[[-p.J]], K_u=[-p.k * alpha], G_u=[-p.c * rate])


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Arc by which the arm's tip trails the hub, in m, and the joint's angle."""
    (alpha,) = q_u
    return Outputs(sway=[p.R * alpha], height=[0.0], angle=[alpha])


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place a mass at the tip that has the arm's moment of inertia."""
    (alpha,), (hub,) = q_u, q_a
    place = (p.R * np.cos(hub - alpha), p.R * np.sin(hub - alpha), 0.0)
    return Mechanics(mass=[p.J / p.R**2], place=[place], springs=0.5 * p.k * alpha**2)


def picture(pose: Pose) -> tuple[Drawing, ...]:
    """Draw hub and arm from above; where the arm would be if it were stiff is drawn as its plumb line."""
    reach = pose.p.R

    def above(pose: Pose) -> Array:
        arm = pose.q_a[:, 0] - pose.q_u[:, 0]
        tip = reach * np.cos(arm), reach * np.sin(arm)
        return stacked((0.0, 0.0), tip, frames=len(arm))

    return (
        drawn(
            "from above",
            pose,
            above,
            Shape(kind="plumb", points=[0, 1]),
            Shape(kind="frame", points=[0, 1]),
            Shape(kind="hook", points=[0], size=(0.1 * reach, 0.1 * reach)),
            Shape(kind="load", points=[1], size=(0.05 * reach, 0.05 * reach)),
        ),
    )


PLANT = Plant(
    type="flexible-joint",
    summary="arm behind a torsion spring on a driven hub",
    parameters=(
        Parameter(
            "J",
            "kg m^2",
            "moment of inertia of the arm",
            nominal=0.0035,
            lower=1e-9,
            upper=1e9,
            essential=True,
        ),
        Parameter("k", "N m/rad", "joint stiffness", nominal=1.3, lower=1e-6, upper=1e12, essential=True),
        Parameter("c", "N m s/rad", "joint damping", nominal=0.004, lower=0.0, upper=1e9),
        Parameter("R", "m", "from hub to tip", nominal=0.3, lower=1e-3, upper=100.0, essential=True),
    ),
    actuated=(Coordinate(name="hub", unit="rad"),),
    unactuated=(Coordinate(name="alpha", unit="rad"),),
    loads=("tip",),
    equations=equations,
    outputs=outputs,
    bodies=("tip",),
    mechanics=mechanics,
    picture=picture,
)
