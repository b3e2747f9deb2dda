"""Following solutions around folds, where shorter moves lead nowhere."""

import attrs
import numpy as np
import pytest
from generator.crane_problems import crane_problem

from gen_profile.problem.pontryagin import optimality_system
from gen_profile.solvers.collocation import GAUSS, sampled
from gen_profile.solvers.indirect.arclength import follow
from gen_profile.solvers.indirect.boundary_value_problem import canonical_problem
from gen_profile.solvers.indirect.continuation import advance
from gen_profile.solvers.indirect.newton import solve_newton

HORIZONTAL = np.pi / 2.0


def linear(problem, intervals=20):
    """A problem, and the solution of its linear model."""
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    canonical = canonical_problem(problem, system)
    size = 2 * len(canonical.final)
    rest = sampled(lambda t: np.zeros((len(t), size)), GAUSS, np.linspace(0.0, 1.0, intervals + 1))
    return canonical.rescaled(canonical.solve_linear(canonical.flow(rest.points), rest))


@pytest.fixture(scope="module")
def folded():
    return linear(
        crane_problem(
            {"m2": 0.1021564313333943, "L1": 4.4816890703380645},
            target=(4.4816890703380645,),
            duration=5.190762123652459,
            sway_weight=0.0,
        )
    )


@pytest.mark.slow
def test_passes_a_fold(folded):
    canonical, guess = folded
    straight = advance(canonical.towards, guess, guess.scaled(0.0))
    assert 0.5 < straight.reached < 1.0
    around = follow(canonical, guess, HORIZONTAL)
    assert around.reached == 1.0
    # it meets the equations of the whole move: Newton's method stays where it is
    again = solve_newton(canonical, around.solution)
    assert again.iterations == 1
    assert canonical.distance(again.solution, around.solution) < 1e-9


def test_finds_what_the_straight_way_finds():
    canonical, guess = linear(crane_problem(sway_weight=0.0))
    straight = advance(canonical.towards, guess, guess.scaled(0.0))
    around = follow(canonical, guess, HORIZONTAL)
    assert straight.reached == around.reached == 1.0
    assert canonical.distance(straight.solution, around.solution) < 1e-9


def test_gives_up_where_ropes_would_have_to_rise(folded):
    canonical, guess = folded
    found = follow(canonical, guess, np.radians(10.0))
    assert found.reached == 0.0
    assert found.residual == np.inf


def test_does_not_take_a_rest_for_a_solution():
    problem = crane_problem(target=(1e4,), sway_weight=0.0)
    canonical, guess = linear(problem)
    assert follow(canonical, guess, HORIZONTAL).reached == 0.0
    assert (
        follow(attrs.evolve(canonical, final=canonical.final * 1e-4), guess.scaled(1e-4), HORIZONTAL).reached
        == 1.0
    )
