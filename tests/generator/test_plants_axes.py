"""Specs of machines with several axes, in metres and radians."""

import numpy as np
import pytest

from gen_profile.dynamics.problem.cost import axis_reach, effort_weights
from gen_profile.dynamics.problem.limits import breaches
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.motion.metrics import greatest, length
from gen_profile.spec.reading import parse_spec, preset_spec, spec_from_dict
from gen_profile.support.errors import SpecError


def fault_of(preset, *overrides):
    with pytest.raises(SpecError) as caught:
        preset_spec(preset, overrides)
    (sentence,) = caught.value.faults
    return sentence


@pytest.mark.parametrize(
    ("preset", "override", "sentence"),
    [
        (
            "gantry-crane",
            "move.distance=3",
            "move.distance: must hold one number per axis (x, y), such as [3, 0], found 3.",
        ),
        ("gantry-crane", "move.distance=[0, 0]", "move.distance: must not be zero on every axis."),
        (
            "single-pendulum-crane",
            "move.target=[12.0, -1.0]",
            "move.target: hoist must be at least 0 m, found -1.",
        ),
        (
            "single-pendulum-crane",
            "move={distance=[40, -15], duration=16}",
            "move.distance: hoist must be at least 0 m, found -15; a distance begins at 0, so state start "
            "and target.",
        ),
        ("tower-crane", "move.start=[0.0, -2.0]", "move.start: trolley must be at least 0 m, found -2."),
        (
            "tower-crane",
            "axis.trolley.unit=deg",
            "axis.trolley.unit: 'deg' does not measure an axis that moves in m.",
        ),
        ("tower-crane", "axis.hook.unit=m", "axis.hook: unknown axis (known: slew, trolley)."),
        (
            "mass-spring-chain",
            "plant.type=mass-spring-chain-99",
            "plant.type: unknown machine 'mass-spring-chain-99'; did you mean 'mass-spring-chain-2'?",
        ),
    ],
)
def test_faults_of_moves_with_several_axes(preset, override, sentence):
    assert fault_of(preset, override) == sentence


def test_a_limit_of_sway_has_no_default_where_axes_turn_only():
    text = '[plant]\ntype = "flexible-joint"\n[move]\ndistance = 1.0\nduration = 1.0\n'
    with pytest.raises(SpecError, match=r"check\.residual_sway: required where no axis moves in m"):
        parse_spec(text)
    spec = parse_spec(text + "[check]\nresidual_sway = 0.01\n")
    assert spec.check.residual_sway == {"tip": 0.01}


def test_a_default_limit_is_a_share_of_the_longest_move_in_metres():
    move = "[move]\nstart = [0.0, 20.0]\ntarget = [3.0, 18.0]\nduration = 60.0\n"
    spec = parse_spec(f'[plant]\ntype = "tower-crane"\n{move}')
    assert set(spec.check.residual_sway.values()) == {0.02}


# ── effort ───────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("preset", "overrides", "reach"),
    [
        ("paper", [], [0.3]),
        ("gantry-crane", [], [12.0, 4.0]),
        ("gantry-crane", ["move.distance=[-12.0, 0.0]"], [12.0, 12.0]),
        # at 25 m, 1 rad is an arc of 25 m
        ("tower-crane", ["move.start=[0, 25]", "move.target=[1, 25]"], [1.0, 25.0]),
        ("tower-crane", ["move.start=[0, 20]", "move.target=[0, 30]"], [10.0 / 25.0, 10.0]),
        ("tower-crane", ["move.start=[0, 0]", "move.target=[1, 0]"], [1.0, 0.01]),  # nothing swings
        ("single-pendulum-crane", ["move.start=[0, 3]", "move.target=[-8, 3]"], [8.0, 0.08]),
        ("single-pendulum-crane", ["move.start=[0, 3]", "move.target=[0, 1]"], [0.02, 2.0]),
    ],
)
def test_every_axis_is_measured_by_its_own_move(preset, overrides, reach):
    found = axis_reach(problem_of(preset_spec(preset, overrides), whole=True))
    np.testing.assert_allclose(found, reach, rtol=1e-12)
    np.testing.assert_allclose(effort_weights(found), (reach[0] / np.array(reach)) ** 2)


def test_a_gantry_treats_its_axes_alike():
    """Exchanging the distances of x and y exchanges the motions, as far as the rope swings little."""

    def profile_of(distance):
        overrides = [f"move.distance={distance}", "cost.sway_weight=0", "move.duration=20"]
        solution = indirect.solve(problem_of(preset_spec("gantry-crane", overrides)))
        optimum = solution.raise_for_status()
        return optimum.top_derivative

    one, other = profile_of([4.0, 2.0]), profile_of([2.0, 4.0])
    np.testing.assert_allclose(one[:, 0], other[:, 0, ::-1], atol=1e-3 * np.abs(one).max())


def test_a_free_axis_stays_where_nothing_is_won_by_it():
    overrides = ["move.distance=[12.0, 0.0]", 'move.free=["y"]', "cost.sway_weight=0"]
    optimum = indirect.solve(problem_of(preset_spec("gantry-crane", overrides))).raise_for_status()
    assert np.abs(optimum.top_derivative[..., 1]).max() < 1e-9 * np.abs(optimum.top_derivative[..., 0]).max()


