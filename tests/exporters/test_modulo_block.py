"""Playback blocks of modulo axes: outputs within it, one motion through all turns."""

import math
import subprocess
import sys
from fractions import Fraction

import attrs
import numpy as np
import pytest
from motions import quintic, target
from playing import checked, column, play, start
from st_interpreter import FunctionBlock
from vendor_axes import VENDORS, PlaybackBench

from gen_profile.planner.execution import BlockInstance
from gen_profile.support.errors import ExportError
from gen_profile_exporters import st_to_c
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.motion_libraries import VELOCITY
from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.axis_wrapper import axis_wrapper
from gen_profile_exporters.playback.library import LibraryEntry, library_source, read_library
from gen_profile_exporters.registry import find_container, find_exporter, require_targets

CYCLE, COUNTS = 0.02, 65536
FOR_LONG = [{}] * 2000
LAYOUTS = ["segments", "samples", "counts"]
MOVES = [(350.0, 1070.0), (10.0, -710.0), (-1090.0, -1081.0), (725.0, 365.0)]  # degrees
RING = {"cycle_time": CYCLE, "unit": "deg", "counts_per_si": COUNTS / (2.0 * np.pi), "modulo": 360.0}


def goal_of(move, layout="segments", tables="constants", **options):
    export = {"plc_layout": layout, "plc_tables": tables}
    return target("hub", start=math.radians(move[0]), export=export, **RING | options)


def motion_of(move, duration=3.0):
    return quintic((math.radians(move[0]), math.radians(move[1])), duration=duration)


def text_of(move, layout="segments", **options):
    return structured_text.block_text(motion_of(move), goal_of(move, layout, **options))


def turn_of(layout):
    return COUNTS if layout == "counts" else 360.0


def hold_within(rows, unwrapped, turn, low=0.0):
    """What is issued is the motion's place within the turn, but for rounding."""
    for row, continuous in zip(rows, unwrapped, strict=True):
        assert low <= row["fposition"] < low + turn
        apart = abs(Fraction(row["fposition"]) - Fraction(continuous)) % Fraction(turn)
        assert min(apart, turn - apart) <= 4 * math.ulp(abs(continuous) + turn)


def run(fb, outputs, inputs):
    """Go on with inputs, one cycle each; the rows, and the continuous positions."""
    rows, places = [outputs], [fb["fUnwrapped"]]
    for given in inputs:
        rows.append(fb.call(**given))
        places.append(fb["fUnwrapped"])
        if not rows[-1]["bbusy"]:
            break
    return rows, places


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("move", "sign"), [*zip(MOVES, [1, 1, -1, -1], strict=True)])
def test_it_issues_the_motion_s_place_within_the_turn(move, sign, layout):
    goal = goal_of(move, layout, sign=sign)
    text = structured_text.block_text(motion_of(move), goal)
    fb = checked(text)
    rows, places = run(fb, start(fb), FOR_LONG)
    assert rows[-1]["bdone"] and len(rows) == 151
    played = structured_text.replay(text.encode(), goal).position[:, 0]
    factor = goal.axes[0].counts_per_si if layout == "counts" else goal.axes[0].factor
    np.testing.assert_array_equal(np.array(places) / factor, played)
    hold_within(rows, places, turn_of(layout))
    if layout == "counts":
        assert [row["nposition"] for row in rows] == [round(place) % COUNTS for place in places]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_next_start_is_in_whatever_turn_the_axis_stands(layout):
    fb = checked(text_of((350.0, 1070.0), layout))
    rows = play(fb, start(fb))
    for place in (rows[-1]["fposition"], rows[-1]["fposition"] + 5 * turn_of(layout), fb["cStart"]):
        again, places = run(fb, start(fb, fActPosition=place), FOR_LONG)
        assert again[-1]["bdone"]
        assert column(again, "position") == pytest.approx(column(rows, "position"), abs=1e-9)
        assert places[-1] - places[0] == pytest.approx(2.0 * turn_of(layout), abs=1e-9)


