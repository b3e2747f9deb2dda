"""Answers of a linearised machine, against SciPy's integrator and the definition of an adjoint."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gen_profile.methods.solvers.collocation import GAUSS, LONG_GAUSS
from gen_profile.methods.solvers.indirect.linear_response import linear_response

N = 5
MESH = np.array([0.0, 0.2, 0.35, 0.6, 0.8, 1.0])
EVEN = np.linspace(0.0, 1.0, 6)
HALVED = np.array([0.0, 0.25, 0.375, 0.5, 0.75, 1.0])


def turning(t):
    """Some matrix of a system that is stiffer later."""
    skew = np.triu(np.arange(N * N, dtype=float).reshape(N, N) % 7, 1)
    return (1.0 + t) * (skew - skew.T) / 3.0 - 0.2 * np.diag(np.arange(N))


def points(mesh, scheme):
    return mesh[:-1, None] + np.diff(mesh)[:, None] * scheme.c


def response_of(matrix, mesh, scheme=LONG_GAUSS):
    A = np.array([[matrix(t) for t in row] for row in points(mesh, scheme)])
    return linear_response(A, scheme, np.diff(mesh))


@pytest.fixture(params=["varying", "constant", "constant on some lengths"])
def case(request):
    meshes = {"varying": MESH, "constant": EVEN, "constant on some lengths": HALVED}
    return turning if request.param == "varying" else (lambda t: turning(0.0)), meshes[request.param]


def force(t):
    return np.array([np.sin(5.0 * t), 1.0, t**2, 0.0, np.exp(-t)])


def test_states_are_those_that_an_integrator_finds(case):
    matrix, mesh = case
    at = points(mesh, LONG_GAUSS)
    slopes, values, final = response_of(matrix, mesh).states(
        np.array([[force(t) for t in row] for row in at])
    )
    found = solve_ivp(
        lambda t, x: matrix(t) @ x + force(t),
        (0.0, 1.0),
        np.zeros(N),
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        dense_output=True,
    )
    np.testing.assert_allclose(final, found.y[:, -1], atol=1e-10)
    for t, value, slope in zip(at.ravel(), values.reshape(-1, N), slopes.reshape(-1, N), strict=True):
        np.testing.assert_allclose(value, found.sol(t), atol=1e-7)
        np.testing.assert_allclose(slope, matrix(t) @ value + force(t), atol=1e-12)


def test_costates_are_those_that_an_integrator_finds_backward(case):
    matrix, mesh = case
    end = np.array([1.0, -2.0, 0.5, 0.0, 3.0])
    response, at = response_of(matrix, mesh), points(mesh, LONG_GAUSS)
    load = np.array([[force(t) for t in row] for row in at])
    values, falls = response.costates(response.weights * load, end)
    found = solve_ivp(
        lambda t, c: -matrix(t).T @ c - force(t),
        (1.0, 0.0),
        end,
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        dense_output=True,
    )
    expected = np.array([[found.sol(t) for t in row] for row in at])
    np.testing.assert_allclose(values / response.weights, expected, atol=1e-7)
    slopes = np.array([[matrix(t).T @ found.sol(t) + force(t) for t in row] for row in at])
    np.testing.assert_allclose(falls / response.weights, slopes, atol=1e-6)


@pytest.mark.parametrize(
    ("matrix", "mesh"),
    [(turning, MESH), (turning, np.array([0.0, 1.0])), (lambda t: turning(0.0), EVEN)],
    ids=["varying", "one interval", "constant"],
)
def test_costates_and_states_are_adjoint_to_the_last_bits(matrix, mesh):
    response = response_of(matrix, mesh, GAUSS)
    random = np.random.default_rng(3)
    pushed, load = random.normal(size=(2, len(mesh) - 1, GAUSS.stages, N))
    end = random.normal(size=N)
    _, states, final = response.states(pushed)
    costates, _ = response.costates(load, end)
    assert (load * states).sum() + end @ final == pytest.approx((costates * pushed).sum(), rel=1e-12)


def test_gains_are_the_answers_to_single_controls(case):
    matrix, mesh = case
    response, driven = response_of(matrix, mesh), np.array([2, 4])
    outputs = np.random.default_rng(4).normal(size=(5, LONG_GAUSS.stages, 3, N))
    seen, final = response.gains(driven, outputs)
    count = 5 * LONG_GAUSS.stages
    for point, control in [(0, 1), (11, 0), (count - 1, 1)]:
        pushed = np.zeros((count, N))
        pushed[point, driven[control]] = 1.0
        _, states, end = response.states(pushed.reshape(5, -1, N))
        column = 2 * point + control
        expected = (outputs @ states[..., None]).reshape(count, 3)
        np.testing.assert_allclose(seen[:, :, column], expected, atol=1e-13)
        np.testing.assert_allclose(final[:, column], end, atol=1e-13)


def test_one_interval_stands_for_all_only_where_all_are_alike():
    still = response_of(lambda t: turning(0.0), EVEN)
    assert len(still.slopes) == 1
    assert len(response_of(lambda t: turning(0.0), MESH).slopes) == 5
    assert len(response_of(turning, EVEN).slopes) == 5


def test_intervals_of_one_length_are_eliminated_once(monkeypatch):
    inverse, inverted = np.linalg.inv, []
    monkeypatch.setattr(
        np.linalg, "inv", lambda matrices: inverted.append(len(matrices)) or inverse(matrices)
    )
    response_of(lambda t: turning(0.0), HALVED)
    response_of(turning, HALVED)
    assert inverted == [2, 5]
