"""Double-pendulum crane: a cart, a hook on a rope, and a payload on a second rope below the hook.

θ1 is the first rope's angle from the vertical, θ2 the second's relative to the first; both are positive when
the load trails a cart that accelerates in +y. Lagrange's equations with massless, taut ropes, the first row
divided by L1 and the second by m2 L2, are the paper's eq. (20)–(22), its misprints corrected:

    M_uu = [ (m1+m2) L1 + m2 L2 cos θ2    m2 L2 cos θ2 ]
           [ L1 cos θ2 + L2               L2           ]
    K_u  = [ −g (m1+m2) sin θ1,  −g sin(θ1+θ2) ]
    G_u  = [ m2 L2 (θ̇1+θ̇2)² sin θ2 − (c1 θ̇1 − c2 θ̇2)/L1,   −L1 θ̇1² sin θ2 − c2 θ̇2/(m2 L2) ]
    M_au = [ −(m1+m2) cos θ1,  −cos(θ1+θ2) ]

c1 and c2 are viscous moments at the cart's and the hook's joint (zero in the paper).
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant, Vector


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the two ropes' equations of motion (module docstring)."""
    # the ropes feel the cart's acceleration only
    (theta1, theta2), (dtheta1, dtheta2) = q_u, dq_u
    mass = p.m1 + p.m2
    coupling = p.m2 * p.L2 * np.cos(theta2)
    return Equations(
        M_uu=[[mass * p.L1 + coupling, coupling], [p.L1 * np.cos(theta2) + p.L2, p.L2]],
        M_au=[[-mass * np.cos(theta1), -np.cos(theta1 + theta2)]],
        K_u=[-p.g * mass * np.sin(theta1), -p.g * np.sin(theta1 + theta2)],
        G_u=[
            p.m2 * p.L2 * (dtheta1 + dtheta2) ** 2 * np.sin(theta2)
            - (p.c1 * dtheta1 - p.c2 * dtheta2) / p.L1,
            -p.L1 * dtheta1**2 * np.sin(theta2) - p.c2 * dtheta2 / (p.m2 * p.L2),
        ],
    )


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Sway relative to the cart, height below it and rope angle, of hook and payload."""
    theta1, theta2 = q_u
    hook_sway = p.L1 * np.sin(theta1)
    hook_height = -p.L1 * np.cos(theta1)
    return Outputs(
        sway=[hook_sway, hook_sway + p.L2 * np.sin(theta1 + theta2)],
        height=[hook_height, hook_height - p.L2 * np.cos(theta1 + theta2)],
        angle=[theta1, theta1 + theta2],
    )


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place hook and payload below the cart."""
    output, (cart,) = outputs(q_u, q_a, p), q_a
    places = [(cart - sway, 0.0, height) for sway, height in zip(output.sway, output.height, strict=True)]
    return Mechanics(mass=[p.m1, p.m2], place=places, gravity=p.g)


PLANT = Plant(
    type="double-pendulum-crane",
    summary="cart, hook and payload on two ropes",
    parameters=(
        Parameter("m1", "kg", "hook mass", nominal=0.192, lower=1e-4, upper=1e6, essential=True),
        Parameter("m2", "kg", "payload mass", nominal=0.203, lower=1e-4, upper=1e6, essential=True),
        Parameter(
            "L1", "m", "rope from cart to hook", nominal=0.470, lower=1e-2, upper=200.0, essential=True
        ),
        Parameter(
            "L2", "m", "rope from hook to payload", nominal=0.391, lower=1e-2, upper=200.0, essential=True
        ),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
        Parameter("c1", "N m s/rad", "damping at the cart", nominal=0.0, lower=0.0, upper=1e6),
        Parameter("c2", "N m s/rad", "damping at the hook", nominal=0.0, lower=0.0, upper=1e6),
    ),
    actuated=(Coordinate(name="cart", unit="m"),),
    unactuated=(Coordinate(name="theta1", unit="rad"), Coordinate(name="theta2", unit="rad")),
    loads=("hook", "payload"),
    equations=equations,
    outputs=outputs,
    bodies=("hook", "payload"),
    mechanics=mechanics,
)
