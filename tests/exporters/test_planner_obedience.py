"""A planner block does what is commanded: soon, no more than that, and says so truly."""

import numpy as np
import pytest
from command_line import run_here
from counted_block import CountedBlock, compile_counting
from driven_block import CYCLE, Driver, require_limits
from generator.planned_machines import swing

import gen_profile as gp
from gen_profile.planner import commands
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import SpecError

pytestmark = pytest.mark.slow

SPEC = preset_spec("bay-crane")
ZONED = preset_spec("bay-crane", ["planner.zones=true"])
LIMITS = (1.1, 0.3, 1.5, 40.0)
NAN = float("nan")


@pytest.fixture(scope="module")
def text():
    return planner_block(SPEC).text


@pytest.fixture(scope="module")
def hoisting():
    return planner_block(preset_spec("bay-crane", ["planner.live_rate={L1=0.1}"])).text


def standing(text, place, **inputs):
    return Driver(text, fActPosition=place, **inputs).hold(2.0)


def last(driver, name):
    return driver.parts[-1][name][-1]


def require_within(driver, start):
    """Hold everything that a driver issued from a cycle on to the ends that were stated before it."""
    out = driver.outputs
    stated = {name: out[name][start - 1] for name in ("fPosition", "fStopLow", "fStopHigh", "fStopDistance")}
    way = out["fPosition"][start:]
    assert stated["fStopLow"] - 1e-9 <= way.min() <= way.max() <= stated["fStopHigh"] + 1e-9
    assert np.abs(way - stated["fPosition"]).max() <= stated["fStopDistance"] + 1e-9
    return stated


def test_a_target_where_it_stands_drops_the_plan_for_one_that_was_given_just_before(text):
    driver = standing(text, 10.0).hold(2 * CYCLE, bExecute=1, fTarget=10.03).hold(CYCLE, bExecute=0)
    out = driver.hold(2.0, bExecute=1, fTarget=10.0).outputs
    assert not out["fVelocity"].any()
    assert last(driver, "bDone") and not last(driver, "bBusy")


def test_a_stop_while_turning_round_passes_no_end_that_was_stated(text):
    """From 0.6 m/s forwards it runs 0.8 m on, to rest a few millimetres away."""
    driver = (
        standing(text, 10.0).hold(10.0, bVelocity=1, fVelocityCommand=1.1).hold(3.1, fVelocityCommand=-1.1)
    )
    assert last(driver, "fVelocity") > 0.4
    start = len(driver.outputs["fPosition"])
    stated = require_within(driver.hold(20.0, bStop=1), start)
    assert 0.7 < stated["fStopDistance"] < 8.0  # to where the stick leads
    assert not last(driver, "bBusy")


@pytest.mark.parametrize(("away", "back"), [(2.0, 0.8), (3.0, 1.2), (4.0, 0.8)])
def test_a_stop_comes_soon_where_the_axis_is_to_turn_round_anyway(text, away, back):
    """It took 13 to 15 s, as the stop was sought that ends farthest ahead of where the motion would end."""
    driver = standing(text, 17.0, fL1=6.0, fm2=2000.0)
    driver.hold(away, bExecute=1, fTarget=2.0).hold(back, bExecute=1, fTarget=19.0).hold(11.0, bStop=1)
    assert (last(driver, "bBusy"), last(driver, "fVelocity")) == (0, 0.0)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["text", "hoisting"])
def test_no_stop_passes_the_ends_that_were_stated(request, kind, seed):
    """Not even where the load is calmed afterwards, while the rope goes on changing."""
    random = np.random.default_rng(seed)
    driver = standing(request.getfixturevalue(kind), random.uniform(0.2, 39.8))
    rope = 6.0

    def hold(seconds, **inputs):
        nonlocal rope
        for _ in range(round(seconds / 0.4)):
            if kind == "hoisting":
                rope = float(np.clip(rope + random.uniform(-0.04, 0.04), 3.0, 9.0))
                ropes = {"fL1": np.linspace(driver.block.inputs["fL1"], rope, 101)[1:]}
                for value in ropes["fL1"]:
                    driver.hold(CYCLE, fL1=value, **inputs)
                    inputs.pop("bExecute", None)
            else:
                driver.hold(0.4, **inputs)
                inputs.pop("bExecute", None)

    for _ in range(5):
        if random.random() < 0.6:
            hold(
                random.uniform(0.4, 12.0), bStop=0, bVelocity=0, bExecute=1, fTarget=random.uniform(0.2, 39.8)
            )
        else:
            hold(random.uniform(0.4, 8.0), bStop=0, bVelocity=1, fVelocityCommand=random.uniform(-1.1, 1.1))
        start = len(driver.outputs["fPosition"])
        hold(random.uniform(1.0, 12.0), bStop=1)
        require_within(driver, start)
    require_limits(driver.outputs, limits=LIMITS)


