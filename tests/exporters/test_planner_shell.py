"""The shell of the planner block, around a motion that plans nothing."""

import math
import re

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from driven_block import BAY
from plain_motion import plain_motion
from test_whole_block import random_rows

from gen_profile.planner.design import planner_constants
from gen_profile.planner.events import events_of
from gen_profile.spec.reading import parse_spec
from gen_profile_exporters.planner.blocks.whole import around

pytestmark = pytest.mark.slow

CYCLE, START = 0.004, 10.0
SPEC = parse_spec(BAY, ["planner.zones=true", "planner.events=true"])
LIMITS = {"fVelocity": 1.0, "fAcceleration": 0.3}


@pytest.fixture(scope="module")
def text():
    constants = planner_constants(SPEC)[1]
    return around(plain_motion(constants), constants)


class Led:
    """A block that is enabled at a place, and all that it issued."""

    def __init__(self, text, **inputs):
        self.block = CountedBlock(compile_counting(text), bEnable=0.0, fActPosition=START)
        self.block.inputs |= {"bEnable": 0.0} | inputs
        self.block.play_on(5)
        self.hold(0.4, bEnable=1.0)

    def hold(self, seconds, **inputs):
        self.block.inputs |= {name: float(value) for name, value in inputs.items()}
        return self.block.play_on(max(1, round(seconds / CYCLE)))

    def now(self, **inputs):
        return {name: float(values[-1]) for name, values in self.hold(0.0, **inputs).items()}


@pytest.mark.parametrize("speed", [0.2, -0.9, 3.0])
def test_an_axis_that_moves_is_braked_from_where_it_is_within_the_limits(text, speed):
    led = Led(text)
    led.hold(0.1, bEnable=0, fActVelocity=speed)
    issued = led.hold(8.0, bEnable=1)
    v, a, x = issued["fVelocity"], issued["fAcceleration"], issued["fPosition"]
    assert np.abs(v).max() <= 1.0 and np.abs(a).max() <= 0.3 + 1e-12
    assert np.abs(np.diff(a)).max() <= 1.0 * CYCLE * (1 + 1e-9)
    assert v[-1] == 0.0 and (x[-1] - START) * speed > 0.0
    assert issued["fTimeToGo"][0] > 0.5 and np.all(np.diff(issued["fTimeToGo"]) <= 0.0)
    assert x[-1] == pytest.approx(max(issued["fStopHigh"][0] if speed > 0 else issued["fStopLow"][0], -99.0))
    assert issued["nPromise"][-1] == 2.0
    assert led.now(bLoadAtRest=1)["nPromise"] == 0.0


@pytest.mark.parametrize("spike", [0.3, -4.0, 1e3, -1e9, math.nan])
def test_one_velocity_that_cannot_be_moves_nothing(text, spike):
    led = Led(text)
    led.hold(0.1, bEnable=0, fActVelocity=0.0)
    led.hold(0.0, fActVelocity=spike)
    assert np.ptp(led.hold(3.0, bEnable=1, fActVelocity=0.0)["fPosition"]) == 0.0


def test_noise_and_steps_of_what_is_measured_move_no_axis_that_stands(text):
    draw = np.random.default_rng(4)
    led = Led(text)
    for _ in range(40):
        led.hold(0.0, bEnable=0, fActVelocity=draw.uniform(-0.01, 0.01), fActPosition=draw.uniform(9.0, 11.0))
    issued = led.hold(3.0, bEnable=1, fActPosition=9.5)
    assert np.abs(issued["fPosition"] - 9.5).max() <= 0.01 * 2.0 * np.sqrt(0.01 / 1.0) + 0.01 * CYCLE


def test_a_place_or_velocity_that_is_no_number_takes_no_axis_over(text):
    led = Led(text)
    led.hold(0.1, bEnable=0)
    for name in ("fActPosition", "fActVelocity"):
        shown = led.now(bEnable=1, **{name: math.nan})
        assert (shown["nErrorId"], shown["bEnabled"], shown["fPosition"]) == (4.0, 0.0, START)
        assert led.now(bEnable=0, fActPosition=START, fActVelocity=0.0)["nErrorId"] == 0.0
    assert led.now(bEnable=1)["bEnabled"] == 1.0


@pytest.mark.parametrize("off", [1.0009, 0.9991, 1.0011, 0.9989, 2.0, math.nan])
def test_a_cycle_time_is_taken_within_the_tolerance_that_the_header_states(text, off):
    assert "within 0.1 % of the cycle time" in text
    due = 0.0 if abs(off - 1.0) < 1e-3 else 1.0
    led = Led(text)
    assert led.now(fCycleTime=off * CYCLE)["nErrorId"] == due
    assert led.now(fCycleTime=CYCLE)["nErrorId"] == 0.0
    led.hold(0.0, bEnable=0)
    assert led.now(bEnable=1, fCycleTime=off * CYCLE)["bEnabled"] == 1.0 - due


