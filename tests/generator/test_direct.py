"""The direct method against the indirect one, the limits at every instant, and linear programs."""

import attrs
import numpy as np
import pytest
from generator.crane_problems import CRANE, EFFORTS, crane_problem
from generator.oracles.crane_optimal_control import CraneOptimalControl, direct_cost

from gen_profile.dynamics.problem.cost import SwayCost
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers import suggestions
from gen_profile.methods.solvers.direct import set_up
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct.refinement import bisected, switching
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.indirect.extremal import METHOD as INDIRECT
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.solution import Status
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.metrics import greatest
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.support.work import OutOfWork, budget

LIMITS = {"velocity": 0.15, "acceleration": 0.4, "jerk": 6.0}


def limited(**limits):
    return crane_problem(limits=LimitsSpec(**limits))


@pytest.mark.slow
@pytest.mark.parametrize(("effort", "tau"), EFFORTS)
@pytest.mark.parametrize("beta", [0.0, 20.0, 50.0])
def test_agrees_with_the_indirect_method(effort, tau, beta):
    problem = crane_problem(effort=effort, tau=tau, sway_weight=beta)
    one, other = direct.solve(problem).raise_for_status(), indirect.solve(problem).raise_for_status()
    assert one.cost == pytest.approx(other.cost, rel=1e-6)
    # Pontryagin's costates are the multipliers of the programs
    size = np.abs(other.costates).max(axis=0)
    for node in (0, -1):
        assert one.costates[node] == pytest.approx(other.costates[node], abs=1e-4 * size.max())
        assert one.costates[node] / size == pytest.approx(other.costates[node] / size, abs=1e-3)


def test_programs_end_where_the_next_step_can_be_foreseen():
    problem = crane_problem()
    usual, exact = (
        direct.solve(problem, options=options)
        for options in (None, set_up.DirectOptions(step_tolerance=1e-10))
    )
    assert usual.residual > set_up.USUAL.step_tolerance > exact.residual
    assert usual.raise_for_status().cost == pytest.approx(exact.raise_for_status().cost, rel=1e-11)


def test_agrees_with_automatic_weights():
    problem = crane_problem(sway_scale=None)
    one, other = direct.solve(problem).raise_for_status(), indirect.solve(problem).raise_for_status()
    assert one.sway_scale == pytest.approx(other.sway_scale, rel=1e-6)
    assert one.sway_weight == pytest.approx(other.sway_weight, rel=1e-6)
    assert one.cost == pytest.approx(other.cost, rel=1e-6)


def test_redundant_sensitivities_are_named():
    solution = direct.solve(crane_problem(desensitized=("L1", "L2"), sway_weight=0.0))
    assert solution.redundant == ("L2",)
    assert solution.status is Status.CONVERGED


@pytest.mark.slow
@pytest.mark.parametrize("tau", [None, 0.05])
@pytest.mark.parametrize(("name", "limit"), LIMITS.items())
def test_limits_hold_for_the_command_at_every_instant(name, limit, tau):
    loose = crane_problem(tau=tau, sway_weight=0.0)
    order = list(LIMITS).index(name) + 1
    free = lag_compensated(optimal_profile(direct.solve(loose)), tau)
    found = np.abs(free.within_segments(201, order)[1]).max()
    limit = 0.9 * found
    solution = direct.solve(attrs.evolve(loose, limits=LimitsSpec(**{name: limit})))
    command = lag_compensated(optimal_profile(solution), tau)
    kept = np.abs(command.within_segments(201, order)[1]).max()
    assert 0.98 * limit < kept <= limit


def test_travel_and_sway_hold_between_samples():
    # the least sway on the way to a target that the axis may not overshoot
    problem = crane_problem(limits=LimitsSpec(travel=(0.0, 0.3), sway=0.018))
    solution = direct.solve(problem)
    position = optimal_profile(solution).within_segments(201, 0)[1]
    assert position.min() >= 0.0
    assert position.max() <= 0.3 + 1e-12
    assert 0.0179 < direct.sway_on_the_way(solution) <= 0.018


def test_a_limit_costs():
    free, bound = (direct.solve(limited(**limits)) for limits in ({}, {"acceleration": 0.5}))
    assert bound.raise_for_status().cost > free.raise_for_status().cost
    assert bound.raise_for_status().hamiltonian is None


def test_auto_takes_the_indirect_method_where_no_limit_binds():
    assert choice.attempt(limited(acceleration=1.0)).method == INDIRECT
    assert choice.attempt(limited(acceleration=0.5)).method == direct.METHOD
    assert choice.attempt(limited(acceleration=0.5), "indirect").method == INDIRECT
    assert choice.attempt(limited(), "direct").method == direct.METHOD


