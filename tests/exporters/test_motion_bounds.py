"""The bounds of the planner's programmes, called alone: places, speeds by the kind of a programme, costs."""

import re

import numpy as np
import pytest

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec

REST, THERE, RAMP, DECLINE, PROMPTLY = range(1, 6)
ARRAYS = ("aLow", "aHigh", "aSlow", "aFast", "aCost")
SLOTS, INSIDE = 64, 5e-4
STANDS = {
    "nSlots": 40, "fLowest": 0.0, "fHighest": 40.0, "fStopLow": 8.0, "fStopHigh": 16.0, "fBegins": 10.0,
    "fStart": 0.0, "fBefore": 0.0, "fRamp": 0.0, "fTop": 1.0, "fFastest": 0.0, "fToward": 0.0, "fUnit": 2.0,
    "fLength": 0.5, "fMostChange": 0.05, "fMostCurve": 0.02,
}  # fmt: skip


@pytest.fixture(scope="module")
def bounds():
    """Give bounds by name, of as many slots as are asked for."""
    text = planner_block(preset_spec("bay-crane")).text
    block = re.search(r"(?s)FUNCTION_BLOCK FB_bay_crane_motion_bounds\n.*?END_FUNCTION_BLOCK\n", text)[0]
    inputs = "".join(f"{name} : LREAL; " for name in STANDS if name != "nSlots")
    outputs = "".join(f"{name} : ARRAY [0..{SLOTS - 1}] OF LREAL; " for name in ARRAYS)
    handed = ", ".join(f"{name} := {name}" for name in ("nKind", "bStops", *STANDS, *ARRAYS))
    called = BlockInstance(f"""{block}
FUNCTION_BLOCK Called
VAR_INPUT nKind : DINT; bStops : BOOL; nSlots : DINT; {inputs} END_VAR
VAR_OUTPUT {outputs} END_VAR
VAR own : FB_bay_crane_motion_bounds; END_VAR
own({handed});
END_FUNCTION_BLOCK
""")

    def found(kind, stops=False, **changes):
        given = STANDS | changes
        issued = called.call(np.array([[kind, stops, *given.values()]], dtype=float))[0].reshape(5, SLOTS)
        return {name: row[: given["nSlots"]] for name, row in zip(ARRAYS, issued, strict=True)}

    return found


def test_places_are_those_of_now_and_of_a_stop_what_it_stated(bounds):
    for stops, low, high in ((False, 0.0, 40.0), (True, 8.0, 16.0)):
        found = bounds(THERE, stops)
        assert np.all(found["aLow"] == (low - 10.0) / 0.5) and np.all(found["aHigh"] == (high - 10.0) / 0.5)
    assert bounds(REST, stops=True, fLowest=9.0)["aLow"][0] == -2.0


def test_speeds_are_those_of_the_kind(bounds):
    moves = {"fStart": 0.4, "fBefore": 0.4, "fFastest": 0.4, "nSlots": 20}
    for kind, slow, fast, changes in (
        (THERE, -1.0, 1.0, {}),
        (THERE, -0.05, 1.0, {"fToward": 3.0}),
        (THERE, -1.0, 0.05, {"fToward": -3.0}),
        (RAMP, 0.38, 0.82, moves | {"fRamp": 1.6}),
        (RAMP, -0.52, 0.42, moves | {"fRamp": -1.0}),
        (RAMP, 0.31, 0.89, moves | {"fRamp": 1.6, "nSlots": 21}),  # more than a period also calms what swings
        (RAMP, -0.02, 0.89, moves | {"fStart": 0.05, "fBefore": 0.05, "fRamp": 1.6, "nSlots": 21}),
        (RAMP, -0.89, 0.02, {"fStart": -0.05, "fBefore": -0.05, "fRamp": -1.6, "nSlots": 21}),
        # led to 0.7 by the change of now
        (RAMP, 0.28, 0.72, {"fStart": 0.5, "fBefore": 0.4, "fRamp": 0.6, "nSlots": 20}),
        (DECLINE, -0.16, 0.82, {"fRamp": 1.6}),
        (DECLINE, -0.82, 0.16, {"fRamp": -1.6}),
        (PROMPTLY, -2 * INSIDE, 0.4 + 2 * INSIDE, moves),
        (PROMPTLY, -0.4 - 2 * INSIDE, 2 * INSIDE, {"fStart": -0.4, "fBefore": -0.4}),
    ):
        found = bounds(kind, **changes)
        assert found["aSlow"] == pytest.approx(slow + INSIDE) and found["aFast"] == pytest.approx(
            fast - INSIDE
        )


def test_a_lower_limit_is_come_to_at_half_the_deceleration_and_no_later(bounds):
    found = bounds(THERE, fStart=0.8, fBefore=0.8, fFastest=0.8, fTop=0.3)
    assert found["aFast"][:2].min() >= 0.8 - INSIDE  # what is fixed leads there
    assert np.diff(found["aFast"]).min() == pytest.approx(-0.025)
    assert found["aFast"][-1] == pytest.approx(0.3 - INSIDE) and np.all(found["aSlow"] == -found["aFast"])
    assert np.all(bounds(PROMPTLY, fStart=0.8, fBefore=0.8, fFastest=0.8, fTop=0.3)["aFast"] > 0.8)
    kept = bounds(THERE, fStart=0.29, fBefore=0.29, fFastest=0.3, fTop=0.3)
    assert np.all(kept["aFast"] == pytest.approx(0.3 - INSIDE))


def test_what_goes_on_costs(bounds):
    assert np.all(bounds(REST, fStart=0.1)["aCost"] == 1.0)
    assert np.all(bounds(REST, fStart=-0.1)["aCost"] == -1.0)
