"""Wrappers of the planner block: they power axes, take them over where they stand, guide and release them."""

import re
from collections import Counter

import attrs
import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.driven_block import ACCELERATION, BAY, CYCLE, JERK, VELOCITY
from exporters.planner_benches import ON, START, UNITS, Converter, PlannerBench, interface_of
from exporters.st_interpreter import FunctionBlock
from exporters.vendor_axes import VENDORS

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec
from gen_profile.support.errors import ExportError
from gen_profile_exporters import motion_libraries
from gen_profile_exporters.block_source import BlockVariable, parse_function_block
from gen_profile_exporters.planner.axis_wrapper import planner_wrapper

GANTRY = f"""
name = "gantry"
plant = {{ type = "gantry-crane", m = 1000.0, L = 5.0 }}
move = {{ distance = [8.0, 3.0], duration = 14.0 }}
export = {{ cycle_time = {CYCLE} }}
[limits.axis]
x = {{ velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }}
y = {{ velocity = 0.5, acceleration = 0.4, jerk = 1.0, travel = [0.0, 12.0] }}
"""
OFF, WORK, AWAY, ASTRAY = 21, 22, 23, 24
BLOCK_OFF, POWERING, TAKING, GUIDING, STOPPING = range(5)
VELOCITY_STEP = VELOCITY * CYCLE * 1.0001
SPEEDING = 3.0  # s, after which an axis is fast


@pytest.fixture(scope="module")
def bay():
    return parse_function_block(planner_block(parse_spec(BAY)).text)


@pytest.fixture(scope="module")
def gantry():
    return parse_function_block(planner_block(parse_spec(GANTRY)).text)


@pytest.fixture(params=VENDORS)
def vendor(request):
    return request.param


@pytest.fixture
def bench(vendor, bay):
    return PlannerBench(VENDORS[vendor], bay, {"": UNITS}, [START])


@pytest.fixture
def two(vendor, gantry):
    return PlannerBench(VENDORS[vendor], gantry, {"_x": UNITS, "_y": UNITS}, [START, 2.0])


def under_way(bench, seconds=SPEEDING, **target):
    bench.guided(bExecute=False)
    for _ in range(round(seconds / CYCLE)):
        outputs = bench.cycle(**ON, bExecute=True, **(target or {"fTarget": 12.0}))
    assert outputs["bbusy"] and outputs["benabled"]
    assert np.abs(np.diff(bench.positions(), axis=0))[-1].min() > 0.1 * CYCLE
    return bench


def require_smooth(places, first=1e-9):
    """Positions that keep the machine's limits; they begin at rest."""
    steps = np.diff(places[:, 0], n=1)
    assert np.abs(steps).max() <= VELOCITY_STEP
    assert np.abs(np.diff(steps)).max() <= ACCELERATION * CYCLE**2 * 1.0001 + first
    assert np.abs(np.diff(steps, n=2)).max() <= JERK * CYCLE**3 * 1.001 + first


def quiet(row):
    return not row["bbusy"]


