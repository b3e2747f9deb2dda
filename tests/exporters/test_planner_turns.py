"""Changes of mind that a planner block obeys in time: it turns round, stops and comes back soon."""

import numpy as np
import pytest
from driven_block import CYCLE, Driver
from exporters.counted_block import CountedBlock, compile_counting
from generator.planned_machines import HOIST

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import parse_spec, preset_spec

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def text():
    return planner_block(preset_spec("bay-crane")).text


def last_motion(driver):
    """Cycles until it ends, and the time that was stated to be left in each of them."""
    out = driver.parts[-1]
    cycles = np.flatnonzero(out["fVelocity"])[-1] + 1
    return cycles, out["fTimeToGo"][:cycles]


TURNS = [  # rope in m, targets and for how long, and the latest time for the last one
    (7.0, ((27.0, 4.3), (13.0, 27.5))),
    (4.0, ((7.0, 5.0), (19.0, 14.0))),
    (6.0, ((5.0, 7.1), (24.0, 23.5))),
    (6.0, ((23.0, 5.6), (27.0, 1.5), (11.0, 23.5))),
]


@pytest.mark.parametrize(("rope", "targets"), TURNS)
def test_an_axis_that_must_turn_round_is_at_its_target_soon(text, rope, targets):
    driver = Driver(text, fActPosition=20.0, fL1=rope, fm2=2000.0).hold(5.0)
    for target, seconds in targets:
        driver.hold(CYCLE, bExecute=0).hold(seconds - CYCLE, bExecute=1, fTarget=target)
    assert driver.parts[-1]["bDone"][-1]


def test_a_far_target_is_not_put_off_by_what_changes_of_mind_have_left(text):
    """A motion that makes up for it took 36 s."""
    late = {"rOverride": 1.0, "fVelocityLimit": 0.6312414434101448, "bStop": 0}
    changes = [  # s, and what is commanded until then
        (1.6110779920588576, {"fTarget": 0.0, "rOverride": 0.31238805813635534, "fVelocityLimit": 0.0}),
        (
            3.158078421562987,
            {"fTarget": 19.819994912833945, "rOverride": 1.0, "fVelocityLimit": 0.7463459959705742},
        ),
        (4.901992312914609, {"fTarget": 16.43971149936375, "fVelocityLimit": 0.0}),
        (8.191219783043351, {"fTarget": 50.0}),
        (8.354364007930203, {"fTarget": 16.43971149936375}),
        (8.372084920538136, {"fTarget": 5.374800143621514, **late}),
        (8.389805833146069, {"bStop": 1}),
        (11.81031891066055, {"fTarget": 5.374800143621514, **late}),
        (43.20294726069968, {"fTarget": 9.747955815891155, "fVelocityLimit": 0.9662829944619734}),
        (90.0, {"fTarget": 26.392674259103607, "fVelocityLimit": 0.0}),
    ]
    driver = Driver(text, fActPosition=14.025363383213625, fL1=5.874267673779331, fm2=934.6799598612181)
    start = 0.2826781745336678
    driver.hold(start)
    for ends, inputs in changes:
        driver.hold(CYCLE, bExecute=0, **inputs).hold(ends - start - CYCLE, bExecute=1)
        start = ends
    cycles, _ = last_motion(driver)
    assert cycles * CYCLE < 30.0
    assert driver.parts[-1]["bDone"][-1]


@pytest.mark.parametrize("seconds", [0.6, 1.5, 3.0])
def test_a_slow_drive_stops_soon_after_it_has_begun_to_speed_up(seconds):
    """A search in too few slots that came too late was begun again with fewer: 12.2 s from 0.21 m/s."""
    changes = ["export.cycle_time=0.01", "robustness.uncertain={L0=0.02}"]
    slow = ["limits.velocity=2.0", "limits.acceleration=0.2", "limits.travel=[0.0, 60.0]"]
    block = BlockInstance(planner_block(parse_spec(HOIST, [*changes, *slow])).text)
    given = block.inputs | {"bEnable": 1.0, "fActPosition": 18.0, "fhoist": 0.5024, "fTarget": 25.3}
    block.call(np.tile([*given.values()], (1500, 1)))
    given["bExecute"] = 1.0
    block.call(np.tile([*given.values()], (round(100 * seconds), 1)))
    given["bStop"] = 1.0
    out = block.call(np.tile([*given.values()], (800, 1)))
    assert not out[-1, block.outputs.index("bBusy")]


