"""The linear model against finite differences and analytic frequencies."""

import attrs
import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from fmu.hoisting_pendulum import PLANT as WINCH
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.dynamics.problem.linearization import linearize, resting_place
from gen_profile.plants.registry import find_plant
from gen_profile.support.errors import InfeasibleProblem

CRANE = find_plant("double-pendulum-crane")
OTHER = {"m1": 350.0, "m2": 12000.0, "L1": 20.0, "L2": 2.0, "g": 9.81, "c1": 900.0, "c2": 50.0}
RELATIVE = np.array([[1.0, 0.0], [-1.0, 1.0]])  # from absolute angles to the second relative to the first


def differences(function, size, step=1e-6):
    """Central differences, one column per argument."""
    return np.column_stack([(function(d) - function(-d)) / (2.0 * step) for d in np.eye(size) * step])


@pytest.mark.parametrize("parameters", [CRANE.nominal(), OTHER], ids=["paper", "heavy"])
def test_the_matrices_are_the_equations_slopes(parameters):
    model = linearize(CRANE, parameters)
    absolute, still = np.linalg.inv(RELATIVE), np.zeros(2)

    def accelerations(q, dq, push):
        return RELATIVE @ oracle.accelerations(absolute @ q, absolute @ dq, push, parameters)

    by_angle = differences(lambda q: accelerations(q, still, 0.0), 2)
    by_rate = differences(lambda dq: accelerations(still, dq, 0.0), 2)
    by_push = differences(lambda push: accelerations(still, still, push[0]), 1)
    by_sway = differences(lambda q: oracle.sway((absolute @ q)[None], parameters)[0], 2)
    np.testing.assert_allclose(model.stiffness, -by_angle, rtol=1e-6)
    np.testing.assert_allclose(model.damping, -by_rate, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(model.input, by_push, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(model.sway_gain, by_sway, rtol=1e-6, atol=1e-9)


@given(
    st.floats(1e-3, 1e3),
    st.floats(1e-3, 1e3),
    st.floats(0.1, 50.0),
    st.floats(0.1, 50.0),
    st.floats(1.0, 20.0),
)
def test_frequencies_of_every_double_pendulum(m1, m2, L1, L2, g):
    """ω⁴ m1 L1 L2 − ω² (m1+m2) g (L1+L2) + (m1+m2) g² = 0, a textbook's characteristic equation."""
    parameters = CRANE.nominal() | {"m1": m1, "m2": m2, "L1": L1, "L2": L2, "g": g}
    model = linearize(CRANE, parameters)
    total = m1 + m2
    half = total * g * (L1 + L2) / (2.0 * m1 * L1 * L2)
    fast = half + np.sqrt(half**2 - total * g**2 / (m1 * L1 * L2))
    slow = total * g**2 / (m1 * L1 * L2) / fast
    np.testing.assert_allclose(model.frequencies, np.sqrt([slow, fast]), rtol=1e-6)


@pytest.mark.parametrize("parameters", [CRANE.nominal(), OTHER], ids=["paper", "heavy"])
def test_modes_turn_the_stiffness_into_squared_frequencies(parameters):
    model = linearize(CRANE, parameters)
    modal = np.linalg.solve(model.modes, model.stiffness @ model.modes)
    np.testing.assert_allclose(modal, np.diag(model.frequencies**2), atol=1e-9 * modal.max())
    np.testing.assert_allclose(np.linalg.norm(model.modes, axis=0), 1.0)
    assert (model.modes[np.abs(model.modes).argmax(axis=0), [0, 1]] > 0.0).all()


def test_damping_ratios_are_the_poles():
    model = linearize(CRANE, CRANE.nominal() | {"c1": 1e-3, "c2": 5e-4})
    state = np.block([[np.zeros((2, 2)), np.eye(2)], [-model.stiffness, -model.damping]])
    poles = np.linalg.eigvals(state)
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))]
    np.testing.assert_allclose(model.damping_ratios, -poles.real / np.abs(poles), rtol=1e-3)


def test_a_mode_may_depend_on_where_the_axes_stand():
    for rope in (0.5, 2.0, 8.0):
        model = linearize(WINCH, WINCH.nominal(), q_a=[0.0, rope])
        np.testing.assert_allclose(model.frequencies, np.sqrt(9.81 / rope), rtol=1e-12)
        np.testing.assert_allclose(model.sway_gain, rope)
        np.testing.assert_allclose(model.input, [[1.0 / rope, 0.0]])


@pytest.mark.parametrize(
    "type_", ["double-pendulum-crane", "gantry-crane", "tower-crane", "single-pendulum-crane"]
)
def test_places_of_axes_count_where_the_equations_feel_them(type_):
    plant = find_plant(type_)
    places, machine = plant.probe()
    here = np.array(places)

    def law(q_a):
        q_u, still = np.full(len(plant.unactuated), 1e-3), np.zeros_like(here)
        terms = plant.equations(q_u, 0.0 * q_u, q_a, still, machine)
        return np.linalg.solve(np.array(terms.M_uu), np.column_stack([terms.K_u, np.array(terms.M_au).T]))

    for axis in np.eye(len(here)):
        there = here + 0.3 * axis
        alike = np.allclose(law(here), law(there), rtol=1e-9, atol=1e-12)
        assert (resting_place(plant, here) == resting_place(plant, there)) == alike
        if not alike:
            assert resting_place(plant, there) @ axis == there @ axis


def test_a_machine_that_falls_over_has_no_frequencies():
    with pytest.raises(InfeasibleProblem, match=r"'double-pendulum-crane' does not return to rest"):
        linearize(CRANE, CRANE.nominal() | {"g": -9.81})


def test_machines_are_told_apart():
    """The compiled terms are kept per machine, not per name."""
    sideways = attrs.evolve(
        CRANE, outputs=lambda q_u, q_a, p: attrs.evolve(CRANE.outputs(q_u, q_a, p), sway=[0.0, q_u[0]])
    )
    assert linearize(sideways, CRANE.nominal()).sway_gain[1] == pytest.approx([1.0, 0.0])
    assert linearize(CRANE, CRANE.nominal()).sway_gain[1] == pytest.approx([0.861, 0.391])