@pytest.mark.slow
class TestOneAxis:
    def test_it_is_powered_then_taken_over_where_it_stands_then_guided(self, bench):
        bench.cycle()
        assert bench.cycle()["nstage"] == BLOCK_OFF
        assert bench.cycle(**ON)["bbusy"]
        stages = []
        bench.until(lambda row: stages.append(row["nstage"]) or row["benabled"], most=40, **ON)
        assert sorted(set(stages)) == [POWERING, TAKING, GUIDING] and stages == sorted(stages)
        assert {at for (at,) in bench.commanded} == {START * UNITS}
        bench.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=6.0)
        assert bench.commanded[-1] == [pytest.approx(6.0 * UNITS, abs=1e-9)]
        require_smooth(bench.positions())

    def test_it_gets_the_setpoints_of_the_block_alone(self, bench, bay):
        bench.guided()
        begin = len(bench.commanded)
        for _ in range(1000):
            bench.cycle(**ON, bExecute=True, fTarget=9.0)
        alone = CountedBlock(compile_counting(bay.text()), bEnable=0.0, fActPosition=START)
        alone.hold(sum(1 for _ in range(begin)))
        alone.hold(1, bEnable=1.0)
        issued = alone.hold(1000, bExecute=1.0, fTarget=9.0)
        moves = bench.positions()[begin:, 0]
        assert issued["fPosition"][-1] > START + 0.5
        np.testing.assert_allclose(moves, issued["fPosition"], rtol=0, atol=1e-9)
        for name in ("fVelocity", "fAcceleration"):
            assert abs(issued[name][-1]) > 0.01
            assert bench.wrapper[name] == pytest.approx(UNITS * issued[name][-1])

    def test_a_tripped_drive_is_let_go_at_once_and_taken_over_where_it_stands(self, bench):
        under_way(bench)
        bench.put(bench.axes[0], bench.vendor.error)
        outputs = bench.cycle(**ON, bExecute=True, fTarget=12.0)
        assert (outputs["nerrorid"], outputs["benabled"], outputs["nstage"]) == (20, False, BLOCK_OFF)
        # It runs on by itself; nothing that happens guides it but a reset and another edge.
        stands = bench.commanded[-1][0] + 0.4 * UNITS
        bench.part(bench.axes[0]).call(**{bench.vendor.actual: stands, bench.vendor.setpoint: stands})
        count = len(bench.commanded)
        for given in (ON, {"bPower": True}, ON, {**ON, "bReset": True}, ON):
            for _ in range(30):
                assert not bench.cycle(**{"bReset": False, "bEnable": False, **given})["benabled"]
        assert bench.cycle(**ON)["nerrorid"] == 0
        bench.cycle(bPower=True, bEnable=False)
        outputs = bench.guided(bExecute=False)
        assert {at for (at,) in bench.commanded[count:]} == {stands}
        assert (outputs["bpromise"], outputs["npromise"]) == (False, 2)
        outputs = bench.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=7.0)
        assert bench.commanded[-1] == [pytest.approx(7.0 * UNITS, abs=1e-9)]
        require_smooth(bench.positions()[count:])

    def test_an_axis_that_is_taken_away_or_loses_its_power_is_an_error_with_its_number(self, bench):
        under_way(bench)
        bench.axes[0].call(bAway=True)
        outputs = bench.until(lambda row: row["berror"], most=2, **ON)
        stood = bench.commanded[-1]
        assert outputs["nerrorid"] == AWAY
        bench.axes[0].call(bAway=False)
        assert not bench.cycle(**ON)["benabled"] and bench.commanded[-1] == stood
        bench.cycle(bEnable=False, bReset=True)
        bench.cycle(bReset=False)
        under_way(bench, fTarget=20.0)
        bench.put(bench.axes[0], bench.vendor.off)
        outputs = bench.cycle(**ON)
        assert (outputs["nerrorid"], outputs["benabled"]) == (OFF, False)

    @pytest.mark.parametrize("dropped", ["bEnable", "bPower"])
    def test_a_controlled_disable_stops_without_sway_first(self, bench, bay, dropped):
        under_way(bench, fTarget=30.0)
        left = ON | {dropped: False}
        moved = len(bench.commanded)
        outputs = bench.cycle(**left)
        assert (outputs["benabled"], outputs["nstage"]) == (True, STOPPING)
        outputs = bench.until(quiet, most=9000, **left)
        assert (outputs["nstage"], outputs["berror"]) == (BLOCK_OFF, False)
        for _ in range(20):
            outputs = bench.cycle(**left)
        assert not outputs["benabled"]
        require_smooth(bench.positions())
        alone = CountedBlock(compile_counting(bay.text()), bEnable=0.0, fActPosition=START)
        alone.hold(100)
        alone.hold(1, bEnable=1.0)
        alone.hold(round(SPEEDING / CYCLE), bExecute=1.0, fTarget=30.0)
        stopped = alone.hold(len(bench.commanded) - moved, bStop=1.0)["fPosition"]
        np.testing.assert_allclose(bench.positions()[moved:, 0], stopped, rtol=0, atol=1e-9)
        assert stopped[-1] < 20.0
        powered = bench.part(bench.axes[0])[bench.vendor.state] == bench.vendor.fit
        assert powered == (dropped == "bEnable")
        bench.axes[0].call(bAway=True)  # another block may have it now
        for _ in range(10):
            assert not bench.cycle(**left)["berror"]

    def test_a_disable_with_a_quick_stop_takes_less_time_and_one_taken_back_goes_on(self, bench):
        under_way(bench, fTarget=7.0)
        for _ in range(50):
            bench.cycle(bPower=True, bEnable=False)
        outputs = bench.cycle(**ON)
        assert (outputs["nstage"], outputs["benabled"]) == (GUIDING, True)
        bench.until(quiet, most=9000, **ON)
        bench.cycle(**ON, bExecute=False)
        bench.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=9.0)
        bench.cycle(**ON, bExecute=False)
        under_way(bench, fTarget=4.0)
        bench.until(lambda row: row["nstage"] == BLOCK_OFF, most=600, bEnable=False, bQuickStop=True)

    def test_the_block_s_own_errors_leave_the_axis_guided(self, bench):
        bench.guided()
        outputs = bench.cycle(**ON, bExecute=True, fTarget=50.0)
        assert (outputs["nerrorid"], outputs["benabled"], outputs["nstage"]) == (3, True, GUIDING)
        outputs = bench.cycle(**ON, bExecute=False)
        assert outputs["nerrorid"] == 0
        outputs = bench.until(lambda row: row["berror"], most=100, **ON, fL1=77.0, bExecute=True, fTarget=9.0)
        assert (outputs["nerrorid"], outputs["benabled"]) == (2, True)
        bench.until(quiet, most=9000, **ON, fL1=6.0)
        assert bench.cycle(**ON)["nerrorid"] == 2
        assert bench.cycle(**ON, bReset=True)["nerrorid"] == 0
        assert not bench.wrapper["fbReset"]["Busy"]  # the drive has no error

    def test_a_block_that_cannot_take_over_is_let_go(self, bench):
        outputs = bench.until(lambda row: row["berror"], most=40, **ON, fCycleTime=0.01)
        assert (outputs["nerrorid"], outputs["nstage"]) == (1, BLOCK_OFF)

    def test_an_axis_that_does_not_follow_is_stopped_and_let_go(self, bench):
        """The setpoints brake at once, as a drive may still follow late."""
        under_way(bench)
        actual = bench.part(bench.axes[0])[bench.vendor.actual]
        for _ in range(500):
            bench.part(bench.axes[0]).call(**{bench.vendor.actual: actual})
            outputs = bench.cycle(**ON, fFollowingLimit=0.05)
            if outputs["nerrorid"]:
                break
        begin = len(bench.commanded)
        assert (outputs["nerrorid"], outputs["nstage"]) == (7, STOPPING)
        bench.until(lambda row: row["nstage"] == BLOCK_OFF, most=600, **ON, fFollowingLimit=0.05)
        steps = np.diff(bench.positions()[begin - 2 :, 0]) / CYCLE
        assert abs(steps[-1]) < 1e-5 and np.diff(steps).min() >= -2.0 * ACCELERATION * CYCLE * 1.001
        assert bench.cycle(**ON)["nerrorid"] == 7

    def test_a_moving_axis_is_taken_over_as_fast_as_it_goes(self, bench):
        """Something else moves it until it is taken; the block then brakes it."""
        bench.until(lambda row: row["nstage"] == BLOCK_OFF, bPower=True)
        speed = 0.3
        for number in range(60):
            outputs = bench.cycle(**(ON if number > 20 else {"bPower": True}))
            if not bench.wrapper["bFeed"] or (bench.vendor.part and not bench.axes[0]["bGenerator"]):
                at = bench.commanded[-1][0] + speed * UNITS * CYCLE
                places = dict.fromkeys((bench.vendor.setpoint, bench.vendor.actual), at)
                bench.part(bench.axes[0]).call(**places, **{bench.vendor.speed: speed * UNITS})
                bench.commanded[-1] = [at]
        assert outputs["benabled"] and outputs["bbusy"]
        bench.until(quiet, most=2000, **ON)
        steps = np.diff(bench.positions()[1:, 0]) / CYCLE
        assert steps.max() < speed * 1.0001 and abs(steps[-1]) < 1e-5
        assert np.abs(np.diff(steps)).max() < 1.01 * ACCELERATION * CYCLE

    def test_an_axis_that_lags_is_taken_over_at_its_setpoint(self, bench):
        for _ in range(20):
            bench.cycle(bPower=True)
        for _ in range(40):
            lagging = {bench.vendor.actual: bench.commanded[-1][0] + 5.0}
            bench.part(bench.axes[0]).call(**lagging)
            outputs = bench.cycle(**ON)
        assert outputs["benabled"]
        assert {at for (at,) in bench.commanded} == {START * UNITS}

    def test_an_axis_that_is_not_homed_is_not_taken_and_can_be_homed_meanwhile(self, bench):
        bench.given |= dict.fromkeys(bench.homed, False)
        bench.put(bench.axes[0], bench.vendor.astray)
        outputs = bench.until(lambda row: row["berror"], most=40, **ON)
        assert (outputs["nerrorid"], outputs["benabled"]) == (ASTRAY, False)
        bench.until(lambda row: bench.part(bench.axes[0])[bench.vendor.state] & 1, most=20, **ON)
        assert bench.commanded == [bench.commanded[0]] * len(bench.commanded)
        bench.put(bench.axes[0], bench.vendor.fit)
        bench.cycle(bPower=True, bEnable=False, bReset=True)
        bench.cycle(bPower=True, bEnable=False, bReset=False)
        bench.given |= dict.fromkeys(bench.homed, True)
        assert not bench.guided()["berror"]

    def test_one_that_is_no_longer_wanted_is_not_taken(self, bench):
        for stage in (POWERING, TAKING):
            bench.until(lambda row, stage=stage: row["nstage"] == stage, most=20, **ON)
            for _ in range(20):
                outputs = bench.cycle(bPower=True, bEnable=False)
                assert (outputs["nstage"], outputs["benabled"]) == (BLOCK_OFF, False)

    def test_an_axis_in_error_is_refused_until_it_is_reset(self, bench):
        bench.put(bench.axes[0], bench.vendor.error)
        assert bench.until(lambda row: row["berror"], most=3, **ON)["nerrorid"] == 20
        bench.cycle(bPower=True, bEnable=False)
        for _ in range(20):
            assert bench.cycle(**ON)["nerrorid"] == 20
        # An edge together with the reset waits until that is through.
        bench.cycle(bPower=True, bEnable=False, bReset=True)
        assert not bench.guided(bReset=False)["berror"]

    @pytest.mark.parametrize(
        ("of", "sound", "broken", "number"),
        [*((of, "Wait > 4", "FALSE", OFF) for of in VENDORS),
         ("codesys", "bBusy := TRUE", "bBusy := FALSE", WORK),
         ("siemens", "IF Enable AND NOT Before THEN Busy := TRUE", "IF FALSE THEN Busy := TRUE", WORK)],
    )  # fmt: skip
    def test_power_and_guidance_that_do_not_come_are_errors(self, bay, of, sound, broken, number):
        blocks = tuple(block.replace(sound, broken) for block in VENDORS[of].blocks)
        assert blocks != VENDORS[of].blocks
        bench = PlannerBench(attrs.evolve(VENDORS[of], blocks=blocks), bay, {"": UNITS}, [START])
        outputs = bench.until(lambda row: row["berror"], most=2600, **ON)
        assert (outputs["nerrorid"], len(bench.commanded) > 2400) == (number, True)


