"""Which end conditions are independent, and what is done about those that are not."""

import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from generator.crane_problems import crane_problem
from scipy.interpolate import PPoly

from gen_profile.dynamics.problem.reachability import independent_states
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.solution import Status

ALL = ("L1", "L2", "m1", "m2")


def augmented(parameters, names):
    """ẋ = A x + B ÿ of small absolute angles, their sensitivities (finite differences), ẏ and y."""

    def pendulum(p):
        mass = oracle.mass_matrix(np.zeros(2), p)
        weight = p["g"] * np.array([(p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]])
        A = np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, np.diag(weight)), np.zeros((2, 2))]]
        )
        return A, np.concatenate([np.zeros(2), np.linalg.solve(mass, oracle.lever(np.zeros(2), p))])

    A, B = pendulum(parameters)
    n = 4 * (1 + len(names)) + 2
    whole, drive = np.zeros((n, n)), np.zeros(n)
    whole[-2, -1] = drive[-1] = 1.0
    whole[:4, :4], drive[:4] = A, B
    for k, name in enumerate(names, start=1):
        rows = slice(4 * k, 4 * k + 4)
        up, down = (pendulum(parameters | {name: parameters[name] * (1 + s)}) for s in (1e-5, -1e-5))
        whole[rows, rows], whole[rows, :4] = A, (up[0] - down[0]) / 2e-5
        drive[rows] = (up[1] - down[1]) / 2e-5
    return 3.0 * whole, 3.0 * drive[:, None]


@pytest.mark.parametrize(("names", "states"), [(("L1",), 10), (("L1", "L2"), 14), (ALL[:3], 18), (ALL, 22)])
def test_sensitivities_of_several_parameters_are_redundant(names, states):
    """Rank 10 of 10, 14, 18, 22: zero sensitivity of two modes to L1 already is zero sensitivity to all."""
    A, B = augmented(crane_problem().parameters, names)
    assert len(A) == states
    chosen = independent_states(A, B, np.arange(states), np.full(states, 1e-7))
    rows = [B]
    for _ in range(400):
        rows.append(rows[-1] + A / 400 @ rows[-1] + A / 400 @ (A / 400 @ rows[-1]) / 2)
    responses = np.array(rows)[:, :, 0].T
    rank = np.linalg.matrix_rank(responses / np.linalg.norm(responses, axis=1, keepdims=True), tol=1e-4)
    assert chosen.sum() == rank == 10


@pytest.mark.parametrize("names", [("L1",), ("L1", "L2"), ALL])
def test_redundant_parameters_are_left_out_and_named(names):
    solution = solve(crane_problem(desensitized=names, sway_weight=0.0))
    assert solution.status is Status.CONVERGED
    assert solution.redundant == names[1:]
    assert solution.problem.desensitized == names
    assert solution.raise_for_status().states.shape[1] == 11


@pytest.mark.parametrize("name", ALL)
def test_dropped_sensitivities_are_zero_in_the_limit_of_small_angles(name):
    """A hundredth of the move leaves a hundredth of the residual per angle: it falls with the square."""

    def sensitivity(distance):
        problem = crane_problem(desensitized=ALL, sway_weight=0.0, target=(distance,))
        profile = optimal_profile(solve(problem))
        acceleration = PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots).derivative(2)
        value, step = problem.parameters[name], 1e-3
        ends = [
            oracle.swing(
                lambda t: float(acceleration(min(t, 3.0))),
                np.array([0.0, 3.0]),
                problem.parameters | {name: value * (1 + sign * step)},
            )[-1]
            for sign in (+1, -1)
        ]
        return np.abs(ends[0] - ends[1]).max() / (2.0 * step) / distance

    large, small = sensitivity(0.3), sensitivity(0.03)
    assert small < 1e-4  # rad per metre moved and relative change; angles on the way are 0.3 rad per metre
    if name != "L1":
        assert small < large / 30.0


def test_what_the_input_cannot_move_is_not_chosen():
    A, B = np.diag([0.0, -1.0, -1.0]), np.array([[1.0], [1.0], [0.0]])
    chosen = independent_states(A, B, np.array([2, 1, 0]), np.full(3, 1e-8))
    assert chosen.tolist() == [False, True, True]
