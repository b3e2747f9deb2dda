"""The planner block, executed: against a strict interpreter, linear programming, and a nonlinear crane."""

import csv

import numpy as np
import pytest
from command_line import run_here
from counted_block import CountedBlock, compile_counting, require_interpreted
from driven_block import (
    ACCELERATION,
    BAY,
    CYCLE,
    HIGH,
    JERK,
    LOW,
    VELOCITY,
    Driver,
    G,
    frequencies,
    most_operations,
    reaction,
    require_limits,
    residual,
)
from farthest_motion import farthest
from scipy.integrate import solve_ivp

from gen_profile.planner.commands import play
from gen_profile.planner.design import planner_block
from gen_profile.planner.machine import frequencies as frequencies_of
from gen_profile.planner.machine import live_modes
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import ExportError, SpecError

pytestmark = pytest.mark.slow

FOLLOWING = ["planner.live_rate={L1=0.25}", "check.residual_sway=0.05"]  # the block that has most to do


@pytest.fixture(scope="module")
def text():
    return planner_block(parse_spec(BAY)).text


ORDERS = [
    (80, {}),
    (160, {"bExecute": 1.0, "fTarget": 3.0}),
    (140, {"bExecute": 1.0, "fTarget": 9.0}),
    (120, {"bVelocity": 1.0, "fVelocityCommand": -0.4, "fL1": 5.95}),
    (20, {"bQuickStop": 1.0}),
]
STICK = [
    (100, {}),
    (200, {"bVelocity": 1.0, "fVelocityCommand": 1.0}),
    (60, {"fVelocityCommand": -0.5}),
    (20, {"bQuickStop": 1.0}),
]
SLOW = ["limits.acceleration=0.05", "export.cycle_time=0.04"]


@pytest.mark.parametrize(("changes", "orders"), [([], ORDERS), (FOLLOWING, ORDERS), (SLOW, STICK)])
def test_it_computes_what_the_text_says(changes, orders):
    text = planner_block(parse_spec(BAY, changes)).text
    last = require_interpreted(text, CountedBlock(compile_counting(text)), orders)
    assert not last["bPromise"]
    assert last["fVelocity"] != 0.0


@pytest.mark.parametrize(
    ("rope", "load", "distance"),
    [(6.0, 2000.0, 1.0), (6.0, 2000.0, 8.0), (4.3, 700.0, 4.0), (9.0, 1500.0, 4.0), (3.0, 2000.0, 36.0)],
)
def test_moves_take_little_longer_than_the_shortest(text, rope, load, distance):
    out = Driver(text, fL1=rope, fm2=load).hold(2.0).hold(50.0, bExecute=1, fTarget=distance).outputs
    duration = np.argmax(out["bDone"]) * CYCLE - 2.0
    require_limits(out)
    assert out["fPosition"][-1] == distance
    limits = (VELOCITY, ACCELERATION, JERK)
    assert farthest(duration / 1.10, frequencies(rope, load), limits) < distance


@pytest.mark.parametrize(
    ("changes", "start", "target", "seconds", "new", "rope", "load"),
    [
        ([], 25.0, 0.5, 10.8, 38.0, 3.3, 784.0),  # behind, at full speed
        (FOLLOWING, 25.0, 0.5, 10.8, 38.0, 3.3, 784.0),
        ([], 18.5, 35.4, 0.12, 12.7, 4.3, 829.0),  # behind, hardly begun
        ([], 16.8, 33.1, 4.8, 26.4, 3.9, 883.0),  # nearer
        ([], 16.8, 33.1, 0.6, 39.0, 3.9, 883.0),  # farther, and not measured yet
    ],
)
def test_a_new_target_is_reached_sooner_than_by_a_stop(changes, start, target, seconds, new, rope, load):
    text = planner_block(parse_spec(BAY, changes)).text

    def moved(*orders):
        driver = Driver(text, fL1=rope, fm2=load, fActPosition=start).hold(2.0)
        driver.hold(seconds, bExecute=1, fTarget=target)
        for given, lasts in orders:
            driver.hold(lasts, **given)
        return driver.outputs

    goal = {"bStop": 0, "bExecute": 1, "fTarget": new}
    out = moved((goal, 80.0))
    stopped = moved(({"bStop": 1}, 80.0))
    standing = max(0.0, np.max(np.flatnonzero(stopped["fVelocity"]), initial=0) * CYCLE - 2.0 - seconds)
    arrived = np.flatnonzero(out["fVelocity"])[-1]
    again = moved(({"bStop": 1}, standing + 0.1), (goal, 80.0))
    assert out["fPosition"][-1] == new
    assert arrived < 1.05 * np.flatnonzero(again["fVelocity"])[-1]
    require_limits(out)
    assert out["operations"].max() <= most_operations(parse_spec(BAY, changes))


