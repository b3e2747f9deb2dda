"""Range robustness against linear programs and separately written equations."""

import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from generator.crane_problems import CRANE, crane_problem
from generator.oracles.crane_linear_program import least_worst_sway

from gen_profile.problem.problem import WorstCase
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct import worst_case
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Status
from gen_profile.spec.model import LimitsSpec

ZVD_ACCELERATION = 0.7067  # m/s²: what the paper's ZVD motion takes


def ranged(nominal_zero=False, uncertain=None, **changes):
    box = WorstCase(uncertain=uncertain or {"L1": 0.2}, load_limits=(0.003, 0.003), nominal_zero=nominal_zero)
    task = {"sway_weight": 0.0, "limits": LimitsSpec(acceleration=ZVD_ACCELERATION), "worst_case": box}
    return crane_problem(**(task | changes))


def payload_sway_after(motion, p):
    """By separately written equations, integrated on their own."""
    times = np.linspace(0.0, motion.duration + 4.0, 8001)
    angles = oracle.swing(lambda t: float(motion.derivative(np.array([t]), 2)[0, 0]), times, p)
    sway = p["L1"] * np.sin(angles[:, 0]) + p["L2"] * np.sin(angles[:, 1])
    return np.abs(sway[times >= motion.duration]).max()


@pytest.mark.slow
@pytest.mark.parametrize(("nominal_zero", "most"), [(False, 0.75e-3), (True, 1.45e-3)])
def test_the_worst_crane_of_the_paper(nominal_zero, most):
    solution = choice.solve(ranged(nominal_zero))
    motion = optimal_profile(solution)
    nominal = CRANE.nominal()
    lengths = nominal["L1"] * (1.0 + np.linspace(-0.2, 0.2, 9))
    found = [payload_sway_after(motion, {**nominal, "L1": length}) for length in lengths]
    assert max(found) <= most
    assert np.abs(motion.within_segments(101, 2)[1]).max() <= ZVD_ACCELERATION
    if nominal_zero:
        assert found[4] < 1e-7

    machines = [{**nominal, "L1": length} for length in lengths]
    bound = least_worst_sway(machines, 0.3, 3.0, ZVD_ACCELERATION, nominal if nominal_zero else None)
    assert bound <= solution.worst_case_bound * 1.001  # the polynomials can do no better than any motion
    assert solution.worst_case_bound <= 1.03 * bound
    assert max(found) <= 1.05 * bound


@pytest.mark.slow
def test_what_lies_between_the_ends_counts():
    # a wide range of a long rope: the worst machine is inside, and the solver must have looked there
    problem = ranged(uncertain={"L1": 0.4}, duration=6.0)
    motion = optimal_profile(choice.solve(problem))
    inside = [
        {**problem.parameters, "L1": problem.parameters["L1"] * (1.0 + share)}
        for share in np.linspace(-0.4, 0.4, 41)
    ]
    shares = worst_case.residual_shares(problem, problem.worst_case, motion, inside)
    assert shares.max() <= 1.05 * max(shares[0], shares[-1], shares[20], np.sort(shares)[-5])


@pytest.mark.slow
def test_two_parameters():
    problem = ranged(uncertain={"L1": 0.1, "m2": 0.2})
    solution = choice.solve(problem)
    assert solution.status is Status.CONVERGED
    worst = worst_case.residual_shares(
        problem,
        problem.worst_case,
        optimal_profile(solution),
        worst_case.candidates(problem, problem.worst_case),
    )
    assert worst.max() * 0.003 <= 1.05 * solution.worst_case_bound


@pytest.mark.slow
def test_minimum_time_keeps_the_loads_limits():
    problem = ranged(limits=LimitsSpec(acceleration=0.4))
    shortest = choice.minimum_time(problem)
    robust_and_exact = choice.minimum_time(crane_problem(limits=LimitsSpec(acceleration=0.4)))
    assert 1.5 < shortest < robust_and_exact
    assert worst_case.solve_within_limits(
        ranged(limits=LimitsSpec(acceleration=0.4), duration=shortest)
    ).optimum
    assert not worst_case.solve_within_limits(
        ranged(limits=LimitsSpec(acceleration=0.4), duration=0.9 * shortest)
    ).optimum


def test_infeasible_limits_are_infeasible_here_too():
    solution = choice.solve(ranged(limits=LimitsSpec(velocity=0.09)))
    assert solution.status is Status.INFEASIBLE
    assert "limits.velocity" in solution.cure


def test_a_problem_without_a_worst_case_is_a_mistake():
    with pytest.raises(ValueError, match="worst case"):
        worst_case.solve(crane_problem())
