"""Moves that begin with a swinging load or end at speed, against separately written equations."""

import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from generator.crane_problems import CRANE, EFFORTS, crane_problem
from generator.oracles.crane_optimal_control import CraneOptimalControl, direct_cost
from scipy.interpolate import PPoly

from gen_profile.dynamics.problem.problem import WorstCase, problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.reading import preset_spec

SWUNG = {"theta1": 0.06, "theta2": -0.04, "theta1.rate": -0.1, "theta2.rate": 0.15}
SOLVERS = pytest.mark.parametrize("solver", [indirect, direct], ids=["indirect", "direct"])


def sways(motion, p, initial, watch=2.0, step=2.5e-3):
    """Hook and payload after the move by the oracle, shape (times, 2), from relative angles at the start."""
    phi = np.cumsum([initial.get("theta1", 0.0), initial.get("theta2", 0.0)])
    rate = np.cumsum([initial.get("theta1.rate", 0.0), initial.get("theta2.rate", 0.0)])
    times = np.arange(0.0, motion.duration + watch, step)
    acceleration = PPoly(motion.coefficients[:, ::-1, 0].T, motion.knots).derivative(2)

    def push(time):
        return float(acceleration(time)) if time < motion.duration else 0.0

    angles = oracle.swing_from(phi, rate, push, times, p)[times >= motion.duration, :2]
    hook = p["L1"] * np.sin(angles[:, 0])
    return np.stack([hook, hook + p["L2"] * np.sin(angles[:, 1])], axis=1)


@pytest.mark.slow
@SOLVERS
@pytest.mark.parametrize(("effort", "tau"), EFFORTS)
def test_a_swinging_load_arrives_at_rest(solver, effort, tau):
    problem = crane_problem(initial=SWUNG, effort=effort, tau=tau, sway_weight=20.0)
    motion = optimal_profile(solver.solve(problem))
    assert np.abs(sways(motion, problem.parameters, SWUNG)).max() < 2e-7
    assert motion.derivative(np.array([0.0]), 1) == pytest.approx(0.0, abs=1e-12)
    assert motion(np.array([3.0])).position == pytest.approx(0.3, abs=1e-12)
    unaware = optimal_profile(solver.solve(crane_problem(effort=effort, tau=tau, sway_weight=20.0)))
    assert np.abs(sways(unaware, problem.parameters, SWUNG)).max() > 0.02


@pytest.mark.slow
@SOLVERS
def test_what_was_measured_is_the_same_on_all_machines(solver):
    """Zero sensitivity means: the state after the move is that of the nominal crane, to first order."""
    apart = {}
    for names in ((), ("L1",)):
        motion = optimal_profile(solver.solve(crane_problem(initial=SWUNG, desensitized=names)))
        both = [
            sways(motion, CRANE.nominal() | {"L1": CRANE.nominal()["L1"] * (1.0 + sign * 1e-3)}, SWUNG)
            for sign in (1, -1)
        ]
        apart[names] = np.abs(both[0] - both[1]).max() / 2e-3
    assert apart[()] > 0.02
    assert apart[("L1",)] < 1e-3 * apart[()]


@pytest.mark.slow
@SOLVERS
@pytest.mark.parametrize("tau", [None, 0.1])
def test_a_load_hangs_still_while_its_crane_goes_on(solver, tau):
    problem = crane_problem(final_velocity=(0.12,), tau=tau)
    motion = optimal_profile(solver.solve(problem))
    after = motion(np.array([3.0, 5.0]))
    assert after.position[:, 0] == pytest.approx([0.3, 0.54], abs=1e-12)
    assert after.velocity[:, 0] == pytest.approx([0.12, 0.12], abs=1e-12)
    just_before = motion(np.array([3.0 - 1e-9]))
    assert just_before.velocity == pytest.approx(0.12, abs=1e-9)
    assert just_before.acceleration == pytest.approx(0.0, abs=1e-6)
    assert np.abs(sways(motion, problem.parameters, {})).max() < 1e-7
    longer = problem.parameters | {"L1": problem.parameters["L1"] * 1.2}
    assert 1e-5 < np.abs(sways(motion, longer, {})).max() < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("initial", "velocity"), [(SWUNG, 0.0), ({}, 0.12), (SWUNG, -0.05)], ids=["swing", "speed", "both"]
)
def test_both_methods_find_what_another_program_finds(initial, velocity):
    problem = crane_problem(initial=initial, final_velocity=(velocity,), sway_weight=20.0)
    one, other = (solver.solve(problem).raise_for_status() for solver in (indirect, direct))
    assert other.cost == pytest.approx(one.cost, rel=1e-6)
    swung = [initial.get(name, 0.0) for name in ("theta1", "theta2", "theta1.rate", "theta2.rate")]
    apart = CraneOptimalControl(problem.parameters, "jerk", None, 20.0, 50.0)
    found = direct_cost(apart, 0.3, 3.0, 24, swung=swung, final_velocity=velocity)
    assert one.cost - 20.0 * 3.0 == pytest.approx(found, rel=1e-6)


