"""Prompt stops of a planner block: never faster than the axis is then, and within the stated ends."""

import numpy as np
import pytest
from driven_block import CYCLE, Driver, require_limits
from generator.planned_machines import swing

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

pytestmark = pytest.mark.slow

SPEC = preset_spec("bay-crane")
LIMITS = (1.1, 0.3, 1.5, 40.0)
IN_A_SLOT = 0.12  # m/s, by which what is fixed may still speed up


@pytest.fixture(scope="module")
def text():
    return planner_block(SPEC).text


def standing(text, random):
    """A block at a random place, rope and load, and which way the farther end of its travel is."""
    live = {f"f{name}": random.uniform(*ends) for name, ends in SPEC.planner.live.items()}
    place = random.uniform(2.0, 38.0)
    return Driver(text, fActPosition=place, bPromptStop=1.0, **live).hold(2.0), 1.0 if place < 20.0 else -1.0


@pytest.mark.parametrize("seed", range(4))
def test_it_is_never_faster_than_the_axis_was_nor_leads_beyond_its_stated_ends(text, seed):
    random = np.random.default_rng([5, seed])
    driver, ahead = standing(text, random)
    moving = driver.hold(random.uniform(1.0, 14.0), bExecute=1, fTarget=20.0 + 18.0 * ahead).parts[-1]
    led_to = abs(moving["fVelocity"][-1]) + IN_A_SLOT * (moving["fAcceleration"][-1] * ahead > 0.0)
    stop = driver.hold(40.0, bStop=1).parts[-1]
    assert np.abs(stop["fVelocity"]).max() <= led_to + 0.01
    assert stop["fVelocity"][-1] == 0.0
    assert moving["fStopLow"][-1] - 1e-9 <= stop["fPosition"].min()
    assert stop["fPosition"].max() <= moving["fStopHigh"][-1] + 1e-9
    require_limits(driver.outputs, limits=LIMITS)


@pytest.mark.parametrize("seed", [0, 1])
def test_an_axis_is_not_kept_standing_by_what_one_left(text, seed):
    """A stick that was thrown over, and a stop: a third of a metre swings on, also as given."""
    random = np.random.default_rng([9, seed])
    driver, ahead = standing(text, random)
    speed = ahead * random.uniform(0.4, 1.0)
    driver.hold(0.1, bVelocity=1).hold(random.uniform(2.0, 8.0), fVelocityCommand=speed)
    driver.hold(random.uniform(0.2, 3.0), fVelocityCommand=-speed)
    stopped = driver.hold(20.0, bVelocity=0, bStop=1).parts[-1]
    assert stopped["fVelocity"][-1] == 0.0
    driver.hold(0.1, bStop=0, bVelocity=1, fVelocityCommand=0.0)
    assert abs(driver.hold(15.0, fVelocityCommand=speed).parts[-1]["fVelocity"][-1]) > 0.9 * abs(speed)
    assert driver.hold(30.0, bVelocity=0, bStop=1).parts[-1]["fVelocity"][-1] == 0.0
    require_limits(driver.outputs, limits=LIMITS)


def hook_and_payload(driver, machine):
    """Their sway in m in every second cycle, by equations of motion that are written apart."""
    outputs = driver.outputs
    time = CYCLE * np.arange(len(outputs["fAcceleration"]))
    return swing(time, outputs["fAcceleration"], m1=350.0, L2=1.5, **machine)


@pytest.mark.parametrize("between", [{"bEnable": 0.0}, {"fL1": 6.2}], ids=["switched off", "another rope"])
def test_what_swings_is_known_where_a_motion_begins_anew(text, between):
    """What a prompt stop had left was calmed out of phase: as much remained, on the machine as given, too."""
    driver = Driver(text, fActPosition=5.0, bPromptStop=1.0, fL1=6.0, fm2=1500.0).hold(2.0)
    driver.hold(0.1, bVelocity=1).hold(4.0, fVelocityCommand=0.5).hold(2.5, fVelocityCommand=-0.5)
    driver.hold(12.37, bVelocity=0, bStop=1)
    driver.hold(1.61, fActPosition=driver.outputs["fPosition"][-1], **between)
    driver.hold(3.0, bEnable=1.0, fL1=6.0, bStop=0)
    stood = len(driver.outputs["fVelocity"])
    driver.hold(45.0, bExecute=1, fTarget=12.0)
    sway = np.abs(hook_and_payload(driver, {"m2": 1500.0, "L1": 6.0})).sum(axis=0)
    assert driver.outputs["bDone"][-1]
    assert sway[stood // 2 - 800 : stood // 2].max() > 0.1
    assert sway[-1500:].max() < 0.02


@pytest.mark.parametrize("waits", [0.06, 0.1, 0.14, 0.18])
def test_a_target_behind_the_axis_replaces_a_plan_that_waits_to_begin(text, waits):
    """What was planned for the former target began, and the axis went there, 9 m the wrong way."""
    driver = Driver(text, fActPosition=20.0, bPromptStop=1.0, fL1=6.0, fm2=1500.0).hold(2.0)
    driver.hold(0.1, bVelocity=1).hold(6.0, fVelocityCommand=0.5).hold(1.5, fVelocityCommand=-0.5)
    place = driver.hold(12.37, bVelocity=0, bStop=1).parts[-1]["fPosition"][-1]
    driver.hold(waits, bStop=0, bExecute=1, fTarget=place + 9.0).hold(CYCLE, bExecute=0)
    back = driver.hold(6.0, bExecute=1, fTarget=1.0).parts[-1]
    assert back["fPosition"].max() < place + 0.2


def test_time_to_go_counts_the_turn(text):
    driver = Driver(text, fActPosition=5.0, fL1=6.0, fm2=1500.0).hold(2.0)
    driver.hold(8.0, bExecute=1, fTarget=38.0).hold(CYCLE, bExecute=0)
    back = driver.hold(60.0, bExecute=1, fTarget=1.0).parts[-1]
    turns, rests = np.flatnonzero(back["fVelocity"] < 0.0)[0], np.flatnonzero(back["fVelocity"])[-1]
    assert back["bDone"][-1]
    takes = CYCLE * (rests - np.arange(len(back["fVelocity"])))
    before = slice(round(2.5 / CYCLE), int(turns))
    assert np.abs(back["fTimeToGo"] - takes)[before].max() < 1.5
