"""A machine whose rope's length changes while it moves: a parameter becomes an axis that is driven.

Equations that were written for a constant length lack the terms of its rate. Lagrange's equations of the
bodies have them: with the places r(q_u, q_a) of all bodies, the driven parameter among q_a,

    M_uu = Σ m J_uᵀ J_u,   M_au = Σ m J_aᵀ J_u,   K_u = −∂V/∂q_u,   G_u = −Σ m J_uᵀ J̇ q̇

where J = ∂r/∂q. Damping is left out, so the machine must have none.
"""

from collections.abc import Sequence
from functools import cache
from types import SimpleNamespace

import attrs

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.plants.plant import Coordinate, Equations, Mechanics, Outputs, Plant, Vector


@cache
def hoisted(plant: Plant, names: tuple[str, ...]) -> Plant:
    """Let some parameters be axes behind those of a machine.

    Parameters
    ----------
    plant : Plant
        Without damping, and with bodies.
    names : tuple of str
        Names of parameters, such as of a rope's length.

    Returns
    -------
    Plant
        Whose equations take symbols only.
    """
    if not names:
        return plant
    known = {parameter.name: parameter for parameter in plant.parameters}
    axes = len(plant.actuated)

    def substituted(q_a: Vector, p: SimpleNamespace) -> tuple[Vector, SimpleNamespace]:
        return q_a[:axes], SimpleNamespace(**(vars(p) | dict(zip(names, q_a[axes:], strict=True))))

    def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
        return plant.outputs(q_u, *substituted(q_a, p))

    def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
        return plant.mechanics(q_u, *substituted(q_a, p))

    def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
        return _lagrange(mechanics(q_u, q_a, p), [q_u, q_a], [dq_u, dq_a])

    winches = (
        Coordinate(name=name, unit="m", lower=known[name].lower, upper=known[name].upper) for name in names
    )
    return attrs.evolve(
        plant,
        type=f"{plant.type} with {', '.join(names)} driven",
        parameters=tuple(parameter for parameter in plant.parameters if parameter.name not in names),
        actuated=(*plant.actuated, *winches),
        equations=equations,
        outputs=outputs,
        mechanics=mechanics,
        picture=lambda _: (),
    )


def _lagrange(bodies: Mechanics, q: Sequence[Vector], dq: Sequence[Vector]) -> Equations:
    """Write the equations of the first coordinates, the others being driven."""
    (q_u, q_a), (dq_u, dq_a) = (map(sym.column, columns) for columns in (q, dq))
    everything, rates = sym.column([q_u, q_a]), sym.column([dq_u, dq_a])
    n_u, n_a = len(q[0]), len(q[1])
    M_uu, M_au, bend = sym.zeros(n_u, n_u), sym.zeros(n_a, n_u), sym.zeros(n_u, 1)
    for mass, place in zip(bodies.mass, bodies.place, strict=True):
        at = sym.column(place)
        along = sym.jacobian(at, q_u)
        velocity = sym.directional(at, everything, rates)
        M_uu += mass * along.T @ along
        M_au += mass * sym.jacobian(at, q_a).T @ along
        bend += mass * along.T @ sym.directional(velocity, everything, rates)
    pull = sym.gradient(bodies.potential, q_u)
    return Equations(M_uu=sym.rows(M_uu), M_au=sym.rows(M_au), K_u=sym.split(-pull), G_u=sym.split(-bend))