@SOLVERS
def test_a_crane_that_goes_nowhere_calms_its_load(solver):
    problem = crane_problem(initial={"theta1": 0.1}, target=(0.0,), desensitized=(), sway_weight=0.0)
    motion = optimal_profile(solver.solve(problem))
    assert np.abs(sways(motion, problem.parameters, problem.initial)).max() < 1e-7
    assert 0.01 < np.ptp(motion(np.linspace(0.0, 3.0, 301)).position) < 0.2


@pytest.mark.parametrize("method", ["indirect", "direct"])
def test_an_axis_moves_for_a_swing_across_the_way(method):
    spec = preset_spec(
        "gantry-crane",
        [
            "move.distance=[12.0, 0.0]",
            'move.free=["y"]',
            "move.initial={theta_y=0.05}",
            f"solver.method={method}",
        ],
    )
    problem = problem_of(spec)
    motion = optimal_profile(choice.attempt(problem, spec.solver.solver))
    across = motion(np.linspace(0.0, 12.0, 601)).position[:, 1]
    assert 0.05 < np.abs(across).max() < 1.0
    assert across[-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_the_worst_machine_of_a_range_swings_at_the_start_too():
    box = WorstCase(uncertain={"L1": 0.2}, load_limits=(0.003, 0.003), nominal_zero=False)
    problem = crane_problem(
        initial={"theta1": 0.03}, sway_weight=0.0, worst_case=box, limits=LimitsSpec(acceleration=0.6)
    )
    solution = choice.attempt(problem)
    motion = optimal_profile(solution)
    lengths = problem.parameters["L1"] * (1.0 + np.linspace(-0.2, 0.2, 3))
    found = max(
        np.abs(sways(motion, problem.parameters | {"L1": length}, problem.initial)).max()
        for length in lengths
    )
    assert 0.9 * solution.worst_case_bound <= found <= 1.1 * solution.worst_case_bound + 1e-5


def test_limits_bind_a_motion_that_ends_at_speed():
    limits = LimitsSpec(acceleration=0.3, velocity=0.16)
    problem = crane_problem(final_velocity=(0.15,), initial={"theta1": 0.01}, limits=limits, sway_weight=0.0)
    motion = optimal_profile(choice.attempt(problem))
    assert np.abs(motion.within_segments(33, 1)[1]).max() <= 0.16
    assert np.abs(motion.within_segments(33, 2)[1]).max() <= 0.3
    assert np.abs(sways(motion, problem.parameters, problem.initial)).max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("initial", [{}, SWUNG], ids=["rest", "swing"])
def test_what_is_left_out_is_told_truly(initial):
    """From rest, zero sensitivity to L1 is zero sensitivity to gravity, too; not so with a swing."""
    solution = indirect.solve(crane_problem(initial=initial, desensitized=("L1", "g")))
    assert solution.redundant == ("g",)
    motion, p = optimal_profile(solution), CRANE.nominal()
    both = [sways(motion, p | {"g": p["g"] * (1.0 + sign * 1e-3)}, initial) for sign in (1, -1)]
    slope = np.abs(both[0] - both[1]).max() / 2e-3
    if initial:
        assert slope > 0.01
        assert "cannot be zero as well" in solution.redundancy
    else:
        assert slope < 1e-5
        assert "zero whenever the others are" in solution.redundancy