def test_without_enable_it_guides_nothing_and_then_takes_the_axis_over_where_that_is(text):
    """The drive tripped on the way to 20 m, and stands at 4.5 m."""
    driver = standing(text, 0.0).hold(8.0, bExecute=1, fTarget=20.0)
    assert last(driver, "fVelocity") > 1.0
    tripped = driver.hold(CYCLE, bEnable=0, fActPosition=4.5).parts[-1]
    assert (tripped["bEnabled"][-1], tripped["fPosition"][-1], tripped["bCommandAborted"][-1]) == (0, 4.5, 1)
    driver.hold(1.0).hold(8.0, bEnable=1)
    assert set(driver.parts[-1]["fPosition"]) == {4.5}
    assert last(driver, "nPromise") == 2  # it is not known how the load swings
    assert last(driver.hold(CYCLE, bLoadAtRest=1), "bPromise")


def test_an_axis_that_moves_is_taken_over_with_its_velocity(text):
    driver = Driver(text, bEnable=0.0, fActPosition=5.0, fActVelocity=0.8).hold(1.0)
    taken = driver.hold(6.0, bEnable=1).parts[-1]
    assert taken["fPosition"][0] == pytest.approx(5.0 + 0.8 * CYCLE, abs=1e-5)
    assert taken["fVelocity"][0] == pytest.approx(0.8, abs=1e-4)
    joined = {name: np.concatenate([[before], taken[name]]) for name, before in
              (("fPosition", 5.0), ("fVelocity", 0.8), ("fAcceleration", 0.0))}  # fmt: skip
    require_limits(joined, limits=LIMITS)
    assert (taken["fVelocity"][-1], taken["nPromise"][-1]) == (0.0, 2)
    assert taken["fPosition"][-1] == pytest.approx(taken["fStopHigh"][0])


def test_a_promise_outlives_a_pause_in_which_nothing_moved(text):
    driver = standing(text, 5.0).hold(1.0, bEnable=0)
    assert (last(driver, "bPromise"), last(driver, "nPromise")) == (0, 4)
    assert last(driver.hold(1.0, bEnable=1), "bPromise")
    assert last(driver.hold(1.0, bEnable=0, fActPosition=5.2).hold(1.0, bEnable=1), "nPromise") == 2


@pytest.mark.parametrize(("seconds", "scale", "promise"), [(8.0, 1.0, 1), (3.0, 1.0, 1), (8.0, 1.2, 0)])
def test_what_an_axis_does_by_hand_is_followed_and_calmed(hoisting, seconds, scale, promise):
    """Where the load sways by half a metre, and the axis stands or still moves when it is taken over."""
    driver = standing(hoisting, 5.0)
    time = CYCLE * np.arange(round(seconds / CYCLE))
    velocity = 0.25 * np.clip(np.minimum(time, 6.0 - time), 0.0, 2.0)
    way = scale * CYCLE * np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2.0)])
    for v, x in zip(velocity, 5.0 + way, strict=True):
        driver.hold(CYCLE, bEnable=0, fActPosition=x, fActVelocity=v)
    driver.hold(130.0, bEnable=1, fActPosition=x + CYCLE * v)
    assert (last(driver, "bPromise"), last(driver, "bBusy")) == (promise, 0)
    out = driver.outputs
    acceleration = np.diff(out["fVelocity"], prepend=0.0) / CYCLE  # by hand, too
    times = CYCLE * np.arange(len(acceleration))
    sway = swing(times, acceleration, 350.0, 2000.0, 6.0, 1.5)
    assert sway.max() > 0.5
    assert (sway[:, -2500:].max() < 5e-3) == promise


