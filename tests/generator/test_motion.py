"""Profiles from solutions: consistent derivatives, continuity, exact ends."""

import numpy as np
import pytest
from generator.crane_problems import EFFORTS, crane_problem
from scipy.integrate import solve_ivp
from scipy.interpolate import PPoly

from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.motion.actuator import lag_compensated

START, TARGET = 0.137, 0.437


@pytest.fixture(scope="module", params=EFFORTS, ids=lambda effort: effort[0])
def solution(request):
    effort, tau = request.param
    return solve(crane_problem(effort=effort, tau=tau, start=(START,), target=(TARGET,)))


@pytest.fixture(scope="module")
def profile(solution):
    return optimal_profile(solution)


def test_derivatives_are_those_of_scipys_polynomials(profile):
    position = PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots)
    times = np.linspace(0.0, profile.duration, 997)[:-1]
    for order in range(4):
        np.testing.assert_allclose(
            profile.derivative(times, order)[:, 0], position.derivative(order)(times), rtol=1e-12, atol=1e-12
        )


def test_motion_is_continuous_at_knots(solution, profile):
    for order in range(solution.optimum.top_order):
        _, values = profile.within_segments(2, order)
        ends, starts = values[1:-1:2, 0], values[2::2, 0]
        np.testing.assert_allclose(ends, starts, rtol=0.0, atol=3e-13 * np.abs(values).max())


def test_ends_are_exact(solution, profile):
    assert profile.start[0] == pytest.approx(START, rel=1e-15)
    times, values = profile.within_segments(2, 0)
    assert values[-1, 0] == pytest.approx(TARGET, rel=2e-15)  # the polynomial itself, not the held target
    for order in range(1, solution.optimum.top_order):
        _, values = profile.within_segments(2, order)
        assert np.abs(values[[0, -1]]).max() < 3e-13 * np.abs(values).max()
    assert times[-1] == profile.duration == 3.0


def test_states_and_profile_are_one(solution, profile):
    optimum = solution.optimum
    for order in range(3):
        found = profile.derivative(optimum.knots[:-1], order)[:, 0]
        expected = optimum.states[:-1, 4 + order]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


def test_snap_begins_and_ends_without_jerk():
    profile = optimal_profile(solve(crane_problem(effort="snap")))
    _, jerk = profile.within_segments(50, 3)
    assert np.abs(jerk[[0, -1]]).max() < 1e-12 * np.abs(jerk).max()
    assert np.abs(jerk).max() == pytest.approx(13.9, rel=0.01)  # 25.9 m/s³ with the jerk as effort


def test_a_lagging_drive_follows_its_command():
    """The drive τ v̇ + v = v_ref is integrated by SciPy, not by the package."""
    tau = 0.1
    motion = optimal_profile(solve(crane_problem(effort="reference", tau=tau)))
    command = lag_compensated(motion, tau)
    times = np.linspace(0.0, 3.0, 61)
    reference = PPoly(command.coefficients[:, ::-1, 0].T, command.knots)
    drive = solve_ivp(
        lambda t, y: (reference(t) - y) / tau,
        (0.0, 3.0),
        [0.0],
        t_eval=times,
        rtol=1e-11,
        atol=1e-13,
        method="DOP853",
        max_step=0.02,
    )
    np.testing.assert_allclose(drive.y[0], motion(times).position[:, 0], rtol=0.0, atol=1e-9)


def test_an_ideal_drive_is_asked_for_the_motion_itself(profile):
    assert lag_compensated(profile, None) is profile
