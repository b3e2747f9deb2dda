"""Every machine against Lagrange's equations of its masses, differentiated by CasADi, and against energy."""

from itertools import pairwise
from types import SimpleNamespace

import casadi
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from gen_profile.plants.registry import BUILT_IN, FAMILIES, find_plant
from gen_profile.problem.linearization import linearize

G = np.array([0.0, 0.0, 1.0])


def square(vector):
    return sum(entry * entry for entry in vector)


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


def own_accelerations(plant, q, dq, ddq_a, parameters):
    """The plant's equations, solved by NumPy."""
    n_u = len(plant.unactuated)
    terms = plant.equations(q[:n_u], dq[:n_u], q[n_u:], dq[n_u:], SimpleNamespace(**parameters))
    forces = np.array(terms.K_u) + terms.G_u - np.array(terms.M_au).T @ ddq_a
    return np.linalg.solve(np.array(terms.M_uu, dtype=float), forces)


def some_machine(plant, seed, damping=1.0):
    """Parameters within half an octave of the nominal ones, and a state."""
    random = np.random.default_rng(seed)
    parameters = {q.name: (q.nominal or damping) * 2.0 ** random.uniform(-0.5, 0.5) for q in plant.parameters}
    n_u, m = len(plant.unactuated), len(plant.actuated)
    q, dq = random.uniform(-1.2, 1.2, n_u + m), random.uniform(-2.0, 2.0, n_u + m)
    q[n_u:] = random.uniform(0.1, 3.0, m)
    return parameters, q, dq, random.uniform(-3.0, 3.0, m)


def undamped(type_, parameters):
    return parameters | dict.fromkeys(MACHINES[type_][2], 0.0)


def test_every_machine_has_its_mechanics_here():
    families = {type_.rpartition("-")[0] for type_ in MACHINES}
    assert set(BUILT_IN) <= set(MACHINES)
    assert set(FAMILIES) <= families


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("type_", MACHINES)
def test_machines_obey_lagrange(type_, seed):
    lagrange = Lagrange(type_)
    parameters, q, dq, ddq_a = some_machine(lagrange.plant, seed)
    if type_ == "slosh-tank":  # its damping ratios are measured below
        parameters = undamped(type_, parameters)
    expected = lagrange.accelerations(q, dq, ddq_a, parameters)
    found = own_accelerations(lagrange.plant, q, dq, ddq_a, parameters)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(expected).max()))


@pytest.mark.parametrize("type_", MACHINES)
def test_energy_is_kept_without_damping_and_lost_with_it(type_):
    lagrange = Lagrange(type_)
    plant = lagrange.plant
    n_u = len(plant.unactuated)
    parameters, q, dq, _ = some_machine(plant, seed=1)
    q, dq = 0.5 * q[:n_u], dq[:n_u]
    axes = np.full(len(plant.actuated), 1.5)
    still = np.zeros(len(plant.actuated))

    def energies(values):
        def rates(_, x):
            full_q, full_dq = np.concatenate([x[:n_u], axes]), np.concatenate([x[n_u:], still])
            return np.concatenate([x[n_u:], own_accelerations(plant, full_q, full_dq, still, values)])

        swing = solve_ivp(rates, (0.0, 5.0), [*q, *dq], method="DOP853", rtol=1e-10, atol=1e-12)
        return np.array(
            [
                lagrange.energy(np.concatenate([x[:n_u], axes]), np.concatenate([x[n_u:], still]), values)
                for x in swing.y.T
            ]
        )

    kept = energies(undamped(type_, parameters))
    np.testing.assert_allclose(kept, kept[0], atol=1e-7 * np.ptp([*kept, 0.0]))
    lost = energies(parameters)
    assert (np.diff(lost) < 1e-9 * abs(lost[0])).all()
    assert lost[-1] < lost[0] - 1e-5 * abs(lost[0])


