"""The planner block of machines with several axes, and of axes that turn."""

import csv

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting, require_interpreted
from driven_block import most_operations
from farthest_motion import farthest
from generator.planned_machines import GANTRY
from scipy.integrate import solve_ivp

import gen_profile as gp
from gen_profile.planner.commands import play
from gen_profile.planner.design import planner_block
from gen_profile.planner.interface import BlockAxis, block_axes
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import SpecError
from gen_profile_exporters.planner.c_source import c_files

pytestmark = pytest.mark.slow

CYCLE, ROPE, G = 0.001, 5.0, 9.81
LIMITS = {"x": (1.0, 0.3, 1.0, 0.0, 40.0), "y": (0.5, 0.4, 1.0, 0.0, 12.0)}


@pytest.fixture(scope="module")
def text():
    return planner_block(parse_spec(GANTRY)).text


@pytest.fixture(scope="module")
def counted(text):
    return compile_counting(text)


@pytest.fixture
def block(counted):
    block = CountedBlock(counted, fL=ROPE)
    block.hold(3000)
    return block


def joined(parts):
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def require_limits(out):
    for axis, (velocity, acceleration, jerk, low, high) in LIMITS.items():
        v, a, x = (out[f"{name}_{axis}"] for name in ("fVelocity", "fAcceleration", "fPosition"))
        assert np.abs(v).max() <= velocity + 1e-9
        assert np.abs(a).max() <= acceleration + 1e-9
        assert np.abs(np.diff(a)).max() <= (jerk + 1e-9) * CYCLE
        assert low - 1e-9 <= x.min() <= x.max() <= high + 1e-9
        advance = CYCLE * (v[1:] + v[:-1]) / 2 - CYCLE**2 * np.diff(a) / 12
        assert np.abs(np.diff(x) - advance).max() < 1e-9


def residual(out, rope=ROPE):
    """Amplitude in m/s that the load is left with, in either direction."""
    phasors = np.exp(1j * np.sqrt(G / rope) * CYCLE * np.arange(len(out["bBusy"])))
    return max(np.abs(np.trapezoid(out[f"fAcceleration_{axis}"] * phasors, dx=CYCLE)) for axis in LIMITS)


def random_command(random):
    targets = {f"fTarget_{axis}": random.uniform(low, high) for axis, (*_, low, high) in LIMITS.items()}
    stick = {f"fVelocityCommand_{axis}": random.choice([0.0, random.uniform(-v, v)])
             for axis, (v, *_) in LIMITS.items()}  # fmt: skip
    return [
        {"bVelocity": 0.0, "bStop": 0.0, "bExecute": 1.0, **targets},
        {"bVelocity": 1.0, "bStop": 0.0, **stick},
        {"bVelocity": 0.0, "bStop": 1.0},
    ][random.choice(3, p=[0.4, 0.4, 0.2])]


def test_any_commands_keep_every_limit_and_leave_no_sway(block):
    random = np.random.default_rng(5)
    parts = [block.hold(int(random.integers(40, 5000)), **random_command(random)) for _ in range(120)]
    parts.append(block.hold(40_000, bVelocity=0.0, bStop=1.0))
    out = joined(parts)
    require_limits(out)
    assert out["operations"].max() <= 3000
    assert not out["bBusy"][-1]
    assert out["bPromise"][:80_000].all()  # longer than its three machines are known
    assert residual(out) < 1e-8


@pytest.mark.parametrize("target", [(8.0, 3.0), (1.0, 9.0), (30.0, 0.02)])
def test_all_axes_arrive_together_as_soon_as_the_slowest_can(block, target):
    out = block.hold(60_000, bExecute=1.0, fTarget_x=target[0], fTarget_y=target[1])
    require_limits(out)
    ends = [np.flatnonzero(out[f"fVelocity_{axis}"])[-1] for axis in LIMITS]
    assert ends[0] == ends[1] and np.argmax(out["bDone"]) - ends[0] in (1, 2)
    assert (out["fPosition_x"][-1], out["fPosition_y"][-1]) == target
    for axis, place in zip(LIMITS, target, strict=True):  # with time to spare, none goes beyond
        assert out[f"fPosition_{axis}"].min() > -1e-9 and out[f"fPosition_{axis}"].max() < place + 1.2e-3
    shorter, rate = CYCLE * ends[0] / 1.10, np.sqrt([G / ROPE])
    reached = [farthest(shorter, rate, limits[:3]) for limits in LIMITS.values()]
    assert any(reach < place for reach, place in zip(reached, target, strict=True))
    first_cycles = [np.argmax(out[f"fVelocity_{axis}"] != 0.0) for axis in LIMITS]
    assert first_cycles[0] * CYCLE < 0.2 * 2.0 * np.pi / rate[0]
    together = first_cycles[1] == first_cycles[0]
    assert together or target[1] < 0.1  # a short way beside a long one begins when it has to


