"""The quick way to the solution, against the sure one, and where it gives way to that."""

import attrs
import numpy as np
import pytest
from generator.crane_problems import EFFORTS, crane_problem

from gen_profile.dynamics.problem.pontryagin import optimality_system
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.collocation import LONG_GAUSS
from gen_profile.methods.solvers.indirect import simplified_newton
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.indirect.boundary_value_problem import (
    canonical_problem,
    independence,
    quintic,
)
from gen_profile.methods.solvers.indirect.simplified_newton import solve_simplified
from gen_profile.methods.solvers.indirect.solver import solve_fully
from gen_profile.plants.registry import find_plant


def posed(problem):
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    canonical = canonical_problem(problem, system)
    asked, _ = independence(canonical)
    return attrs.evolve(canonical, final=np.where(asked, canonical.final, np.nan))


def solve_surely(problem):
    return solve_fully(problem, posed(problem))


def is_quick(solution):
    """Whether its intervals have as many points as only the quick way's."""
    if solution.optimum is None:
        return False
    intervals = len(solution.optimum.knots) - 1
    return len(solution.optimum.sway) == len(LONG_GAUSS.c) * intervals


def move(type_name, start, target, **changes):
    plant = find_plant(type_name)
    task = {
        "plant": plant,
        "parameters": plant.nominal(),
        "start": start,
        "target": target,
        "duration": 4.0,
        "tau": None,
        "desensitized": (),
        "effort": "jerk",
        "sway_weight": 20.0,
        "sway_scale": None,
    }
    return Problem(**(task | changes))


PROBLEMS = {
    **{effort: crane_problem(effort=effort, tau=tau) for effort, tau in EFFORTS},
    "no cost of sway": crane_problem(sway_weight=0.0),
    "scaled cost": crane_problem(sway_scale=None),
    "steep cost": crane_problem(sway_weight=5000.0),
    "second order": crane_problem(desensitized=("L1",), order=2, duration=5.0),
    "swinging at first": crane_problem(initial={"theta1": 0.05}),
    "ending at speed": crane_problem(final_velocity=(0.1,)),
    "hoist": move("single-pendulum-crane", (0.0, 1.0), (0.5, 0.6)),
    "two axes": move("gantry-crane", (0.0, 0.0), (0.6, 0.3)),
    "slewing": move("tower-crane", (0.0, 2.0), (0.3, 2.5), duration=8.0),
    "sloshing": move("slosh-tank", (0.0,), (0.3,)),
    "flexible joint": move("flexible-joint", (0.0,), (0.5,)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_both_ways_lead_to_the_same_motion(name):
    quick, sure = indirect.solve(PROBLEMS[name]), solve_surely(PROBLEMS[name])
    assert is_quick(quick)
    assert not is_quick(sure)
    measured = PROBLEMS[name].sway_scale is None  # to some 1e-6, on either mesh
    assert quick.optimum.cost == pytest.approx(sure.optimum.cost, rel=4e-6 if measured else 1e-6)
    ends = [np.abs(solution.optimum.costates[0]) for solution in (quick, sure)]
    np.testing.assert_allclose(*ends, rtol=1e-4, atol=1e-5 * ends[0].max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"target": (5.5,), "sway_weight": 0.0},  # swings by 49°
        {"target": (4.0,), "sway_scale": None},  # by less, at a cost that is far from quadratic
        {"duration": 300.0, "target": (30.0,)},  # periods by the hundred
    ],
)
def test_gives_way_to_the_sure_one(changes):
    problem = crane_problem(**changes)
    quick, sure = indirect.solve(problem), solve_surely(problem)
    assert not is_quick(quick)
    assert quick.status is sure.status
    assert quick.advice == sure.advice


def test_too_many_controls_are_refused_before_any_work():
    canonical = posed(crane_problem())
    start = quintic(canonical, np.linspace(0.0, 1.0, simplified_newton.MOST_CONTROLS), LONG_GAUSS)
    assert solve_simplified(canonical, start).solution is None


def test_converges_the_faster_the_less_it_swings():
    """Without a cost of sway the linear model is wrong by the square of the angle only."""
    counts = [
        indirect.solve(crane_problem(target=(distance,), sway_weight=0.0)).iterations
        for distance in (1e-4, 0.05, 0.6)
    ]
    assert counts == sorted(counts)
    assert counts[0] <= 2


def test_a_machine_is_linearised_anew_only_while_its_motion_still_changes_much(monkeypatch):
    model, made = simplified_newton._model, []
    monkeypatch.setattr(simplified_newton, "_model", lambda *given: made.append(given) or model(*given))
    iterations = indirect.solve(PROBLEMS["hoist"]).iterations
    assert 0 < len(made) < 0.7 * iterations