@pytest.mark.parametrize(
    ("rope", "load", "stick"),
    [
        (8.65, 1983.0, [(0.68, 0.61), (1.1, 8.43), (-1.1, 3.27)]),  # 0.43 m
        (7.7, 946.0, [(-1.1, 8.12), (1.1, 0.66), (-1.1, 0.51)]),  # 0.22 m
        (6.51, 1597.0, [(-1.1, 2.33), (-1.0, 0.63), (0.87, 0.65)]),  # 0.62 m
    ],
)
def test_a_stick_that_was_let_go_of_leads_nowhere_beyond_the_ends_stated_then(text, rope, load, stick):
    """They were those of a stop; a stick's stop was planned twice, and farther, or led beyond them."""
    driver = Driver(text, fActPosition=20.0, fL1=rope, fm2=load).hold(4.0)
    for velocity, seconds in stick:
        driver.hold(seconds, bVelocity=1, fVelocityCommand=velocity)
    before = driver.parts[-1]["fPosition"][-1]
    driver.hold(30.0, bVelocity=1, fVelocityCommand=0.0)
    place, low, high = (driver.parts[-1][name] for name in ("fPosition", "fStopLow", "fStopHigh"))
    acted = slice(round(0.4 / CYCLE), None)  # the slot in which it was let go of, and a little
    lowest, highest = (most.accumulate(place[::-1])[::-1] for most in (np.minimum, np.maximum))
    assert (low[acted] - 1e-9 <= lowest[acted]).all()
    assert (highest[acted] <= high[acted] + 1e-9).all()
    assert np.abs(place - before).max() > 0.1


def test_an_axis_beyond_its_travel_comes_back_though_there_is_no_room_to_damp():
    """The load was swung by the hand that moved the axis there: it stood for 33 s, or for good."""
    changes = ["planner.live_rate={L1=0.2}", "check.residual_sway=0.02"]
    block = CountedBlock(
        compile_counting(planner_block(preset_spec("bay-crane", changes)).text),
        **{"fActPosition": 41.0, "fL1": 6.0, "fm2": 100.0},
    )
    block.hold(500)
    block.hold(1, bEnable=0.0)
    speeds = 0.2 * np.sin(np.linspace(0.0, np.pi, 251))
    places = 41.0 + CYCLE * np.cumsum(0.5 * (speeds[1:] + speeds[:-1]))
    for place, speed in zip(places, speeds[1:], strict=True):
        block.hold(1, fActPosition=place, fActVelocity=speed)
    block.hold(10, bEnable=1.0, fActVelocity=0.0)
    moved = block.hold(2500, bExecute=1.0, fTarget=20.0)["fPosition"]
    assert moved[-1] < places[-1] - 0.5


def test_a_stick_that_trembles_is_followed(text):
    driver = Driver(text, fActPosition=10.0).hold(2.0).hold(0.1, bVelocity=1)
    for number in range(700):
        speed = min(1.0, 0.01 * number) * (1.0 + 0.05 * (-1) ** number)
        driver.hold(3 * CYCLE, fVelocityCommand=speed)
    assert driver.parts[-1]["fVelocity"][-1] > 0.9


def test_a_far_target_that_is_corrected_does_not_slow_the_axis(text):
    """What swings behind the ramp turns against the decline, and the speed stays as it is."""
    driver = Driver(text, fActPosition=3.0).hold(2.0).hold(9.0, bExecute=1, fTarget=38.0)
    speed = driver.hold(CYCLE, bExecute=0).parts[-1]["fVelocity"][-1]
    corrected = driver.hold(60.0, bExecute=1, fTarget=37.2).parts[-1]
    assert corrected["fVelocity"][corrected["fPosition"] < 29.0].min() > 0.9 * speed > 0.5
    assert corrected["bDone"][-1] and corrected["fPosition"][-1] == 37.2


def test_the_slowest_speed_of_a_stick_moves_the_axis(text):
    driver = Driver(text, fActPosition=10.0).hold(2.0).hold(0.1, bVelocity=1)
    slowly = driver.hold(20.0, fVelocityCommand=1.1e-4).parts[-1]["fVelocity"]
    assert slowly[-1] == pytest.approx(1.1e-4)