def test_a_rope_that_is_no_number_at_power_up_divides_nothing_by_zero(hoisting):
    block = BlockInstance(hoisting)  # whose calls fail where the text divides by zero
    given = block.inputs | {"bEnable": 1.0, "fL1": NAN}
    errors = block.call(np.tile([*given.values()], (100, 1)))[:, block.outputs.index("nErrorId")]
    assert np.unique(errors).tolist() == [0.0, 2.0]


def test_the_same_target_again_and_again_changes_nothing(text):
    driver = standing(text, 2.0).hold(4.0, bExecute=1, fTarget=20.0)
    for _ in range(50):
        driver.hold(0.5, bExecute=1, fTarget=8.0)
        assert not driver.parts[-1]["bCommandAborted"][2:].any()
    assert last(driver, "fPosition") == 8.0
    assert driver.outputs["fPosition"].max() <= 8.0 + 1e-9


@pytest.mark.parametrize("every", [0.008, 0.02, 0.06])
def test_targets_that_change_every_few_cycles_are_followed(text, every):
    random = np.random.default_rng(0)
    driver = standing(text, 2.0)
    for _ in range(round(25.0 / every)):
        driver.hold(every, bExecute=1, fTarget=8.0 + random.uniform(-0.5, 0.5))
    assert abs(last(driver, "fPosition") - 8.0) < 0.6
    require_limits(driver.outputs, limits=LIMITS)


@pytest.mark.parametrize(("begin", "step"), [(2.0, 4e-4), (30.0, -4e-4)])
def test_a_target_that_creeps_is_followed(text, begin, step):
    """Half of all cycles bring a new one; the axis is some seconds behind."""
    driver = standing(text, 2.0)
    for number in range(4000):
        driver.hold(2 * CYCLE, bExecute=1, fTarget=begin + step * number)
    assert abs(last(driver, "fPosition") - driver.block.inputs["fTarget"]) < 0.6
    assert last(driver.hold(20.0), "fPosition") == driver.block.inputs["fTarget"]


WRONG = [({"fL1": 9.001}, 2), ({"fm2": NAN}, 2), ({"rOverride": -1.0}, 5), ({"fVelocityLimit": NAN}, 5)]


@pytest.mark.parametrize(("given", "number"), WRONG)
def test_an_input_out_of_range_is_held_for_a_while_and_then_stops_the_command_visibly(text, given, number):
    driver = standing(text, 2.0).hold(6.0, bExecute=1, fTarget=20.0)
    good = {name: driver.block.inputs[name] for name in given}

    def goes_on(seconds, **inputs):  # with bExecute high
        driver.block.inputs |= inputs
        driver.parts.append(driver.block.play_on(round(seconds / CYCLE)))
        return driver.parts[-1]

    goes_on(0.15, **given)
    goes_on(3.0, **good)
    assert not driver.outputs["nErrorId"].any()
    assert driver.outputs["bPromise"][-1]
    goes_on(0.3, **given)
    wrong = goes_on(12.0, **good)
    assert set(wrong["nErrorId"]) == {number}
    assert wrong["bCommandAborted"].all()
    assert (wrong["bBusy"][-1], wrong["fVelocity"][-1]) == (0, 0.0)
    driver.hold(1.0, bExecute=1, fTarget=20.0)  # not before it is acknowledged
    assert last(driver, "bCommandAborted")
    assert last(driver.hold(1.0, bReset=1), "nErrorId") == 0
    assert last(driver.hold(30.0, bReset=0, bExecute=1, fTarget=20.0), "bDone")
    require_limits(driver.outputs, limits=LIMITS)


def test_an_override_of_zero_holds_and_goes_on(text):
    driver = standing(text, 2.0).hold(6.0, bExecute=1, fTarget=20.0)
    driver.block.inputs["rOverride"] = 0.0
    held = driver.block.play_on(5000)
    assert (held["fVelocity"][-1], held["bBusy"][-1], held["nErrorId"].max()) == (0.0, 1, 0)
    driver.block.inputs["rOverride"] = 1.0
    gone = driver.block.play_on(8000)
    assert (gone["fPosition"][-1], gone["bDone"][-1]) == (20.0, 1)