@pytest.mark.slow
class TestTwoAxes:
    @pytest.mark.parametrize("number", [0, 1])
    def test_one_that_trips_is_let_go_and_the_other_brakes_at_once(self, two, number):
        under_way(two, fTarget_x=12.0, fTarget_y=8.0)
        two.put(two.axes[number], two.vendor.error)
        outputs = two.cycle(**ON)
        assert (outputs["nerrorid"], outputs["benabled"], outputs["nstage"]) == (20, True, STOPPING)
        begin, lost = len(two.commanded), two.commanded[-1][number]
        outputs = two.until(lambda row: row["nstage"] == BLOCK_OFF, most=600, **ON)
        for _ in range(20):
            assert two.cycle(**ON)["nerrorid"] == 20
        assert {row[number] for row in two.commanded[begin:]} == {lost}
        steps = np.diff(two.positions()[begin - 2 :, 1 - number]) / CYCLE
        assert steps[0] > 0.1 and abs(steps[-1]) < 1e-5
        assert np.abs(np.diff(steps)).max() < 0.8 * CYCLE * 1.001  # the quick stop's deceleration

    def test_both_are_taken_over_before_either_moves_and_arrive_together(self, two):
        two.guided()
        assert np.ptp(two.commanded, axis=0).tolist() == [0.0, 0.0]
        given = {"fTarget_x": 6.0, "fTarget_y": 3.0}
        two.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, **given)
        np.testing.assert_allclose(two.positions()[-1], [6.0, 3.0], rtol=0, atol=1e-9)

    def test_one_that_is_not_homed_keeps_both_from_being_taken(self, two):
        two.put(two.axes[1], two.vendor.astray)
        two.given |= dict.fromkeys(two.homed[1:], False)
        outputs = two.until(lambda row: row["berror"], most=40, **ON)
        assert (outputs["nerrorid"], outputs["nstage"]) == (ASTRAY, BLOCK_OFF)


