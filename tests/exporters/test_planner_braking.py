"""An axis keeps out of an interval that is blocked in its way, where braking at once keeps it out."""

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from driven_block import most_operations

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

pytestmark = pytest.mark.slow
SPEC = preset_spec("bay-crane", ["planner.zones=true"])
CYCLE, LIMITS = SPEC.export.cycle_time, SPEC.limits.of(0)
STEP, UNSURE = 1e-4, 1e-4  # s, and m by which its steps may miss the way
MOST = most_operations(SPEC)


@pytest.fixture(scope="module")
def compiled():
    return compile_counting(planner_block(SPEC).text)


def braked(place, velocity, acceleration):
    """Between which places an axis stays that is braked within the limits, by the law of feedback."""
    most, jerk, low, high = LIMITS.acceleration, LIMITS.jerk, place, place
    sign = np.sign(velocity + 0.5 * acceleration * abs(acceleration) / jerk)
    v, a, x = sign * velocity, sign * acceleration, 0.0
    while (brakes := v + 0.5 * a * abs(a) / jerk > 0.0) or a < -jerk * STEP:
        change = np.clip((-most - a) / STEP, -jerk, jerk) if brakes else jerk
        x += STEP * (v + STEP * (a / 2.0 + STEP * change / 6.0))
        v += STEP * (a + STEP * change / 2.0)
        a += STEP * change
        low, high = min(low, place + sign * x), max(high, place + sign * x)
    return low, high


def moving(compiled, random):
    """A block whose axis is on its way by random commands, and its state."""
    live = {f"f{name}": random.uniform(*ends) for name, ends in SPEC.planner.live.items()}
    block = CountedBlock(compiled, fActPosition=random.uniform(3.0, 37.0), **live)
    block.hold(round(1.0 / CYCLE))
    block.hold(2, bVelocity=1.0)
    while True:
        cycles = round(random.uniform(0.05, 6.0) / CYCLE)
        if random.random() < 0.5:
            issued = block.hold(cycles, bVelocity=0.0, bExecute=1.0, fTarget=random.uniform(*LIMITS.travel))
        else:
            speed = random.choice([-1.0, 1.0]) * random.uniform(0.2, 1.0) * LIMITS.velocity
            issued = block.hold(cycles, bVelocity=1.0, fVelocityCommand=speed)
        state = [issued[name][-1] for name in ("fPosition", "fVelocity", "fAcceleration")]
        if abs(state[1]) > 0.01 and random.random() < 0.5:
            return block, state


@pytest.mark.parametrize("seed", range(4))
def test_an_axis_enters_no_interval_that_braking_at_once_keeps_out_of(compiled, seed):
    """It searched for a stop without sway for four slots, and entered those that were nearer: 13 of 36."""
    random = np.random.default_rng([31, seed])
    kept = braking = 0
    for _ in range(40):
        block, state = moving(compiled, random)
        place, up = state[0], bool(state[1] > 0.0)
        ends = braked(*state)
        room = abs(ends[up] - place)
        gap = random.choice([room + UNSURE, room + 0.02, random.uniform(0.0, 1.0) ** 2 * 3.0])
        edge = place + gap if up else place - gap
        low, high = (edge, edge + 3.0) if up else (edge - 3.0, edge)
        issued = block.hold(round(12.0 / CYCLE), **{"aBlockedLow[0]": low, "aBlockedHigh[0]": high})
        a = np.concatenate([state[2:], issued["fAcceleration"]])
        assert np.abs(a).max() <= LIMITS.acceleration * (1.0 + 1e-9)
        assert np.abs(np.diff(a)).max() <= LIMITS.jerk * CYCLE * (1.0 + 1e-6)
        assert issued["operations"].max() <= MOST
        if gap >= room + UNSURE:
            beyond = issued["fPosition"].max() - edge if up else edge - issued["fPosition"].min()
            assert beyond <= 1e-9
            kept += 1
            braking += not issued["bPromise"][-1]
    assert kept > 20
    assert 0 < braking < kept  # where there is room for it, a stop without sway is found
