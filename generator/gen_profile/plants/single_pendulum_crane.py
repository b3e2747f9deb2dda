"""Single-pendulum crane with hoist: a cart, and a payload on a rope whose length a winch drives.

The rope's length is l = L0 + h, h the hoist's position, positive when paid out; φ is its angle from the
vertical, positive when the load trails a cart that accelerates in +y. Lagrange's equation of the payload at
(y − l sin φ, −l cos φ) with a viscous moment c φ̇ at the cart, divided by m l:

    l φ̈ = −g sin φ − 2 ḣ φ̇ − c φ̇ / (m l) + ÿ cos φ

Hoisting does work on the swing through 2 ḣ φ̇ and moves the natural frequency √(g/l) along the way. The
hoist's acceleration acts along the rope only. (Any text on parametric pendulums; for cranes E. M.
Abdel-Rahman, A. H. Nayfeh, Z. N. Masoud, Dynamics and control of cranes: a review, 2003.)
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant, Vector


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the payload's equation of motion (module docstring)."""
    (phi,), (dphi,) = q_u, dq_u
    (_, hoist), (_, hoist_rate) = q_a, dq_a
    rope = p.L0 + hoist
    return Equations(
        M_uu=[[rope]],
        M_au=[[-np.cos(phi)], [0.0]],
        K_u=[-p.g * np.sin(phi)],
        G_u=[-2.0 * hoist_rate * dphi - p.c * dphi / (p.m * rope)],
    )


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Sway relative to the cart, height below it and rope angle of the payload."""
    (phi,), (_, hoist) = q_u, q_a
    rope = p.L0 + hoist
    return Outputs(sway=[rope * np.sin(phi)], height=[-rope * np.cos(phi)], angle=[phi])


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place the payload below the cart."""
    output, (cart, _) = outputs(q_u, q_a, p), q_a
    return Mechanics(mass=[p.m], place=[(cart - output.sway[0], 0.0, output.height[0])], gravity=p.g)


PLANT = Plant(
    type="single-pendulum-crane",
    summary="cart with a hoist, and a payload on the rope",
    parameters=(
        Parameter("m", "kg", "payload mass", nominal=1000.0, lower=1e-4, upper=1e6, essential=True),
        Parameter(
            "L0",
            "m",
            "from cart to payload with the hoist at 0",
            nominal=2.0,
            lower=1e-2,
            upper=200.0,
            essential=True,
        ),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
        Parameter("c", "N m s/rad", "damping at the cart", nominal=0.0, lower=0.0, upper=1e9),
    ),
    actuated=(Coordinate(name="cart", unit="m"), Coordinate(name="hoist", unit="m", lower=0.0)),
    unactuated=(Coordinate(name="phi", unit="rad"),),
    loads=("payload",),
    equations=equations,
    outputs=outputs,
    bodies=("payload",),
    mechanics=mechanics,
)