@pytest.mark.parametrize(("cycles", "x"), [(6000, 12.0), (8000, 4.0)])
def test_a_new_target_on_the_way_brings_all_axes_to_rest_together(block, cycles, x):
    parts = [block.hold(cycles, bExecute=1.0, fTarget_x=20.0, fTarget_y=2.0)]
    parts.append(block.hold(60_000, bExecute=1.0, fTarget_x=x, fTarget_y=9.0))
    out = joined(parts)
    require_limits(out)
    ends = [np.flatnonzero(out[f"fVelocity_{axis}"])[-1] for axis in LIMITS]
    assert ends[0] == ends[1]
    assert (out["fPosition_x"][-1], out["fPosition_y"][-1]) == (x, 9.0)
    assert residual(out) < 1e-8


def test_an_axis_that_is_where_it_shall_be_stays(block):
    out = block.hold(60_000, bExecute=1.0, fTarget_x=8.0, fTarget_y=0.0)
    assert not out["fVelocity_y"].any()
    assert out["bDone"][-1]


def test_a_quick_stop_brakes_every_axis(block):
    block.hold(5000, bExecute=1.0, fTarget_x=20.0, fTarget_y=9.0)
    out = block.hold(3000, bQuickStop=1.0)
    for axis, (_, acceleration, jerk, *_) in LIMITS.items():
        assert np.abs(out[f"fAcceleration_{axis}"]).max() <= 2 * acceleration + 1e-12
        assert np.abs(np.diff(out[f"fAcceleration_{axis}"])).max() <= (4 * jerk + 1e-9) * CYCLE
        assert out[f"fVelocity_{axis}"][-1] == 0.0
    assert not out["bPromise"][-1]


@pytest.mark.parametrize(
    ("given", "number"),
    [
        ({"bExecute": 1.0, "fTarget_y": 13.0}, 3),
        ({"bVelocity": 1.0, "fVelocityCommand_y": np.nan}, 3),
        ({"fVelocityLimit_y": -1.0}, 5),
    ],
)
def test_a_senseless_input_of_one_axis_stops_all(block, given, number):
    parts = [block.hold(5000, bExecute=1.0, fTarget_x=20.0, fTarget_y=9.0), block.hold(20_000, **given)]
    out = joined(parts)
    assert out["nErrorId"][-1] == number
    assert not out["bBusy"][-1]
    require_limits(out)
    assert residual(out) < 1e-8


def test_it_computes_what_the_text_says(text, counted):
    orders = [
        (60, {}),
        (400, {"bVelocity": 1.0, "fVelocityCommand_x": 0.5, "fVelocityCommand_y": -0.2}),
        (60, {"bVelocity": 0.0, "bExecute": 1.0, "fTarget_x": 0.3, "fTarget_y": 0.1}),
        (5, {"bQuickStop": 1.0}),
    ]
    last = require_interpreted(text, CountedBlock(counted, fL=ROPE), orders)
    assert last["fVelocity_x"] != 0.0


def test_on_the_spherical_pendulum_little_remains_of_both_directions(block):
    """A point mass on a rope, in Cartesian coordinates: what couples the directions remains."""
    out = block.hold(25_000, bExecute=1.0, fTarget_x=8.0, fTarget_y=3.0)
    pushes = np.transpose([out["fAcceleration_x"], out["fAcceleration_y"]])
    times = CYCLE * np.arange(len(pushes))

    def slope(time, state):
        place, speed = state[:3], state[3:]
        push = np.append(pushes[min(int(time / CYCLE), len(pushes) - 1)], 0.0)
        free = np.array([0.0, 0.0, -G]) - push
        pull = (free @ place + speed @ speed) / (place @ place)
        return np.concatenate([speed, free - pull * place])

    begin = [0.0, 0.0, -ROPE, 0.0, 0.0, 0.0]
    found = solve_ivp(slope, (0.0, times[-1]), begin, max_step=0.02, t_eval=times[::10], rtol=1e-7)
    sway = np.hypot(*found.y[:2])
    arrived = np.argmax(out["bDone"]) // 10
    assert sway[arrived:].max() < 2e-3 * sway.max()


COMMANDS = "time_s,command,value_x,value_y,L\n0.5,position,4.0,2.0,4.5\n20,velocity,0.0,-0.3,\n25,stop,,,\n"


