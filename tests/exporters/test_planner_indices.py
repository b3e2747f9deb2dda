"""No index of a planner block leaves its array, whatever is commanded; and none of its C form could."""

import ctypes
import subprocess

import numpy as np
import pytest
from system_parts import program as program_of

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import parse_spec
from gen_profile_exporters.planner.c_source import c_files

STACKER = """
name = "stacker"
move = { distance = 20.0, duration = "minimum" }
limits = { velocity = 4.0, acceleration = 0.6, jerk = 2.0, travel = [0.0, 100.0] }
robustness = { uncertain = { m2 = 0.1 } }
check = { residual_sway = 0.005 }
export = { cycle_time = 0.004 }
planner = { live = { m2 = [300.0, 1500.0] }, events = true }
[plant]
type = "mass-spring-chain-2"
m1 = 2500.0
m2 = 1200.0
k1 = 250000.0
k2 = 120000.0
c1 = 300.0
c2 = 150.0
"""
SPEC = parse_spec(STACKER)  # it may take the whole committed future to stop


@pytest.fixture(scope="module")
def text():
    return planner_block(SPEC).text


@pytest.mark.slow
def test_a_decline_that_fills_the_committed_future_is_not_lengthened(text):
    histories = Histories.of(SPEC)
    drawn = Numbering.of(histories, 200, 0)
    with ClosedLoop(SPEC, text, histories) as loop:
        assert loop.run(drawn.history(137)).fault == 0


def random_rows(inputs, random, cycles):
    """Inputs of an operator who knows neither patience nor reason."""
    given, rows = dict(inputs) | {"bEnable": 1.0}, np.empty((cycles, len(inputs)))
    low, high = SPEC.planner.live["m2"]
    begin = 0
    while begin < cycles:
        one = {
            "target": {"bVelocity": 0.0, "bExecute": 1.0, "fTarget": random.uniform(0.0, 100.0)},
            "released": {"bExecute": 0.0},
            "stick": {"bVelocity": 1.0, "fVelocityCommand": random.choice([-4.0, 0.0, 4.0, 1.0])},
            "stop": {"bStop": 1.0 - given["bStop"]},
            "quick": {"bQuickStop": float(random.random() < 0.2)},
            "override": {"rOverride": random.choice([1.0, 0.0, 0.3, np.nan])},
            "limit": {"fVelocityLimit": random.choice([0.0, 0.5, 3.0])},
            "live": {"fm2": random.choice([low, high, random.uniform(low, high)])},
            "enable": {"bEnable": float(random.random() < 0.9)},
            "sound": {"bStop": 0.0, "bQuickStop": 0.0, "rOverride": 1.0, "bEnable": 1.0, "bReset": 1.0},
        }
        given |= one[random.choice([*one, "target", "stick", "stick"])]
        lasts = int(np.exp(random.uniform(0.0, np.log(1500.0))))
        rows[begin : begin + lasts] = list(given.values())
        given["bReset"], begin = 0.0, begin + lasts
    return rows


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_index_leaves_its_array_under_random_commands(text, seed):
    block = BlockInstance(text)  # checked: it raises where one would
    issued = block.call(random_rows(block.inputs, np.random.default_rng(seed), 50_000))
    assert np.ptp(issued[:, block.outputs.index("fPosition")]) > 1.0


@pytest.mark.slow
def test_events_are_kept_where_they_belong_after_two_thousand_million(text):
    block = BlockInstance(text.replace("nEvents : DINT;", "nEvents : DINT := 1999999995;", 1))
    issued = block.call(random_rows(block.inputs, np.random.default_rng(0), 20_000))
    counts = issued[:, block.outputs.index("nEvents")]
    assert counts.max() < 2e9 and 16 < counts[-1] < 1e5


PLACES = """FUNCTION_BLOCK FB_PLACES
VAR_INPUT
    nPlace : DINT;
    fGiven : LREAL;
END_VAR
VAR_OUTPUT
    fPosition : LREAL;
END_VAR
VAR
    aBefore : ARRAY [0..1] OF LREAL;
    aKept : ARRAY [2..5] OF LREAL;
    aBehind : ARRAY [0..1] OF LREAL;
END_VAR
aKept[nPlace] := fGiven;
fPosition := aKept[nPlace];
END_FUNCTION_BLOCK
"""


def test_an_index_of_the_exported_c_touches_no_other_memory_and_is_told(tmp_path):
    for file in c_files(PLACES, "places"):
        (tmp_path / file.filename).write_bytes(file.content)
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsanitize=undefined"]
    command = [program_of("cc", "gcc"), *strict, "-shared", "-fPIC", "places.c", "-o", "places.so"]
    subprocess.run([*command, "-lm"], cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "places.so"))

    class Inputs(ctypes.Structure):
        _fields_ = [("place", ctypes.c_int32), ("given", ctypes.c_double)]

    state, given, issued = (ctypes.c_double * 9)(), Inputs(), ctypes.c_double()
    library.places_init(state, ctypes.byref(given))
    for place in (1, 6, 2**31 - 1, -(2**31) + 2):
        given.place, given.given = place, 7.0
        assert library.places_step(state, ctypes.byref(given), ctypes.byref(issued)) == 1
        assert [*state] == [7.0, 0.0, 0.0, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    for place in range(2, 6):
        given.place, given.given = place, float(place)
        assert library.places_step(state, ctypes.byref(given), ctypes.byref(issued)) == 0
        assert issued.value == place
