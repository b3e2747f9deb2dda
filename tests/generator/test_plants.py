"""Machines against analytic mechanics and separately derived equations."""

from importlib.metadata import EntryPoint, EntryPoints
from types import SimpleNamespace

import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.plants import registry
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.support.errors import SpecError

CRANE = find_plant("double-pendulum-crane")
ANGLES, RATES = st.floats(-1.5, 1.5), st.floats(-5.0, 5.0)
PAIR, RATE_PAIR = st.tuples(ANGLES, ANGLES), st.tuples(RATES, RATES)
CRANES = st.fixed_dictionaries(
    {
        "m1": st.floats(0.1, 1000.0),
        "m2": st.floats(0.1, 1000.0),
        "L1": st.floats(0.2, 20.0),
        "L2": st.floats(0.2, 20.0),
        "g": st.floats(1.0, 20.0),
        "c1": st.floats(0.0, 10.0),
        "c2": st.floats(0.0, 10.0),
    }
)


def accelerations(q, dq, push, parameters):
    """The plant's own equations, solved by NumPy."""
    terms = CRANE.equations(q, dq, [0.0], [0.0], SimpleNamespace(**parameters))
    forces = np.array(terms.K_u) + terms.G_u - np.array(terms.M_au).T @ [push]
    return np.linalg.solve(np.array(terms.M_uu), forces)


def absolute(q):
    """Both angles from the vertical."""
    return np.cumsum(q)


@given(PAIR, RATE_PAIR, st.floats(-10.0, 10.0), CRANES)
def test_the_crane_obeys_lagrange_in_absolute_angles(q, dq, push, parameters):
    expected = oracle.accelerations(absolute(q), absolute(dq), push, parameters)
    scale = np.abs(expected).max() + 1.0
    np.testing.assert_allclose(
        absolute(accelerations(q, dq, push, parameters)), expected, rtol=1e-7, atol=1e-7 * scale
    )


@given(PAIR, CRANES)
def test_sway_height_and_angle_are_where_the_loads_hang(q, parameters):
    p = SimpleNamespace(**parameters)
    outputs = CRANE.outputs(q, [0.0], p)
    ropes = np.array([p.L1, p.L2]) * np.exp(
        1j * absolute(q)
    )  # along the vertical, trailing as the imaginary part
    hanging = np.cumsum(ropes)
    np.testing.assert_allclose(outputs.sway, hanging.imag, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(outputs.height, -hanging.real, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(outputs.angle, absolute(q), rtol=1e-15)


def test_loads_trail_a_cart_that_starts():
    assert (accelerations([0.0, 0.0], [0.0, 0.0], 1.0, CRANE.nominal())[0]) > 0.0


def free_swing(parameters, seconds=10.0):
    def rates(_, x):
        return np.concatenate([x[2:], accelerations(x[:2], x[2:], 0.0, parameters)])

    swing = solve_ivp(rates, (0.0, seconds), [0.8, -0.5, 0.0, 1.0], method="DOP853", rtol=1e-10, atol=1e-12)
    return np.array([oracle.energy(absolute(x[:2]), absolute(x[2:]), parameters) for x in swing.y.T])


def test_energy_is_kept_without_damping():
    energies = free_swing(CRANE.nominal())
    np.testing.assert_allclose(energies, energies[0], atol=1e-8)


@pytest.mark.parametrize("joint", ["c1", "c2"])
def test_either_damper_takes_energy_all_the_time(joint):
    energies = free_swing(CRANE.nominal() | {joint: 0.01})
    assert (np.diff(energies) < 1e-9).all()
    assert energies[-1] < energies[0] - 0.1


@pytest.mark.parametrize(("payload", "frequencies"), [(0.203, (3.640, 9.017)), (0.201, (3.642, 8.990))])
def test_the_papers_frequencies_belong_to_another_payload(payload, frequencies):
    found = linearize(CRANE, CRANE.nominal() | {"m2": payload}).frequencies
    np.testing.assert_allclose(found, frequencies, atol=5e-4)


def test_nominal_parameters_lie_within_their_bounds():
    for type_ in plant_types():
        for parameter in find_plant(type_).parameters:
            assert parameter.lower <= parameter.nominal <= parameter.upper


def test_every_type_of_the_list_is_found_by_its_name():
    assert [find_plant(type_).type for type_ in plant_types()] == plant_types()


def test_other_distributions_add_machines(monkeypatch):
    own = EntryPoint("winch", "fmu.hoisting_pendulum:PLANT", registry.GROUP)

    monkeypatch.setattr(registry, "entry_points", EntryPoints([own]).select)
    assert "winch" in plant_types()
    assert find_plant("winch").parameters
    with pytest.raises(KeyError):
        find_plant("crane")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("no_such_module:PLANT", "No module named"),
        ("fmu.hoisting_pendulum:outputs", "is no gen_profile"),
        ("generator.unsound_plant:PLANT", "M_uu is singular at rest"),
    ],
)
def test_a_broken_machine_of_another_distribution(monkeypatch, value, why):
    broken = EntryPoints([EntryPoint("winch", value, registry.GROUP)])
    monkeypatch.setattr(registry, "entry_points", broken.select)
    assert "winch" in plant_types()
    with pytest.raises(SpecError, match=rf"plant\.type: 'winch'.*{why}.*update or uninstall"):
        find_plant("winch")