def test_a_trolley_answers_the_pull_of_the_slew():
    """A slewing load flies outward; only the trolley, which ends where it began, can bring it to rest."""
    overrides = ["move.start=[0, 20]", "move.target=[1.5, 20]", 'move.free=["trolley"]', "cost.sway_weight=0"]
    optimum = indirect.solve(problem_of(preset_spec("tower-crane", overrides))).raise_for_status()
    assert np.abs(optimum.top_derivative[..., 1]).max() > 0.0
    states = optimum.states
    np.testing.assert_allclose(states[-1, :4], 0.0, atol=1e-9)  # angles and rates


@pytest.mark.parametrize("solve", [indirect.solve, direct.solve])
def test_a_hoist_alone_swings_nothing(solve):
    overrides = ["move.start=[12.0, 7.0]", "move.target=[12.0, 1.0]", "cost.sway_weight=5"]
    optimum = solve(problem_of(preset_spec("single-pendulum-crane", overrides))).raise_for_status()
    assert (optimum.sway == 0.0).all()


def test_a_free_hoist_hardly_moves_where_the_cost_counts():
    overrides = ["move.start=[0.0, 1.0]", 'move.free=["hoist"]', "cost.sway_weight=5"]
    optimum = indirect.solve(problem_of(preset_spec("single-pendulum-crane", overrides))).raise_for_status()
    hoist = optimum.states[:, 3]
    assert np.abs(hoist - 1.0).max() < 0.01


# ── limits of single axes ────────────────────────────────────────────────────────────────────────────────


HOISTING = ["cost.sway_weight=0", "limits.velocity=1.3", "limits.axis.hoist.velocity=0.45"]


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("limits.axis=3", "limits.axis: must be a table by axis, found 3."),
        ("limits.axis.hoist=3", "limits.axis.hoist: must be a table, found 3."),
        ("limits.axis.hook={}", "limits.axis.hook: unknown axis (known: cart, hoist)."),
        (
            "limits.axis.hoist.velocity=0",
            "limits.axis.hoist.velocity: must be greater than 0, found 0.0.",
        ),
        (
            "limits.axis.hoist.travel=[0.0, 5.0]",
            "limits.axis.hoist.travel: must contain move.start of hoist (7), found [0.0, 5.0].",
        ),
        (
            "limits.travel=[0.0, 8.0]",
            "limits.travel: must contain move.target of cart (12), found [0.0, 8.0].",
        ),
    ],
)
def test_faults_of_limits_by_axis(override, sentence):
    assert fault_of("single-pendulum-crane", override) == sentence


def test_an_axis_may_have_limits_of_its_own():
    spec = preset_spec("single-pendulum-crane", [*HOISTING, "limits.acceleration=0.5"])
    limits = spec.limits
    cart, hoist = limits.of(0), limits.of(1)
    assert (cart.velocity, cart.acceleration) == (1.3, 0.5)
    assert (hoist.velocity, hoist.acceleration) == (0.45, 0.5)
    changed = spec.changed({"limits.acceleration": 0.6, "limits.axis.hoist.velocity": 0.5}).limits
    assert (changed.of(0).acceleration, changed.of(1).acceleration, changed.of(1).velocity) == (0.6, 0.6, 0.5)
    assert spec.changed(limits.stated()) == spec
    again = preset_spec("single-pendulum-crane", [*HOISTING, "limits.acceleration=0.5"])
    assert spec_from_dict(again.to_dict()) == again


def test_every_axis_keeps_its_own_limits():
    spec = preset_spec("single-pendulum-crane", HOISTING)
    profile = optimal_profile(choice.attempt(problem_of(spec)))
    assert 0.999 * 1.3 < greatest(profile, 1, 0) <= 1.3 + 1e-9
    assert 0.999 * 0.45 < greatest(profile, 1, 1) <= 0.45 + 1e-9
    assert breaches(spec.limits, profile, 0.0) == ()


def test_what_an_axis_breaks_is_named():
    spec = preset_spec("single-pendulum-crane", [*HOISTING, "limits.axis.hoist.travel=[1.0, 7.0]"])
    free = optimal_profile(indirect.solve(problem_of(spec)))
    broken = {breach.place: breach for breach in breaches(spec.limits, free, 0.0)}
    assert broken.keys() == {"limits.velocity", "limits.axis.hoist.velocity"}
    assert (
        broken["limits.axis.hoist.velocity"]
        .sentence()
        .startswith("limits.axis.hoist.velocity: 0.45 is allowed")
    )


def test_the_shortest_move_waits_for_the_slowest_axis():
    """6 m of hoisting at 0.3 m/s take 20 s, whatever the cart could do."""
    limits = ["limits.acceleration=0.5", "limits.axis.hoist.velocity=0.3"]
    spec = preset_spec("single-pendulum-crane", ["cost.sway_weight=0", "move.duration=minimum", *limits])
    shortest = choice.minimum_time(problem_of(spec)).duration
    assert 20.0 < shortest < 22.0


# ── loads that swing in two directions ───────────────────────────────────────────────────────────────────


def test_one_frequency_counts_once():
    spec = preset_spec("gantry-crane")
    linear = linearize(spec.machine(), spec.plant.parameters)
    assert (len(linear.frequencies), len(linear.distinct_frequencies)) == (2, 1)
    paper = preset_spec("paper")
    assert len(linearize(paper.machine(), paper.plant.parameters).distinct_frequencies) == 2


def test_the_length_of_a_sway():
    np.testing.assert_allclose(length(np.array([[3.0, 4.0], [0.0, -2.0]])), [[5.0], [2.0]])
    np.testing.assert_allclose(length(np.array([[-3.0], [2.0]])), [[-3.0], [2.0]])
