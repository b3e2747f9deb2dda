"""Planner blocks of every kind: containers, C, random inputs, and the operations that they may state."""

import ctypes
import re
import subprocess

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from driven_block import BAY
from generator.planned_machines import GANTRY
from system_parts import program
from test_planner_far import STACKER
from test_planner_forms import Exported

from gen_profile.planner.design import planner_block, planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files, read_block
from gen_profile.planner.interface import block_axes, live_inputs
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import SpecError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.planner.blocks.sizes import operations
from gen_profile_exporters.registry import containers
from gen_profile_exporters.st_to_c import translate

SWITCHED = {
    "bExecute": 0.5, "bVelocity": 0.1, "bStop": 0.08, "bPromptStop": 0.3, "bQuickStop": 0.04, "bReset": 0.4,
    "bLoadAtRest": 0.3,
}  # fmt: skip


def random_rows(inputs, cycles, seed):
    """Inputs of random spans of cycles: commands, stops, limits, zones, faults, ropes, another place."""
    draw = np.random.default_rng(seed)
    given, rows, left = inputs | {"bEnable": 1.0}, [], cycles
    while left > 0:
        span = min(left, int(draw.choice([1, 2, 20, 300, 1500])))
        left -= span
        given |= {name: float(draw.random() < share) for name, share in SWITCHED.items()}
        given |= {"bEnable": float(draw.random() > 0.06), "fTarget": round(draw.uniform(-1.0, 21.0), 3)}
        given["fVelocityCommand"] = round(draw.uniform(-1.3, 1.3), 2) * (draw.random() < 0.8)
        given["rOverride"] = 1.0 - round(draw.uniform(-0.1, 1.0), 2) * (draw.random() < 0.15)
        given["fVelocityLimit"] = round(draw.uniform(-0.1, 1.0), 2) * (draw.random() < 0.1)
        given["fFollowingLimit"] = 0.0
        if draw.random() < 0.1:
            given |= {
                "fL1": round(draw.uniform(2.9, 9.0), 2),
                "fActVelocity": round(draw.uniform(-0.5, 0.5), 2),
            }
            given["fActPosition"] = round(draw.uniform(0.0, 20.0), 2)
        if draw.random() < 0.03:
            given["fFollowingLimit"] = 0.5
        if "aSlowLow[0]" in inputs and draw.random() < 0.1:
            low = round(draw.uniform(0.0, 20.0), 2)
            kind = draw.choice(["Slow", "Blocked"])
            given |= {f"a{kind}Low[1]": low, f"a{kind}High[1]": low + draw.choice([-1.0, 1.0, 2.5])}
            given["aSlowLimit[1]"] = round(draw.uniform(0.05, 0.5), 2)
        if "fSensor" in inputs:
            given |= {
                "fSensor": round(draw.uniform(-0.1, 0.1), 3),
                "fSensorAge": round(draw.uniform(0.0, 0.2), 2),
            }
            given |= {"bSensorValid": float(draw.random() > 0.1), "bSensorCheck": float(draw.random() < 0.1)}
        row = np.array([given[name] for name in inputs])
        if draw.random() < 0.03:
            row[draw.choice([k for k, name in enumerate(inputs) if name[0] != "b" and name[0] != "n"])] = (
                np.nan
            )
        rows.append(np.tile(row, (span, 1)))
    return np.concatenate(rows)


MEASURED = [
    "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}",
    'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}',
    "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.1, longest=5.0}, settle=12.0}",
]
KINDS = {
    "zones": ["planner.zones=true", "planner.events=true"],
    "a rope that changes on the way": ["planner.live_rate={L1=0.1}", "planner.events=true"],
    "a load that is measured": [*MEASURED, "planner.events=true"],
    "numbers as variables": ['export.plc_tables="variables"', "planner.zones=true"],
}


# quick ones have every text but two of the motions within
QUICKLY = [
    pytest.param(kind, marks=() if kind in {"zones", "numbers as variables"} else pytest.mark.slow)
    for kind in KINDS
]


@pytest.fixture(scope="module", params=QUICKLY)
def spec(request):
    return preset_spec("bay-crane", KINDS[request.param])


@pytest.fixture(scope="module")
def block(spec):
    return planner_block(spec)


@pytest.mark.parametrize("format_", containers())
def test_every_container_reads_back_as_the_same_blocks(spec, block, format_, tmp_path):
    files = block_files(block, spec, [format_])
    for file in files:
        (tmp_path / file.filename).write_bytes(file.content)
    source = parse_function_block(block.text)
    assert len(source.within) >= 6
    assert parse_function_block(read_block(tmp_path / files[0].filename)).program() == source.program()


