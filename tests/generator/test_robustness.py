"""Cranes and moves of any size come to rest, or the linear model says why they cannot."""

import attrs
import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from generator.crane_problems import CRANE, crane_problem
from generator.oracles.linear_bound import least_peak_angle
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PPoly

from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.solution import Status

FIFTY_DEGREES = np.radians(50.0)  # beyond, Newton may fail although a motion exists
LARGE = np.radians(25.0)  # beyond, moves that are barely possible may be refused, with a cure that works
SLOW_ENOUGH = 1200.0  # rad; a faster second mode is followed by its own, exact linear equation


def logarithmic(low, high):
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


@st.composite
def problems(draw):
    payload = draw(logarithmic(0.1, 50_000.0))
    hook = draw(st.one_of(st.just(0.192), logarithmic(0.3, 3.0).map(lambda share: payload * share)))
    machine = {
        "m1": hook,
        "m2": payload,
        "L1": draw(logarithmic(0.2, 20.0)),
        "L2": draw(st.one_of(st.just(0.391), logarithmic(0.2, 20.0))),
    }
    parameters = CRANE.nominal() | machine
    slow, fast = frequencies(parameters)
    duration = draw(st.floats(1.2, 12.0)) * 2.0 * np.pi / slow
    return crane_problem(
        machine,
        target=(draw(logarithmic(0.05, 40.0)),),
        duration=duration,
        sway_weight=draw(st.one_of(st.just(0.0), st.floats(0.0, 200.0))),
        sway_scale=None,
    ), fast * duration


def frequencies(p):
    mass = oracle.mass_matrix(np.zeros(2), p)
    weight = p["g"] * np.array([(p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]])
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, np.diag(weight))).real))


def residual(problem, profile):
    """Greatest amplitude in m at which hook or payload swing on, by the oracle's nonlinear equations."""
    p, end = problem.parameters, profile.duration
    acceleration = PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots).derivative(2)
    times = np.linspace(end, end + 2.0 * np.pi / frequencies(p)[0], 400)
    angles = oracle.swing(lambda t: float(acceleration(t)) if t < end else 0.0, np.r_[0.0, times], p)
    return np.abs(oracle.sway(angles[1:], p)).max()


def mode_amplitude(problem, profile, which):
    """Sway in m, greatest load, of one mode after the move: |∫ ÿ e^(−jωt) dt|, piece by piece by parts."""
    p = problem.parameters
    mass = oracle.mass_matrix(np.zeros(2), p)
    weight = p["g"] * np.array([(p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]])
    squares, modes = np.linalg.eig(np.linalg.solve(mass, np.diag(weight)))
    k = np.argsort(squares.real)[which]
    omega, turn = np.sqrt(squares[k].real), 1j * np.sqrt(squares[k].real)
    drive = np.linalg.solve(modes, np.linalg.solve(mass, oracle.lever(np.zeros(2), p)))[k].real
    acceleration = PPoly(profile.coefficients[:, ::-1, 0].T, profile.knots).derivative(2)
    starts, ends = np.exp(-turn * profile.knots[:-1]), np.exp(-turn * profile.knots[1:])
    lengths, total = np.diff(profile.knots), 0.0
    for order in range(len(acceleration.c)):
        piece = acceleration.derivative(order).c
        last = sum(c * lengths ** (len(piece) - 1 - i) for i, c in enumerate(piece))
        total += ((piece[-1] * starts - last * ends) / turn ** (order + 1)).sum()
    hook, payload = np.cumsum([p["L1"], p["L2"]] * modes[:, k].real)
    return np.abs(drive / omega * total) * max(abs(hook), abs(payload))


@pytest.mark.slow
@settings(max_examples=12)
@given(problems())
def test_every_crane_comes_to_rest(drawn):
    problem, phase = drawn
    solution = solve(problem)
    if solution.status is not Status.CONVERGED:
        quiet = solve(attrs.evolve(problem, sway_weight=0.0, target=(problem.target[0] * 1e-4,)))
        linear = quiet.raise_for_status().angle * 1e4
        if solution.status is Status.DIVERGED:
            assert linear > LARGE
            assert "Allow more time" in solution.advice or "Lower cost.sway_weight" in solution.advice
            return
        assert solution.status is Status.SWINGS_TOO_FAR
        best = least_peak_angle(problem.parameters, problem.target[0], problem.duration)
        assert best is None or max(best, linear) > FIFTY_DEGREES
        return
    profile = optimal_profile(solution)
    # moves of little more than a period are so nearly impossible that rounding shows
    allowed = max(1e-4 * problem.target[0], 5e-6)
    if phase < SLOW_ENOUGH:
        assert residual(problem, profile) < allowed
    else:
        assert mode_amplitude(problem, profile, 1) < allowed
        assert np.abs(solution.optimum.states[-1, 0]) * problem.parameters["L1"] < allowed


def test_the_two_oracles_agree():
    """Of a move that leaves both modes swinging: their amplitudes frame what integration finds."""
    problem = crane_problem(target=(1e-4,), duration=1.0, sway_weight=0.0, desensitized=())
    profile = optimal_profile(solve(problem))
    other = attrs.evolve(problem, parameters=problem.parameters | {"L2": 0.3})
    slow, fast = (mode_amplitude(other, profile, which) for which in (0, 1))
    assert min(slow, fast) > 1e-7  # both swing
    assert 0.99 * max(slow, fast) < residual(other, profile) < 1.01 * (slow + fast)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "periods", "distance", "beta"),
    [
        ({"m2": 26100.0, "L1": 2.11, "L2": 0.841}, 10.14, 0.847, 110.0),  # ω₂T = 52 000
        ({"m2": 26200.0, "L1": 0.248}, 3.94, 23.6, 197.0),  # the same at 25° of swing
        (
            {"m2": 0.5217, "L1": 0.7626, "L2": 13.99},
            1.34,
            0.129,
            27.0,
        ),  # sensitivities that are nearly dependent
        ({"m1": 1.8, "m2": 0.777, "L1": 0.278}, 4.07, 33.5, 181.0),  # 54° of swing
        ({"m2": 1096.633, "L1": 1.0}, 1.25, 2.71828, 0.0),  # a light hook at 29°
        # a sway so costly that absolute rounding errors drown Newton's steps
        ({"m1": 11.0, "m2": 4.82, "L1": 12.68, "L2": 7.0}, 1.2, 0.51, 91.0),
    ],
    ids=["fast", "fast-and-far", "nearly-dependent", "far", "light-hook", "costly-sway"],
)
def test_moves_that_used_to_diverge(machine, periods, distance, beta):
    parameters = CRANE.nominal() | machine
    duration = periods * 2.0 * np.pi / frequencies(parameters)[0]
    solution = choice.attempt(
        crane_problem(machine, target=(distance,), duration=duration, sway_weight=beta, sway_scale=None)
    )
    assert solution.status is Status.CONVERGED
    limit = max(2e-6 * distance, 5e-6)
    if frequencies(parameters)[1] * duration < SLOW_ENOUGH:
        assert residual(solution.problem, optimal_profile(solution)) < limit
    else:
        assert mode_amplitude(solution.problem, optimal_profile(solution), 1) < limit
