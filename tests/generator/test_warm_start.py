"""The indirect method where the load swings far, begun at the solution of a similar problem."""

import attrs
import numpy as np
import pytest

from gen_profile.problem.problem import problem_of
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.spec.reading import preset_spec


def problem(*overrides):
    """By default, one whose load swings by 20°."""
    return problem_of(preset_spec("paper", ("move.distance=3.2", 'cost.sway_scale="auto"', *overrides)))


@pytest.fixture(scope="module")
def neighbour():
    return indirect.solve(problem("plant.L1=0.45", "move.distance=3.1"))


def agree(one, other):
    assert one.optimum.cost == pytest.approx(other.optimum.cost, rel=1e-7)
    knots = other.optimum.knots
    sizes = np.abs(other.optimum.states).max(axis=0)
    if len(one.optimum.knots) == len(knots):
        np.testing.assert_allclose(one.optimum.states / sizes, other.optimum.states / sizes, atol=1e-6)


@pytest.mark.parametrize(
    "overrides",
    [(), ("move.distance=3.25", "plant.L2=0.4"), ('actuator.type="first-order"', "actuator.tau=0.1")],
)
def test_finds_the_same_in_fewer_steps(neighbour, overrides):
    cold = indirect.solve(problem(*overrides))
    warm = choice.solve(problem(*overrides), "indirect", neighbour.trajectory)
    assert warm.iterations < cold.iterations
    agree(warm, cold)


def test_a_problem_begun_at_its_own_solution_is_solved(neighbour):
    same = indirect.solve(neighbour.problem, neighbour.trajectory)
    assert same.iterations < neighbour.iterations
    agree(same, neighbour)


def test_where_a_linear_model_does_a_neighbour_changes_nothing(neighbour):
    little = problem("move.distance=0.3")
    cold, warm = indirect.solve(little), indirect.solve(little, neighbour.trajectory)
    assert warm.iterations == cold.iterations
    np.testing.assert_array_equal(warm.optimum.states, cold.optimum.states)


@pytest.mark.parametrize("wrong", ["far off", "of another size", "not a number"])
def test_what_does_not_help_does_not_harm(neighbour, wrong):
    at = neighbour.trajectory
    near = {
        "far off": at.scaled(-30.0),
        "of another size": attrs.evolve(at, nodes=at.nodes[:, :-2], stages=at.stages[:, :, :-2]),
        "not a number": at.scaled(float("nan")),
    }[wrong]
    cold, warm = indirect.solve(problem()), indirect.solve(problem(), near)
    assert warm.optimum.cost == cold.optimum.cost
    np.testing.assert_array_equal(warm.optimum.states, cold.optimum.states)


def test_without_a_cost_of_sway_there_is_nothing_to_gain(neighbour):
    quiet = problem("cost.sway_weight=0")
    cold, warm = indirect.solve(quiet), indirect.solve(quiet, neighbour.trajectory)
    assert warm.iterations == cold.iterations
    assert warm.optimum.cost == cold.optimum.cost


def test_leaves_sensitivities_out_that_vanish_anyway(neighbour):
    redundant = attrs.evolve(problem(), desensitized=("L1", "m1"))
    cold = indirect.solve(redundant)
    agree(indirect.solve(redundant, neighbour.trajectory), cold)