@pytest.mark.slow
def test_an_infeasible_problem_says_what_would_do():
    solution = suggestions.solve(preset_spec("paper", ["limits={acceleration=0.2, velocity=0.2}"]))
    assert solution.status is Status.INFEASIBLE
    assert [one.values for one in solution.suggestions] == [
        {"move.duration": 3.16},
        {"limits.acceleration": 0.233},
    ]


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_no_duration_does_where_the_target_is_out_of_reach():
    with budget(1.0), pytest.raises(OutOfWork):
        choice.minimum_time(limited(acceleration=1.0, travel=(0.0, 0.2)))


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize(
    "settings", [["limits.acceleration=0.3"], ["limits.acceleration=0.3", "robustness.method=range"]]
)
def test_the_tests_fixture_halves_the_intervals_of_every_program(monkeypatch, settings):
    asked, mesh = [], set_up._mesh
    monkeypatch.setattr(set_up, "_mesh", lambda one, options: asked.append(options) or mesh(one, options))
    choice.attempt(problem_of(preset_spec("paper", settings)))
    assert {options.intervals for options in asked} == {20}


def test_a_wild_move_is_refused_not_returned():
    solution = direct.solve(crane_problem(duration=0.4, sway_weight=0.0))
    assert solution.optimum is None
    assert solution.status in {Status.SWINGS_TOO_FAR, Status.DIVERGED, Status.INFEASIBLE}
    assert solution.advice


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.0, 50.0])
def test_programs_that_overshoot_back_and_forth_settle(weight):
    """Long ropes and little time: linearised about one another's motions, the programs swap two of them."""
    machine = {"m1": 1.79, "m2": 1.0, "L1": np.exp(0.5), "L2": np.exp(1.5)}
    problem = crane_problem(machine, target=(1.0,), duration=5.5, sway_scale=None, sway_weight=weight)
    one, other = direct.solve(problem).raise_for_status(), indirect.solve(problem).raise_for_status()
    assert one.cost == pytest.approx(other.cost, rel=1e-6 if weight == 0.0 else 3e-5)


@pytest.mark.slow
def test_a_bisected_mesh_holds_the_same_motion():
    (setup, _), cost = set_up.set_up(limited(acceleration=0.3)), SwayCost(beta=50.0, gamma=50.0)
    goal = direct.Goal(setup=setup, sway_cost=cost, sway_limit=None)
    found = direct.sequence(setup.transcription.rest(), goal)
    where = switching(setup, found.iterate, (None, None))
    finer, motion = bisected(setup, found.iterate, where)
    assert 0 < where.sum() < len(where)
    assert finer.effort(motion.local) == pytest.approx(setup.effort(found.iterate.local), rel=1e-12)
    assert finer.cost(motion, cost) == pytest.approx(setup.cost(found.iterate, cost), rel=1e-6)


@pytest.mark.slow
def test_the_cost_within_a_limit_is_what_another_program_finds():
    found = direct.solve(limited(acceleration=0.3)).raise_for_status()
    apart = CraneOptimalControl(dict(CRANE.nominal()), "jerk", None, 50.0, 50.0)
    acceleration = np.eye(apart.size + 1)[6]
    cost = direct_cost(apart, 0.3, 3.0, 100, limit=(acceleration, 0.3))
    assert found.cost - 3.0 * 50.0 == pytest.approx(cost, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "task", "loss"),
    [
        ("paper", ["limits.velocity=0.145"], 1e-4),
        ("slosh-tank", ["cost.effort=snap", "move.duration=6.0", "limits.sway=0.003"], 1e-3),
        ("paper", ["actuator.type=first-order", "actuator.tau=0.067", "limits.jerk=10"], 1e-4),
    ],
)
def test_few_programs_find_what_a_fine_mesh_does(machine, task, loss):
    problem = problem_of(preset_spec(machine, task))
    few = direct.solve(problem)
    assert few.iterations <= 20
    many = direct.solve(problem, options=set_up.DirectOptions(intervals=120))
    assert few.raise_for_status().cost == pytest.approx(many.raise_for_status().cost, rel=loss)


@pytest.mark.slow
def test_a_limit_that_makes_the_cost_of_sway_steep_is_kept():
    """The sway is three times what the cost expects, at whose exponential programs fail that leap there."""
    task = ["cost.effort=snap", "move.duration=6.0", "limits.velocity=0.2"]
    solution = direct.solve(problem_of(preset_spec("slosh-tank", task)))
    assert greatest(optimal_profile(solution), 1) == pytest.approx(0.2, rel=1e-3)


def test_where_programs_on_a_finer_mesh_fail_a_coarser_one_does(monkeypatch):
    plainly, problem = direct.sequence, limited(acceleration=0.4)

    def failing(start, goal, *rest):
        found = plainly(start, goal, *rest)
        fine = goal.setup.transcription.intervals > set_up.USUAL.intervals
        return attrs.evolve(found, verdict=direct.ConicStatus.FAILED) if fine else found

    best = direct.solve(problem).raise_for_status()
    monkeypatch.setattr(direct, "sequence", failing)
    found = direct.solve(problem)
    assert len(found.raise_for_status().knots) == set_up.USUAL.intervals + 1 < len(best.knots)
    assert best.cost < found.optimum.cost < 1.05 * best.cost
    assert choice.keeps_limits(found)
