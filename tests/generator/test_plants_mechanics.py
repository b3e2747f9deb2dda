"""Every machine against Lagrange's equations of its masses, the conservation of energy, and textbooks."""

from types import SimpleNamespace

import numpy as np
import pytest
from generator.lagrangian_machines import MACHINES, Lagrange
from scipy.integrate import quad, simpson, solve_ivp

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.plants.registry import BUILT_IN, FAMILIES, find_plant


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


@pytest.mark.parametrize("type_", MACHINES)
def test_machines_obey_lagrange(type_):
    lagrange = Lagrange(type_)
    for seed in range(20):
        parameters, q, dq, ddq_a = some_machine(lagrange.plant, seed)
        if type_ == "slosh-tank":  # its damping ratios are measured below
            parameters = undamped(type_, parameters)
        expected = lagrange.accelerations(q, dq, ddq_a, parameters)
        found = own_accelerations(lagrange.plant, q, dq, ddq_a, parameters)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(expected).max()))


@pytest.mark.slow
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
    expected = trailing[:, : plant.directions].ravel()
    np.testing.assert_allclose(outputs.sway, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("type_", MACHINES)
def test_bodies_are_where_and_of_what_mass_the_mechanics_say(type_, seed):
    """Places and energy, against those of the other text; the sloshing masses are measured below."""
    lagrange = Lagrange(type_)
    plant = lagrange.plant
    parameters, q, dq, _ = some_machine(plant, seed)
    n_u, p = len(plant.unactuated), SimpleNamespace(**parameters)
    mechanics = plant.mechanics(q[:n_u], q[n_u:], p)
    assert len(mechanics.place) == len(mechanics.mass) == len(plant.bodies)
    masses = MACHINES[type_][0](q, p)[0]
    places = [place for _, place in masses][: len(plant.bodies)]
    if type_ == "flexible-joint":  # there on the unit circle
        places = [np.multiply(place, p.R) for place in places]
    np.testing.assert_allclose(mechanics.place, places, rtol=1e-12, atol=1e-12)
    if type_ != "slosh-tank":
        e = dynamics(plant)
        energy = Function("energy", {"q": sym.column([e.q_u, e.q_a]), "dq": sym.column([e.dq_u, e.dq_a]),
                                     "p": e.p}, e.energy)  # fmt: skip
        (found,) = energy(q[None], dq[None], np.array([list(parameters.values())])).ravel()
        assert found == pytest.approx(lagrange.energy(q, dq, parameters), rel=1e-12)


@pytest.mark.parametrize("parameters", [{}, {"a": 2.0, "b": 1.2, "h": 0.2, "rho": 900.0}])
def test_sloshing_masses_have_the_energy_of_the_liquids_surface(parameters):
    """½ ρ g b ∫ η² dx for the rise at the wall that the sway tells."""
    plant = find_plant("slosh-tank")
    values = plant.nominal() | parameters
    a, b, _, rho, _, g = values.values()
    x, p = np.linspace(0.0, a, 20_001), SimpleNamespace(**values)
    for mode in range(2):
        q = [1e-3 * (mode == other) for other in range(2)]
        wave = plant.outputs(q, [0.0], p).sway[0] * np.cos((2 * mode + 1) * np.pi * x / a)
        surface = 0.5 * rho * g * b * simpson(wave**2, x=x)
        raised = plant.mechanics(q, [0.0], p).potential - plant.mechanics([0.0, 0.0], [0.0], p).potential
        assert raised == pytest.approx(surface, rel=1e-5)


@pytest.mark.parametrize("type_", MACHINES)
def test_loads_trail_an_axis_that_starts(type_):
    plant = find_plant(type_)
    axes = [1.0] * len(plant.actuated)
    linear = linearize(plant, plant.nominal(), axes)
    lag = linear.sway_gain @ np.linalg.solve(linear.stiffness, linear.input)
    pairs = {
        "gantry-crane": [(0, 0), (1, 1)],
        "hall-crane": [(0, 0), (1, 1), (2, 0), (3, 1)],
        "tower-crane": [(0, 1), (1, 0)],
    }
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