def test_play_has_columns_for_every_axis(text):
    rows = list(csv.DictReader(play(text, COMMANDS).table.splitlines()))
    own = [
        f"{axis}_{name}"
        for axis in "xy"
        for name in ("position_m", "velocity_m_per_s", "acceleration_m_per_s2")
    ]
    common = ["busy", "done", "error_id", "promise", "x_stop_distance_m", "y_stop_distance_m"]
    assert list(rows[0]) == ["time_s", *own, *common]
    there = rows[round(20 / CYCLE) - 1]
    assert [float(there[name]) for name in ("x_position_m", "y_position_m", "done")] == [4.0, 2.0, 1.0]
    assert float(rows[-1]["x_position_m"]) == 4.0
    assert float(rows[-1]["y_position_m"]) < 1.5
    with pytest.raises(
        SpecError, match="no column value_y; the first line must name time_s, command, value_x"
    ):
        play(text, "time_s,command,value_x\n0,position,1\n")


def test_from_python_a_number_for_each_axis_takes_the_place_of_one():
    planner = gp.Planner(parse_spec(GANTRY))
    assert planner.axes == ("x", "y")
    planner.hold(3.0)
    moved = planner.hold(20.0, target=(4.0, 2.0))
    assert moved.position.shape == (20_000, 2)
    assert moved.position[-1].tolist() == [4.0, 2.0]
    assert planner.step(velocity=[0.1, -0.1]).stop_distance.tolist() == [0.0, 0.0]
    stick = np.linspace([0.0, 0.0], [0.1, -0.1], 2000)
    assert planner.hold(2.0, velocity=stick).velocity[-1, 1] < 0.0
    with pytest.raises(SpecError, match=r"target: must be a number for each axis \(x, y\), found 3.0"):
        planner.step(target=3.0)
    with pytest.raises(
        SpecError, match=r"\(x, y\), or such a row for each of 250 cycles, found an array \(9, 2"
    ):
        planner.hold(0.25, velocity=np.zeros((9, 2)))


def test_the_c_header_names_the_setpoint_of_each_axis():
    text = planner_block(parse_spec(GANTRY)).text
    header = c_files(text, "gantry")[1].content.decode("ascii")
    assert "then out.fPosition_x and out.fPosition_y are the setpoints. Names" in header


def test_an_axis_that_turns_is_planned_in_rad():
    limits = ["velocity=3.0", "acceleration=20.0", "jerk=800.0", "travel=[-3.0, 3.0]"]
    text = planner_block(preset_spec("flexible-joint", [f"limits.{limit}" for limit in limits])).text
    assert "velocity 3 rad/s, acceleration 20 rad/s2, jerk 800 rad/s3, travel -3 to 3 rad." in text
    assert block_axes(text) == (BlockAxis(name="", unit="rad"),)


def test_short_slots_leave_no_cycle_more_work():
    """Slots of 43 cycles, where a new target comes on the way."""
    text = planner_block(parse_spec(GANTRY, ["export.cycle_time=0.004", "planner.operations=3000"])).text
    block = CountedBlock(compile_counting(text), fL=3.0, fActPosition_x=30.0, fActPosition_y=9.95)
    block.hold(930)
    ways = [(70, 40.0, 8.7), (215, 33.8, 9.7), (6000, 0.0, 0.14)]
    parts = [block.hold(cycles, bExecute=1.0, fTarget_x=x, fTarget_y=y) for cycles, x, y in ways]
    assert max(part["operations"].max() for part in parts) <= 3000
    assert parts[-1]["fVelocity_x"][2200] < -0.1


LEAVES_MUCH = """
plant = { type = "gantry-crane", m = 2000.0, L = 5.0 }
move = { distance = [12.0, 4.0], duration = 16.0 }
robustness = { uncertain = { L = 0.05 } }
check = { residual_sway = 0.05 }
export = { cycle_time = 0.004 }
limits.axis.x = { velocity = 1.2, acceleration = 0.4, jerk = 2.0, travel = [0.0, 40.0] }
limits.axis.y = { velocity = 1.0, acceleration = 0.4, jerk = 2.0, travel = [0.0, 20.0] }
planner = { live = { L = [3.0, 9.0] } }
"""


