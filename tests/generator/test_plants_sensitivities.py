"""Sensitivities of both orders of every machine to every parameter, against finite differences."""

from itertools import combinations

import numpy as np
import pytest
from generator.lagrangian_machines import MACHINES
from scipy.integrate import solve_ivp

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.motion_equations import motion_equations
from gen_profile.dynamics.problem.sensitivities import sensitivities
from gen_profile.plants.registry import find_plant

STEP = 4e-3  # of the logarithm of a parameter
STENCIL = np.exp(STEP * np.arange(-2, 3))
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * STEP)
HEAVY = {"hall-crane": 5000.0}  # kg, that damping can be seen beside; of others their m
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * STEP**2)


def swung(plant, names, order, machines):
    """States of machines, and their sensitivities, while all axes move from 1 to 2: (machines, states)."""
    equations = motion_equations(plant, names, order)
    m, count = len(plant.actuated), len(machines)

    def rates(t, y):
        position, velocity, push = (
            1.0 + t**3 * (10.0 - 15.0 * t + 6.0 * t * t),
            *(
                30.0 * t**2 * (1.0 - t) ** 2,
                60.0 * t * (1.0 - t) * (1.0 - 2.0 * t),
            ),
        )
        axes = np.repeat([position, velocity, push], m)[None]
        return equations.rate(y.reshape(count, -1), axes, machines)[:, :, 0].ravel()

    start = np.zeros(count * equations.size)
    swing = solve_ivp(rates, (0.0, 0.8), start, method="DOP853", rtol=1e-12, atol=1e-14)
    return swing.y[:, -1].reshape(count, -1)


def places(plant, *names):
    """Rows of the machine's states that the sensitivities of first and second order belong to, in order."""
    d = dynamics(plant)
    parameters = dict(zip((q.name for q in plant.parameters), sym.split(d.p), strict=True))
    state = sym.column([d.q_u, d.dq_u])
    found = sensitivities(sym.column([d.dq_u, d.ddq_u]), state, parameters, names, 2)
    return [list(one.rows) for one in found]


@pytest.mark.slow
@pytest.mark.parametrize("type_", MACHINES)
def test_every_sensitivity_is_a_finite_difference(type_):
    plant = find_plant(type_)
    values = {
        q.name: q.nominal or 0.1 * HEAVY.get(type_, plant.nominal().get("m", 1.0)) for q in plant.parameters
    }
    for index, name in enumerate(values):
        lanes = np.tile(list(values.values()), (5, 1))
        lanes[:, index] *= STENCIL
        states = swung(plant, (), 1, lanes)
        augmented = swung(plant, (name,), 2, lanes[2:3])[0, states.shape[1] :]
        first, second = places(plant, name)
        assert len(augmented) == len(first) + len(second)
        for rows, found, weights in (
            (first, augmented[: len(first)], FIRST),
            (second, augmented[len(first) :], SECOND),
        ):
            expected = weights @ states[:, rows]
            size = np.abs(expected).max(initial=1e-9)
            np.testing.assert_allclose(found / size, expected / size, atol=1e-6, err_msg=name)
            others = np.delete(weights @ states, rows)
            assert np.abs(others).max(initial=0.0) < 1e-6  # left out because they are zero


@pytest.mark.slow
@pytest.mark.parametrize("type_", MACHINES)
def test_mixed_sensitivities_are_finite_differences_too(type_):
    plant = find_plant(type_)
    values = {
        q.name: q.nominal or 0.1 * HEAVY.get(type_, plant.nominal().get("m", 1.0)) for q in plant.parameters
    }
    for pair in combinations(list(values)[:3], 2):
        lanes = np.tile(list(values.values()), (5, 5, 1))
        for k, name in enumerate(pair):
            lanes[..., list(values).index(name)] *= np.expand_dims(STENCIL, 1 - k)
        states = swung(plant, (), 1, lanes.reshape(25, -1)).reshape(5, 5, -1)
        augmented = swung(plant, pair, 2, lanes[2, 2:3])[0, states.shape[2] :]
        ends = np.cumsum([len(rows) for rows in places(plant, *pair)])
        rows, found = places(plant, *pair)[3], augmented[ends[2] : ends[3]]  # one, other; twice one, mixed
        expected = np.einsum("a,b,abs->s", FIRST, FIRST, states)
        size = np.abs(expected).max(initial=1e-9)
        np.testing.assert_allclose(found / size, expected[rows] / size, atol=1e-6, err_msg=str(pair))
        assert np.abs(np.delete(expected, rows)).max(initial=0.0) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("type_", MACHINES)
def test_without_damping_sensitivities_are_numbers(type_):
    """Roots of a viscosity, for one, have no slope at zero."""
    plant = find_plant(type_)
    values = {q.name: 0.0 if q.lower == 0.0 else q.nominal for q in plant.parameters}
    uncertain = tuple(name for name, value in values.items() if value > 0.0)
    equations = motion_equations(plant, uncertain, 2)
    axes = np.ones((1, 3 * len(plant.actuated)))
    rates = equations.rate(np.full((1, equations.size), 0.1), axes, np.array([list(values.values())]))
    assert np.isfinite(rates).all()
