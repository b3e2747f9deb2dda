"""Sensitivities against finite differences of separately written equations, integrated by SciPy."""

import attrs
import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from generator.crane_problems import EFFORTS, crane_problem
from scipy.interpolate import PPoly

from gen_profile.dynamics.problem.pontryagin import optimality_system
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile

STEP = 1e-4


def relative_states(profile, times, parameters):
    """θ1, the relative θ2 and their rates, (times, 4), from the oracle's absolute angles."""
    segments = PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots).derivative(2)
    fine = np.sort(np.concatenate([times, times[1:-1] - 1e-4, times[1:-1] + 1e-4]))
    angles = oracle.swing(lambda t: float(segments(min(t, profile.duration))), fine, parameters)
    relative = angles @ np.array([[1.0, -1.0], [0.0, 1.0]])
    rates = np.gradient(relative, fine, axis=0)
    at = np.searchsorted(fine, times)
    return np.concatenate([relative[at], rates[at]], axis=1)


@pytest.mark.parametrize("parameter", ["L1", "L2", "m1", "m2"])
def test_states_follow_a_change_of_the_parameter(parameter):
    problem = crane_problem(desensitized=(parameter,))
    solution = solve(problem)
    optimum, profile = solution.raise_for_status(), optimal_profile(solution)
    value = problem.parameters[parameter]
    apart = [
        relative_states(profile, optimum.knots, problem.parameters | {parameter: value * (1.0 + sign * STEP)})
        for sign in (+1, -1)
    ]
    differences = (apart[0] - apart[1]) / (2.0 * STEP)
    found = optimum.states[:, 7:11]
    sizes = np.abs(found).max(axis=0)
    assert (sizes[:2] > 1e-3).all()  # there is something to compare
    np.testing.assert_allclose(found[:, :2] / sizes[:2], differences[:, :2] / sizes[:2], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(
        found[1:-1, 2:] / sizes[2:], differences[1:-1, 2:] / sizes[2:], rtol=0.0, atol=1e-3
    )


def test_all_sensitivities_vanish_at_both_ends():
    optimum = solve(crane_problem()).raise_for_status()
    sizes = np.abs(optimum.states).max(axis=0)
    assert (np.abs(optimum.states[0, 7:]) < 1e-10 * sizes[7:]).all()
    assert (np.abs(optimum.states[-1, 7:]) < 1e-12 * sizes[7:]).all()


def residual(profile, parameters):
    """Payload's greatest sway after the move, in m."""
    acceleration, end = (
        PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots).derivative(2),
        profile.duration,
    )
    times = np.linspace(end, end + 4.0, 2001)
    angles = oracle.swing(lambda t: float(acceleration(t)) if t < end else 0.0, np.r_[0.0, times], parameters)
    return np.abs(oracle.sway(angles[1:], parameters)[:, 1]).max()


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shares", [{"L1": 1.0}, {"L1": 1.0, "m2": -1.0}])
def test_residual_sway_grows_with_the_power_above_the_order(shares, order):
    """Of the sensitivities to m2, too, which those to L1 imply: leaving them out loses nothing."""
    problem = crane_problem(desensitized=tuple(shares), order=order, duration=5.0, sway_weight=0.0)
    profile, nominal = optimal_profile(solve(problem)), problem.parameters
    machines = [
        nominal | {name: nominal[name] * (1.0 + share * off) for name, share in shares.items()}
        for off in (0.02, 0.04)
    ]
    near, far = (residual(profile, machine) for machine in machines)
    assert np.log2(far / near) == pytest.approx(order + 1, abs=0.15)


@pytest.mark.parametrize(("effort", "tau"), EFFORTS)
def test_one_length_adds_four_states(effort, tau):
    del tau
    plant = crane_problem().plant
    without = optimality_system(plant, (), effort).layout
    with_L1 = optimality_system(plant, ("L1",), effort).layout
    assert without.size == 4 + (4 if effort == "snap" else 3)
    assert with_L1.size == without.size + 4
    assert [row for _, row in with_L1.sensitivity_rows] == [0, 1, 2, 3]


def test_rows_that_a_parameter_cannot_reach_are_dropped():
    """Two pendulums that do not feel one another: the second's length leaves the first as it is."""
    crane = crane_problem().plant

    def uncoupled(q_u, dq_u, q_a, dq_a, p):
        terms = crane.equations([q_u[0], 0.0], [dq_u[0], 0.0], q_a, dq_a, p)
        return attrs.evolve(
            terms,
            M_uu=[[p.L1, 0.0], [0.0, p.L2]],
            M_au=[[-1.0, -1.0]],
            K_u=[-p.g * q_u[0], -p.g * q_u[1]],
            G_u=[0.0, 0.0],
        )

    plant = attrs.evolve(crane, type="two pendulums", equations=uncoupled)
    rows = optimality_system(plant, ("L2",), "jerk").layout.sensitivity_rows
    assert [row for _, row in rows] == [1, 3]
