"""Pontryagin's conditions and the cost, against a Hamiltonian and a direct method that were written apart."""

import numpy as np
import pytest
from generator.crane_problems import EFFORTS, crane_problem
from generator.oracles.crane_optimal_control import CraneOptimalControl, direct_cost
from scipy.integrate import solve_ivp

from gen_profile.dynamics.problem.pontryagin import SNAP_TIME
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.motion.metrics import greatest, root_mean_square

CASES = [(beta, *effort) for beta in (0.0, 20.0, 50.0) for effort in EFFORTS]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[1]}-beta{case[0]:g}")
def case(request):
    beta, effort, tau = request.param
    problem = crane_problem(sway_weight=beta, effort=effort, tau=tau)
    oracle = CraneOptimalControl(problem.parameters, effort, tau, beta, problem.sway_scale)
    return oracle, solve(problem).raise_for_status()


def test_control_makes_the_hamiltonian_least(case):
    """The jerk (or snap) of the motion is the one that the oracle's ∂H/∂u = 0 gives."""
    oracle, optimum = case
    controls = [oracle.control(x, c) for x, c in zip(optimum.states, optimum.costates, strict=True)]
    tops = [
        float(oracle.rates(x, u)[3 + oracle.orders])
        for x, u in zip(optimum.states[:-1], controls[:-1], strict=True)
    ]
    found = optimum.top_derivative[:, 0, 0]
    np.testing.assert_allclose(found, tops, rtol=1e-6, atol=1e-8 * np.abs(tops).max())


def test_hamiltonian_is_constant(case):
    oracle, optimum = case
    values = [
        float(oracle.hamiltonian(x, c, oracle.control(x, c)))
        for x, c in zip(optimum.states, optimum.costates, strict=True)
    ]
    np.testing.assert_allclose(optimum.hamiltonian, values, rtol=1e-7)
    assert np.ptp(values) < 1e-6 * np.abs(values).max()
    assert optimum.hamiltonian_variation < 1e-6


@pytest.mark.slow
def test_canonical_equations_lead_from_node_to_node(case):
    oracle, optimum = case
    n = oracle.size

    def slope(_, z):
        f, costate_rate = oracle.canonical(z[:n], z[n:], oracle.control(z[:n], z[n:]))
        return np.concatenate([np.array(f).ravel(), np.array(costate_rate).ravel()])

    nodes = np.concatenate([optimum.states, optimum.costates], axis=1)
    sizes = np.abs(nodes).max(axis=0)
    for k in (0, len(nodes) // 3, len(nodes) - 2):
        span = (optimum.knots[k], optimum.knots[k + 1])
        # snap's equations multiply the error of a node by e every 0.02 s
        tolerance = 4e-6 * (np.exp((span[1] - span[0]) / SNAP_TIME) if oracle.orders == 4 else 1.0)
        arrived = solve_ivp(slope, span, nodes[k], method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
        np.testing.assert_allclose(arrived / sizes, nodes[k + 1] / sizes, rtol=0.0, atol=tolerance)


@pytest.mark.slow
def test_cost_is_that_of_a_direct_method(case):
    oracle, optimum = case
    constant = optimum.sway_weight * optimum.knots[-1]  # the oracle counts exp(…) − 1
    assert optimum.cost - constant == pytest.approx(direct_cost(oracle, 0.3, 3.0), rel=1e-6)


# the paper's table, found independently: peak and RMS of acceleration and of jerk, transient sway in m
FOUND = {
    0.0: (0.3336, 0.1840, 3.749, 1.0655, 29.406e-3),
    20.0: (0.5569, 0.2281, 19.436, 3.1667, 21.992e-3),
    50.0: (0.7026, 0.2833, 25.867, 4.2040, 19.362e-3),
}


@pytest.mark.parametrize("beta", FOUND)
def test_the_papers_table(beta):
    solution = solve(crane_problem(sway_weight=beta))
    profile = optimal_profile(solution)
    figures = [figure(profile, order) for order in (2, 3) for figure in (greatest, root_mean_square)]
    sway = np.abs(solution.raise_for_status().sway[:, -1]).max()
    np.testing.assert_allclose([*figures, sway], FOUND[beta], rtol=5e-3)


def test_initial_jerk_of_the_reference_solution():
    optimum = solve(crane_problem()).raise_for_status()
    assert optimum.top_derivative[0, 0, 0] == pytest.approx(25.867416, rel=1e-6)
    assert -optimum.costates[0, 6] == pytest.approx(25.867416, rel=1e-6)  # u = −λ of the acceleration
