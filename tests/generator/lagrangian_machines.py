"""Every machine written a second time: masses at places, springs, and Rayleigh's dissipation.

Lagrange's equations of all coordinates, the driven ones included, follow by CasADi's differentiation.
"""

from itertools import pairwise
from types import SimpleNamespace

import casadi
import numpy as np

from gen_profile.plants.registry import find_plant


def double_pendulum(q, p):
    theta1, theta2, y = q
    angle = theta1 + theta2
    hook = [y - p.L1 * np.sin(theta1), 0.0, -p.L1 * np.cos(theta1)]
    payload = [hook[0] - p.L2 * np.sin(angle), 0.0, hook[2] - p.L2 * np.cos(angle)]
    return [(p.m1, hook), (p.m2, payload)], 0.0


def single_pendulum(q, p):
    phi, y, hoist = q
    rope = p.L0 + hoist
    return [(p.m, [y - rope * np.sin(phi), 0.0, -rope * np.cos(phi)])], 0.0


def gantry(q, p):
    a, b, x, y = q
    place = [x - p.L * np.sin(a) * np.cos(b), y - p.L * np.sin(b), -p.L * np.cos(a) * np.cos(b)]
    return [(p.m, place)], 0.0


def hall(q, p):
    ax, ay, bx, by, x, y, hoist = q
    rope = p.L0 + hoist
    hook = [x - rope * np.sin(ax) * np.cos(ay), y - rope * np.sin(ay), -rope * np.cos(ax) * np.cos(ay)]
    payload = [
        hook[0] - p.L2 * np.sin(bx) * np.cos(by),
        hook[1] - p.L2 * np.sin(by),
        hook[2] - p.L2 * np.cos(bx) * np.cos(by),
    ]
    return [(p.m1, hook), (p.m2, payload)], 0.0


def tower(q, p):
    a, b, slew, radius = q
    along, across = radius - p.L * np.sin(a) * np.cos(b), -p.L * np.sin(b)
    place = [
        along * np.cos(slew) - across * np.sin(slew),
        along * np.sin(slew) + across * np.cos(slew),
        -p.L * np.cos(a) * np.cos(b),
    ]
    return [(p.m, place)], 0.0


def flexible_joint(q, p):
    """The arm as two equal masses on a massless rod through the hub: the same moment of inertia."""
    alpha, hub = q
    angle = hub - alpha
    ends = [(0.5 * p.J, [sign * np.cos(angle), sign * np.sin(angle), 0.0]) for sign in (1.0, -1.0)]
    return ends, 0.5 * p.k * alpha**2


def chain(q, p):
    *deflections, axis = q
    places = [axis, *(axis - d for d in deflections)]
    potential = sum(
        0.5 * getattr(p, f"k{i + 1}") * (before - after) ** 2
        for i, (before, after) in enumerate(pairwise(places))
    )
    return [(getattr(p, f"m{i + 1}"), [place, 0.0, 0.0]) for i, place in enumerate(places[1:])], potential


def slosh(q, p):
    theta1, theta2, y = q
    lengths = [1.0 / (k * np.tanh(k * p.h)) for k in (np.pi / p.a, 3.0 * np.pi / p.a)]
    return [
        (1.0, [y - length * np.sin(angle), 0.0, -length * np.cos(angle)])
        for length, angle in zip(lengths, (theta1, theta2), strict=True)
    ], 0.0


def rope_dissipation(q, dq, p):
    """½ c times the square of the rope's angular velocity relative to the suspension."""
    return 0.5 * p.c * (np.cos(q[1]) ** 2 * dq[0] ** 2 + dq[1] ** 2)


def chain_dissipation(q, dq, p):
    links = [dq[0], *(after - before for before, after in pairwise(dq[:-1]))]
    return sum(0.5 * getattr(p, f"c{i + 1}") * link**2 for i, link in enumerate(links))


def no_dissipation(q, dq, p):
    return 0.0


# type → (masses at places and potential of the springs, Rayleigh's dissipation, damping parameters)
MACHINES = {
    "double-pendulum-crane": (
        double_pendulum,
        lambda q, dq, p: 0.5 * p.c1 * dq[0] ** 2 + 0.5 * p.c2 * dq[1] ** 2,
        ("c1", "c2"),
    ),
    "single-pendulum-crane": (single_pendulum, lambda q, dq, p: 0.5 * p.c * dq[0] ** 2, ("c",)),
    "gantry-crane": (gantry, rope_dissipation, ("c",)),
    "hall-crane": (hall, rope_dissipation, ("c",)),
    "tower-crane": (tower, rope_dissipation, ("c",)),
    "flexible-joint": (flexible_joint, lambda q, dq, p: 0.5 * p.c * dq[0] ** 2, ("c",)),
    "mass-spring-chain-1": (chain, chain_dissipation, ("c1",)),
    "mass-spring-chain-4": (chain, chain_dissipation, ("c1", "c2", "c3", "c4")),
    "slosh-tank": (slosh, no_dissipation, ("mu",)),
}


class Lagrange:
    """Accelerations and energy of a machine from its masses, places and springs."""

    def __init__(self, type_):
        self.plant = find_plant(type_)
        mechanics, dissipation, _ = MACHINES[type_]
        n_u, n = len(self.plant.unactuated), len(self.plant.unactuated) + len(self.plant.actuated)
        q, dq, ddq_a = casadi.SX.sym("q", n), casadi.SX.sym("dq", n), casadi.SX.sym("a", n - n_u)
        names = [parameter.name for parameter in self.plant.parameters]
        values = casadi.SX.sym("p", len(names))
        p = SimpleNamespace(**dict(zip(names, casadi.vertsplit(values), strict=True)))
        masses, springs = mechanics(casadi.vertsplit(q), p)
        velocities = [casadi.jtimes(casadi.vertcat(*place), q, dq) for _, place in masses]
        kinetic = sum(0.5 * m * casadi.sumsqr(v) for (m, _), v in zip(masses, velocities, strict=True))
        gravity = getattr(p, "g", 0.0)
        potential = springs + sum(m * gravity * place[2] for m, place in masses)
        momentum = casadi.gradient(kinetic, dq)
        forces = (
            casadi.gradient(kinetic - potential, q)
            - casadi.jtimes(momentum, q, dq)
            - casadi.gradient(casadi.SX(dissipation(casadi.vertsplit(q), casadi.vertsplit(dq), p)), dq)
        )
        mass = casadi.jacobian(momentum, dq)
        free = forces[:n_u] - mass[:n_u, n_u:] @ ddq_a
        ddq_u = casadi.solve(mass[:n_u, :n_u], free)
        self._accelerations = casadi.Function("accelerations", [q, dq, ddq_a, values], [ddq_u])
        self._energy = casadi.Function("energy", [q, dq, values], [kinetic + potential])

    def accelerations(self, q, dq, ddq_a, parameters):
        return np.array(self._accelerations(q, dq, ddq_a, list(parameters.values()))).ravel()

    def energy(self, q, dq, parameters):
        return float(self._energy(q, dq, list(parameters.values())))
