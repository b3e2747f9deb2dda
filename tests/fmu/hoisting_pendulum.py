"""A plant as a user would write one: a load on a winch that a trolley carries, so two driven axes."""

from __future__ import annotations

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Outputs, Parameter, Plant


def equations(q_u, dq_u, q_a, dq_a, p):
    """l φ̈ + 2 l̇ φ̇ + g sin φ + c φ̇ / (m l) = ẍ cos φ, with the rope's length l driven."""
    (phi,), (rate,), (_, length), (_, hoist) = q_u, dq_u, q_a, dq_a
    return Equations(
        M_uu=[[length]],
        M_au=[[-np.cos(phi)], [0.0]],
        K_u=[-p.g * np.sin(phi)],
        G_u=[-2.0 * hoist * rate - p.c * rate / (p.m * length)],
    )


def outputs(q_u, q_a, p):
    del p
    (phi,), (_, length) = q_u, q_a
    return Outputs(sway=[length * np.sin(phi)], height=[-length * np.cos(phi)], angle=[phi])


PLANT = Plant(
    type="2-axis winch",
    summary="a trolley with a winch",
    parameters=(
        Parameter(name="m", unit="kg", description="load", nominal=2.0, lower=1e-3, upper=1e6),
        Parameter(name="c", unit="N m s", description="damping", nominal=0.05, lower=0.0, upper=1e3),
        Parameter(name="g", unit="m/s^2", description="gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(Coordinate(name="trolley", unit="m"), Coordinate(name="winch", unit="m")),
    unactuated=(Coordinate(name="phi", unit="rad"),),
    loads=("load",),
    equations=equations,
    outputs=outputs,
)