@pytest.mark.slow
class TestVelocity:
    def test_the_axis_arrives_although_the_drive_slips(self, bay):
        axis = Converter(bay)
        assert axis.until(lambda row: row["benabled"], most=20, **ON)["fspeed"] == 0.0
        outputs = axis.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=9.0)
        for _ in range(1500):
            outputs = axis.cycle(**ON)
        assert axis.position == pytest.approx(9.0, abs=1e-3)
        assert not outputs["berror"] and abs(outputs["fspeed"]) < 1e-3
        speeds = np.array(axis.rows)[:, 0]
        assert 0.5 < speeds.max() <= VELOCITY + 0.1
        assert np.abs(np.diff(speeds)).max() < 2.0 * ACCELERATION * CYCLE

    def test_without_its_position_control_it_would_not(self, bay):
        axis = Converter(bay)
        axis.given |= {"fGain": 1e-9, "fFollowingLimit": 9.0}
        axis.until(lambda row: row["benabled"], most=20, **ON)
        axis.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=9.0)
        assert axis.position < 8.95

    @pytest.mark.parametrize("lost", [lambda axis: axis.stuck, lambda axis: np.nan], ids=["stuck", "nan"])
    def test_a_measurement_that_fails_ends_in_a_stop_that_needs_none(self, bay, lost):
        axis = under_way_by_velocity(bay)
        axis.stuck = axis.position
        axis.measured = lambda: float(lost(axis))
        outputs = axis.until(lambda row: row["berror"], most=200, **ON)
        assert (outputs["nerrorid"], outputs["nstage"]) == (7, STOPPING)
        begin = len(axis.rows)
        outputs = axis.until(lambda row: row["nstage"] == BLOCK_OFF, most=600, **ON)
        assert abs(outputs["fspeed"]) < 1e-4
        for _ in range(200):
            outputs = axis.cycle(**ON)
        assert outputs["fspeed"] == 0.0 and outputs["brun"] and abs(axis.velocity) < 1e-3
        speeds = np.array(axis.rows)[begin:, 0]
        assert speeds[0] > 0.3 and np.diff(speeds).max() <= ACCELERATION * CYCLE

    def test_a_converter_that_trips_is_told_nothing_more_and_taken_over_where_it_stands(self, bay):
        axis = under_way_by_velocity(bay)
        axis.failed = True
        outputs = axis.cycle(**ON)
        assert (outputs["nerrorid"], outputs["fspeed"], outputs["benabled"]) == (20, 0.0, False)
        for given in (ON, {**ON, "bReset": True}, {**ON, "bReset": False}):
            for _ in range(100):
                assert axis.cycle(**given)["fspeed"] == 0.0
        axis.cycle(bEnable=False, bExecute=False)
        outputs = axis.until(lambda row: row["benabled"], most=20, **ON)
        assert abs(outputs["fspeed"]) < 1e-9
        axis.until(lambda row: row["bdone"], most=9000, **ON, bExecute=True, fTarget=12.0)
        assert axis.position == pytest.approx(12.0, abs=8e-3)  # by its lag

    @pytest.mark.parametrize("name", ["fGain", "fCorrection", "fFollowingLimit"])
    def test_it_is_not_guided_without_control_and_supervision(self, bay, name):
        for value in (0.0, np.nan):
            axis = Converter(bay)
            axis.given[name] = value
            outputs = axis.until(lambda row: row["berror"], most=20, **ON)
            assert (outputs["nerrorid"], outputs["benabled"], outputs["fspeed"]) == (WORK, False, 0.0)

    def test_an_input_that_is_lost_on_the_way_does_not_reach_the_converter(self, bay):
        for name in ("fGain", "fCorrection"):
            axis = under_way_by_velocity(bay)
            speed, axis.given[name] = axis.rows[-1][0], np.nan
            for _ in range(100):
                assert abs(axis.cycle(**ON)["fspeed"] - speed) < 0.15

    def test_what_is_corrected_is_bounded(self, bay):
        axis = Converter(bay)
        axis.given["fFollowingLimit"] = 5.0
        axis.until(lambda row: row["benabled"], most=20, **ON)
        for way in (-1.0, 1.0):
            axis.measured = lambda way=way: START - way
            assert axis.cycle(**ON)["fspeed"] == pytest.approx(0.1 * way)


