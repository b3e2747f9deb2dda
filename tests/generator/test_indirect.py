"""Outcomes of the indirect method: cures that work, clear refusals, determinism, several axes."""

import os
import subprocess
import sys

import attrs
import numpy as np
import pytest
from generator.crane_problems import crane_problem
from scipy.integrate import solve_ivp

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.plan import plan
from gen_profile.methods.solvers.solution import Status
from gen_profile.plants.plant import Coordinate, Equations, Outputs, Parameter, Plant
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import InfeasibleProblem, SolverDiverged


@pytest.mark.slow
def test_the_suggestion_for_too_short_a_move_works():
    overrides = ["move.distance=25.0", "cost={sway_weight=0.0}", "check.residual_sway=0.2"]
    with pytest.raises(InfeasibleProblem, match=r"swing too far.*move\.duration") as refusal:
        plan(preset_spec("paper", overrides))
    (suggestion,) = refusal.value.suggestions
    assert list(suggestion.values) == ["move.duration"]
    plan(suggestion.spec)


@pytest.mark.slow
def test_a_scale_that_no_weight_needs_does_no_harm():
    """Without weight the sway's exponential, which overflows here, must not enter."""
    with_scale, without = (
        solve(crane_problem(target=(6.0,), sway_weight=0.0, sway_scale=scale)).raise_for_status()
        for scale in (50.0, None)
    )
    assert with_scale.cost == without.cost


@pytest.mark.slow
def test_an_absurd_sway_scale_diverges_with_a_cure():
    solution = solve(crane_problem(sway_scale=5000.0))
    assert solution.optimum is None
    with pytest.raises(SolverDiverged, match=r"Lower cost\.sway_weight.*cost\.sway_scale = \"auto\""):
        solution.raise_for_status()


def test_an_iterate_that_overflows_warns_nobody():
    """The suite turns warnings into errors; users saw NumPy's, with places in the source."""
    assert [solve(crane_problem(duration=time)).optimum for time in (0.497, 0.853)] == [None, None]


@pytest.mark.parametrize("scale", [1e-3, 1e6])
def test_moves_of_any_size_scale_alike(scale):
    """With the automatic scale a crane of another size does the same in its own lengths and times."""
    large = {"L1": 0.47 * scale**0.5, "L2": 0.391 * scale**0.5, "g": 9.81 * scale**0.5}
    normal, other = (
        solve(crane_problem(machine, target=(0.3 * size,), sway_scale=None)).raise_for_status()
        for machine, size in (({}, 1.0), (large, scale**0.5))
    )
    np.testing.assert_allclose(
        other.top_derivative[:, 0] / scale**0.5, normal.top_derivative[:, 0], rtol=0.0, atol=1e-5
    )


def two_masses(pushed: float) -> Plant:
    """A mass on a spring that the axis carries, and one that it does not, pushed by a constant force."""
    return Plant(
        type=f"two masses, {pushed:g}",
        summary="test",
        parameters=(Parameter(name="k", unit="1/s^2", description="", nominal=9.0, lower=0.0, upper=1e3),),
        actuated=(Coordinate(name="cart", unit="m"),),
        unactuated=(Coordinate(name="carried", unit="m"), Coordinate(name="alone", unit="m")),
        loads=("alone", "carried"),
        equations=lambda q_u, dq_u, q_a, dq_a, p: Equations(
            M_uu=[[1.0, 0.0], [0.0, 1.0]],
            M_au=[[-1.0, 0.0]],
            K_u=[-p.k * q_u[0], -4.0 * p.k * q_u[1] + pushed],
            G_u=[0.0, 0.0],
        ),
        outputs=lambda q_u, q_a, p: Outputs(
            sway=[q_u[1], q_u[0]], height=[0.0 * q_u[1], 0.0 * q_u[0]], angle=[0.0 * q_u[1], 0.0 * q_u[0]]
        ),
    )


def masses_problem(pushed: float) -> Problem:
    plant = two_masses(pushed)
    return crane_problem(
        plant=plant, parameters=plant.nominal(), desensitized=(), sway_weight=0.0, sway_scale=None
    )


def test_what_no_axis_moves_may_rest():
    optimum = solve(masses_problem(0.0)).raise_for_status()
    assert np.abs(optimum.states[:, 1]).max() == 0.0
    assert np.abs(optimum.states[-1, 0]) < 1e-12


def test_what_swings_by_itself_is_refused():
    solution = solve(masses_problem(1.0))
    assert solution.status is Status.NOT_CONTROLLABLE
    with pytest.raises(InfeasibleProblem, match="swings on, whatever the axes do"):
        solution.raise_for_status()


def test_a_machine_that_falls_over_is_refused():
    with pytest.raises(InfeasibleProblem, match="does not return to rest"):
        solve(crane_problem({"g": -9.81}))


