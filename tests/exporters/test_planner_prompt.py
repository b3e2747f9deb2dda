"""Prompt stops of a planner block: never faster than the axis is then, and within the stated ends."""

import numpy as np
import pytest
from driven_block import Driver, require_limits

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