def under_way_by_velocity(source):
    axis = Converter(source)
    axis.until(lambda row: row["benabled"], most=20, **ON)
    for _ in range(1200):
        outputs = axis.cycle(**ON, bExecute=True, fTarget=12.0)
    assert outputs["fspeed"] > 0.35
    return axis


LIBRARIES = [getattr(motion_libraries, name) for name in ("TWINCAT", "CODESYS", "SIEMENS", "VELOCITY")]


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("axes", ["bay", "gantry"])
def test_a_wrapper_takes_and_tells_all_but_places(request, library, axes):
    block, units = request.getfixturevalue(axes), {"bay": {"": 1.0}, "gantry": {"_x": 1.0, "_y": 1.0}}[axes]
    wrapper = planner_wrapper(block, units, library)
    outer, inner = (
        {v.name for v in source.variables if v.section in {"VAR_INPUT", "VAR_OUTPUT"}}
        for source in (wrapper, block)
    )
    places = {"fPosition", "fVelocity", "fAcceleration"}
    if library != motion_libraries.VELOCITY:
        places |= {"fActPosition", "fActVelocity"}
    assert inner - outer == {f"{name}{n}" for name in places for n in units}
    names = Counter(v.name.lower() for v in wrapper.variables)
    assert names.most_common(1)[0][1] == 1
    used = Counter(re.findall(r"\b\w+\b", wrapper.body))
    assert not [v.name for v in wrapper.variables if not used[v.name]]