def test_override_and_velocity_limit_act_on_the_motion_of_now_both_ways(text):
    """It takes what the change of velocity takes: a slow period and a half, planning included."""
    driver = standing(text, 2.0).hold(12.0, bExecute=1, fTarget=38.0)
    for name, slow, usual in (("rOverride", 0.3, 1.0), ("fVelocityLimit", 0.33, 0.0)):
        driver.block.inputs[name] = slow
        slowed = driver.block.play_on(2400)["fVelocity"]
        assert np.argmax(slowed <= 0.331) * CYCLE < 9.0
        driver.block.inputs[name] = usual
        if name == "rOverride":
            raised = driver.block.play_on(2400)["fVelocity"]
            assert np.argmax(raised >= 1.09) * CYCLE < 9.0
    end = driver.block.play_on(12_000)
    assert (end["fPosition"][-1], end["bDone"][-1]) == (38.0, 1)


def test_a_command_during_a_stop_is_answered(text):
    driver = standing(text, 2.0).hold(6.0, bExecute=1, fTarget=20.0).hold(1.0, bStop=1)
    assert driver.hold(1.0, bExecute=1, fTarget=5.0).parts[-1]["bCommandAborted"].all()
    assert not last(driver.hold(20.0), "bCommandAborted")


@pytest.mark.parametrize(("velocity", "seconds"), [(1.1, CYCLE), (-1.1, 0.1), (0.05, CYCLE)])
def test_a_tap_of_the_stick_moves_as_far_as_the_stick_says(text, velocity, seconds):
    driver = standing(text, 10.0).hold(0.5, bVelocity=1)
    driver.hold(seconds, fVelocityCommand=velocity).hold(12.0, fVelocityCommand=0.0)
    assert last(driver, "fPosition") == pytest.approx(10.0 + velocity * seconds, abs=1e-9)


@pytest.mark.parametrize(
    ("order", "way"), [({"bStop": 1, "bVelocity": 0}, 0.1), ({"fVelocityCommand": 0.0}, 0.12)]
)
def test_a_slow_stick_has_its_velocity_soon_and_ends_soon(text, order, way):
    """Pulses of 7 s followed it, which ran 0.2 m on."""
    driver = standing(text, 10.0).hold(0.1, bVelocity=1).hold(3.0, fVelocityCommand=0.05)
    assert last(driver, "bInVelocity")
    begin = last(driver, "fPosition")
    driver.hold(4.0, **order)
    assert abs(last(driver, "fVelocity")) < 1e-3
    assert 0.0 < last(driver, "fPosition") - begin < way


def test_a_stick_at_zero_takes_the_axis_from_its_way_to_a_target(text):
    """It went on to the target, 25 m away, since nothing of the stick had changed."""
    driver = standing(text, 2.0).hold(6.0, bExecute=1, fTarget=30.0)
    begin = last(driver, "fPosition")
    driver.hold(7.0, bVelocity=1, fVelocityCommand=0.0)
    assert last(driver, "fVelocity") == 0.0
    assert last(driver, "fPosition") - begin < 4.0


@pytest.mark.parametrize(("begin", "end"), [(40.0, 40.0), (38.0, 40.0), (0.0, 0.0)])
def test_a_stick_turns_a_motion_that_has_just_begun_near_the_end_of_the_travel(text, begin, end):
    """It went on for 20 to 25 s and 7 m, as no plan to the stick's velocity ends within the travel."""
    way = np.sign(end - 20.0)
    driver = standing(text, begin).hold(0.35, bExecute=1, fTarget=20.0)
    out = driver.hold(25.0, bExecute=0, bVelocity=1, fVelocityCommand=way).parts[-1]
    assert 0.0 < CYCLE * np.count_nonzero(way * out["fVelocity"] < 0.0) < 7.0
    assert out["fPosition"][-1] == pytest.approx(end, abs=0.01)
    require_limits(driver.outputs, limits=LIMITS)


