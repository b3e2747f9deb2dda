"""The planner with a measured load: observer and planner together, on a nonlinear crane of another rope."""

import attrs
import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.measured_machines import MeasuredCrane
from exporters.swinging_crane import Hoist, SwingingCrane

from gen_profile.planner.design import planner_constants
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.followed import motion
from gen_profile_exporters.planner.blocks.measured import observer
from gen_profile_exporters.planner.blocks.sizes import operations

pytestmark = pytest.mark.slow
LIVE = "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}"
SENSOR = 'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}'
SWING = "planner.disturbance={swing={payload=0.5}, settle=12.0}"
ROPE, CYCLE, STANDS = 6.0, 0.004, 20.0
OUTPUTS = {
    "fPosition": "LREAL", "fVelocity": "LREAL", "fAcceleration": "LREAL", "bMoving": "BOOL", "nSpent": "DINT",
    "nProgrammes": "DINT", "fSwayLeft": "LREAL", "bReady": "BOOL",
}  # fmt: skip


def measured_text(constants):
    """Observer and planner, with inputs by the names that the whole block has."""
    outputs = "\n".join(f"{name} : {type_};" for name, type_ in OUTPUTS.items())
    given = "\n".join(f"{name} := planner.{name};" for name in OUTPUTS)
    return f"""{observer(constants, constants.sensor)}
{motion(constants)}
FUNCTION_BLOCK Measured
VAR_INPUT
    bEnable : BOOL; bExecute : BOOL; fTarget : LREAL; bStop : BOOL; fActPosition : LREAL;
    fSensor : LREAL; bSensorValid : BOOL; fSensorAge : LREAL := 0.1;
    fL1 : LREAL := 6.0; fm2 : LREAL := 2000.0;
END_VAR
VAR_OUTPUT
{outputs}
    fSway : LREAL; nFault : DINT; bUsed : BOOL;
END_VAR
VAR
    observer : bay_crane_observer; planner : bay_crane_planner; aLive : ARRAY [0..1] OF LREAL;
    aSwing : ARRAY [0..1] OF LREAL; aSwingRate : ARRAY [0..1] OF LREAL;
    bOn : BOOL; bBegin : BOOL; bWas : BOOL; bNew : BOOL; nCommand : DINT; nBefore : DINT; fGoal : LREAL;
END_VAR
bBegin := bEnable AND NOT bOn;
bOn := bEnable;
aLive[0] := fL1;
aLive[1] := fm2;
observer(bReady := planner.bReady, fVelocity := planner.fVelocity, bNews := bSensorValid, fValue := fSensor,
    fAge := fSensorAge, bLed := TRUE, bMoves := planner.bMoving, bKept := TRUE,
    aLive := aLive, aSwing := aSwing, aSwingRate := aSwingRate);
nBefore := nCommand;
bNew := FALSE;
IF planner.bReady AND (bStop OR (nCommand = 0)) THEN nCommand := 1; END_IF;
IF bExecute AND NOT bWas THEN
    nCommand := 2;
    fGoal := fTarget;
    bNew := TRUE;
END_IF;
bWas := bExecute;
bNew := bNew OR (nCommand <> nBefore);
planner(bBegin := bBegin, bForget := TRUE, fBeginAt := fActPosition,
    nOperations := {operations(constants)} - 400,
    nCommand := nCommand, fGoal := fGoal, bNew := bNew, fLimit := 1.1, fLowest := 0.0, fHighest := 40.0,
    bMeasured := observer.bSees, fSwing := aSwing[0],
    fSwingRate := aSwingRate[0], aLive := aLive);
{given}
fSway := observer.fSway;
nFault := observer.nFault;
bUsed := observer.bUsed;
END_FUNCTION_BLOCK
"""


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", [LIVE, SENSOR, SWING])


@pytest.fixture(scope="module")
def compiled(spec):
    return compile_counting(measured_text(planner_constants(spec)[1]))


def crane(compiled, rope=ROPE, **machine):
    found = MeasuredCrane(CountedBlock(compiled), rope, **machine)
    found.inputs |= {"bEnable": 1.0, "fActPosition": STANDS, "fL1": ROPE}
    return found


