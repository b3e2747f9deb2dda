"""A machine of one's own: bridge, trolley and hoist, and a load on a rope that swings in both directions.

The load hangs at (x − l sin θx cos θy, y − l sin θy, −l cos θx cos θy), l = L0 + hoist. Lagrange's equations,
divided by m l and in θx by cos θy as well:

    l cos²θy θ̈x = −g sin θx cos θy + 2 l sin θy cos θy θ̇x θ̇y − 2 l̇ cos²θy θ̇x + ẍ cos θx cos θy
    l θ̈y        = −g cos θx sin θy − l sin θy cos θy θ̇x² − 2 l̇ θ̇y − ẍ sin θx sin θy + ÿ cos θy
"""

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant


def equations(q_u, dq_u, q_a, dq_a, p):
    (a, b), (da, db), rope, paid = q_u, dq_u, p.L0 + q_a[2], dq_a[2]
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    return Equations(
        M_uu=[[rope * cb**2, 0.0], [0.0, rope]],
        M_au=[[-ca * cb, sa * sb], [0.0, -cb], [0.0, 0.0]],
        K_u=[-p.g * sa * cb, -p.g * ca * sb],
        G_u=[
            2.0 * rope * sb * cb * da * db - 2.0 * paid * cb**2 * da,
            -rope * sb * cb * da**2 - 2.0 * paid * db,
        ],
    )


def outputs(q_u, q_a, p):
    (a, b), rope = q_u, p.L0 + q_a[2]
    height = -rope * np.cos(a) * np.cos(b)
    return Outputs(
        sway=[rope * np.sin(a) * np.cos(b), rope * np.sin(b)], height=[height, height], angle=[a, b]
    )


def mechanics(q_u, q_a, p):
    seen = outputs(q_u, q_a, p)
    return Mechanics(
        mass=[p.m], place=[(q_a[0] - seen.sway[0], q_a[1] - seen.sway[1], seen.height[0])], gravity=p.g
    )


PLANT = Plant(
    type="hoisting-gantry",
    summary="bridge, trolley and hoist, and a load that swings in both directions",
    parameters=(
        Parameter("m", "kg", "load", nominal=5000.0, lower=1.0, upper=1e6),
        Parameter("L0", "m", "trolley to load with the hoist at 0", nominal=3.0, lower=0.1, upper=100.0),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(
        Coordinate(name="bridge", unit="m"),
        Coordinate(name="trolley", unit="m"),
        Coordinate(name="hoist", unit="m", lower=0.0),
    ),
    unactuated=(Coordinate(name="theta_x", unit="rad"), Coordinate(name="theta_y", unit="rad")),
    loads=("load-x", "load-y"),
    directions=2,
    equations=equations,
    outputs=outputs,
    bodies=("load",),
    mechanics=mechanics,
)