@pytest.mark.parametrize("later", [1.0, 1.05])
def test_a_short_reversal_counts_by_its_length_not_by_its_phase(text, later):
    ends = []
    for phase in np.arange(0.0, 0.3, 0.05):
        driver = standing(text, 10.0).hold(6.0 + phase, bVelocity=1, fVelocityCommand=0.5)
        driver.hold(0.06, fVelocityCommand=-0.5).hold(later - phase, fVelocityCommand=0.5)
        ends.append(last(driver.hold(12.0, fVelocityCommand=0.0), "fPosition"))
    assert np.ptp(ends) < 0.01  # two cycles and a half


def test_a_stick_that_is_deflected_at_power_up_counts_once_it_was_at_zero(text):
    driver = Driver(text, fActPosition=10.0, bVelocity=1.0, fVelocityCommand=1.0).hold(5.0)
    assert set(driver.outputs["fPosition"]) == {10.0}
    assert last(driver.hold(0.1, fVelocityCommand=0.0).hold(9.0, fVelocityCommand=1.0), "bInVelocity")


def test_an_axis_that_does_not_follow_is_braked_at_once(text):
    driver = standing(text, 10.0, fFollowingLimit=0.05).hold(4.0, bExecute=1, fTarget=20.0)
    at = np.argmax(driver.outputs["nErrorId"] == 7)
    assert driver.outputs["fPosition"][at] < 10.06
    assert last(driver, "fPosition") < 10.11
    assert (last(driver, "bBusy"), last(driver, "bCommandAborted"), last(driver, "nPromise")) == (0, 1, 2)


def test_from_beyond_its_travel_an_axis_only_comes_back(text):
    driver = standing(text, 45.0).hold(CYCLE, bVelocity=1).hold(10.0, fVelocityCommand=1.0)
    assert driver.outputs["fPosition"].max() <= 45.0 + 1e-9
    assert last(driver.hold(20.0, fVelocityCommand=-0.5), "fPosition") < 40.0
    assert driver.hold(40.0, fVelocityCommand=1.0).parts[-1]["fPosition"].max() <= 40.0 + 1e-9
    straight = standing(text, -2.0).hold(40.0, bExecute=1, fTarget=5.0)
    assert (last(straight, "fPosition"), last(straight, "nErrorId")) == (5.0, 0)


@pytest.mark.parametrize("again", [False, True])
def test_a_damped_machine_obeys_soon_after_it_is_enabled(again):
    """It measured for 2.4 s how far motions go, and got ready only then where it was enabled again."""
    limits = "limits={velocity=3.0, acceleration=10.0, jerk=200.0, travel=[-3.0, 3.0]}"
    joint = planner_block(preset_spec("flexible-joint", [limits])).text
    block = CountedBlock(compile_counting(joint), fActPosition=0.0)
    block.hold(100)
    for enabled in (0.0, 1.0) * again:
        block.hold(100, bEnable=enabled)
    moves = block.hold(1000, bExecute=1.0, fTarget=2.5)["fVelocity"] != 0.0
    assert 0.0 < np.argmax(moves) * 1e-3 < 0.42  # cReaction


@pytest.mark.parametrize(("spike", "seconds"), [(3.0, CYCLE), (9.0, CYCLE), (3.0, 0.18), (9.0, 0.18)])
def test_a_spike_of_a_live_parameter_costs_nothing(text, spike, seconds):
    plain, spiked = standing(text, 2.0), standing(text, 2.0)
    for driver, rope in ((plain, 6.0), (spiked, spike)):
        driver.hold(4.0, bExecute=1, fTarget=20.0).hold(seconds - 2 * CYCLE, fL1=rope, bExecute=0)
        driver.hold(2 * CYCLE, bExecute=1, fTarget=12.0).hold(30.0, fL1=6.0)  # planned for the other rope
    np.testing.assert_array_equal(plain.outputs["fPosition"], spiked.outputs["fPosition"])
    assert spiked.outputs["bPromise"][500:].all()


def test_stated_noise_of_a_live_parameter_keeps_the_promise():
    noisy = planner_block(preset_spec("bay-crane", ["planner.live_noise={L1=0.02}"])).text
    random = np.random.default_rng(0)
    driver = standing(noisy, 2.0)
    for number in range(5000):
        driver.hold(
            CYCLE,
            fL1=6.0 + random.uniform(-0.02, 0.02),
            **({"bExecute": 1, "fTarget": 12.0} if number == 99 else {}),
        )
    assert last(driver, "fPosition") == 12.0
    assert driver.outputs["bPromise"][500:].all()


