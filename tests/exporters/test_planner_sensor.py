"""Planner blocks with a sensor, on a nonlinear crane that nothing of the program had a part in."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.measured_machines import MeasuredCrane, MeasuredGantry, MeasuredJoint, MeasuredTank

from gen_profile.planner.design import planner_block
from gen_profile.planner.sensor import damping_room
from gen_profile.spec.reading import preset_spec

pytestmark = pytest.mark.slow

LIVE = "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}"
SENSOR = 'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}'
SWING = "planner.disturbance={swing={payload=0.5}, settle=12.0}"
GUSTS = SWING.replace("settle", "gust={acceleration=0.1, longest=5.0}, settle")
MEASURED = [LIVE, SENSOR, SWING]
ALLOWED = 0.05  # m
SHORTEST = {3.0: 5.3, 6.0: 5.7, 9.0: 5.9}  # s, of an independent linear programme, at the worst phase
STANDS = 20.0  # m
CYCLE = 0.004
ROUNDING = 1e-9


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", MEASURED)


@pytest.fixture(scope="module")
def compiled(spec):
    return compile_counting(text_of(spec))


def text_of(spec):
    return planner_block(spec).text


def crane(compiled, rope=6.0, *, rope_given=None, **machine):
    found = MeasuredCrane(CountedBlock(compiled), rope, **machine)
    found.inputs |= {"bEnable": 1.0, "fActPosition": STANDS, "fL1": rope_given or rope}
    return found


def require_limits(issued, room=0.0):
    assert issued["operations"].max() <= 12_000
    jerk = np.diff(issued["fAcceleration"]) / CYCLE
    for values, most in ((issued["fVelocity"], 1.1), (issued["fAcceleration"], 0.3), (jerk, 1.5)):
        assert np.abs(values).max() <= most * (1.0 + ROUNDING)
    integral = np.diff(issued["fPosition"]) - 0.5 * CYCLE * (
        issued["fVelocity"][1:] + issued["fVelocity"][:-1]
    )
    assert np.abs(integral).max() <= 1e-7
    if room:
        assert np.abs(issued["fPosition"] - STANDS).max() <= room + ROUNDING


@pytest.mark.parametrize(("rope", "phase"), [(3.0, 0.4), (6.0, 3.5), (9.0, 1.9)])
def test_a_swing_that_nobody_computed_is_damped_in_time(spec, compiled, rope, phase):
    swung = crane(compiled, rope, swing=(0.5, phase))
    issued = swung.run(24.0, noise=0.002, offset=0.005, random=np.random.default_rng(1))
    start = int(np.argmax(issued["bDamping"] > 0.0))
    assert 0 < start * CYCLE < 3.6
    late = np.flatnonzero(np.abs(issued["sway"]) > ALLOWED)[-1]
    assert (late - start) * CYCLE <= 1.35 * SHORTEST[rope]
    require_limits(issued, damping_room(spec))
    assert not issued["fVelocity"][-500:].any()  # at rest, the noise going on
    assert issued["bPromise"][-1] and not issued["bBusy"][-1]
    assert (issued["nPromise"][start : start + 100] == 6.0).all()
    rests = np.flatnonzero(issued["bBusy"])[-1]
    assert (rests - start) * CYCLE <= 2.4 * SHORTEST[rope]  # not for the offset, nor the way home
    apart = np.abs(issued["fSwayEstimated"] - issued["sway"])
    assert apart[-1000:].max() < 0.015
    beyond, used = apart - issued["fSwayUncertainty"], issued["bSensorUsed"] > 0.0
    assert beyond[used].max() <= 0.2 * ALLOWED
    assert beyond[used & (issued["fSwayUncertainty"] < ALLOWED)].max() <= 0.01 * ALLOWED


def test_a_rope_that_is_wrong_an_offset_and_a_late_sensor_leave_little(spec, compiled):
    swung = crane(compiled, 6.3, rope_given=6.0, swing=(0.5, 1.0), load=1000.0)
    swung.inputs["fm2"] = 1000.0
    issued = swung.run(24.0, noise=0.002, offset=0.005, delay=0.15, random=np.random.default_rng(2))
    assert np.abs(issued["sway"][-1500:]).max() < ALLOWED
    require_limits(issued, damping_room(spec))


def test_it_comes_back_to_the_target_and_is_done_then(compiled):
    swung = crane(compiled, swing=(0.3, 0.0))
    swung.run(0.1)
    issued = swung.run(34.0, fTarget=STANDS + 3.0, bExecute=1.0)
    assert issued["bDamping"].any()
    done = issued["bDone"] > 0.0
    assert done[-1] and not (done & (issued["bDamping"] > 0.0)).any()
    assert abs(issued["fPosition"][-1] - STANDS - 3.0) <= 1e-9
    require_limits(issued)


def test_on_the_way_it_is_damped_within_the_limits_and_the_way_takes_little_longer(compiled):
    swung = crane(compiled, swing=(0.5, 0.8))
    swung.run(0.1)
    issued = swung.run(24.0, fTarget=STANDS + 8.0, bExecute=1.0)
    assert (np.abs(issued["fVelocity"][issued["bDamping"] > 0.0]) > 0.5).any()
    assert issued["bDone"][-1] and issued["bPromise"][-1]  # damped at the end only, later than 28 s
    assert np.abs(issued["sway"][-250:]).max() < ALLOWED
    assert issued["fPosition"].max() <= STANDS + 8.0 + 1.25 * 0.5
    require_limits(issued)


SLOWER = {
    "stop": ({"bStop": 1.0}, 0.3),  # it stands, and damps
    "stick": ({"bVelocity": 1.0}, 0.3),
    "override": ({"rOverride": 0.5}, 0.551),
    "limit": ({"fVelocityLimit": 0.55}, 0.551),
}  # and how fast an axis may go 8 s later, in m/s


@pytest.mark.parametrize("name", SLOWER)
def test_while_it_damps_on_the_way_a_stop_and_a_lower_limit_are_obeyed(compiled, name):
    swung = crane(compiled, swing=(0.5, 0.8))
    swung.run(0.1)
    swung.run(8.0, fTarget=1.0, bExecute=1.0)
    assert swung.rows["bDamping"][-1] and swung.rows["fVelocity"][-1] < -0.7
    inputs, most = SLOWER[name]
    issued = swung.run(10.0, **inputs)
    assert np.abs(issued["fVelocity"][-500:]).max() <= most
    require_limits(issued)


@pytest.mark.parametrize("speed", [0.2, -1.1])
def test_a_stick_is_obeyed_though_the_load_swings_and_promises_nothing(compiled, speed):
    swung = crane(compiled, swing=(0.5, 0.8))
    swung.run(2.0)  # it is not damped yet
    begun = len(swung.rows["sway"])
    issued = swung.run(10.0, bVelocity=1.0, fVelocityCommand=speed)
    assert np.abs(issued["fVelocity"][-500:] - speed).max() <= 0.05 * abs(speed)
    assert not issued["bPromise"][begun:].any()
    require_limits(issued)


@pytest.mark.parametrize("quickly", [False, True])
def test_stated_ends_hold_what_damping_takes(compiled, quickly):
    swung, sound = crane(compiled, swing=(0.3, 2.0)), {"noise": 0.002, "random": np.random.default_rng(6)}
    swung.run(0.1, **sound)
    swung.run(8.0 * quickly, **sound, bVelocity=1.0, fVelocityCommand=1.0)
    begun = len(swung.rows["sway"])
    swung.run(0.1, **sound, bVelocity=0.0, bStop=1.0, bQuickStop=float(quickly))
    issued = {name: values[begun:] for name, values in swung.run(20.0, **sound, bQuickStop=0.0).items()}
    assert (
        issued["bDamping"].any() and not (issued["bDamping"] * np.abs(issued["fAcceleration"]) > 0.31).any()
    )
    ahead = issued["fPosition"][::-1]
    lowest, highest = np.minimum.accumulate(ahead)[::-1], np.maximum.accumulate(ahead)[::-1]
    assert np.ptp(ahead) > 0.15
    assert (issued["fStopLow"] <= lowest + ROUNDING).all()
    assert (issued["fStopHigh"] >= highest - ROUNDING).all()


def test_after_a_quick_stop_the_promise_comes_back_by_itself(compiled):
    swung = crane(compiled)
    swung.run(1.0)
    swung.run(5.0, bVelocity=1.0, fVelocityCommand=1.0)
    swung.run(3.0, bQuickStop=1.0, bVelocity=0.0)
    assert swung.rows["nPromise"][-1] == 2.0 or swung.rows["nPromise"][-1] == 6.0
    issued = swung.run(28.0, bQuickStop=0.0)
    dropped = round(9.0 / CYCLE)
    assert np.argmax(issued["bDamping"][dropped:] > 0.0) <= 1
    assert issued["bPromise"][-1]
    assert np.abs(issued["sway"][-1000:]).max() < ALLOWED
    assert np.abs(issued["hook"][-1000:]).max() < ALLOWED  # the fast mode, too


SOUND = (0.0, 8.0)  # values of nSensorFault; 8: it has not shown a motion of the axis yet
FAULTS = {
    1: lambda _, value: None,
    2: lambda _, value: np.nan,
    3: lambda _, value: value + 0.25,
    4: lambda _, value: 0.04,
    6: lambda number, value: value + 0.02 * np.sin(37.0 * number * number),
}


@pytest.mark.parametrize("number", FAULTS)
def test_a_sensor_that_fails_is_left_out_and_the_axis_comes_to_rest(compiled, number):
    swung = crane(compiled, swing=(0.5, 0.5))
    swung.run(5.0)
    assert swung.rows["bDamping"][-1]
    issued = swung.run(8.0, sensor=FAULTS[number])
    assert issued["nSensorFault"][-1] == number and not issued["bSensorUsed"][-1]
    assert not issued["bDamping"][-1] and not issued["fVelocity"][-1]
    assert issued["nPromise"][-1] == 2.0  # so much was left that it is not known how it swings
    require_limits(issued)
    if number == 1:  # news alone is enough then
        assert swung.run(1.0)["nSensorFault"][-1] in SOUND
    else:
        assert swung.run(1.0)["nSensorFault"][-1] == number
        assert swung.run(1.0, bReset=1.0)["nSensorFault"][-1] in SOUND


WORSENING = {
    "reversed": lambda swung: -swung.shown[-26],
    "late": lambda swung: swung.shown[-151],  # 0.6 s, where 0.05 to 0.15 s are stated
    "of twice the scale": lambda swung: 2.0 * swung.shown[-26],
}


@pytest.mark.parametrize("name", WORSENING)
def test_a_sensor_that_becomes_wrong_while_it_damps_makes_little_worse(compiled, name):
    swung, random = crane(compiled, swing=(0.5, 0.5)), np.random.default_rng(7)
    swung.run(4.5, noise=0.002, random=random)
    assert swung.rows["bDamping"][-1]
    issued = swung.run(60.0, sensor=lambda *_: WORSENING[name](swung) + 0.002 * random.standard_normal())
    assert np.abs(issued["sway"]).max() <= 0.5 + 2.0 * 1.25 * 0.5  # as the proof allows
    swings = np.abs(issued["sway"][-2000:]).max()
    assert swings <= ALLOWED or not issued["bPromise"][-1]
    require_limits(issued)


def test_a_target_that_comes_while_it_damps_is_reached(compiled):
    swung, sound = crane(compiled, swing=(0.5, 0.5)), {"noise": 0.002, "random": np.random.default_rng(8)}
    swung.run(5.0, **sound)
    assert swung.rows["bDamping"][-1]
    issued = swung.run(30.0, **sound, fTarget=STANDS - 8.0, bExecute=1.0)
    assert issued["bDone"][-1] and issued["bPromise"][-1] and issued["fPosition"][-1] == STANDS - 8.0
    assert np.abs(issued["sway"][-500:]).max() < ALLOWED
    require_limits(issued)


def test_a_sensor_that_fails_before_it_showed_anything_withdraws_the_promise(compiled):
    swung = crane(compiled, swing=(0.4, 0.5))
    issued = swung.run(2.0, sensor=lambda _, value: np.nan)
    assert issued["nSensorFault"][-1] == 2.0 and issued["nPromise"][-1] == 2.0
    assert not swung.run(0.1, bLoadAtRest=1.0)["nPromise"][-1]  # who knows may say so


def test_a_value_that_stays_the_same_may_hide_a_gust():
    compiled = compile_counting(text_of(preset_spec("bay-crane", [LIVE, SENSOR, GUSTS])))
    swung, sound = crane(compiled), {"noise": 0.002, "random": np.random.default_rng(4)}
    assert swung.run(10.0, **sound)["nPromise"][-1] == 6.0  # nothing has moved yet
    assert swung.run(0.1, **sound, bLoadAtRest=1.0)["bPromise"][-1]
    swung.gust = 0.08
    swung.run(1.2, **sound, bLoadAtRest=0.0)
    swung.gust = 0.0
    swung.run(0.1, **sound)  # which the sensor has hardly shown yet
    issued = swung.run(10.0, sensor=lambda *_: 0.0)
    assert np.abs(issued["sway"][-1000:]).max() > 1.2 * ALLOWED
    assert issued["nPromise"][-1] == 6.0


def test_an_override_of_0_holds_while_the_load_swings(compiled):
    swung = crane(compiled, swing=(0.4, 0.5))
    issued = swung.run(6.0, rOverride=0.0)
    assert not issued["fVelocity"].any() and issued["nPromise"][-1] == 6.0
    assert swung.run(1.0, rOverride=1.0)["bDamping"][-1]


MISREADS = {
    "sign": lambda _, value: -value,
    "scale": lambda _, value: 2.0 * value,
    "dead": lambda number, _: 0.002 * np.sin(37.0 * number * number),
}


@pytest.mark.parametrize("name", MISREADS)
def test_a_sensor_that_misreads_the_axis_s_own_motion_is_noticed_within_it(compiled, name):
    swung = crane(compiled)
    swung.run(6.0, sensor=MISREADS[name])
    issued = swung.run(14.0, sensor=MISREADS[name], fTarget=STANDS + 6.0, bExecute=1.0)
    assert issued["nSensorFault"][-1] in (5.0, 7.0)  # soon after the block was enabled 5 may be first
    assert issued["nPromise"][-1] == 2.0
    assert not issued["bDamping"].any()  # so the load does as without a sensor
    assert np.abs(issued["sway"][-500:]).max() < 1e-3
    require_limits(issued)
    swung.run(0.1, bReset=1.0, bLoadAtRest=1.0)  # repaired
    reset = len(swung.rows["sway"])
    again = swung.run(9.0, bReset=0.0, bExecute=0.0, noise=0.002, random=np.random.default_rng(3))
    assert not again["bDamping"][reset:].any()  # what the fault had left of the estimate is forgotten
    assert again["nSensorFault"][-1] in SOUND and again["bSensorUsed"][-1] and again["bPromise"][-1]


def test_a_rate_sensor_of_the_wrong_sign_is_noticed_on_a_long_rope_as_soon_as_on_a_short_one():
    rate = SENSOR.replace('"angle"', '"rate"').replace("offset=0.005", "offset=0.02")
    compiled = compile_counting(text_of(preset_spec("bay-crane", [LIVE, rate, GUSTS])))
    swung = crane(compiled, 9.0, swing=(0.45, 3.0))
    swung.shows = lambda: swung.state[2]
    sound = {"noise": 0.002, "offset": 0.02, "random": np.random.default_rng(0)}
    swung.run(10.0, **sound)
    issued = swung.run(40.0, **sound, sensor=lambda _, rate: -rate)
    assert issued["nSensorFault"][-1] in (5.0, 7.0)
    assert np.abs(issued["sway"]).max() < 1.6  # and 1.8 where all ropes are judged as one


def test_what_it_shows_of_the_axis_s_own_motion_is_told(compiled):
    for scale in (1.0, 1.3):
        swung = crane(compiled)
        swung.run(6.0)
        issued = swung.run(7.0, sensor=lambda _, value, by=scale: by * value, fTarget=30.0, bExecute=1.0)
        farthest = np.abs(issued["fSensorScale"] - 1.0).max()  # it fades where the axis coasts
        assert abs(farthest - (scale - 1.0)) < 0.07
        assert set(issued["nSensorFault"]) <= {*SOUND} and not issued["nSensorFault"][-1]
        swung.run(20.0, sensor=lambda _, value, by=scale: by * value)
        rested = swung.run(20.0, sensor=lambda _, value, by=scale: by * value)["fSensorScale"][-5000:]
        assert np.ptp(rested) == 0.0 and abs(rested[-1] - scale) < 0.15  # of the last motion, not of the rest


def test_a_sensor_that_was_dead_from_the_start_vouches_for_nothing(compiled):
    """The promise was given, with 355 of 50 mm left after a way of 9.5 m."""
    for seed in range(2):
        random = np.random.default_rng(seed)
        swung = crane(compiled, swing=(0.35, 0.4 + seed))
        dead = {"sensor": lambda _, value, random=random: 0.002 * random.standard_normal()}
        swung.run(8.0, **dead)
        issued = swung.run(40.0, **dead, fTarget=STANDS + 9.5, bExecute=1.0)
        assert np.abs(issued["sway"][-500:]).max() > 2.0 * ALLOWED
        assert not issued["bPromise"][20:].any()  # once it is used
        assert issued["nSensorFault"][-1] != 0.0
        assert not issued["bDamping"].any()


def test_after_disable_and_enable_it_is_damped_at_once_and_promised_again(compiled):
    swung = crane(compiled, swing=(0.4, 1.0))
    swung.run(5.0)
    swung.run(2.0, bEnable=0.0, fActPosition=swung.rows["fPosition"][-1])
    enabled = len(swung.rows["sway"])
    issued = swung.run(20.0, bEnable=1.0)
    assert np.argmax(issued["bDamping"][enabled:] > 0.0) * CYCLE <= 0.05
    assert issued["nPromise"][enabled + 100] == 2.0 and issued["bPromise"][-1]
    assert np.abs(issued["sway"][-1000:]).max() < ALLOWED


def test_what_errors_may_have_left_is_forgotten_once_the_load_was_damped(compiled):
    swung = crane(compiled)
    swung.run(0.5)
    swung.run(5.0, bVelocity=1.0, fVelocityCommand=1.0)
    swung.run(5.0, bVelocity=0.0)
    swung.gust = 0.15
    swung.run(1.5)
    swung.gust = 0.0
    issued = swung.run(9.0)
    (ends,) = np.flatnonzero(np.diff(issued["bDamping"]) < 0.0)
    assert issued["fSwayLeft"][ends - 100] > 0.005
    assert issued["fSwayLeft"][ends + 100] <= 0.27 * ALLOWED  # at which damping ends


JOINT = [
    "limits={velocity=4.0, acceleration=15.0, jerk=400.0, travel=[-3.0, 3.0]}",
    "robustness.uncertain={J=0.05}",
    'planner.sensor={quantity="angle", of="alpha", noise=0.0002, offset=0.001, drop_out=0.05}',
    "planner.sensor.delay=[0.001, 0.003]",
    "planner.disturbance={swing={tip=0.03}, gust={acceleration=3.0, longest=0.5}, settle=1.0}",
]
TANK = [
    "limits={velocity=0.6, acceleration=0.4, jerk=3.0, travel=[-5.0, 5.0]}",
    "robustness.uncertain={h=0.05}",
    "export.cycle_time=0.002",
    'planner.sensor={quantity="sway", of="surface", noise=0.0002, delay=[0.0, 0.01], drop_out=0.2}',
    "planner.disturbance={swing={surface=0.02}, gust={acceleration=0.1, longest=1.5}, settle=4.0}",
]


def test_an_arm_is_damped_by_an_encoder_and_what_swings_at_first_is_no_fault():
    text = text_of(preset_spec("flexible-joint", JOINT))
    compiled = compile_counting(text)
    random, sound = np.random.default_rng(0), {"noise": 0.0002, "offset": -0.001, "delay": 0.002}
    arm = MeasuredJoint(CountedBlock(compiled), inertia=0.003368, swing=(0.03, -0.864))
    arm.run(0.023, **sound, random=random, rOverride=0.67)
    arm.run(0.094, **sound, random=random, bVelocity=1.0, fVelocityCommand=-0.191)
    arm.run(0.04, **sound, random=random, sensor=lambda *_: None)
    moves = arm.run(1.0, **sound, random=random)
    assert {*moves["nSensorFault"]} <= {0.0, 8.0}  # it has not shown a motion yet
    issued = arm.run(2.0, **sound, random=random, fVelocityCommand=0.0)
    assert issued["bDamping"].any() and issued["bPromise"][-1] and not issued["bBusy"][-1]
    assert np.abs(issued["sway"][-500:]).max() < 0.005


def test_a_liquid_is_damped_by_a_level_probe_that_shows_two_modes():
    compiled = compile_counting(text_of(preset_spec("slosh-tank", TANK)))
    random = np.random.default_rng(0)
    tank = MeasuredTank(CountedBlock(compiled), fill=0.26, swing=(0.02, 1.0))
    tank.run(1.0, noise=0.0002, delay=0.005, random=random, fTarget=1.0, bExecute=1.0)
    tank.run(8.0, noise=0.0002, delay=0.005, random=random)
    assert tank.rows["bDone"][-1]
    for tank.gust in (0.1, -0.1, 0.0):
        tank.run(0.4, noise=0.0002, delay=0.005, random=random)
    issued = tank.run(6.0, noise=0.0002, delay=0.005, random=random)
    assert issued["bDamping"][-3000:].any() and issued["bDone"][-1] and issued["bPromise"][-1]
    assert {*issued["nSensorFault"]} <= {0.0, 8.0}
    assert np.abs(issued["sway"][-1000:]).max() < 0.004
    assert np.abs(issued["fSwayEstimated"] - issued["sway"])[-1000:].max() < 0.001


GANTRY = [
    "limits={velocity=1.0, acceleration=0.3, jerk=1.0, travel=[0.0, 40.0]}",
    'planner.sensor={quantity="angle", of=["theta_x", "theta_y"], noise=0.0005}',
    "planner.disturbance={swing={payload-x=0.5, payload-y=0.5}, settle=15.0}",
    "plant.L=3.0",  # a fast swing beside its jerk
    "export.cycle_time=0.02",
    "planner.operations=50000",
]


def test_a_gantry_is_damped_in_both_directions_and_in_one_where_a_sensor_fails():
    compiled = compile_counting(text_of(preset_spec("gantry-crane", GANTRY)))
    gantry, random = MeasuredGantry(CountedBlock(compiled), 3.0, swing=(0.45, -0.3), cycle=0.02), np.random
    gantry.inputs |= {"bEnable": 1.0, "fActPosition_x": 20.0, "fActPosition_y": 10.0}

    def noisy(axis, value):
        return value + 0.0005 * random.default_rng(len(gantry.rows)).standard_normal()

    issued = gantry.run(14.0, noisy)
    for axis in "xy":
        # after 10.2 s: in turn, each axis has half the operations
        assert np.abs(issued[f"sway_{axis}"][-190:]).max() < ALLOWED
        assert np.abs(issued[f"fSwayEstimated_{axis}"] - issued[f"sway_{axis}"])[-190:].max() < 0.01
        assert np.abs(issued[f"fAcceleration_{axis}"]).max() <= 0.3 * (1.0 + ROUNDING)
        assert np.abs(np.diff(issued[f"fAcceleration_{axis}"])).max() <= 0.02 * (1.0 + ROUNDING)
        assert set(issued[f"nSensorFault_{axis}"]) <= {*SOUND} and not issued[f"nSensorFault_{axis}"][-1]
    assert issued["bPromise"][-1]
    gantry.gust = np.array([0.15, 0.0])
    gantry.run(1.5, noisy)
    gantry.gust = np.zeros(2)
    issued = gantry.run(12.0, lambda axis, value: np.nan if axis == "y" else noisy(axis, value))
    assert np.abs(issued["sway_x"][-700:-400]).max() > 1.5 * ALLOWED
    assert np.abs(issued["sway_x"][-250:]).max() < 0.5 * ALLOWED
    assert issued["nSensorFault_y"][-1] == 2.0 and not issued["nSensorFault_x"][-1]
    assert not issued["bPromise"][-1]
    require_exchanged_sensors_told(compiled)


def require_exchanged_sensors_told(compiled):
    """They drove the load to 3.2 m of sway, and the first fault came after up to 105 s."""
    gantry = MeasuredGantry(CountedBlock(compiled), 3.0, swing=(0.45, -0.1), cycle=0.02)
    gantry.inputs |= {"bEnable": 1.0, "fActPosition_x": 20.0, "fActPosition_y": 10.0}

    def exchanged(axis, value):
        noise = 0.0005 * np.random.default_rng(len(gantry.rows)).standard_normal()
        return gantry.shows()["y" if axis == "x" else "x"] + noise

    checked = gantry.run(12.0, exchanged, bSensorCheck=1.0)
    assert not checked["bDamping"].any() and not checked["bPromise"][20:].any()
    issued = gantry.run(90.0, exchanged, bSensorCheck=0.0)
    sways = np.hypot(issued["sway_x"], issued["sway_y"])
    assert sways.max() < 1.75
    assert {*issued["nSensorFault_x"][-50:], *issued["nSensorFault_y"][-50:]} != {0.0}
    assert not issued["bPromise"][-1]
