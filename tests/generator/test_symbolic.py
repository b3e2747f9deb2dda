"""Functions of many points, which NumPy evaluates operation by operation, against CasADi's own machine."""

from concurrent.futures import ThreadPoolExecutor

import casadi
import numpy as np
import pytest

from gen_profile.dynamics.evaluation.simulation import equations_of
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.plants.registry import find_plant, plant_types

MANY = 500
x, y = casadi.SX.sym("x", 2), casadi.SX.sym("y", 3)
a, b, c = x[0], x[1], y[2]
EXPRESSIONS = {
    "arithmetic": [a + b * c - a / (2.0 + b**2), -b, 2.0 * a, 1.0 / c, casadi.SX(3.5), casadi.SX(1, 1)],
    "powers": [a**0.5, a**b, a**3, casadi.sqrt(b), casadi.exp(c), casadi.log(a)],
    "angles": [
        casadi.sin(a),
        casadi.cos(b),
        casadi.tan(c),
        casadi.atan(a),
        casadi.atan2(a, b),
    ],
    "hyperbolic": [casadi.sinh(a), casadi.cosh(b), casadi.tanh(c)],
    "choices": [casadi.fabs(c), casadi.fmin(a, b), casadi.fmax(a, c), casadi.sin(a * b)],
    "what NumPy is not asked for": [casadi.if_else(a < b, a, c), casadi.floor(5.0 * a), casadi.erf(b)],
}


@pytest.mark.parametrize("entries", EXPRESSIONS.values(), ids=EXPRESSIONS.keys())
@pytest.mark.parametrize("points", [(MANY, MANY), (MANY, 1), (1, MANY), (MANY - 1, MANY - 1)])
def test_many_points_give_what_each_gives_alone(entries, points):
    matrix = casadi.reshape(casadi.vertcat(*entries, *entries[: len(entries) % 2]), 2, -1)
    random = np.random.default_rng(1)
    first, second = random.uniform(0.1, 2.0, (points[0], 2)), random.uniform(-2.0, 2.0, (points[1], 3))
    function = Function("f", {"x": x, "y": y}, matrix, casadi.vertcat(a, b))
    found = function(first, second)
    assert found.shape == (max(points), *matrix.shape)
    pairs = zip(
        np.broadcast_to(first, (max(points), 2)), np.broadcast_to(second, (max(points), 3)), strict=True
    )
    due = np.array([function(one[None], other[None])[0] for one, other in pairs])
    np.testing.assert_allclose(found, due, rtol=1e-13, atol=1e-15)


def test_what_has_no_value_is_nan_without_a_warning():
    function = Function("f", {"x": x}, casadi.log(a) / b)
    points = np.array([[-1.0, 1.0], [1.0, 0.0], [2.0, 0.0]] * MANY)
    np.testing.assert_array_equal(function(points)[:3, 0, 0], [np.nan, np.nan, np.inf])


def test_numpy_is_asked_from_some_points_on(monkeypatch):
    function, asked = Function("f", {"x": x}, a * b), []
    monkeypatch.setattr(function, "_by_operations", lambda points, _: asked.append(points))
    function(np.ones((MANY, 2)))
    function(np.ones((3, 2)))
    assert asked == [(MANY,)]


@pytest.mark.parametrize("machine", plant_types())
def test_every_machine_is_evaluated_operation_by_operation(monkeypatch, machine):
    """Point by point, a tank's motion takes twice as long."""
    for function in equations_of(find_plant(machine)):
        asked = []
        monkeypatch.setattr(function, "_by_operations", lambda points, _, asked=asked: asked.append(points))
        sizes = [function._function.size1_in(i) for i in range(function._function.n_in())]
        function(*(np.ones((MANY, size)) for size in sizes))
        assert asked == [(MANY,)]


@pytest.mark.parametrize("count", [3, MANY])
def test_inputs_that_are_alike_along_an_axis_are_given_once(count):
    function, random = Function("f", {"x": x, "y": y}, casadi.vertcat(a * c, b)), np.random.default_rng(3)
    one, other = random.random((4, 2)), random.random((count, 1, 3))
    pairs = np.repeat(other[:, 0], 4, axis=0), np.tile(one, (count, 1))
    due = function(pairs[1], pairs[0]).reshape(count, 4, 2, 1)
    np.testing.assert_array_equal(function(one, other), due)


def test_threads_do_not_disturb_one_another():
    function = Function("f", {"x": x}, a**3 + casadi.sin(b))
    points = np.random.default_rng(2).uniform(0.1, 2.0, (2000, 1, 2))
    with ThreadPoolExecutor(4) as threads:
        found = np.array(list(threads.map(function, points))).ravel()
    np.testing.assert_allclose(found, points[:, 0, 0] ** 3 + np.sin(points[:, 0, 1]), rtol=1e-14)
