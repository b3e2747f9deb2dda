"""A machine of one's own: a trolley on an inclined track, and a load on a rope below it.

With the track rising by the angle s, Lagrange's equation of the load, divided by m L, is

    L φ̈ = −g sin φ − c φ̇ / (m L) + ÿ cos(φ + s)
"""

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Parameter, Plant


def equations(q_u, dq_u, q_a, dq_a, p):
    (phi,), (rate,) = q_u, dq_u
    return Equations(
        M_uu=[[p.L]],
        M_au=[[-np.cos(phi + p.s)]],
        K_u=[-p.g * np.sin(phi)],
        G_u=[-p.c * rate / (p.m * p.L)],
    )


def outputs(q_u, q_a, p):
    (phi,) = q_u
    return Outputs(sway=[p.L * np.sin(phi)], height=[-p.L * np.cos(phi)], angle=[phi])


def mechanics(q_u, q_a, p):  # may be left out: it gives FMUs places and energy, and proves the equations
    (phi,), (way,) = q_u, q_a
    place = (way * np.cos(p.s) - p.L * np.sin(phi), 0.0, way * np.sin(p.s) - p.L * np.cos(phi))
    return Mechanics(mass=[p.m], place=[place], gravity=p.g)


PLANT = Plant(
    type="inclined-crane",
    summary="a load below a trolley on an inclined track",
    parameters=(
        Parameter(name="m", unit="kg", description="load", nominal=500.0, lower=1.0, upper=1e5),
        Parameter(name="L", unit="m", description="rope", nominal=4.0, lower=0.1, upper=100.0),
        Parameter(name="s", unit="rad", description="slope of the track", nominal=0.2, lower=-1.2, upper=1.2),
        Parameter(name="c", unit="N m s/rad", description="damping", nominal=50.0, lower=0.0, upper=1e6),
        Parameter(name="g", unit="m/s^2", description="gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(Coordinate(name="trolley", unit="m"),),
    unactuated=(Coordinate(name="phi", unit="rad"),),
    loads=("load",),
    equations=equations,
    outputs=outputs,
    bodies=("load",),
    mechanics=mechanics,
)
