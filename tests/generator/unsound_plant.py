"""A machine that another distribution might offer: nothing of it has inertia."""

import attrs
from fmu.hoisting_pendulum import PLANT as WINCH

PLANT = attrs.evolve(
    WINCH, equations=lambda *arguments: attrs.evolve(WINCH.equations(*arguments), M_uu=[[0.0]])
)
