"""A planner block's stops: one is planned before it is ordered, and in less time while it is under way."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from generator.planned_machines import GANTRY

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import parse_spec, preset_spec

CYCLE, SLOT = 0.004, 0.272  # s, that of a rope of 6 m
PERIOD = 4.6504  # s, of a gantry's rope of 5.3747 m
MOMENTS = np.linspace(3.0, 10.0, 9)  # s, on the way


def stopped(compiled, moment):
    """When a stop is first obeyed, how long it takes from then on as it states, and as it takes."""
    issued = []
    for order in ({}, {"bStop": 1.0}):
        block = CountedBlock(compiled, fActPosition=2.0, fL1=6.0, fm2=2000.0)
        block.hold(round(5.0 / CYCLE))
        block.hold(round(moment / CYCLE), bExecute=1.0, fTarget=35.0)
        issued.append(block.hold(round(20.0 / CYCLE), **order))
    goes_on, stops = issued
    begun = int(np.flatnonzero(np.abs(stops["fPosition"] - goes_on["fPosition"]) > 1e-9)[0])
    rests = int(np.flatnonzero(stops["fVelocity"])[-1]) + 1
    assert stops["operations"].max() <= 12_000
    return begun * CYCLE, stops["fTimeToGo"][begun], (rests - begun) * CYCLE


@pytest.mark.slow
def test_a_stop_begins_with_the_next_slot_and_ends_no_later_than_first_stated():
    """It begins with the slot after its programme is found, 0.15 s later at most."""
    compiled = compile_counting(planner_block(preset_spec("bay-crane")).text)
    delays, stated, took = np.transpose([stopped(compiled, moment) for moment in MOMENTS])
    assert delays.max() <= SLOT + 0.15
    assert delays.mean() <= 0.75 * SLOT
    assert (took <= stated + CYCLE).all()
    assert (took < stated - SLOT / 2).any()


@pytest.mark.slow
def test_a_rope_that_changes_before_a_quick_stop_is_known_after_it():
    """Dropped in one of two cycles of a slot, it stayed half that of another rope: 2 % too fast."""
    changes = ["planner.live_rate={L1=0.2}", "check.residual_sway=0.02"]
    compiled = compile_counting(planner_block(preset_spec("bay-crane", changes)).text)
    for hoisted in range(739, 743):
        block = CountedBlock(compiled, fActPosition=5.0, fL1=3.0, fm2=300.0)
        block.hold(7, bVelocity=1.0)
        for cycle in range(hoisted):
            block.hold(1, fVelocityCommand=0.6, fL1=3.0 + 0.0008 * (cycle + 1))
        block.hold(1, bQuickStop=1.0)
        block.hold(1200, bQuickStop=0.0, bVelocity=0.0, bReset=1.0)
        block.hold(3, bReset=0.0, bVelocity=1.0, fVelocityCommand=0.0)
        assert block.hold(3000, fVelocityCommand=0.6)["fVelocity"][-1] == pytest.approx(0.6)


@pytest.mark.slow
@pytest.mark.parametrize(("stop", "set_first"), [("quiet", 0.0), ("prompt", 1.0)])
def test_a_spec_says_how_axes_stop_where_the_controller_does_not(stop, set_first):
    spec = preset_spec("bay-crane", [f'planner.stop="{stop}"'])
    assert BlockInstance(planner_block(spec).text).inputs["bPromptStop"] == set_first


@pytest.fixture(scope="module")
def slow_gantry():
    """A bridge that takes 13 s to full speed, at 20 ms."""
    x = "x={velocity=2.0, acceleration=0.15, jerk=0.2, travel=[0.0, 150.0]}"
    y = "y={velocity=0.63, acceleration=0.12, jerk=0.2, travel=[0.0, 25.0]}"
    changes = ["export.cycle_time=0.02", "robustness.uncertain={L=0.04}", "planner.live={L=[3.0, 12.0]}"]
    return compile_counting(planner_block(parse_spec(GANTRY, [*changes, f"limits.axis={{{x}, {y}}}"])).text)


@pytest.mark.slow
def test_ends_of_a_stop_go_no_farther_beyond_the_committed_motion_than_a_load_sways(slow_gantry):
    """A fifth of a ramp of 31 m was added on both sides: 6 m behind an axis that had begun to move."""
    rope = 5.27
    block = CountedBlock(slow_gantry, fActPosition_x=60.0, fActPosition_y=12.0, fL=rope)
    block.hold(50)
    block.hold(2, bVelocity=1.0)
    out = block.hold(100, fVelocityCommand_x=-2.0, fVelocityCommand_y=-0.63)
    for axis, acceleration in (("x", 0.15), ("y", 0.12)):
        sways = 2.0 * acceleration * rope / 9.81
        assert out[f"fVelocity_{axis}"][-1] < 0.0
        assert 0.0 < out[f"fStopHigh_{axis}"][-1] - 60.0 * (axis == "x") - 12.0 * (axis == "y") < 1.05 * sways


@pytest.mark.slow
def test_a_plan_that_would_begin_as_a_stick_is_let_go_is_dropped(slow_gantry):
    """The target was 0 as the stick is, and so the axis moved by 2 cm."""
    stick = {"bExecute": 0.0, "bVelocity": 1.0, "fVelocityCommand_x": -2.0}

    def issued(cycles):  # to 0 m, before the stick
        block = CountedBlock(slow_gantry, fActPosition_x=60.0, fActPosition_y=12.0, fL=5.0)
        block.hold(50)
        return block.hold(cycles, bExecute=1.0), block.hold(200, **stick)

    first = int(np.flatnonzero(issued(200)[0]["fVelocity_y"])[0])
    assert (issued(first)[1]["fPosition_y"] == 12.0).all()


@pytest.mark.slow
def test_a_stop_stays_within_the_ends_that_a_tap_before_it_stated(slow_gantry):
    """It stated wider ones, as its own, and left those of the tap by a millimetre."""
    for moves in range(10, 100, 6):
        block = CountedBlock(slow_gantry, fActPosition_x=60.0, fActPosition_y=12.0, fL=11.0)
        block.hold(20)
        block.hold(2, bVelocity=1.0, fVelocityCommand_x=0.5, fVelocityCommand_y=-0.46)
        tapped = block.hold(moves, fVelocityCommand_x=0.0, fVelocityCommand_y=0.0)
        stops = block.hold(500, bVelocity=0.0, bStop=1.0)
        for axis in "xy":
            low, high = (tapped[f"fStop{end}_{axis}"][-1] for end in ("Low", "High"))
            if tapped[f"fVelocity_{axis}"][-1]:
                assert low - 1e-9 <= stops[f"fPosition_{axis}"].min()
                assert stops[f"fPosition_{axis}"].max() <= high + 1e-9


@pytest.mark.slow
def test_a_stick_from_rest_leads_no_farther_than_a_stop_from_full_speed_may(slow_gantry):
    """Ramps of 88 slots, and declines of as many, stated ends of a stop 34 m away at 0.1 m/s."""
    block = CountedBlock(slow_gantry, fActPosition_x=113.14, fActPosition_y=12.0, fL=5.3747)
    block.hold(5)
    block.hold(50, bVelocity=1.0, fVelocityCommand_x=-2.0, fVelocityCommand_y=-0.32926)
    out = block.hold(400, fVelocityCommand_x=2.0, fVelocityCommand_y=0.35831)
    brakes = np.abs(out["fVelocity_x"]) / 0.15 + 0.5 * PERIOD + 0.15 / 0.2  # s, once a stop is found
    assert (out["fStopDistance_x"] < 2.0 * (0.5 * PERIOD + 1.5 * (PERIOD + brakes))).all()


@pytest.mark.slow
def test_a_stop_that_waits_for_another_axis_to_be_planned_does_not_count_as_failed(slow_gantry):
    """The other one took all operations of a slot; the stop took 14 s, and went 2.2 m back."""
    block = CountedBlock(slow_gantry, fActPosition_x=28.48848, fActPosition_y=11.007932, fL=8.97503)
    block.hold(23)
    block.hold(
        16, bExecute=1.0, fTarget_x=78.0, fTarget_y=6.14, fVelocityLimit_x=0.957, fVelocityLimit_y=0.3014
    )
    block.hold(104, bStop=1.0, fVelocityLimit_x=0.0, fVelocityLimit_y=0.0)
    for cycles, x, y in ((12, 10.976, 0.0), (11, 132.57, 8.526), (11, 68.056, 1.793)):
        block.hold(cycles, bStop=0.0, bExecute=1.0, fTarget_x=x, fTarget_y=y)
    out = block.hold(750, bStop=1.0)
    assert np.flatnonzero(out["bBusy"])[-1] * 0.02 < 6.0
    assert np.abs(out["fPosition_y"] - out["fPosition_y"][0]).max() < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("rope", [3.5, 9.0])
def test_an_axis_begins_while_another_one_is_planned(slow_gantry, rope):
    """The first one took all operations as long as it had a ramp to seek: the other one stood for 6 s."""
    block = CountedBlock(slow_gantry, fActPosition_x=80.0, fActPosition_y=12.0, fL=rope)
    block.hold(50)
    block.hold(2, bVelocity=1.0)
    block.hold(500, fVelocityCommand_x=2.0)
    out = block.hold(60, fVelocityCommand_x=-2.0, fVelocityCommand_y=0.63)
    assert out["fVelocity_y"].any()
    assert 0.02 * np.argmax(out["fVelocity_y"] != 0.0) < 0.6