@pytest.mark.parametrize(
    ("place", "error"),
    [
        (0.0, 0),
        (359.9, 0),
        (-0.1, 0),
        (719.95, 0),
        (0.5, 2),
        (180.0, 2),
        (math.nan, 2),
        (math.inf, 2),
        (1e30, 2),
    ],
)
def test_a_stand_beside_the_end_of_the_turn_is_near(place, error):
    fb = checked(text_of((360.0, 300.0)))
    rows = [start(fb, fActPosition=place, fStartTolerance=0.2)]
    assert rows[0]["nerrorid"] == error
    if error == 0:
        assert rows[0]["fposition"] == pytest.approx(place % 360.0, abs=1e-9)
        assert play(fb, rows[0])[-1]["fposition"] == pytest.approx(300.0)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("move", MOVES[:2])
def test_hold_and_override_go_on_through_the_end(move, layout):
    """At every cycle the way between two setpoints is what the velocities say, whatever the turn."""
    turn = turn_of(layout)
    fb = checked(text_of(move, layout))
    inputs = [{"bHold": 40 <= k < 90, "rOverride": 0.4 if k > 120 else 1.0} for k in range(600)]
    rows, places = run(fb, start(fb), inputs)
    assert rows[-1]["bdone"]
    hold_within(rows, places, turn)
    speed = column(rows, "velocity")[:, 0]
    moved = np.diff(np.unwrap(column(rows, "position")[:, 0], period=turn))
    slack = 1e-9 if layout == "segments" else 2e-3
    assert np.abs(moved - 0.5 * CYCLE * (speed[1:] + speed[:-1])).max() < (slack + 2e-3) * turn
    assert (np.sign(moved[np.abs(moved) > 1e-6 * turn]) == np.sign(move[1] - move[0])).all()
    assert moved.sum() == pytest.approx((move[1] - move[0]) * turn / 360.0, abs=1.01)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("move", "cycle", "away"), [(MOVES[0], 15, -3.0), (MOVES[0], 55, 0.0), (MOVES[1], 40, 1.0)]
)
def test_an_abort_on_the_way_continues_in_whatever_turn_the_axis_stands(move, layout, cycle, away):
    turn = turn_of(layout)
    fb = checked(text_of(move, layout))
    rows, places = run(fb, start(fb), [{}] * cycle + [{"bAbort": True}] * 200)
    assert rows[-1]["baborted"] and fb["bLeft"]
    hold_within(rows, places, turn)
    stand = rows[-1]["fposition"]
    fb.call(bExecute=False, bAbort=False)
    assert fb.call(bContinue=True, fActPosition=(stand + turn / 2) % turn)["nerrorid"] == 2
    fb.call(bContinue=False)
    outputs = fb.call(bContinue=True, fActPosition=stand + away * turn, bAbort=False)
    assert outputs["fposition"] == pytest.approx(stand, abs=1e-6) and not outputs["berror"]
    rest, way = run(fb, outputs, FOR_LONG)
    hold_within(rest, way, turn)
    assert rest[-1]["bdone"]
    assert way[-1] - places[0] == pytest.approx((move[1] - move[0]) * turn / 360.0, abs=1e-6)
    assert rest[-1]["fdistancetogo"] == 0.0


@pytest.mark.parametrize("layout", LAYOUTS)
def test_mirrored_scaled_and_shifted(layout):
    turn = turn_of(layout)
    fb = checked(text_of((350.0, 1070.0), layout))
    shift = 1.75 * turn
    given = {
        "fScale": 0.75,
        "bMirror": True,
        "fStartOffset": shift,
        "fActPosition": (fb["cStart"] + shift) % turn,
    }
    rows, places = run(fb, start(fb, **given), FOR_LONG)
    assert rows[-1]["bdone"]
    hold_within(rows, places, turn)
    assert places[0] == pytest.approx(fb["cStart"] + shift)
    assert places[-1] - places[0] == pytest.approx(-1.5 * turn)