class TestZones:
    """Intervals of the travel that are closed, or passed slowly."""

    @pytest.fixture
    def planner(self):
        planner = gp.Planner(ZONED, position=5.0)
        planner.hold(2.0)
        planner.restrict(blocked=[(20.0, 24.0)], slow=[(10.0, 14.0, 0.3)])
        return planner

    def test_no_command_leads_in_or_passes_too_fast(self, planner):
        there = planner.hold(60.0, target=19.0)
        assert (there.position[-1], there.done[-1]) == (19.0, True)
        for target in (22.0, 30.0):
            refused = planner.hold(1.0, target=target)
            assert refused.error_id[-1] == 8
            assert (refused.outputs["nZone"][-1], refused.outputs["bCommandAborted"][-1]) == (1, True)
        pushed = planner.hold(30.0, velocity=1.1)
        assert pushed.position.max() <= 20.0 + 1e-9
        assert pushed.position[-1] == pytest.approx(20.0, abs=0.01)
        back = planner.hold(60.0, velocity=-1.1)
        assert back.position[-1] < 0.1
        for part in (there, back):
            within = (part.position > 10.0) & (part.position < 14.0)
            assert within.any()
            assert np.abs(part.velocity[within]).max() <= 0.3 + 1e-9

    def test_one_that_is_set_on_the_way_stops_before_it_or_slows_down(self, planner):
        planner.restrict()
        planner.hold(10.0, target=35.0)
        planner.restrict(slow=[(0.0, 40.0, 0.25)])
        assert np.abs(planner.hold(15.0).velocity[-1000:]).max() <= 0.25 + 1e-9
        planner.restrict(blocked=[(20.0, 24.0)])
        stopped = planner.hold(20.0)
        assert stopped.error_id[-1] == 8
        assert stopped.outputs["bCommandAborted"][-1]
        assert (stopped.velocity[-1], stopped.position[-1] <= 20.0) == (0.0, True)

    @pytest.mark.parametrize("gap", [1.0, 2.0])
    def test_a_stick_back_through_a_slow_one_first_stops_what_leads_away(self, gap):
        """No plan to its velocity passes there; the axis led away for 8.9 s, by up to 5 m."""
        planner = gp.Planner(ZONED, position=16.0)
        planner.hold(2.0)
        planner.restrict(slow=[(13.0 - gap, 16.0 - gap, 0.2)])
        place = planner.hold(2.0, target=35.0).position[-1]
        back = planner.hold(7.0, velocity=-1.0)
        assert back.position.max() < place + 3.1
        assert back.velocity[-1] < 0.0

    def test_a_stick_that_changes_while_it_slows_down_goes_no_faster(self, planner):
        """It held 0.8 m/s, as what was committed was too fast anyway."""
        planner.hold(10.0, velocity=1.0)
        planner.restrict(slow=[(0.0, 40.0, 0.25)])
        planner.hold(1.0, velocity=1.0)
        assert planner.hold(10.0, velocity=0.8).velocity[2000:].max() <= 0.25 + 1e-9

    def test_within_a_blocked_one_an_axis_may_only_leave(self):
        planner = gp.Planner(ZONED, position=22.0)
        planner.restrict(blocked=[(20.0, 24.0)])
        planner.hold(2.0)
        assert planner.hold(20.0, target=23.0).error_id[-1] == 8
        assert planner.hold(30.0, target=30.0).done[-1]
        assert planner.hold(30.0, target=19.0).error_id[-1] == 8

    def test_they_keep_to_the_operations_of_a_cycle(self):
        """All of them in use, where a cycle may spend least."""
        changes = ["planner.zones=true", "planner.events=true", "export.cycle_time=0.001"]
        block = CountedBlock(compile_counting(planner_block(preset_spec("bay-crane", changes)).text))
        for k in range(8):
            block.inputs |= {f"aBlockedLow[{k}]": 30.0 + k, f"aBlockedHigh[{k}]": 30.5 + k}
            slow = {"Low": 1.0 + 3.0 * k, "High": 2.0 + 3.0 * k, "Limit": 0.3}
            block.inputs |= {f"aSlow{name}[{k}]": value for name, value in slow.items()}
        parts = [block.hold(3000)]
        parts += [block.hold(9000, bExecute=1.0, fTarget=target) for target in (19.0, 3.0, 25.0, 10.0)]
        parts += [block.hold(6000, bVelocity=1.0, fVelocityCommand=speed) for speed in (1.1, -1.1)]
        for rope in (6.0, 4.0, 8.0, 5.0):  # a pulse is weighed while modes are found: it took 5990
            parts += [block.hold(500, fVelocityCommand=speed, fL1=rope) for speed in (0.3, -0.2, 0.1)]
        assert max(part["operations"].max() for part in parts) <= 5000
        with pytest.raises(SpecError, match=r"planner\.operations: at least 5000 with zones"):
            planner_block(preset_spec("bay-crane", ["planner.zones=true", "planner.operations=3000"]))

    def test_more_of_them_than_the_block_takes_are_refused(self, planner):
        with pytest.raises(SpecError, match="takes 8 such intervals, found 9"):
            planner.restrict(blocked=[(1.0, 2.0)] * 9)
        with pytest.raises(SpecError, match="slow: must be rows of 3 numbers"):
            planner.restrict(slow=[(1.0, 2.0)])
        with pytest.raises(SpecError, match="blocked, a row: must be a list of numbers"):
            planner.restrict(blocked=(1.0, 2.0))
        for axis in ("cart", False):
            with pytest.raises(SpecError, match=rf"axis: .* found '?{axis}"):
                planner.restrict(axis=axis)
        with pytest.raises(SpecError, match=r"state planner\.zones = true"):
            gp.Planner(SPEC).restrict(slow=[(1.0, 2.0, 0.1)])