def test_an_axis_that_has_left_much_moves_on_beside_another():
    """x stood for 92 s while y crept: its share of what may be left was used up, that of y was not."""
    places = {"fActPosition_x": 21.31370246703929, "fActPosition_y": 9.300723183119427}
    block = CountedBlock(compile_counting(planner_block(parse_spec(LEAVES_MUCH)).text), fL=7.519, **places)
    block.hold(500, bEnable=1.0)

    def go(x, y, seconds, override=1.0, limits=(0.0, 0.0)):
        slower = {"rOverride": override, "fVelocityLimit_x": limits[0], "fVelocityLimit_y": limits[1]}
        block.hold(1, bStop=0.0, bVelocity=0.0, bExecute=0.0, **slower)
        return block.hold(round(seconds / 0.004) - 1, bExecute=1.0, fTarget_x=x, fTarget_y=y)

    def stick(x, y, seconds, override=1.0, limits=(0.0, 0.0)):
        slower = {"rOverride": override, "fVelocityLimit_x": limits[0], "fVelocityLimit_y": limits[1]}
        speeds = {"fVelocityCommand_x": x, "fVelocityCommand_y": y}
        block.hold(1, bExecute=0.0, bVelocity=1.0, fVelocityCommand_x=0.0, fVelocityCommand_y=0.0, **slower)
        block.hold(round(seconds / 0.004) - 1, **speeds)

    go(10.42292262255703, 2.745268938513687, 0.349)
    stick(0.51814, -0.79457, 0.398, 0.34)
    block.hold(367, bVelocity=0.0, bStop=1.0, rOverride=0.4019)
    go(38.597, 13.188, 0.942)
    go(3.6911, 1.97157, 15.0, limits=(0.5715, 0.47625))
    go(3.6911, 1.97157, 1.1153, limits=(0.5715, 0.47625))
    go(12.9037, 20.0, 0.3287, limits=(0.36218, 0.3018))
    stick(-1.2, -0.4264, 4.448, limits=(1.09, 0.9086))
    block.hold(386, bVelocity=0.0, bStop=1.0, fVelocityLimit_x=0.3757, fVelocityLimit_y=0.3131)
    go(1.607, 0.0, 40.6, 0.7434)
    out = go(40.0, 4.677, 45.0)
    assert out["fSwayLeft"][0] > 0.026
    assert out["bDone"][-1] and out["bPromise"].all()


def test_a_far_target_is_approached_soon_where_much_is_left():
    """It began 5 s later."""
    places = {"fActPosition_x": 20.527381009898555, "fActPosition_y": -0.6}
    text = planner_block(parse_spec(LEAVES_MUCH)).text
    block = CountedBlock(compile_counting(text), fL=7.237206773782146, **places)

    def stick(x, y, seconds, **inputs):
        speeds = {"fVelocityCommand_x": x, "fVelocityCommand_y": y}
        block.hold(round(seconds / 0.004), bExecute=0.0, bVelocity=1.0, **speeds, **inputs)

    block.hold(69, bEnable=1.0)
    stick(-1.0757211394296429, 0.6290580749480357, 3.128)
    stick(-1.0757211394296429, float("nan"), 0.175)
    stick(-1.0757211394296429, 0.6290580749480357, 0.404)
    stick(0.0, 0.0, 1.239)
    stick(-1.0757211394296429, 0.6290580749480357, 6.96)
    block.hold(340, bVelocity=0.0, bExecute=1.0, fTarget_x=13.912835609271173, fTarget_y=9.930992746004346)
    block.hold(110, rOverride=0.0)
    stick(-1.1867769724950896, 0.7216046025025749, 1.631)
    stick(0.0, 0.0, 0.44)
    stick(0.0, 0.0, 8.517, rOverride=1.0)
    stick(-1.0644461934011693, 1.0, 0.425)
    stick(0.94, 1.0, 57.028, fVelocityLimit_x=0.99268, fVelocityLimit_y=0.82724)
    quick = {"fVelocityLimit_x": 0.0, "fVelocityLimit_y": 0.0}
    out = block.hold(11_500, bVelocity=0.0, bExecute=1.0, fTarget_x=0.0, fTarget_y=2.0, **quick)
    assert out["fSwayLeft"][0] > 0.02
    assert out["bDone"][-1] and out["bPromise"].all()


def test_a_long_way_is_held_against_slow_intervals_in_no_more_operations():
    """All of it was in one cycle: 6 600 operations here, and up to 8 500 of 6 000."""
    changes = [
        *(
            "export.cycle_time=0.01",
            "planner.zones=true",
            "planner.sway_share=0.0",
        ),
        "limits.axis.x={velocity=1.5, acceleration=0.12, jerk=1.0, travel=[0.0, 40.0]}",
        "limits.axis.y={velocity=1.0, acceleration=0.1, jerk=1.0, travel=[0.0, 20.0]}",
    ]
    spec = parse_spec(GANTRY, changes)
    text = planner_block(spec).text
    block = CountedBlock(compile_counting(text), fL=3.0, fActPosition_x=1.0, fActPosition_y=1.0)
    block.hold(1000, bEnable=1.0)
    out = block.hold(4500, bExecute=1.0, fTarget_x=39.0, fTarget_y=19.0)
    assert out["bDone"][-1]
    assert out["operations"].max() <= most_operations(spec)