@pytest.mark.parametrize(
    "offset", [0.0, 1e-300, -1e-300, -5e-14, 5e-14, 359.99999999999994, -720.0, 3.6e9 + 0.1]
)
def test_no_place_is_the_turn_s_end_itself(offset):
    fb = checked(text_of((0.0, 30.0)))
    rows, places = run(fb, start(fb, fStartOffset=offset, fActPosition=offset), FOR_LONG)
    assert rows[-1]["bdone"]
    hold_within(rows, places, 360.0)


def test_all_of_32_bits_lie_around_zero():
    goal = target(
        start=2147.0, unit="counts", modulo=2.0**32, cycle_time=CYCLE, export={"plc_layout": "samples"}
    )
    text = structured_text.block_text(quintic((2147.0, 2149.0), duration=2.0), goal)
    fb = checked(text)
    rows, places = run(fb, start(fb, fActPosition=2_147_000_000.0), FOR_LONG)
    hold_within(rows, places, 2.0**32, -(2.0**31))
    assert rows[-1]["fposition"] == 2_149_000_000 - 2**32
    assert structured_text.replay(text.encode(), goal).position[-1, 0] == pytest.approx(2149.0)


def test_of_two_axes_one_is_modulo():
    goal = target("slew", "radius", cycle_time=CYCLE, unit="deg", start=0.0)
    goal = attrs.evolve(goal, axes=(attrs.evolve(goal.axes[0], modulo=360.0), goal.axes[1]))
    text = structured_text.block_text(quintic((6.0, 20.0), (-0.5, 7.0), duration=3.0), goal)
    fb = checked(text)
    rows = play(fb, start(fb))
    slew, radius = column(rows, "position").T
    assert slew.min() >= 0.0 and slew.max() < 360.0
    assert np.unwrap(slew, period=360.0)[-1] - slew[0] == pytest.approx(math.degrees(14.0))
    assert (radius[0], radius[-1]) == pytest.approx((math.degrees(-0.5), math.degrees(7.0)))
    beside = [float(slew[0]) - 360.0, float(radius[0]) - 360.0]
    fb.call(bExecute=False)
    assert start(fb, fActPosition=beside)["nerrorid"] == 2
    assert start(fb, fActPosition=[beside[0], float(radius[0])])["nerrorid"] == 0


