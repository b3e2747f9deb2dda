"""The bound that proves that no motion keeps the limits: below what motions take, and close to it."""

import attrs
import numpy as np
import pytest

from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.direct import impossibility
from gen_profile.methods.solvers.direct.impossibility import impossible, least_widening, linear_machine
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.solution import Status
from gen_profile.motion.metrics import greatest
from gen_profile.spec.model import AxisLimitsSpec, LimitsSpec
from gen_profile.spec.reading import preset_spec, presets
from gen_profile.support.units import RATES

DURATION, WAY = 3.0, 0.3  # of the paper's move


def posed(preset, *changes):
    return problem_of(preset_spec(preset, ["limits={}", "cost.sway_weight=0", *changes]))


@pytest.mark.parametrize(
    ("limits", "least"),
    [
        ({"velocity": 0.05}, WAY / DURATION / 0.05),
        ({"acceleration": 0.05}, 4.0 * WAY / DURATION**2 / 0.05),
        ({"jerk": 0.2}, 32.0 * WAY / DURATION**3 / 0.2),
        ({"velocity": 0.05, "acceleration": 100.0}, WAY / DURATION / 0.05),
        ({"velocity": 0.08, "acceleration": 0.1}, None),
    ],
)
def test_an_axis_by_itself_needs_what_formulas_say(limits, least):
    problem = attrs.evolve(posed("paper"), limits=LimitsSpec(**limits))
    if least is None:  # s v (T − s v / (s a)) = way
        least = WAY / (limits["velocity"] * (DURATION - limits["velocity"] / limits["acceleration"]))
    found = least_widening(problem, impossibility.nothing(1))
    assert found == pytest.approx(least, rel=5e-3)
    assert found < 1.0001 * least


@pytest.mark.parametrize(
    "preset", ["flexible-joint", "mass-spring-chain", "paper", "bay-crane", "gantry-crane"]
)
@pytest.mark.parametrize("limited", ["velocity", "acceleration", "jerk"])
def test_the_bound_is_below_what_a_motion_takes_and_close_to_it(preset, limited):
    free = posed(preset)
    motion = optimal_profile(choice.attempt(free))
    peaks = {"velocity": 1, "acceleration": 2, "jerk": 3}
    limits = {limited: 0.5 * min(greatest(motion, peaks[limited], axis) for axis in range(motion.axes))}
    problem = attrs.evolve(free, limits=LimitsSpec(**limits))
    needed = choice.least_violation(problem)
    bound = least_widening(problem, linear_machine(problem))
    assert 0.9 * needed.wider < bound < 1.005 * needed.wider


@pytest.mark.parametrize("preset", presets())
def test_limits_that_a_motion_keeps_are_never_called_impossible(preset):
    spec = preset_spec(preset, ["cost.sway_weight=0"])
    free = attrs.evolve(problem_of(spec), limits=LimitsSpec(), worst_case=None)
    motion = optimal_profile(choice.attempt(free))
    axis = {
        str(column): AxisLimitsSpec(
            **{name: greatest(motion, order, column) or None for order, name in enumerate(RATES, start=1)}
        )
        for column in range(motion.axes)
    }
    problem = attrs.evolve(free, limits=LimitsSpec(axis=axis))
    assert not impossible(problem)
    narrow = attrs.evolve(problem, duration=0.4 * problem.duration)
    assert impossible(narrow)


def test_a_machine_that_may_swing_far_is_not_called_impossible_by_its_linear_model():
    """With 3.8 m/s the linear gantry would need limits 1.28 times as wide, and the true one less."""
    move = ["move.distance=[5.0, -9.0]", "move.duration=9.0", "robustness.order=2", "plant.L=11"]
    problem = posed("gantry-crane", *move, "limits.velocity=3.8")
    assert least_widening(problem, linear_machine(problem)) > 1.25
    assert not impossible(problem)


def test_what_only_few_intervals_lack_is_not_called_impossible():
    """On forty even intervals this takes 2.3 % more than it may, and 0.2 % as far as a bound tells."""
    problem = posed(
        "bay-crane", "move.distance=8", "move.duration=13.9", "limits={velocity=0.9, acceleration=0.25}"
    )
    assert choice.least_violation(problem).wider > 1.02
    assert not impossible(problem)
    assert impossible(attrs.evolve(problem, duration=13.0))


def test_a_lagging_drive_is_judged_by_the_command_alone():
    lag = "actuator={type='first-order', tau=0.1}"
    assert linear_machine(posed("paper", lag)) is None
    assert impossible(posed("paper", lag, "limits.velocity=0.09"))
    assert choice.attempt(posed("paper", lag, "limits.velocity=0.09")).status is Status.INFEASIBLE


def test_conditions_that_an_axis_without_limits_meets_prove_nothing():
    """The bridge must come to rest within its limits; what the trolley does to the load is its own affair."""
    move = ["move.distance=[8.0, 2.0]", "move.duration=9.0"]
    swung = posed("gantry-crane", *move, "limits.axis.x.acceleration=0.5")
    assert impossible(swung) is False
    narrow = least_widening(swung, linear_machine(swung))
    both = posed("gantry-crane", *move, "limits.acceleration=0.5")
    assert narrow == pytest.approx(least_widening(both, linear_machine(both)), rel=1e-2)
    assert np.isfinite(narrow)
