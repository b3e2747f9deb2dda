"""Axes that a move does not ask to move are held, exactly, unless `move.free` names them."""

import re

import numpy as np
import pytest

import gen_profile as gp
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.metrics import excursion
from gen_profile.spec.reading import make_spec, preset_spec
from gen_profile.support.errors import GenProfileError, SpecError

HOIST = ["move.start=[0, 6]", "move.target=[12, 6]"]
ACROSS = ["move.distance=[8, 0]"]
JIB = ["move.start=[0.5, 20]", "move.target=[0.5, 30]"]
CASES = [("single-pendulum-crane", HOIST, 1), ("gantry-crane", ACROSS, 1), ("tower-crane", JIB, 0)]
LIMITED = ["limits.acceleration=0.5", "limits.velocity=1.4"]
WAYS = {
    "indirect": ["solver.method=indirect"],
    "direct": ["solver.method=direct", "cost.sway_weight=5"],
    "limited": ["limits.acceleration=0.5", "limits.jerk=1.0"],
    "range": ["robustness.method=range"],
    "zvd": ["solver.method=zvd"],
}


def held_exactly(motion, axis, place):
    """Whether a motion has an axis at a place, and nothing else, in all of its numbers."""
    own = motion.coefficients[:, :, axis]
    return bool((own[:, 0] == place).all() and not own[:, 1:].any() and motion.target[axis] == place)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("preset", "overrides", "axis"), CASES)
def test_every_method_holds_an_axis(preset, overrides, axis, way):
    spec = preset_spec(preset, [*overrides, *WAYS[way]])
    planned = plan(spec)
    assert held_exactly(planned.motion, axis, spec.move.start[axis])
    assert planned.motion.target.tolist() == list(spec.move.target)
    assert excursion(planned.motion, 1 - axis) == pytest.approx(abs(spec.move.distance[1 - axis]), abs=1e-9)
    assert planned.figures["sway_residual_peak_m"] < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "overrides", "axis"), CASES[:2])
def test_the_shortest_motion_holds_an_axis(preset, overrides, axis):
    planned = plan(preset_spec(preset, [*overrides, *LIMITED, "move.duration=minimum"]))
    assert held_exactly(planned.motion, axis, planned.spec.move.start[axis])


def pendulum(duration, **tables):
    """State a crane with its hoist at 0, as another program's bridge crane has none."""
    return make_spec(
        plant={"type": "single-pendulum-crane", "m": 1000.0, "L0": 10.0, "g": 9.8, "c": 0.0},
        **{
            "move": {"distance": [15.0, 0.0], "duration": duration},
            "limits": {"acceleration": 1.0},
            "check": {"residual_sway": 0.05},
            **tables,
        },
    )


@pytest.mark.slow
def test_the_shortest_move_of_a_bridge_crane_is_the_published_one():
    """That of PROPT's examples, by D. Augustin and H. Maurer: x₄' = −0.98 x₃ + 0.1 u, 15 m, |u| ≤ 1."""
    assert plan(pendulum("minimum")).motion.duration == pytest.approx(8.579, rel=3e-3)


def test_a_free_hoist_helps():
    """Lifting the load is what makes the move shorter than any with the rope as it is."""
    free = {"distance": [15.0, 0.0], "duration": 9.0, "free": ["hoist"]}
    held, helped = (choice.minimum_time(problem_of(pendulum(9.0, **own))) for own in ({}, {"move": free}))
    assert helped.duration < 0.99 * held.duration


def test_a_gantry_that_is_held_across_its_way_is_a_single_pendulum():
    shared = {"robustness": {"uncertain": {}}, "check": {"residual_sway": 0.05}}
    along = make_spec(
        plant={"type": "gantry-crane", "m": 1000.0, "L": 8.0, "g": 9.81, "c": 0.0},
        move={"distance": [9.0, 0.0], "duration": 11.0},
        **shared,
    )
    alone = make_spec(
        plant={"type": "single-pendulum-crane", "m": 1000.0, "L0": 8.0, "g": 9.81, "c": 0.0},
        move={"distance": [9.0, 0.0], "duration": 11.0},
        **shared,
    )
    one, other = (choice.attempt(problem_of(spec)).raise_for_status() for spec in (along, alone))
    assert one.states.shape == other.states.shape
    np.testing.assert_allclose(one.states, other.states, atol=1e-9)
    assert one.cost == pytest.approx(other.cost, rel=1e-9)