SCRIPT = """
import sys
sys.path.insert(0, {tests!r})
from generator.crane_problems import crane_problem
from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
print(optimal_profile(solve(crane_problem(desensitized=("L1", "L2")))).payload_hash())
"""


@pytest.mark.slow
def test_the_same_problem_has_the_same_bits():
    tests = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
    hashes = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT.format(tests=tests)],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert hashes[0] == hashes[1]
    assert len(hashes[0].strip()) == 64


def two_pendulums() -> Plant:
    """Two pendulums under a gantry's two axes, each of which feels how fast the other swings."""
    return Plant(
        type="gantry under test",
        summary="test",
        parameters=(
            Parameter(name="Lx", unit="m", description="", nominal=0.8, lower=0.1, upper=9.0),
            Parameter(name="Ly", unit="m", description="", nominal=1.3, lower=0.1, upper=9.0),
        ),
        actuated=(Coordinate(name="bridge", unit="m"), Coordinate(name="trolley", unit="m")),
        unactuated=(Coordinate(name="a", unit="rad"), Coordinate(name="b", unit="rad")),
        loads=("first", "second"),
        equations=lambda q_u, dq_u, q_a, dq_a, p: Equations(
            M_uu=[[p.Lx, 0.0], [0.0, p.Ly]],
            M_au=[[-np.cos(q_u[0]), 0.0], [0.0, -np.cos(q_u[1])]],
            K_u=[-9.81 * np.sin(q_u[0]), -9.81 * np.sin(q_u[1])],
            G_u=[-0.3 * dq_u[1] ** 2 * q_u[0], -0.2 * dq_u[0] ** 2 * q_u[1]],
        ),
        outputs=lambda q_u, q_a, p: Outputs(
            sway=[p.Lx * np.sin(q_u[0]), p.Ly * np.sin(q_u[1])],
            height=[-p.Lx * np.cos(q_u[0]), -p.Ly * np.cos(q_u[1])],
            angle=[q_u[0], q_u[1]],
        ),
    )


@pytest.mark.parametrize(("effort", "desensitized"), [("jerk", ("Lx", "Ly")), ("snap", ())])
def test_several_axes_reach_their_targets_without_sway(effort, desensitized):
    plant = two_pendulums()
    start, target = (0.5, -1.0), (2.5, 0.2)
    solution = solve(
        crane_problem(
            plant=plant,
            parameters=plant.nominal(),
            desensitized=desensitized,
            start=start,
            target=target,
            duration=6.0,
            effort=effort,
            sway_scale=None,
        )
    )
    solution.raise_for_status()
    profile = optimal_profile(solution)
    np.testing.assert_allclose(profile(np.array([0.0])).position[0], start, rtol=1e-14)
    np.testing.assert_allclose(profile.within_segments(2, 0)[1][-1], target, rtol=1e-14)

    def rates(t, x):
        (a, b), (da, db), (push_a, push_b) = x[:2], x[2:], profile.derivative(np.array([t]), 2)[0]
        first = (push_a * np.cos(a) - 9.81 * np.sin(a) - 0.3 * db**2 * a) / 0.8
        second = (push_b * np.cos(b) - 9.81 * np.sin(b) - 0.2 * da**2 * b) / 1.3
        return [da, db, first, second]

    end = solve_ivp(rates, (0.0, 6.0), np.zeros(4), method="DOP853", rtol=1e-10, atol=1e-13, max_step=0.1)
    assert np.abs(end.y[:2]).max() > 0.02  # they did swing
    assert np.abs(end.y[:, -1]).max() < 1e-7


def test_an_axis_may_stand_still():
    plant = two_pendulums()
    solution = solve(
        crane_problem(
            plant=plant,
            parameters=plant.nominal(),
            desensitized=(),
            start=(0.0, 3.0),
            target=(1.0, 3.0),
            duration=4.0,
            sway_weight=0.0,
        )
    )
    profile = optimal_profile(solution)
    np.testing.assert_allclose(profile(np.linspace(0.0, 4.0, 41)).position[:, 1], 3.0, rtol=1e-12)


@pytest.mark.slow
def test_a_cost_that_is_too_steep_is_blamed():
    """exp((50/m · 0.25 m)²) at the start: what follows is faster than any mesh."""
    problem = crane_problem(initial={"theta1": 0.3}, target=(0.0,), desensitized=())
    solution = solve(problem)
    assert solution.status is Status.DIVERGED
    assert solution.advice.startswith("Lower cost.sway_weight")
    assert solution.advice.endswith(', or set cost.sway_scale = "auto".')
    solve(attrs.evolve(problem, sway_scale=None)).raise_for_status()