@pytest.mark.parametrize("tables", ["constants", "variables"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_compiled_it_issues_the_same_bits(layout, tables):
    text = text_of((350.0, 1070.0), layout, tables=tables)
    block, fb = BlockInstance(text), checked(text)
    names, row = list(block.inputs), dict(block.inputs)
    block.call(np.tile(list(row.values()), (200, 1)))  # until it has found its checksum right
    begin = {"fCycleTime": CYCLE, "fActPosition": -10.0 if layout != "counts" else COUNTS - 1820.0}
    given = [begin | {"fStartTolerance": 1.0}, {"bExecute": True}, *[{}] * 60, {"bHold": True}, *[{}] * 60]
    given += [{"bHold": False, "rOverride": 0.7}, *[{}] * 40, {"bAbort": True}, *[{}] * 150]
    for changed in given:
        row |= {name: float(value) for name, value in changed.items()}
        issued = dict(
            zip(block.outputs, block.call(np.array([[row[name] for name in names]]))[0], strict=True)
        )
        outputs = fb.call(**changed)
        assert [issued[name] for name in ("fPosition", "fVelocity", "fAcceleration", "fDistanceToGo")] == [
            outputs[name] for name in ("fposition", "fvelocity", "facceleration", "fdistancetogo")
        ]
        assert (issued["nErrorId"], issued["bBusy"]) == (outputs["nerrorid"], outputs["bbusy"])
        if tables == "variables":  # what gen-profile deploy --watch holds to the table
            assert issued["aState[14]"] == fb["fUnwrapped"]
    assert outputs["baborted"] and fb["fUnwrapped"] > turn_of(layout)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_its_c_compiles_without_a_warning(layout, tmp_path):
    made = st_to_c.translate(text_of((350.0, 1070.0), layout))
    (tmp_path / f"{made.name}.h").write_text(made.header, "ascii")
    (tmp_path / "block.c").write_text(made.source, "ascii")
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function"]
    subprocess.run(
        [sys.executable, "-m", "ziglang", "cc", *strict, "-c", "block.c"], cwd=tmp_path, check=True
    )


@pytest.mark.parametrize("tables", ["constants", "variables"])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", ["plc", "plcopen-xml", "twincat", "siemens-scl"])
def test_forms_are_read_back_refused_where_the_turn_is_another_and_have_no_cam(name, layout, tables):
    exporter, goal = find_exporter(name), goal_of((350.0, 1070.0), layout, tables)
    files = exporter.encode(motion_of((350.0, 1070.0)), goal)
    content = files[0].content
    back = exporter.replay(content, goal).position[:, 0]
    assert back[[0, -1]] == pytest.approx(np.radians([350.0, 1070.0]), abs=1e-4)
    assert not [file.filename for file in files if "cam" in file.filename or "GVL" in file.filename]
    assert b"MC_MOTIONINPOSITION" not in b"".join(file.content for file in files)
    (axis,) = goal.axes
    for other in (None, 720.0):
        another = attrs.evolve(goal, axes=(attrs.evolve(axis, modulo=other),))
        with pytest.raises(ExportError, match="export "):
            exporter.replay(content, another)
    turn = b"65536.0" if layout == "counts" else b"360.0"
    altered = content.replace(turn, b"180.0")
    assert altered != content
    with pytest.raises(ExportError):
        exporter.replay(altered, goal)


@pytest.mark.parametrize("tables", ["constants", "variables"])
def test_a_library_goes_on_through_the_end_too(tables):
    goal = goal_of(MOVES[0], tables=tables)
    sources = [parse_function_block(text_of(move, tables=tables)) for move in MOVES[:2]]
    library = library_source([LibraryEntry(source=source, label="a move") for source in sources], goal)
    fb = checked(library.text())
    fb.call(nProfile=1)
    for _ in range(100):
        fb.call()
    outputs = fb.call(bExecute=True, nProfile=1, fActPosition=370.0, fCycleTime=CYCLE)
    assert outputs["nerrorid"] == 0
    rows = play(fb, outputs, most=2000)
    places = column(rows, "position")[:, 0]
    assert places.min() >= 0.0 and places.max() < 360.0
    assert np.unwrap(places, period=360.0)[-1] - places[0] == pytest.approx(-720.0)
    assert [round(math.degrees(m.position[-1, 0])) for m in read_library(library, goal)] == [1070, -710]


def test_what_no_axis_could_follow_is_refused():
    with pytest.raises(ExportError, match=r"half a turn of axis\.modulo or more in a cycle"):
        structured_text.block_text(motion_of((0.0, 7200.0), duration=0.5), goal_of((0.0, 7200.0)))
    with pytest.raises(ExportError, match="counts, which are not whole"):
        text_of((0.0, 90.0), "counts", counts_per_si=1000.0)


@pytest.mark.parametrize("tables", ["constants", "variables"])
@pytest.mark.parametrize("name", ["plc", "plcopen-xml", "twincat", "siemens-scl"])
def test_forms_of_two_axes_are_read_back(name, tables):
    options = {"cycle_time": CYCLE, "unit": "deg", "start": 0.0, "export": {"plc_tables": tables}}
    goal = target("slew", "radius", **options)
    goal = attrs.evolve(goal, axes=(attrs.evolve(goal.axes[0], modulo=360.0), goal.axes[1]))
    move, exporter = quintic((6.0, 20.0), (-0.5, 7.0), duration=3.0), find_exporter(name)
    back = exporter.replay(exporter.encode(move, goal)[0].content, goal)
    assert back.position[-1] == pytest.approx(move.target, abs=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("move", "turn"), [*zip(MOVES, [0, 3, -2, -2], strict=True)])
def test_an_nc_axis_counts_on_from_the_turn_in_which_it_stands(move, layout, turn):
    full, source = turn_of(layout), parse_function_block(text_of(move, layout))
    begin, end = (place / 360.0 * full + turn * full for place in move)
    slack = 1.0 if layout == "counts" else 1e-6
    bench = PlaybackBench(VENDORS["twincat"], source, [begin])
    bench.given["fStartTolerance"] = slack
    for _ in range(40):
        bench.cycle(bExecute=True)
    bench.until(lambda row: row["baborted"], bAbort=True)
    for _ in range(10):  # let go, and taken again for the rest of the way
        bench.cycle(bExecute=False, bAbort=False)
    outputs = bench.until(lambda row: row["bdone"] or row["berror"], bContinue=True)
    assert outputs["bdone"], outputs
    way = np.array(bench.commanded)[:, 0]
    assert way[0] == pytest.approx(begin, abs=slack) and way[-1] == pytest.approx(end, abs=slack)
    assert np.abs(np.diff(way)).max() <= abs(end - begin) * 1.875 / 3.0 * CYCLE * 1.001 + 2.0 * slack
    bench.cycle(bContinue=False)
    bench.bring([begin - 5.0 * full])  # by hand, five turns back
    bench.until(lambda row: row["bdone"], bExecute=True)
    assert bench.commanded[-1][0] == pytest.approx(end - 5.0 * full, abs=slack)


def test_of_two_nc_axes_one_is_modulo():
    goal = target("slew", "radius", cycle_time=CYCLE, unit="deg", start=0.0)
    goal = attrs.evolve(goal, axes=(attrs.evolve(goal.axes[0], modulo=360.0), goal.axes[1]))
    move = quintic((6.0, 20.0), (-0.5, 7.0), duration=3.0)
    begin, end = (np.degrees(place).tolist() for place in (move.start, move.target))
    bench = PlaybackBench(
        VENDORS["twincat"],
        parse_function_block(structured_text.block_text(move, goal)),
        [begin[0] + 720.0, begin[1]],
    )
    bench.until(lambda row: row["bdone"], bExecute=True)
    assert bench.commanded[-1] == pytest.approx([end[0] + 720.0, end[1]])
    bench.cycle(bExecute=False)
    bench.bring([begin[0], begin[1] + 720.0])
    assert bench.until(lambda row: row["berror"], bExecute=True)["nerrorid"] == 2


@pytest.mark.parametrize("wraps", [True, False])
@pytest.mark.parametrize("move", [(350.0, 460.0), (20.0, -95.0)])
def test_a_converter_s_axis_may_wrap_or_count_on(move, wraps):
    source = parse_function_block(text_of(move))
    wrapper = FunctionBlock(axis_wrapper(source, 1, VELOCITY).text(), (source.text(),))
    given = {"fCycleTime": CYCLE, "fGain": 2.0, "fCorrection": 20.0, "fFollowingLimit": 10.0}
    given |= {"bRunning": True, "fStartTolerance": 0.1}
    place = move[0] + 720.0
    for cycle in range(260):
        shown = place % 360.0 if wraps else place
        outputs = wrapper.call(**given, fActPosition=shown, bExecute=cycle > 60)
        place += CYCLE * outputs["fspeed"]
    assert outputs["bdone"] and not outputs["berror"]
    assert place == pytest.approx(move[1] + 720.0, abs=0.1)


@pytest.mark.parametrize("name", ["codesys", "rockwell-l5x"])
def test_what_is_not_known_of_a_vendor_s_axes_is_refused(name):
    source, goal = parse_function_block(text_of(MOVES[0])), goal_of(MOVES[0])
    with pytest.raises(ExportError, match=rf"{name} takes no modulo axes; export can, csv, plc, plcopen-xml"):
        require_targets({name: find_exporter(name)}, goal)
    if name == "codesys":  # through whichever door the block comes
        with pytest.raises(ExportError, match="write the block by plc or plcopen-xml"):
            find_container(name).wrap(source, goal)
