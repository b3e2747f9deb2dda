"""A machine of one's own: a trolley with a hoist, a hook block, and a load on a sling.

Both angles are from the vertical. Lagrange's equations of hook and load below a driven trolley y and rope l,
the first divided by l, the second by m2 d, with c = cos(a − b) and s = sin(a − b):

    (m1+m2) (l ä + 2 l̇ ȧ − ÿ cos a + g sin a) + m2 d (b̈ c + ḃ² s) = 0
    d b̈ + (l ä + 2 l̇ ȧ) c + (l̈ − l ȧ²) s − ÿ cos b + g sin b = 0
"""

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant


def equations(q_u, dq_u, q_a, dq_a, p):
    (a, b), (da, db), rope, paid = q_u, dq_u, p.L0 + q_a[1], dq_a[1]
    mass, c, s = p.m1 + p.m2, np.cos(a - b), np.sin(a - b)
    return Equations(
        M_uu=[[mass * rope, p.m2 * p.d * c], [rope * c, p.d]],
        M_au=[[-mass * np.cos(a), -np.cos(b)], [0.0, s]],
        K_u=[-mass * p.g * np.sin(a), -p.g * np.sin(b)],
        G_u=[-2.0 * mass * paid * da - p.m2 * p.d * db**2 * s, -2.0 * paid * da * c + rope * da**2 * s],
    )


def outputs(q_u, q_a, p):
    (a, b), rope = q_u, p.L0 + q_a[1]
    hook, low = rope * np.sin(a), -rope * np.cos(a)
    return Outputs(sway=[hook, hook + p.d * np.sin(b)], height=[low, low - p.d * np.cos(b)], angle=[a, b])


def mechanics(q_u, q_a, p):
    seen = outputs(q_u, q_a, p)
    places = [(q_a[0] - sway, 0.0, height) for sway, height in zip(seen.sway, seen.height, strict=True)]
    return Mechanics(mass=[p.m1, p.m2], place=places, gravity=p.g)


PLANT = Plant(
    type="hook-crane",
    summary="trolley with a hoist, hook block and load",
    parameters=(
        Parameter("m1", "kg", "hook block", nominal=450.0, lower=1.0, upper=1e6),
        Parameter("m2", "kg", "load", nominal=20000.0, lower=1.0, upper=1e6),
        Parameter("L0", "m", "trolley to hook with the hoist at 0", nominal=2.0, lower=0.1, upper=100.0),
        Parameter("d", "m", "sling", nominal=3.0, lower=0.1, upper=100.0),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(Coordinate(name="trolley", unit="m"), Coordinate(name="hoist", unit="m", lower=0.0)),
    unactuated=(Coordinate(name="a", unit="rad"), Coordinate(name="b", unit="rad")),
    loads=("hook", "load"),
    equations=equations,
    outputs=outputs,
    bodies=("hook", "load"),
    mechanics=mechanics,
)