def test_events_tell_what_was_commanded_and_what_came_of_it(tmp_path, monkeypatch):
    (tmp_path / "block.st").write_text(planner_block(preset_spec("bay-crane", ["planner.events=true"])).text)
    rows = ["0.5,position,2", "20,position,50", "21,velocity,0.4", "23,quick-stop,"]
    (tmp_path / "commands.csv").write_text("\n".join(["time_s,command,value", *rows]) + "\n")
    played = ("planner", "play", tmp_path / "block.st", "--commands", tmp_path / "commands.csv")
    events = tmp_path / "events.csv"
    assert run_here(*played, "--out", tmp_path / "setpoints.csv", "--events", events).code == 6  # of 50 m
    explained = run_here("planner", "explain", events, "--json").document["events"]
    assert [one["code"] for one in explained if one["time_s"] < 0.45][:2] in ([11, 60], [11, 63])
    later = [one["code"] for one in explained if one["time_s"] > 0.45]
    later[10:12] = sorted(later[10:12])  # of one cycle
    assert later == [21, 32, 12, 11, 70, 20, 53, 41, 50, 22, 12, 34, 42, 20, 13, 62, 11]
    assert next(one for one in explained if one["code"] == 70)["value"] == 2.0
    assert "the target is reached, at 2" in run_here("planner", "explain", events).out
    with monkeypatch.context() as uncompiled:  # else the refusal came after the whole table was played
        uncompiled.setattr(commands, "BlockInstance", lambda _: pytest.fail("compiled"))
        plain = run_here("planner", "play", *write_plain(tmp_path), "--events", events)
    assert (plain.code, "state planner.events = true" in plain.err) == (2, True)
    for wrong in ("1,21,here", "1,inf,0", "1,21", "1,1.5,0", "nan,1,0", "1,21,0,5"):
        events.write_text(f"time_s,code,value\n{wrong}\n")
        refused = run_here("planner", "explain", events)
        assert refused.code == 2 and "line 2: a time, a whole number and a value" in refused.err
        assert "without quotes" not in refused.err


def write_plain(folder):
    """A block without events, and its commands."""
    (folder / "plain.st").write_text(planner_block(SPEC).text)
    return folder / "plain.st", "--commands", folder / "commands.csv", "--out", folder / "plain.csv"