def test_nothing_is_negated_that_strucpp_takes_for_a_number(block):
    """It takes two comparisons that are joined for one, and negates flags only."""
    text = re.sub(r"(?s)\(\*.*?\*\)", "", block.text)
    for found in re.finditer(r"\bNOT \(", text):
        end, depth = found.end(), 1
        while depth:
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        assert len(re.findall(r" (?:<>|[<>]=?|=) ", text[found.end() : end])) <= 1, text[found.start() : end]


@pytest.mark.slow
def test_exported_c_issues_the_same_bits_without_a_warning(spec, block, tmp_path):
    files = [tmp_path / file.filename for file in block_files(block, spec, ["c"])]
    for path, file in zip(files, block_files(block, spec, ["c"]), strict=True):
        path.write_bytes(file.content)
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC"]
    subprocess.run([program("cc", "gcc"), *strict, files[0], "-o", tmp_path / "c.so", "-lm"], check=True)
    oracle = BlockInstance(block.text)
    exported = Exported(translate(block.text), ctypes.CDLL(tmp_path / "c.so"), "bay_crane")
    rows = random_rows(oracle.inputs, 20_000, seed=5)
    assert np.array_equal([exported.call(row) for row in rows.tolist()], oracle.call(rows))


def test_its_inputs_for_live_parameters_are_found(block):
    inputs = [
        one.name
        for one in parse_function_block(block.text).variables
        if one.section == "VAR_INPUT" and "[" not in one.type
    ]
    assert live_inputs(inputs, block_axes(block.text)) == {"L1": "fL1", "m2": "fm2"}


@pytest.mark.slow
@pytest.mark.parametrize("rope", [{}, {"fL1": 5.5}], ids=["that stays", "that comes with it"])
@pytest.mark.parametrize("changes", [[], ["robustness.uncertain={L1=0.05}"]], ids=["no errors", "errors"])
def test_a_target_from_rest_is_reached_to_the_last_bit(changes, rope):
    block = BlockInstance(planner_block(parse_spec(BAY, changes)).text)
    given = block.inputs | {"fActPosition": 10.0}
    rows = [given] + 100 * [given | {"bEnable": 1.0}]
    rows += 3000 * [given | {"bEnable": 1.0, "bExecute": 1.0, "fTarget": 12.0} | rope]
    issued = block.call(np.array([list(row.values()) for row in rows]))[-1]
    last = dict(zip(block.outputs, issued.tolist(), strict=True))
    assert (last["bDone"], last["fPosition"], last["bPromise"]) == (1.0, 12.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("stops", [{"bStop": 1.0}, {"bVelocity": 1.0}], ids=["stop", "stick let go"])
def test_a_prompt_stop_that_leaves_more_than_is_allowed_withdraws_the_promise_without_stated_errors_too(
    stops,
):
    """After a stick was thrown over; at steadier speeds ten slots more leave no more than a plan may."""
    block = BlockInstance(planner_block(parse_spec(BAY, ["planner.operations=12000"])).text)
    given = block.inputs | {"fActPosition": 20.0, "bEnable": 1.0, "bPromptStop": 1.0}
    rows = 410 * [given]
    for speed in (0.0, 1.0, -1.0):
        rows += (300 if speed else 10) * [given | {"bVelocity": 1.0, "fVelocityCommand": speed}]
    rows += 2500 * [given | stops]
    rows += 8000 * [given | {"bExecute": 1.0, "fTarget": 38.0}]
    issued = block.call(np.array([list(row.values()) for row in rows]))
    promise, speed = (issued[:, block.outputs.index(name)] for name in ("nPromise", "fVelocity"))
    assert promise[1019] == 0.0 and promise[3519] == 5.0 and promise[-1] == 0.0
    assert np.abs(speed[1020:3520]).max() < np.abs(speed[1019]) + 0.12 and not speed[3270:3520].any()


@pytest.mark.slow
@pytest.mark.parametrize("changes", [[], ["planner.live_rate={L1=0.25}"]], ids=["stays", "changes"])
def test_a_cycle_of_a_millisecond_has_operations_enough(changes):
    spec = preset_spec("bay-crane", ["export.cycle_time=0.001", *changes])
    block = CountedBlock(compile_counting(planner_block(spec).text), fActPosition=2.0)
    out = [block.hold(500), block.hold(40_000, bExecute=1.0, fTarget=4.0), block.hold(1)]
    out.append(block.hold(60_000, bExecute=1.0, fTarget=39.0))
    assert [part["fPosition"][-1] for part in (out[1], out[3])] == [4.0, 39.0]
    assert max(part["operations"].max() for part in out) <= operations(planner_constants(spec)[1])


QUICK = [
    "limits={velocity=0.3, acceleration=0.7, jerk=20.0, travel=[0.0, 2.0]}",
    "planner.live={L1=[0.3, 0.6]}",
]


@pytest.mark.parametrize(
    ("preset", "changes"),
    [
        ("mass-spring-chain", QUICK[:1]),
        ("bay-crane", ["planner.live_rate={L1=0.25}", "export.cycle_time=0.001"]),
    ],
    ids=["three modes", "followed"],
)
def test_fewer_operations_than_a_machine_needs_are_refused(preset, changes):
    with pytest.raises(SpecError, match="operations: at least") as refused:
        planner_block(preset_spec(preset, [*changes, "planner.operations=3000"]))
    least = int(re.search(r"at least (\d+)", str(refused.value))[1])
    with pytest.raises(SpecError, match=f"operations: at least {least} for this machine, found {least - 1}"):
        planner_block(preset_spec(preset, [*changes, f"planner.operations={least - 1}"]))
    stated = preset_spec(preset, [*changes, f"planner.operations={least}"])
    assert f"cOperations : DINT := {least};" in planner_block(stated).text
    more = preset_spec(preset, [*changes, f"planner.operations={least + 500}"])
    assert operations(planner_constants(more)[1]) == least + 500


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "changes", "number"),
    [
        # between 4,500 and 6,500 it planned without end: more machines were watched than it could weigh
        *[("bay-crane", [], number) for number in (3000, 4000, 5000, 6000, 7000)],
        ("mass-spring-chain", QUICK[:1], 3197),
        ("paper", QUICK, 3000),
        ("bay-crane", ["planner.live_rate={L1=0.25}"], 5600),
    ],
)
def test_an_axis_moves_with_as_many_operations_as_may_be_stated(preset, changes, number):
    require_moves(preset_spec(preset, [*changes, f"planner.operations={number}"]))