def test_a_machine_of_which_nothing_swings_is_held_too():
    planned = plan(preset_spec("single-pendulum-crane", ["move.start=[12, 7]", "move.target=[12, 1]"]))
    assert held_exactly(planned.motion, 0, 12.0)
    assert planned.motion.target[1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("travel", [[0.0, 0.0], [-1e-4, 1e-4]])
def test_a_free_axis_keeps_a_narrow_travel(travel):
    move = {"distance": [12.0, 0.0], "duration": "minimum", "free": ["hoist"]}
    limits = {"acceleration": 1.0, "axis": {"hoist": {"travel": travel}}}
    motion = plan(pendulum("minimum", move=move, limits=limits)).motion
    assert excursion(motion, 1) <= travel[1] - travel[0] + 1e-9  # m: no drive resolves a nanometre


@pytest.mark.slow
def test_a_refused_move_with_an_axis_that_has_no_room_is_answered():
    limits = {"acceleration": 0.01, "axis": {"hoist": {"travel": [0.0, 0.0]}}}
    with pytest.raises(GenProfileError, match=r"It can be done with move\.duration = "):
        plan(pendulum(9.0, limits=limits))


@pytest.mark.parametrize(
    ("preset", "overrides", "sentence"),
    [
        (
            "single-pendulum-crane",
            ['move.free=["hook"]'],
            "move.free: 'hook' is no axis (known: cart, hoist).",
        ),
        ("single-pendulum-crane", ["move.free=hoist"], "move.free: must be an array, found text 'hoist'."),
        (
            "gantry-crane",
            ["move.distance=[0, 0]", "move.initial={theta_y=0.05}"],
            'move.free: required where no axis has a way to go: name those that may move, such as ["x"].',
        ),
        (
            "single-pendulum-crane",
            [*HOIST, "limits.axis.hoist.velocity=0.4", "move.duration=minimum"],
            'move.duration: "minimum" needs a limit: state limits.acceleration, or velocity or jerk.',
        ),
    ],
)
def test_faults(preset, overrides, sentence):
    with pytest.raises(SpecError) as caught:
        preset_spec(preset, overrides)
    assert caught.value.faults == (sentence,)


def test_a_spec_without_free_axes_has_the_hash_that_it_had():
    spec = preset_spec("paper")
    assert "free" not in spec.to_dict()["move"]
    freed = preset_spec("single-pendulum-crane", ['move.free=["hoist"]'])
    assert gp.evolve_spec(freed).move.free == ("hoist",)


def test_a_swing_across_the_way_of_a_held_axis_is_told_with_the_cure():
    overrides = [*ACROSS, "move.initial={theta_y=0.05}"]
    with pytest.raises(GenProfileError, match=r'ask y to move, so it is held; move\.free = \["y"\]'):
        plan(preset_spec("gantry-crane", [*overrides, "solver.method=indirect"]))
    freed = plan(preset_spec("gantry-crane", [*overrides, 'move.free=["y"]']))
    assert freed.figures["sway_residual_peak_m"] < 1e-6 < excursion(freed.motion, 1)


def header_of(folder, name):
    return (folder / f"{name}.st").read_text("ascii").partition("FUNCTION_BLOCK")[0]


def test_what_every_axis_takes_is_told(tmp_path):
    written = gp.design(preset_spec("single-pendulum-crane", HOIST), "plc", tmp_path)
    axes = written.to_dict()["axes"]
    assert axes["hoist"] == dict.fromkeys(axes["cart"], 0.0)
    assert axes["cart"]["excursion_m"] == pytest.approx(12.0, abs=1e-9)
    assert axes["cart"]["velocity_max_m_per_s"] == pytest.approx(
        np.abs(written.plan.motion.within_segments(200, 1)[1][:, 0]).max(), rel=1e-4
    )
    header = header_of(tmp_path, written.spec.name)
    assert "Axis 2, hoist: 6000 to 6000 mm, peaks 0 mm/s and 0 mm/s2,\n" in header
    assert "on the way 6000 to 6000 mm;" in header


@pytest.mark.slow
def test_a_free_axis_s_way_stands_in_the_header(tmp_path):
    spec = preset_spec(
        "tower-crane", ["move.start=[0, 25]", "move.target=[1.2, 25]", 'move.free=["trolley"]']
    )
    written = gp.design(spec, "plc", tmp_path)
    places = 1e3 * written.plan.motion.within_segments(65, 0)[1][:, 1]
    found = re.search(r"2, trolley:.*\n.*on the way ([\d.]+) to ([\d.]+) mm", header_of(tmp_path, spec.name))
    assert [float(edge) for edge in found.groups()] == pytest.approx([places.min(), places.max()], abs=0.1)
    assert places.max() - places.min() > 100.0
