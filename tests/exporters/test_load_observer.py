"""The observer of a measured load, by itself and within the whole block, on a nonlinear crane."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.measured_machines import MeasuredCrane

from gen_profile.planner.design import planner_block, planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.interface import UNPROVEN
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.measured import observer

LIVE = "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}"
SENSOR = 'planner.sensor={quantity="%s", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}'
GUSTS = "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.1, longest=5.0}, settle=12.0}"
CYCLE, ROPE, LOAD = 0.004, 6.0, 2000.0
GIVEN = ("bReady", "fVelocity", "bNews", "fValue", "fAge", "bReset", "bLoadAtRest", "bLed", "bMoves")
SHOWN = ("fSway", "fUncertainty", "bUsed", "nFault", "fScale", "bProven", "bLost", "fOffset")


def text(spec):
    _, constants = planner_constants(spec)
    types = {"b": "BOOL", "f": "LREAL", "n": "DINT"}
    given = "\n".join(f"{name} : {types[name[0]]};" for name in GIVEN)
    shown = "\n".join(f"{name} : {types[name[0]]};" for name in SHOWN)
    handed = ", ".join(f"{name} := {name}" for name in GIVEN)
    copied = "\n".join(f"{name} := observer.{name};" for name in SHOWN)
    return f"""{observer(constants, constants.sensor)}
FUNCTION_BLOCK Called
VAR_INPUT {given} END_VAR
VAR_OUTPUT {shown} END_VAR
VAR
    observer : bay_crane_observer; aLive : ARRAY [0..1] OF LREAL;
    aSwing : ARRAY [0..1] OF LREAL; aSwingRate : ARRAY [0..1] OF LREAL;
END_VAR
aLive[0] := {ROPE!r};
aLive[1] := {LOAD!r};
observer({handed}, bKept := TRUE, aLive := aLive, aSwing := aSwing, aSwingRate := aSwingRate);
{copied}
END_FUNCTION_BLOCK
"""


@pytest.fixture(scope="module", params=["angle", "rate"])
def observed(request):
    """The whole block, and the observer's."""
    spec = preset_spec("bay-crane", [LIVE, SENSOR % request.param, GUSTS])
    return request.param, compile_counting(planner_block(spec).text), text(spec)


def sound(number, value):
    return value


SENSORS = {  # what it says, and the faults that may be found by the end
    "sound": (sound, {0}),
    "silent for a second": (lambda number, value: None if 3000 < number < 3250 else value, {0}),
    "of the other sign": (lambda number, value: -value, {5, 7}),
    "dead": (lambda number, value: 0.001 * (number % 7), {7, 8}),
    "noisy": (lambda number, value: value + (0.1 * (-1.0) ** number if number > 2000 else 0.0), {6}),
    "of no number": (lambda number, value: value if number < 2000 else np.nan, {2}),
    "stuck": (lambda number, value: value if number < 600 else 0.0123, {4}),
}


class Recorded(MeasuredCrane):
    """Keeps what the block was given of the sensor."""

    def __init__(self, *args, quantity, **machine):
        self.quantity, self.given, self.angle = quantity, [], 0.0
        super().__init__(*args, **machine)

    def shows(self):
        if self.quantity == "angle":
            return super().shows()
        return self.state[2]

    def step(self, measured, valid=True, age=None):
        self.given.append((float(valid), measured))
        return super().step(measured, valid, age)


@pytest.mark.slow
@pytest.mark.parametrize("fault", SENSORS)
def test_it_estimates_as_today_s_block_does_and_finds_the_same_faults(observed, fault):
    quantity, compiled, own = observed
    machine = Recorded(CountedBlock(compiled), ROPE, swing=(0.3, 0.7), load=LOAD, quantity=quantity)
    machine.inputs |= {"bEnable": 1.0, "fActPosition": 20.0, "fL1": ROPE, "bSensorCheck": 1.0, "fm2": LOAD}
    run = {"noise": 0.002, "offset": 0.004, "sensor": SENSORS[fault][0]}
    random = np.random.default_rng(1)
    machine.run(8.0, random=random, **run)
    machine.run(12.0, random=random, bExecute=1.0, fTarget=26.0, **run)
    today = machine.run(15.0, random=random, bExecute=0.0, fTarget=20.0, **run)
    velocity = np.r_[0.0, today["fVelocity"][:-1]]
    ready = np.r_[False, today["nPromise"][:-1] != 3.0]
    ready &= np.arange(len(ready)) > 0
    moves = np.r_[False, (today["fVelocity"] != 0.0)[:-1]]
    news, values = np.array(machine.given).T
    n = len(velocity)
    inputs = np.column_stack(
        [ready, velocity, news, values, np.full(n, 0.1), np.zeros(n), np.zeros(n), np.ones(n), moves]
    )
    found = dict(zip(SHOWN, BlockInstance(own).call(inputs.astype(float)).T, strict=True))
    apart = found["nFault"] % UNPROVEN != today["nSensorFault"] % UNPROVEN  # by a period of whole slots
    alike = np.cumsum(apart) == 0
    assert alike.mean() > 0.3
    assert np.allclose(found["fSway"][alike], today["fSwayEstimated"][alike], rtol=0, atol=1e-9)
    assert np.mean(found["nFault"] != today["nSensorFault"]) < 2e-3
    assert found["nFault"][-1] == today["nSensorFault"][-1]
    assert np.mean(found["bUsed"] != today["bSensorUsed"]) < 2e-3
    assert found["fScale"][-1] == pytest.approx(today["fSensorScale"][-1], abs=2e-3)
    assert found["nFault"][-1] in SENSORS[fault][1]
    if fault == "sound":
        assert np.abs(found["fSway"] - today["sway"])[-2000:].max() < 0.02