def test_busy_falls_with_enable_and_what_was_promised_too(text):
    led = Led(text)
    assert led.hold(3.0, bExecute=1, fTarget=14.0)["bBusy"][-1] == 1.0
    shown = led.now(bEnable=0)
    assert shown["bBusy"] == 0.0 and shown["nPromise"] == 4.0
    assert led.hold(0.3, bEnable=1)["nPromise"][-1] == 2.0


def test_following_error_brakes_as_a_quick_stop_and_stays_until_reset(text):
    led = Led(text, fFollowingLimit=0.0)
    led.hold(4.0, bExecute=1, fTarget=30.0)
    issued = led.hold(4.0, fFollowingLimit=0.3)
    assert issued["nErrorId"][-1] == 7.0 and issued["fVelocity"][-1] == 0.0
    assert np.abs(issued["fAcceleration"]).max() == pytest.approx(0.6)
    assert led.now(bExecute=0)["nErrorId"] == 7.0
    assert led.now(bReset=1, fFollowingLimit=0.0)["nErrorId"] == 0.0


class TestLiveParameters:
    def test_a_spike_or_no_number_changes_nothing_and_what_lasts_is_error_2(self, text):
        led = Led(text)
        for value in (math.nan, 99.0, 4.0):
            led.hold(0.0, fL1=value)
            assert led.hold(0.1, fL1=6.0)["nPromise"].max() == 0.0
        assert led.hold(0.18, fL1=math.nan)["nErrorId"].max() == 0.0
        assert led.hold(0.1)["nErrorId"][-1] == 2.0
        assert led.hold(0.1, fL1=6.0)["nErrorId"][-1] == 0.0

    def test_standing_others_are_taken_over_and_on_the_way_the_promise_goes(self, text):
        led = Led(text)
        assert led.hold(0.3, fL1=7.0)["nPromise"].max() == 0.0
        assert led.hold(3.0, bExecute=1, fTarget=14.0)["nPromise"].max() == 0.0
        assert led.hold(0.1, fL1=7.1)["nPromise"].max() == 0.0
        assert led.hold(0.5, fL1=7.0)["nPromise"].max() == 0.0
        assert led.hold(0.3, fL1=7.1)["nPromise"][-1] == 1.0
        assert led.hold(10.0, fL1=7.0)["nPromise"][-1] == 1.0
        assert led.hold(0.3, bExecute=0, bLoadAtRest=1)["nPromise"][-1] == 0.0

    def test_a_hoist_that_goes_on_does_not_put_off_a_motion(self, text):
        led = Led(text)
        for cycle in range(300):
            shown = led.now(fL1=6.0 + 0.01 * cycle, bExecute=1, fTarget=14.0)
        assert shown["fVelocity"] > 0.0 and shown["nPromise"] == 1.0


class TestZones:
    def test_a_target_within_or_behind_a_blocked_interval_is_refused(self, text):
        led = Led(text)
        led.hold(0.1, **{"aBlockedLow[2]": 15.0, "aBlockedHigh[2]": 16.0})
        for target in (15.5, 20.0):
            shown = led.now(bExecute=1, fTarget=target)
            assert (shown["nErrorId"], shown["nZone"], shown["bCommandAborted"]) == (8.0, 3.0, 1.0)
            assert led.now(bExecute=0)["nErrorId"] == 0.0
        assert led.hold(20.0, bExecute=1, fTarget=14.5)["bDone"][-1] == 1.0

    def test_one_that_is_set_in_the_way_stops_the_axis_before_it_or_brakes_it(self, text):
        for low, promise in ((20.0, 0.0), (11.0, 2.0)):
            led = Led(text)
            led.hold(2.1, bExecute=1, fTarget=30.0)
            issued = led.hold(12.0, **{"aBlockedLow[0]": low, "aBlockedHigh[0]": 25.0})
            assert issued["nErrorId"][-1] == 8.0 and issued["fVelocity"][-1] == 0.0
            assert issued["nPromise"][-1] == promise
            assert np.abs(np.diff(issued["fAcceleration"])).max() < 1.0
            assert led.now()["nErrorId"] == 8.0
            assert led.now(bReset=1, bExecute=0, **{"aBlockedHigh[0]": 0.0})["nErrorId"] == 0.0

    @pytest.mark.parametrize("stick", [False, True])
    def test_a_slow_interval_is_passed_at_its_limit_both_ways(self, text, stick):
        led = Led(text)
        led.hold(0.1, **{"aSlowLow[1]": 14.0, "aSlowHigh[1]": 16.0, "aSlowLimit[1]": 0.2})
        for end in (20.0, 10.0):
            led.hold(0.0, bVelocity=1, fVelocityCommand=0.0) if stick else led.hold(0.0, bExecute=0)
            given = (
                {"fVelocityCommand": math.copysign(1.0, end - 15.0)}
                if stick
                else {"bExecute": 1, "fTarget": end}
            )
            issued = led.hold(60.0 if stick else 30.0, **given)
            x, v = issued["fPosition"], np.abs(issued["fVelocity"])
            assert v[(x > 14.0 + 1e-9) & (x < 16.0 - 1e-9)].max() == pytest.approx(0.2)
            assert v.max() > 0.7 and (x.max() >= 20.0 if end == 20.0 else x.min() <= 10.0)
            led.hold(0.0, bVelocity=0)

    def test_a_target_is_refused_by_an_interval_before_its_range_and_while_held_too(self, text):
        led = Led(text)
        led.hold(0.1, **{"aBlockedLow[0]": 15.0, "aBlockedHigh[0]": 16.0})
        assert led.now(bExecute=1, fTarget=99.0)["nErrorId"] == 8.0
        led.hold(0.1, bExecute=0, rOverride=0.0)
        assert led.now(bExecute=1, fTarget=20.0)["nErrorId"] == 8.0
        led.hold(0.1, bExecute=0, rOverride=1.0)
        led.hold(3.0, bExecute=1, fTarget=14.0)  # and a motion stops for it
        led.hold(0.0, bExecute=0)
        assert led.hold(3.0, bExecute=1, fTarget=20.0)["fVelocity"][-1] == 0.0

    def test_an_axis_beyond_its_travel_comes_back_and_goes_no_farther(self, text):
        led = Led(text)
        led.hold(0.1, bEnable=0, fActPosition=-0.5)
        issued = led.hold(9.0, bEnable=1, bExecute=1, fTarget=2.0)
        assert issued["bDone"][-1] == 1.0 and issued["fPosition"].min() == -0.5

    def test_what_is_no_number_holds_the_last_good_ones_and_is_error_5(self, text):
        led = Led(text)
        led.hold(0.1, **{"aBlockedLow[0]": 15.0, "aBlockedHigh[0]": 16.0})
        assert led.hold(0.15, **{"aBlockedLow[0]": math.nan})["nErrorId"].max() == 0.0
        assert led.now(bExecute=1, fTarget=20.0)["nErrorId"] == 8.0
        assert led.hold(0.2, bExecute=0)["nErrorId"][-1] == 5.0