@pytest.fixture(scope="module")
def quick():
    spec = parse_spec(BAY, ["export.cycle_time=0.001", *FOLLOWING])
    return planner_block(spec).text, most_operations(spec)


@pytest.fixture(scope="module")
def counted(quick):
    return compile_counting(quick[0])


def test_a_target_from_rest_is_begun_within_the_time_that_the_header_states(quick, counted):
    text, most = quick
    for rope, load in ((3.0, 2000.0), (6.2, 350.0), (9.0, 0.0)):
        block = CountedBlock(counted, fL1=rope, fm2=load)
        worst = block.hold(600)["operations"].max()
        for target in (1.0, 3.0, 8.0, 39.0):
            block.hold(1)
            out = block.hold(60_000, bExecute=1.0, fTarget=target)
            assert 0.001 * np.argmax(out["fVelocity"] != 0.0) <= reaction(text)
            assert out["bDone"][-1]
            worst = max(worst, out["operations"].max())
        assert worst <= most


def test_no_cycle_takes_more_operations_on_the_way_either(quick, counted):
    block = CountedBlock(counted, fL1=5.0)
    out = [block.hold(300), block.hold(9000, bExecute=1.0, fTarget=39.0)]
    for step in range(600):  # hoisting at 0.2 m/s
        command = {"bExecute": 1.0, "fTarget": (3.0, 9.0, 4.0)[step // 200]} if step % 200 == 0 else {}
        out.append(block.hold(20, **command, fL1=5.0 + 0.004 * (step if step < 300 else 600 - step)))
    for _ in range(4):
        out += [block.hold(3000, bExecute=1.0, fTarget=target) for target in (20.0, 30.0, 3.0)]
        out += [block.hold(250, bVelocity=1.0, fVelocityCommand=speed) for speed in (1.0, -1.0, 0.3)]
        out += [block.hold(2500, bVelocity=0.0, fL1=block.inputs["fL1"] + 0.002)]
    assert max(part["operations"].max() for part in out) <= quick[1]


MACHINES = {
    "paper": ["limits.velocity=0.3", "limits.acceleration=0.7", "planner.live={L1=[0.3, 0.6]}"],
    "single-pendulum-crane": [
        "planner.live={hoist=[0.0, 5.0]}",
        "planner.live_rate={hoist=0.1}",
        "plant.c=0.0",
    ],
    "slosh-tank": [],
    "mass-spring-chain": [],  # a step of the search took more than a cycle may spend: it never moved
    "double-pendulum-crane": ["plant.c1=100.0", "plant.c2=200.0"],
}


def test_commands_while_the_hoist_runs_take_no_more_operations():
    limits = "limits.axis.cart={velocity=0.5, acceleration=0.3, jerk=2.0, travel=[-20.0, 20.0]}"
    changes = [limits, "export.cycle_time=0.002"]
    spec = preset_spec("single-pendulum-crane", [*changes, *MACHINES["single-pendulum-crane"]])
    block, random, hoist = (
        CountedBlock(compile_counting(planner_block(spec).text), fhoist=2.5),
        np.random.default_rng(7),
        2.5,
    )
    block.hold(1500)
    for _ in range(20):
        hoist = np.clip(hoist + 0.05 * random.normal(), 0.0, 5.0)
        out = block.hold(
            random.integers(5, 1500), bExecute=1.0, fTarget=random.uniform(-20.0, 20.0), fhoist=hoist
        )
        assert out["operations"].max() <= most_operations(spec)


@pytest.mark.parametrize("preset", MACHINES)
def test_no_machine_takes_more_operations(preset):
    limits = ["velocity=0.5", "acceleration=0.3", "jerk=2.0", "travel=[-20.0, 20.0]"]
    changes = [
        *(f"limits.{limit}" for limit in limits),
        "export.cycle_time=0.002",
        *MACHINES[preset],
    ]
    spec = preset_spec(preset, changes)
    text = planner_block(spec).text
    assert len(text) < 170_000
    library, *_ = compiled = compile_counting(text)
    assert library.size() < 72 * 1024
    block = CountedBlock(compiled, fActPosition=0.0)
    out = [block.hold(2000)]
    out += [block.hold(700, bExecute=1.0, fTarget=target) for target in (5.0, 0.3, 2.0)]
    out += [block.hold(100, bVelocity=1.0, fVelocityCommand=speed) for speed in (0.5, -0.5, 0.2)]
    out.append(block.hold(20_000, bVelocity=0.0))
    out.append(block.hold(20_000, bExecute=1.0, fTarget=-1.0))
    assert out[-1]["bDone"][-1]
    assert max(part["operations"].max() for part in out) <= most_operations(spec)


def test_a_stop_in_a_long_motion_ends_long_before_it(counted):
    block = CountedBlock(counted)
    block.hold(600)
    assert block.hold(6000, bExecute=1.0, fTarget=39.0)["fTimeToGo"][-1] > 30.0
    assert not block.hold(15_000, bStop=1.0)["bBusy"][-1]


def test_a_rope_that_never_stands_still_is_taken_over(counted):
    """Hoisting while the axis stands, and the last digits of an encoder."""
    block = CountedBlock(counted)
    for cycle in range(150):
        block.hold(4, fL1=4.0 + 0.001 * cycle + 1e-6 * (-1) ** cycle)
    out = block.hold(200, bExecute=1.0, fTarget=0.5)
    assert out["fVelocity"][-1] > 0.0


@pytest.mark.parametrize("distance", [1.0, 4.0, 15.0])
def test_damped_modes_are_left_at_rest_too(distance):
    changes = ["plant.c1=100.0", "plant.c2=200.0", "planner.live={}"]
    spec = parse_spec(BAY, changes)
    out = Driver(planner_block(spec).text).hold(2.0).hold(30.0, bExecute=1, fTarget=distance).outputs
    assert out["fPosition"][-1] == distance
    require_limits(out)
    modes = live_modes(spec).interpolant([])
    done = np.argmax(out["bDone"])
    before = CYCLE * (np.arange(done) - done)
    for rate, decay in zip(np.sqrt(np.roots([1.0, -modes[0], modes[1]]))[::-1], modes[2:], strict=True):
        left = np.trapezoid(out["fAcceleration"][:done] * np.exp((decay + 1j * rate) * before), dx=CYCLE)
        assert np.abs(left) < 1e-4 * VELOCITY  # what sampling leaves


def test_played_on_the_nonlinear_crane_it_leaves_a_thousandth_of_the_sway(text):
    out = Driver(text).hold(0.5).hold(15.0, bExecute=1, fTarget=4.0).outputs
    time = CYCLE * np.arange(len(out["fAcceleration"]))
    m1, m2, L1, L2 = 350.0, 2000.0, 6.0, 1.5

    def slope(t, state):
        """Two point masses below a cart, by absolute angles."""
        a, b, da, db = state
        push = np.interp(t, time, out["fAcceleration"])
        mass = [[(m1 + m2) * L1, m2 * L2 * np.cos(a - b)], [L1 * np.cos(a - b), L2]]
        force = [
            (m1 + m2) * (push * np.cos(a) - G * np.sin(a)) - m2 * L2 * db**2 * np.sin(a - b),
            push * np.cos(b) - G * np.sin(b) + L1 * da**2 * np.sin(a - b),
        ]
        return [da, db, *np.linalg.solve(mass, force)]

    swing = solve_ivp(slope, (0.0, time[-1]), np.zeros(4), max_step=0.05, rtol=1e-8, atol=1e-10, t_eval=time)
    sway = np.abs(L1 * np.sin(swing.y[0]) + L2 * np.sin(swing.y[1]))
    arrived = np.argmax(out["bDone"])
    assert sway[arrived:].max() < 1e-3 * sway.max()


def test_a_machine_of_one_mode_without_live_parameters():
    changes = [f"limits.velocity={VELOCITY}", f"limits.acceleration={ACCELERATION}", f"limits.jerk={JERK}"]
    changes += [f"limits.travel=[{LOW}, {HIGH}]", f"export.cycle_time={CYCLE}", "plant.c=0.0"]
    spec = preset_spec("single-pendulum-crane", changes)
    out = Driver(planner_block(spec).text).hold(0.5).hold(15.0, bExecute=1, fTarget=2.0).outputs
    require_limits(out)
    assert out["fPosition"][-1] == 2.0
    rope = spec.plant.parameters["L0"] + spec.move.start[1]
    assert residual(out, np.sqrt([spec.plant.parameters["g"] / rope])) < 1e-8


CHAIN = ["plant.c1=0", "plant.c2=0", "plant.c3=0", "planner.live={m3=[0.8, 1.5]}", "limits.velocity=0.6"]
CHAIN += ["limits.acceleration=1.5", "limits.jerk=20.0", "limits.travel=[-2.0, 2.0]", "check.uncertain={}"]


def test_three_modes_are_left_at_rest_in_little_more_than_the_shortest_time():
    """A chain of three masses whose last is another than the spec's."""
    spec = preset_spec("mass-spring-chain", CHAIN)
    text = planner_block(spec).text
    block = CountedBlock(compile_counting(text), fm3=1.3)
    springs = 100.0 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    rates = np.sqrt(np.linalg.eigvals(springs / [[1.0], [1.0], [1.3]]).real)
    worst = [block.hold(3000)["operations"].max()]
    for target in (0.5, -1.9):
        before = block.hold(1)["fPosition"][0]
        out = block.hold(9000, bExecute=1.0, fTarget=target)
        done = np.argmax(out["bDone"])
        assert out["fPosition"][-1] == target
        assert 0.001 * np.flatnonzero(out["fVelocity"])[0] <= reaction(text)
        phasors = np.exp(1j * np.outer(rates, 1e-3 * np.arange(9000)))
        assert np.abs(np.trapezoid(out["fAcceleration"] * phasors, dx=1e-3)).max() < 1e-7
        assert farthest(1e-3 * done / 1.10, rates, (0.6, 1.5, 20.0)) < abs(target - before)
        worst.append(out["operations"].max())
    stick = [block.hold(400, bVelocity=1.0, fVelocityCommand=speed) for speed in (0.6, -0.6)]
    stopped = block.hold(4000, bVelocity=0.0)
    assert not stopped["bBusy"][-1]
    assert max(worst + [part["operations"].max() for part in (*stick, stopped)]) <= most_operations(spec)


@pytest.mark.parametrize(
    ("given", "number"),
    [
        ({"bExecute": 1.0, "fTarget": np.nan}, 3),
        ({"bExecute": 1.0, "fTarget": HIGH + 0.1}, 3),
        ({"bVelocity": 1.0, "fVelocityCommand": np.nan}, 3),
        ({"fL1": np.nan}, 2),
        ({"fm2": 2001.0}, 2),
        ({"rOverride": -0.1}, 5),
        ({"rOverride": np.nan}, 5),
        ({"fVelocityLimit": -1.0}, 5),
        ({"fCycleTime": 0.002}, 1),
        ({"bVelocity": 1.0, "bExecute": 1.0}, 6),
    ],
)
def test_a_senseless_input_stops_the_axis_without_sway(text, given, number):
    driver = Driver(text).hold(0.5).hold(6.0, bExecute=1, fTarget=20.0).hold(25.0, **given)
    out = driver.outputs
    assert out["nErrorId"][-1] == number
    assert not out["bBusy"][-1]
    assert 0.0 < out["fPosition"][-1] < 19.0
    require_limits(out)
    assert residual(out, frequencies(6.0, 2000.0)) < 1e-8


def test_a_quick_stop_brakes_at_once_and_gives_no_promise(text):
    driver = Driver(text).hold(0.5).hold(6.0, bExecute=1, fTarget=20.0)
    moving = driver.outputs["fVelocity"][-1]
    stopped = driver.hold(4.0, bQuickStop=1).outputs
    late = {name: values[-1000:] for name, values in stopped.items()}
    standing = np.argmax(late["fVelocity"] == 0.0) * CYCLE
    assert standing < moving / (2 * ACCELERATION) + 2 * ACCELERATION / (4 * JERK) + 0.5
    assert np.abs(np.diff(late["fAcceleration"])).max() <= (4 * JERK + 1e-9) * CYCLE
    assert np.abs(late["fAcceleration"]).max() <= 2 * ACCELERATION + 1e-12
    assert not late["bPromise"][-1]
    again = driver.hold(0.1, bQuickStop=0, bEnable=0).hold(0.5, bEnable=1).outputs
    assert again["nPromise"][-1] == 2
    assert driver.hold(0.1, bLoadAtRest=1).outputs["bPromise"][-1]


def test_a_rope_that_changes_on_the_way_ends_the_promise(text):
    """However slowly: the block has taken each step over, and yet sway remains."""
    driver = Driver(text).hold(2.0).hold(2.0, bExecute=1, fTarget=20.0)
    assert driver.outputs["bPromise"][-1]
    for step in range(100):
        driver.hold(0.04, fL1=6.0 + 0.0004 * step)
    assert driver.outputs["nPromise"][-1] == 1
    out = driver.hold(30.0).outputs
    require_limits(out)
    assert out["fPosition"][-1] == 20.0


def test_the_command_line_writes_and_executes_a_block(tmp_path):
    (tmp_path / "bay.toml").write_text(BAY)
    written = run_here("planner", "write", tmp_path / "bay.toml", "--no-check", "--out", tmp_path, "--json")
    assert written.document["modes"] == 2
    commands = tmp_path / "commands.csv"
    commands.write_text("time_s,command,value,L1\n0.5,position,4.0,5.5\n30,velocity,0.5,\n33,stop,,\n")
    out = tmp_path / "setpoints.csv"
    run_here("planner", "play", tmp_path / "bay 3.st", "--commands", commands, "--out", out, "--json")
    rows = list(csv.DictReader(out.read_text().splitlines()))
    columns = "position_m velocity_m_per_s acceleration_m_per_s2 busy done error_id promise stop_distance_m"
    assert list(rows[0]) == ["time_s", *columns.split()]
    assert (
        rows[round(30 / CYCLE) - 1] | {"position_m": "4.0", "done": "1", "promise": "1"}
        == rows[round(30 / CYCLE) - 1]
    )
    assert float(rows[-1]["position_m"]) > 4.5
    assert rows[-1]["velocity_m_per_s"] == "0.0"


@pytest.mark.parametrize(
    ("commands", "words"),
    [
        ("time,command,value\n", "no column time_s"),
        ("time_s,command,value\n", "there is no row"),
        ("time_s,command,value\n0,jump,1\n", "line 2: unknown command 'jump'"),
        ("time_s,command,value\n0,position,far\n", "line 2: value must be a number"),
        ("time_s,command,value\n2,stop,\n1,stop,\n", "line 3: time_s goes back"),
        ("time_s,command,value,L9\n0,stop,,1\n", "no live parameter 'L9'; it has L1, m2"),
    ],
)
def test_a_fault_in_the_commands_is_told_with_its_line_before_anything_is_compiled(
    text, commands, words, monkeypatch
):
    monkeypatch.setattr("gen_profile.planner.commands.BlockInstance", None)
    with pytest.raises(SpecError, match=words):
        play(text, commands)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("FUNCTION_BLOCK x VAR END_VAR y := 1; END_FUNCTION_BLOCK", "y is not declared"),
        (
            "FUNCTION_BLOCK x VAR\n  y : REAL; END_VAR END_FUNCTION_BLOCK",
            "line 2: REAL is neither a type nor a block",
        ),
        ("FUNCTION_BLOCK x VAR", "line 1, column [0-9]+ is not understood"),
        ("FUNCTION_BLOCK x VAR y : DINT; END_VAR y[1] := 1; END_FUNCTION_BLOCK", "y is no array"),
    ],
)
def test_what_is_no_block_is_refused(text, words):
    with pytest.raises(ExportError, match=words):
        play(text, "")


