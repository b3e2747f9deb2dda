"""A planner block takes axes over within their limits, however wrong velocities and places are given."""

import re

import numpy as np
import pytest
from exporters.planner_benches import ON, START, Converter
from generator.planned_machines import HOIST

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import parse_spec
from gen_profile_exporters.block_source import parse_function_block

pytestmark = pytest.mark.slow

SPEC = parse_spec(HOIST, ["planner.live_rate={hoist=0.1}"])
CYCLE, VELOCITY, ACCELERATION, JERK = 0.004, 0.5, 0.3, 2.0
TEXTS = {"followed": planner_block(SPEC).text, "not followed": planner_block(parse_spec(HOIST)).text}
BEFORE, AFTER = 40, 1500  # cycles without bEnable, and with it


def taken_over(text, velocities, places=4.0, then=0.0):
    """Setpoints, (cycles, 3), and nPromise of an axis that is enabled after some cycles of its own."""
    block = BlockInstance(text)
    names, issued = list(block.inputs), block.outputs
    rows = np.tile([*block.inputs.values()], (BEFORE + AFTER, 1))
    rows[:, names.index("fActVelocity")] = then
    rows[: BEFORE + 1, names.index("fActVelocity")] = velocities
    rows[:, names.index("fActPosition")] = places
    rows[BEFORE:, names.index("bEnable")] = 1.0
    outputs = block.call(rows)
    assert outputs[BEFORE, issued.index("bEnabled")] == 1.0
    axis = [issued.index(name) for name in ("fPosition", "fVelocity", "fAcceleration")]
    return outputs[BEFORE:, axis], int(outputs[-1, issued.index("nPromise")])


def require_limits(setpoints):
    x, v, a = setpoints.T
    assert np.abs(v).max() <= VELOCITY and np.abs(a).max() <= ACCELERATION + 1e-9
    assert np.abs(np.diff(a)).max() <= JERK * CYCLE * (1.0 + 1e-9)
    assert np.abs(np.diff(x) - 0.5 * CYCLE * (v[1:] + v[:-1])).max() < 1e-6
    assert v[-1] == a[-1] == 0.0


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("noise", [0.002, 0.005, 0.02, 0.1])
def test_an_axis_that_stands_stays_where_it_is_however_noisy_its_velocity(text, noise):
    for seed in range(12):
        random = np.random.default_rng(seed)
        setpoints, _ = taken_over(text, random.uniform(-noise, noise, BEFORE + 1))
        require_limits(setpoints)
        way = noise * 2.0 * np.sqrt(noise / JERK) + noise * CYCLE
        # where what an axis does by hand is followed, what its braking makes swing is calmed
        assert np.ptp(setpoints[:, 0]) <= (2.5 if text == TEXTS["followed"] else 1.0) * way


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("spike", [0.3, -4.0, 1e3, -1e9])
def test_one_velocity_that_cannot_be_moves_nothing(text, spike):
    setpoints, _ = taken_over(text, [*np.zeros(BEFORE), spike], then=spike)
    assert np.ptp(setpoints[:, 0]) == 0.0


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("speed", [0.1, -0.4, 2.0])
def test_an_axis_that_moves_is_braked_from_its_velocity_and_nothing_is_promised(text, speed):
    random = np.random.default_rng(1)
    noise = random.uniform(-0.01, 0.01, BEFORE + 1)
    setpoints, promise = taken_over(text, speed + noise, 4.0 + speed * CYCLE * np.arange(BEFORE + AFTER))
    require_limits(setpoints)
    most = min(abs(speed), VELOCITY)
    way = most * 0.5 * (most / ACCELERATION + ACCELERATION / JERK)
    if most < ACCELERATION**2 / JERK:
        way = most * np.sqrt(most / JERK)
    assert abs(setpoints[-1, 0] - setpoints[0, 0]) == pytest.approx(way, rel=0.25)
    assert promise == 2


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_a_position_that_steps_is_taken_over_where_it_is_given(text):
    places = np.where(np.arange(BEFORE + AFTER) < BEFORE, 3.0, 4.0)
    setpoints, _ = taken_over(text, np.zeros(BEFORE + 1), places)
    assert (setpoints[:, 0] == 4.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_converter_s_unfiltered_measurements_move_no_axis_that_stands(seed):
    random, axis = np.random.default_rng(seed), Converter(parse_function_block(TEXTS["followed"]))
    axis.measured = lambda: axis.position + random.uniform(-1e-3, 1e-3)
    outputs = {"benabled": False}
    for cycle in range(1500):
        noisy = {"fActVelocity": random.uniform(-0.02, 0.02), "fCorrection": 0.02}
        outputs = axis.cycle(**ON | {"bEnable": cycle > 20}, **noisy)
    assert outputs["benabled"] and not outputs["berror"]
    assert np.abs(np.array(axis.rows)[:, 1] - START).max() < 0.01


def test_the_proof_takes_over_with_noise_and_refuses_a_block_that_runs_away_then():
    wrong, count = re.subn(
        r"(fVelocity := fSpeed;\s+fAcceleration := )0\.0;", r"\1 100.0 * fSpeed;", TEXTS["followed"]
    )
    assert count == 1
    histories = Histories.of(SPEC)
    drawn = Numbering.of(histories, 800, 0)
    noisy = [k for k in range(len(drawn.drawn)) if any(c.noise for c in drawn.history(k).changes)][:8]
    assert len(noisy) == 8
    for text, refused in ((TEXTS["followed"], False), (wrong, True)):
        with ClosedLoop(SPEC, text, histories) as loop:
            faults = [fault for one in loop.judged(drawn, noisy) for fault in one.faults]
        assert any("acceleration is above its limit" in fault for fault in faults) == refused
        assert refused or not faults