@pytest.mark.parametrize("type_", [name for name in MACHINES if name != "slosh-tank"])
def test_sway_is_the_distance_by_which_masses_trail_their_place_at_rest(type_):
    plant = find_plant(type_)
    mechanics = MACHINES[type_][0]
    parameters, q, _, _ = some_machine(plant, seed=3)
    p, n_u = SimpleNamespace(**parameters), len(plant.unactuated)
    if "slew" in [axis.name for axis in plant.actuated]:
        q[n_u] = 0.0  # the jib along x
    rest = np.concatenate([np.zeros(n_u), q[n_u:]])
    here, there = mechanics(q, p)[0], mechanics(rest, p)[0]
    trailing = np.array([np.array(b) - np.array(a) for (_, a), (_, b) in zip(here, there, strict=True)])
    outputs = plant.outputs(q[:n_u], q[n_u:], p)
    if type_ == "flexible-joint":  # an arc on the circle of the tip; the places are on the unit circle
        chord = np.linalg.norm(trailing[0])
        assert outputs.sway[0] == pytest.approx(np.sign(q[0]) * 2.0 * p.R * np.arcsin(chord / 2.0))
        return
    expected = trailing[0, :2] if plant.directions == 2 else trailing[:, 0]
    np.testing.assert_allclose(outputs.sway, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("type_", MACHINES)
def test_loads_trail_an_axis_that_starts(type_):
    plant = find_plant(type_)
    axes = [1.0] * len(plant.actuated)
    linear = linearize(plant, plant.nominal(), axes)
    lag = linear.sway_gain @ np.linalg.solve(linear.stiffness, linear.input)
    pairs = {"gantry-crane": [(0, 0), (1, 1)], "tower-crane": [(0, 1), (1, 0)]}
    for load, axis in pairs.get(type_, [(load, 0) for load in range(len(plant.loads))]):
        assert lag[load, axis] > 0.0


def test_the_chains_frequencies_are_the_lattices():
    for n in (1, 2, 5, 12):
        plant = find_plant(f"mass-spring-chain-{n}")
        j = np.arange(1, n + 1)
        expected = 2.0 * np.sqrt(100.0) * np.sin((2 * j - 1) * np.pi / (4 * n + 2))
        np.testing.assert_allclose(linearize(plant, plant.nominal()).frequencies, expected, rtol=1e-10)


def test_a_pendulums_frequency_follows_the_hoist():
    plant = find_plant("single-pendulum-crane")
    for hoist in (0.0, 1.0, 8.0):
        (frequency,) = linearize(plant, plant.nominal(), [3.0, hoist]).frequencies
        assert frequency == pytest.approx(np.sqrt(9.81 / (2.0 + hoist)), rel=1e-12)


@pytest.mark.parametrize(("type_", "rope"), [("gantry-crane", 5.0), ("tower-crane", 10.0)])
def test_a_spherical_pendulum_has_one_frequency_twice(type_, rope):
    plant = find_plant(type_)
    frequencies = linearize(plant, plant.nominal(), [0.3, 4.0]).frequencies
    np.testing.assert_allclose(frequencies, np.sqrt(9.81 / rope), rtol=1e-12)


def test_a_flexible_joints_frequency_and_damping():
    plant = find_plant("flexible-joint")
    linear = linearize(plant, plant.nominal())
    assert linear.frequencies[0] == pytest.approx(np.sqrt(1.3 / 0.0035), rel=1e-12)
    assert linear.damping_ratios[0] == pytest.approx(0.004 / (2.0 * np.sqrt(1.3 * 0.0035)), rel=1e-12)


@pytest.mark.parametrize("parameters", [{}, {"a": 2.0, "b": 1.2, "h": 0.2, "mu": 0.5, "rho": 900.0}])
def test_sloshing_frequencies_and_losses_are_those_of_the_potential_flow(parameters):
    """φ = cos κx cosh κ(z+h) sin ωt: energy and boundary layers' losses by quadrature over the walls."""
    plant = find_plant("slosh-tank")
    values = plant.nominal() | parameters
    a, b, h, rho, mu, g = values.values()
    linear = linearize(plant, values)
    for mode, frequency in enumerate(linear.frequencies):
        k = (2 * mode + 1) * np.pi / a
        assert frequency == pytest.approx(np.sqrt(g * k * np.tanh(k * h)), rel=1e-12)

        def speed2(x, z, k=k):  # of the amplitude, squared: along the tank, and upward
            return (k * np.sin(k * x) * np.cosh(k * z)) ** 2, (k * np.cos(k * x) * np.sinh(k * z)) ** 2

        def over(function, upper):
            return quad(function, 0.0, upper, epsabs=0.0, epsrel=1e-10)[0]

        bottom = b * over(lambda x: speed2(x, 0.0)[0], a)
        ends = 2.0 * b * over(lambda z: speed2(0.0, z)[1], h)
        sides = 2.0 * over(lambda x: over(lambda z: sum(speed2(x, z)), h), a)
        energy = 0.5 * rho * b * sides / 2.0
        loss = 0.5 * np.sqrt(frequency * mu * rho / 2.0) * (bottom + ends + sides)
        ratio = loss / energy / (2.0 * frequency) + 2.0 * mu / rho * k**2 / frequency
        assert linear.damping_ratios[mode] == pytest.approx(ratio, rel=1e-8)


def test_liquid_at_steady_acceleration_is_tilted_by_it():
    """The modes' rises at the wall are the first terms of the Fourier series of a straight surface."""
    plant = find_plant("slosh-tank")
    linear = linearize(plant, plant.nominal())
    static = np.linalg.solve(linear.stiffness, linear.input[:, 0] * 1.0)
    a = plant.nominal()["a"]
    x = np.linspace(-a / 2.0, a / 2.0, 200_001)
    surface = -x / 9.81  # the tank accelerates to positive x, and the wall at −a/2 trails
    for mode, rise in enumerate(linear.sway_gain[0] * static):
        shape = -np.sin((2 * mode + 1) * np.pi * x / a)
        coefficient = 2.0 * (surface * shape)[:-1].mean()
        assert rise == pytest.approx(coefficient * shape[0], rel=1e-4)


@pytest.mark.parametrize("number", ["0", "25", "02", "two", ""])
def test_families_know_their_members(number):
    with pytest.raises(KeyError):
        find_plant(f"mass-spring-chain-{number}")