def test_arrays_are_handed_over_element_by_element(bay):
    """As matiec takes no whole array for a parameter."""
    extra = (
        BlockVariable(section="VAR_INPUT", name="aPlaces", type="ARRAY [0..3] OF LREAL"),
        BlockVariable(section="VAR_OUTPUT", name="aDoubled", type="ARRAY [0..3] OF LREAL"),
    )
    body = "".join(f"aDoubled[{k}] := 2.0 * aPlaces[{k}];\n" for k in range(4))
    block = interface_of(bay)
    block = attrs.evolve(block, variables=(*block.variables, *extra), body=body)
    wrapper = planner_wrapper(block, {"": 1.0}, motion_libraries.VELOCITY)
    assert "aPlaces :=" not in wrapper.body
    outputs = FunctionBlock(wrapper.text(), (block.text(),)).call(aPlaces=[1.0, 2.0, 3.0, 4.0])
    assert outputs["adoubled"] == [2.0, 4.0, 6.0, 8.0]


def test_a_live_parameter_that_meets_a_variable_of_the_wrapper_is_refused(bay):
    (rope,) = (v for v in bay.variables if v.name == "fL1")
    gain = attrs.evolve(bay, variables=(*bay.variables, attrs.evolve(rope, name="fgain")))
    with pytest.raises(ExportError, match="name the live parameter otherwise"):
        planner_wrapper(gain, {"": 1.0}, motion_libraries.VELOCITY)