@pytest.mark.parametrize("phase", [0.4, 2.0, 3.5, 5.1])
@pytest.mark.parametrize(("rope", "delay"), [(6.0, 0.1), (6.3, 0.15), (5.7, 0.052)])
def test_a_swing_that_nobody_computed_is_damped(spec, compiled, rope, delay, phase):
    swung = crane(compiled, rope, swing=(0.5, phase))
    run = {"noise": 0.002, "offset": 0.005, "delay": delay, "random": np.random.default_rng(1)}
    issued = swung.run(30.0, **run)
    start = int(np.argmax(issued["fVelocity"] != 0.0))
    assert 0 < start * CYCLE < 4.0
    above = np.flatnonzero(np.abs(issued["sway"]) > 0.05)[-1]
    assert (above - start) * CYCLE <= 7.0
    assert np.abs(issued["sway"][-2500:]).max() <= 0.02
    assert np.abs(issued["fPosition"] - STANDS).max() <= 1.25 * 0.5
    assert not issued["fVelocity"][-1500:].any()
    assert issued["operations"].max() <= operations(planner_constants(spec)[1])
    limits = spec.limits.of(0)
    assert np.abs(issued["fAcceleration"]).max() <= limits.acceleration * (1.0 + 1e-9)
    assert np.abs(np.diff(issued["fAcceleration"])).max() / CYCLE <= limits.jerk * (1.0 + 1e-6)


@pytest.mark.parametrize("seconds", [2.0, 5.0])
def test_the_axis_rests_soon_after_a_gust(compiled, seconds):
    blown = crane(compiled)
    run = {"noise": 0.002, "offset": 0.005, "random": np.random.default_rng(4)}
    blown.run(8.0, **run)
    blown.gust = 0.1
    blown.run(seconds, **run)
    blown.gust, number = 0.0, len(blown.rows["fVelocity"])
    after = {name: values[number:] for name, values in blown.run(30.0, **run).items()}
    assert 0 < np.flatnonzero(after["fVelocity"])[-1] * CYCLE <= 8.0
    assert np.abs(after["sway"][-2500:]).max() <= 0.015


@pytest.mark.parametrize("phase", [0.4, 3.5])
def test_a_swing_is_damped_on_the_way_to_a_target_which_is_reached(spec, compiled, phase):
    swung = crane(compiled, swing=(0.5, phase))
    run = {"noise": 0.002, "offset": 0.005, "random": np.random.default_rng(2)}
    swung.run(2.6, **run)
    issued = swung.run(40.0, bExecute=1.0, fTarget=28.0, **run)
    start = round(2.6 / CYCLE)
    rests = np.flatnonzero(issued["bMoving"])[-1]
    assert (rests - start) * CYCLE <= 20.0
    assert issued["fPosition"][-1] == pytest.approx(28.0, abs=1e-9)
    assert np.abs(issued["sway"][-2500:]).max() <= 0.02


def slow_mode(rope, hook=350.0, load=2000.0, sling=1.5):
    """Frequency in rad/s, and sway of hook and load by 1 m of the load."""
    upper, lower = (hook + load) * 9.81 / rope, load * 9.81 / sling
    squares, shapes = np.linalg.eig(
        np.array([[(upper + lower) / hook, -lower / hook], [-lower / load, lower / load]])
    )
    slow = squares.argmin()
    return np.sqrt(squares[slow]), shapes[:, slow] / shapes[1, slow]


@pytest.mark.parametrize("phase", [0.4, 3.5])
@pytest.mark.parametrize("rate", [0.3, -0.3])
def test_a_swing_is_damped_while_the_rope_changes(spec, rate, phase):
    constants = attrs.evolve(planner_constants(spec)[1], rates={"L1": 0.3})
    block = CountedBlock(compile_counting(measured_text(constants)), fActPosition=STANDS, fL1=ROPE)
    random, hoist = np.random.default_rng(3), Hoist(ROPE, (3.0, rate, 2.5))
    swung = SwingingCrane(ROPE)
    frequency, shape = slow_mode(ROPE)
    swung.state[0], swung.state[2] = 0.5 * np.cos(phase) * shape
    swung.state[1] = -np.sqrt(ROPE**2 - swung.state[0] ** 2)
    swung.state[3] = swung.state[1] - np.sqrt(1.5**2 - (swung.state[2] - swung.state[0]) ** 2)
    swung.state[4], swung.state[6] = -0.5 * np.sin(phase) * frequency * shape
    angles, rows, before = [], [], 0.0
    for number in range(round(30.0 / CYCLE)):
        time = number * CYCLE
        angles.append(-np.arctan2(swung.state[0], -swung.state[1]))
        said = angles[-min(26, len(angles))] + 0.005 + 0.002 * random.standard_normal()
        block.inputs |= {"fL1": hoist(time)[0], "fSensor": said, "bSensorValid": 1.0}
        out = block.step()
        ropes = [hoist(time + share * CYCLE) for share in (0.0, 0.5, 1.0)]
        swung.advance(before, out["fAcceleration"], ropes, CYCLE)
        before = out["fAcceleration"]
        rows.append((out["fVelocity"], swung.sway))
    velocity, sway = np.array(rows).T
    start = int(np.argmax(velocity != 0.0))
    above = np.flatnonzero(np.abs(sway) > 0.05)[-1]
    assert (above - start) * CYCLE <= 7.0
    assert np.abs(sway[-2500:]).max() <= 0.02
    assert not velocity[-1000:].any()