def test_an_override_of_0_holds_and_the_motion_goes_on(text):
    led = Led(text)
    led.hold(2.0, bExecute=1, fTarget=14.0)
    held = led.hold(3.0, rOverride=0.0)
    assert held["fVelocity"][-1] == 0.0 and held["bDone"][-1] == 0.0 and held["bBusy"][-1] == 1.0
    assert led.hold(2.0, rOverride=0.4)["fVelocity"].max() == pytest.approx(0.4)
    assert led.hold(9.0, rOverride=1.0)["bDone"][-1] == 1.0


def test_no_motion_for_long_is_error_9_and_then_enabling_withdraws_the_promise(text):
    stuck = text.replace(
        "IF nCommand = 2 THEN fSpeed := cFull;", "IF nCommand = 2 THEN fSpeed := 0.0 * cFull;"
    )
    assert stuck != text
    led = Led(stuck)
    assert led.hold(15.0, bExecute=1, fTarget=14.0)["bBusy"].min() == 1.0
    assert led.hold(30.0)["nErrorId"][-1] == 9.0
    assert led.now(bReset=1, bExecute=0)["nErrorId"] == 0.0


def test_events_say_what_happened_in_order(text):
    led = Led(text)
    parts = [
        led.hold(20.0, bExecute=1, fTarget=14.0), led.hold(0.1, bExecute=0),
        led.hold(0.1, bExecute=1, fTarget=99.0), led.hold(0.1, bExecute=0), led.hold(0.0, bEnable=0),
    ]  # fmt: skip
    names = [name for name in parts[0] if name != "operations"]
    issued = np.concatenate([np.column_stack([part[name] for name in names]) for part in parts])
    events = [(event.code, event.value) for event in events_of(names, issued)]
    codes = [code for code, _ in events]
    assert codes == [11, 63, 60, 21, 32, 12, 11, 70, 20, 53, 41, 50, 10, 64]
    assert dict(events)[21] == 14.0 and dict(events)[12] == pytest.approx(START, abs=0.01)


def test_random_inputs_keep_the_rules_of_the_signals(text):
    block = CountedBlock(compile_counting(text), bEnable=0.0)
    rows = random_rows(block.inputs, 200_000, seed=2)
    issued = block._played(rows)
    (counted,) = map(int, re.findall(r"cShellWork : DINT := (\d+);", text))
    assert issued["operations"].max() <= counted + 30  # of the motion that plans nothing
    finite = np.column_stack([values for name, values in issued.items()])
    assert np.isfinite(finite).all()
    shown = [issued[name] for name in ("bBusy", "bDone", "bError", "bInVelocity")]
    assert not np.any((shown[1] > 0) & ((shown[0] > 0) | (shown[3] > 0)))
    assert np.array_equal(issued["bError"], np.float64(issued["nErrorId"] > 0))
    assert not np.any(issued["bBusy"][issued["bEnabled"] == 0.0])
    assert not np.any(issued["bPromise"] * issued["nPromise"])
    assert set(issued["nErrorId"]) >= {0.0, 3.0, 5.0, 6.0, 7.0, 8.0}