@pytest.mark.slow
@pytest.mark.parametrize("mass", [300.0, 1000.0, 1500.0])
def test_a_drive_that_is_very_slow_beside_the_swing_begins(mass):
    """No decline was found from the speed of the longest ramp, and no ramp to less was tried."""
    damped = [
        "plant.c1=300.0",
        "plant.c2=150.0",
        "robustness.uncertain={m2=0.1}",
        "check.residual_sway=0.005",
    ]
    require_moves(parse_spec(STACKER, damped), fm2=mass)


def require_moves(spec, **given):
    (low, high), top, cycle = spec.limits.travel, spec.limits.velocity, spec.export.cycle_time
    block = CountedBlock(compile_counting(planner_block(spec).text), fActPosition=0.5 * (low + high), **given)
    block.hold(round(2.0 / cycle))
    block.hold(2, bVelocity=1.0)
    assert block.hold(round(12.0 / cycle), fVelocityCommand=0.9 * top)["fVelocity"].max() > 0.2 * top
    out = block.hold(round(60.0 / cycle), bVelocity=0.0, bExecute=1.0, fTarget=0.3 * low + 0.7 * high)
    assert out["bDone"][-1] and out["fPosition"][-1] == 0.3 * low + 0.7 * high
    assert out["operations"].max() <= operations(planner_constants(spec)[1])


@pytest.mark.slow
def test_an_axis_whose_stick_is_at_zero_rests_as_after_a_stop_while_the_other_one_is_led():
    block = BlockInstance(planner_block(parse_spec(GANTRY, ["export.cycle_time=0.004"])).text)
    given = block.inputs | {"bEnable": 1.0, "fActPosition_x": 30.0, "fActPosition_y": 10.0, "fL": 5.0}
    rows = [given] * 500 + [given | {"bExecute": 1.0}] * 75  # both to 0
    rows += [given | {"bVelocity": 1.0, "fVelocityCommand_x": -1.0}] * 3000
    issued = block.call(np.array([list(row.values()) for row in rows]))
    x, y, low, high = (
        issued[575:, block.outputs.index(name)]
        for name in ("fPosition_x", "fPosition_y", "fStopLow_y", "fStopHigh_y")
    )
    assert np.ptp(y[1500:]) == 0.0 and x[-1] < x[0] - 5.0
    assert low[1] - 1e-9 <= y.min() and y.max() <= high[1] + 1e-9