def test_targets_of_cycles_one_after_the_other_are_all_taken(text):
    """The last one holds, though a rising edge needs a cycle without one before it."""
    rows = [f"{0.1 + CYCLE * number},position,{number + 1}" for number in range(4)]
    table = play(text, "\n".join(["time_s,command,value", *rows])).table
    name, last = (line.split(",") for line in (table.splitlines()[0], table.splitlines()[-1]))
    assert float(dict(zip(name, last, strict=True))["position_m"]) == pytest.approx(4.0, abs=1e-9)


def test_an_error_of_the_block_is_told(text):
    """The target lies beyond the travel."""
    assert play(text, "time_s,command,value\n0,position,1e6\n").errors == (3,)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["limits.jerk=0"], "limits.jerk"),
        (["planner.live={L3=[1.0, 2.0]}"], "planner.live.L3: unknown parameter"),
        (["planner.live={L1=[2.0, 1.0]}"], "planner.live.L1: must be two rising numbers"),
        (["planner.quick_stop=0.1"], "planner.quick_stop: must be at least limits.acceleration, "),
        (["export.cycle_time=0.2"], "export.cycle_time: at most"),
        (
            ["planner.live={L1=[3.0, 12.0]}", "plant.m1=200.0", "plant.m2=20000.0", "plant.L2=1.8"],
            r"L1 = 12 m .* 29.8 times .* takes 25 at most; narrow .* such as to L1 = \[3, 7.1\], or",
        ),
        (  # where it is followed
            [
                *("planner.live={L1=[3.0, 12.0]}", "planner.live_rate={L1=0.1}", "check.uncertain={L1=0.01}"),
                *("plant.m1=450.0", "plant.m2=20000.0", "plant.L2=1.8"),
            ],
            "planner.live: at L1 = 12 m the fastest mode has 20 times the frequency .* takes 9 at most",
        ),
        (
            ["planner.live={m1=[0.0, 800.0], m2=[0.0, 5000.0]}", "plant.L2=2.0"],
            r"narrow the ranges, such as to m1 = \[50, 800\], or state",
        ),
        (
            [
                *("planner.live={L1=[1.5, 7.0], m2=[0.0, 5000.0]}", "plant.m1=80.0", "plant.L2=1.2"),
                "robustness.uncertain={L1=0.03}",
            ],
            "near L1 = 1.5 m and m2 = 0 kg two modes .* such as by a least load above 0",
        ),
    ],
)
def test_a_fault_in_the_spec_is_told_with_its_place(changes, words):
    with pytest.raises(SpecError, match=words):
        planner_block(parse_spec(BAY, changes))


def test_modes_of_the_same_frequency_are_found_despite_rounding():
    assert frequencies_of(np.array([2.0, 1.0 + 1e-12])) == pytest.approx([1.0, 1.0])
