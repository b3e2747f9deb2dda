"""The forms of the planner block: containers, C99 and Python do what its Structured Text says."""

import ctypes
import io
import math
import re
import subprocess
import sys
from pathlib import Path

import attrs
import numpy as np
import pytest
from command_line import error_of, run_here
from lxml import etree
from system_parts import program as program_of

import gen_profile as gp
from gen_profile.planner.commands import play, read_commands
from gen_profile.planner.design import planner_block
from gen_profile.planner.events import read_events
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files, block_in, read_block, require_forms
from gen_profile.planner.interface import BlockAxis
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import ExportError, SpecError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.planner.axis_wrapper import LIBRARIES
from gen_profile_exporters.planner.openplc import openplc_files
from gen_profile_exporters.playback.structured_text import read_table
from gen_profile_exporters.registry import containers
from gen_profile_exporters.st_to_c import translate
from gen_profile_exporters.vendors import siemens_scl

BAY = """
name = "bay 3"
plant = { type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }
move = { distance = 8.0, duration = 14.0 }
limits = { velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }
planner = { live = { L1 = [5.0, 7.0] } }
export = { cycle_time = 0.004 }
"""
SPEC = parse_spec(BAY)
WRAPPERS = tuple(f"_{kind}{end}" for kind in ("axis", "velocity") for end in (".st", ".scl", ".codesys.xml"))
TYPES = {"BOOL": ctypes.c_bool, "DINT": ctypes.c_int32, "LREAL": ctypes.c_double}


@pytest.fixture(scope="module")
def block():
    return planner_block(SPEC)


@pytest.fixture(scope="module")
def program(block):
    return translate(block.text)


def test_a_block_in_place_of_a_motion_is_told_as_such(block):
    with pytest.raises(ExportError, match=r"^this is a planner block, .*; name an exported motion\.$"):
        read_table(block.text, target_of(SPEC))


@pytest.mark.slow
@pytest.mark.parametrize("format_", containers())
def test_every_container_reads_back_as_the_same_program(block, program, format_, tmp_path):
    """With inputs and outputs in their order."""
    files = block_files(block, SPEC, [format_])
    for file in files:
        (tmp_path / file.filename).write_bytes(file.content)
    back, source = read_block(tmp_path / files[0].filename), parse_function_block(block.text)
    assert parse_function_block(back).program() == source.program()
    again = translate(back)
    assert (again.inputs, again.outputs) == (program.inputs, program.outputs)
    within = {one.name for one in source.within}
    wrappers = [file for file in files[1:] if Path(file.filename).stem not in within]
    assert len(wrappers) == 1 + (format_ in LIBRARIES)
    for wrapper in wrappers:
        with pytest.raises(ExportError, match="holds a planner block's wrapper; name the"):
            read_block(tmp_path / wrapper.filename)


@pytest.mark.parametrize("name", containers())
def test_a_block_reads_back_before_its_files_stand_in_a_folder(block, name):
    first, *_ = files = block_files(block, SPEC, [name])
    back = block_in(Path(first.filename), first.content, {file.filename: file.content for file in files})
    assert parse_function_block(back).program() == parse_function_block(block.text).program()


@pytest.mark.parametrize("tables", ["constants", "variables"])
def test_a_block_larger_than_a_data_block_is_told_what_makes_a_planner_smaller(block, monkeypatch, tables):
    monkeypatch.setattr(siemens_scl, "MOST_BYTES", 1000)
    spec = attrs.evolve(SPEC, export=attrs.evolve(SPEC.export, plc_tables=tables))
    with pytest.raises(
        ExportError, match=r"ask less of the planner: no robustness\.uncertain, fewer planner"
    ):
        block_files(block, spec, ["siemens-scl"])


def test_xml_is_valid(block, tc6_schema):
    for file in block_files(block, SPEC, ["plcopen-xml", "codesys"]):
        tc6_schema.assertValid(etree.fromstring(file.content.replace(b"/tc6_0200", b"/tc6_0201")))


def constant_indices_outside(text):
    """Constant indices that leave their arrays: compilers refuse them, also where they are never reached."""
    constants = {name: int(value) for name, value in re.findall(r"(c\w+) : DINT := (-?\d+);", text)}
    tops = {name: int(top) for name, top in re.findall(r"(\w+) : ARRAY \[0\.\.(\d+)\]", text)}
    for name, index in re.findall(r"(\w+)\[([^][]+)\]", text):
        constant = name in tops and set(re.findall(r"[a-zA-Z]\w*", index)) <= constants.keys()
        if constant and not 0 <= eval(index, {}, constants) <= tops[name]:
            yield name, index


def test_a_block_of_one_mode_names_no_element_beyond_an_array_s_end():
    limits = ["velocity=0.5", "acceleration=0.3", "jerk=2.0", "travel=[-20.0, 20.0]"]
    spec = preset_spec("single-pendulum-crane", [f"limits.{limit}" for limit in limits])
    assert not [*constant_indices_outside(planner_block(spec).text)]


def planner_commands(inputs):
    """Rows of inputs by command: moves, a new target with another rope, a stick, no number, a quick stop."""
    inputs = inputs | {"bEnable": 1.0}
    for cycles, given in (
        (40, {}),
        (700, {"bExecute": 1.0, "fTarget": 3.0}),
        (2, {"bExecute": 0.0}),
        (400, {"bExecute": 1.0, "fTarget": 9.0, "fL1": 5.5}),
        (800, {"bExecute": 0.0, "bVelocity": 1.0, "fVelocityCommand": -0.4}),
        (30, {"fVelocityCommand": math.nan}),
        (400, {"bQuickStop": 1.0}),
    ):
        inputs |= given
        yield np.tile(list(inputs.values()), (cycles, 1))


def test_no_loop_is_one_that_matiec_may_leave_out(block):
    """Since 2024 it skips FOR loops of a single pass; what a counter holds after one is undefined."""
    assert not re.findall(r"\b(?:END_)?FOR\b", block.text)


class Exported:
    """The exported C, compiled by a system's compiler and called through ctypes."""

    def __init__(self, program, library, name):
        self.step, self.state = getattr(library, f"{name}_step"), ctypes.create_string_buffer(100_000)
        self.given, self.issued = (self._structure(v) for v in (program.inputs, program.outputs))
        getattr(library, f"{name}_init")(self.state, ctypes.byref(self.given))

    def _structure(self, variables):
        fields = [(v.name, TYPES[v.type]) for v in variables]
        return type("Structure", (ctypes.Structure,), {"_fields_": fields})()

    def values(self, structure):
        return [float(getattr(structure, name)) for name, _ in structure._fields_]

    def call(self, row):
        for (name, type_), value in zip(self.given._fields_, row, strict=True):
            setattr(self.given, name, value if type_ is ctypes.c_double else int(value))
        self.step(self.state, ctypes.byref(self.given), ctypes.byref(self.issued))
        return self.values(self.issued)


@pytest.mark.slow
def test_exported_c_issues_the_same_bits_without_a_warning(block, program, tmp_path):
    files = [tmp_path / file.filename for file in block_files(block, SPEC, ["c"])]
    for path, file in zip(files, block_files(block, SPEC, ["c"]), strict=True):
        path.write_bytes(file.content)
    assert [path.name for path in files] == ["bay 3.c", "bay 3.h"]
    assert not [line for line in files[1].read_text("ascii").splitlines() if line != line.rstrip()]
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    clang = [sys.executable, "-m", "ziglang", "cc"]
    quickly = ["-O0", "-fno-sanitize=all", "-c"]  # all of its warnings come before it optimises
    subprocess.run([*clang, *strict, *quickly, files[0], "-o", tmp_path / "bay.o"], check=True)
    command = [program_of("cc", "gcc"), *strict, "-shared", "-fPIC", files[0], "-o", tmp_path / "bay.so"]
    subprocess.run([*command, "-lm"], check=True)
    exported, oracle = Exported(program, ctypes.CDLL(tmp_path / "bay.so"), "bay_3"), BlockInstance(block.text)
    assert exported.values(exported.given) == list(oracle.inputs.values())
    for rows in planner_commands(oracle.inputs):
        assert [exported.call(row) for row in rows.tolist()] == oracle.call(rows).tolist()


@pytest.mark.slow
def test_c_plus_plus_takes_the_header(block, tmp_path):
    (_, header) = block_files(block, SPEC, ["c"])
    assert b"then out.fPosition is the setpoint. Names" in header.content
    (tmp_path / header.filename).write_bytes(header.content)
    (tmp_path / "user.cpp").write_text(
        f'#include "{header.filename}"\nvoid f(bay_3_state *s, bay_3_inputs *in) {{ bay_3_init(s, in); }}\n'
    )
    command = [sys.executable, "-m", "ziglang", "c++", "-Wall", "-Werror", "-c", "user.cpp", "-o", "user.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert b"_Z10bay_3_init" not in (tmp_path / "user.o").read_bytes()  # the mangled name


class TestInPython:
    @pytest.mark.slow
    def test_a_history_is_that_of_the_played_block(self, block):
        """Steps, stretches and columns are the same inputs; both enable the block in a cycle of its own.

        It is the first that is played, and none of Python's; there bExecute falls when the next target comes.
        """
        commands = (
            "time_s,command,value,L1\n0.404,position,3.0,5.5\n2.008,position,2.5,\n4.004,velocity,0.3,\n"
            "8.004,stop,,\n"
        )
        played = np.genfromtxt(io.StringIO(play(block.text, commands).table), delimiter=",", names=True)
        planner = gp.Planner(SPEC)
        parts = [
            planner.hold(0.4),
            planner.hold(1.6, target=3.0, live={"L1": 5.5}),
            planner.hold(1.0, target=2.5),
            planner.hold(1.0),
            planner.hold(4.0, velocity=np.full(1000, 0.3)),
        ]
        steps = [planner.step(stop=True) for _ in range(500)]
        for name, column in (
            ("position", "position_m"),
            ("stop_distance", "stop_distance_m"),
            ("busy", "busy"),
        ):
            issued = [*np.concatenate([getattr(p, name) for p in parts]), *(getattr(s, name) for s in steps)]
            np.testing.assert_array_equal(issued, played[column][1 : 1 + len(issued)])
        assert planner.live == {"L1": 5.5}

    @pytest.mark.slow
    def test_a_target_of_every_cycle_is_one_command_and_a_new_one_another(self):
        planner = gp.Planner(SPEC)
        for target in (0.5, 0.5, 0.6, 0.7):
            planner.step(target=target)
        assert planner.step(target=0.7).outputs["fDistanceToGo"] == 0.7
        assert planner.hold(20.0, target=0.7).position[-1] == 0.7
        assert planner.step(target=0.7).done

    @pytest.mark.slow
    def test_a_live_parameter_that_comes_with_the_first_command_is_no_change_of_it(self):
        planner = gp.Planner(SPEC)
        assert planner.hold(20.0, target=3.0, live={"L1": 5.5}).promise[-1]
        planner.restart(3.0)
        assert planner.hold(20.0, target=6.0, live={"L1": 6.8}).promise[-1]

    def test_it_goes_on_after_a_quick_stop(self):
        planner = gp.Planner(SPEC, position=4.0)
        planner.hold(4.0, target=9.0)
        stopped = planner.hold(3.0, quick_stop=True)
        assert not stopped.promise[-1]
        planner.restart(stopped.position[-1])
        again = planner.hold(15.0, target=9.0)
        assert again.promise[-1]
        assert again.done[-1]
        assert again.position[-1] == 9.0

    def test_a_place_that_is_no_number_is_an_error_and_takes_the_axis_over_nowhere(self):
        planner = gp.Planner(SPEC, position=2.0)
        assert planner.step(actual_position=math.nan).error_id == 4
        assert planner.step().error_id == 4
        assert planner.hold(0.1, actual_position=2.0).position[-1] == 2.0

    def test_it_follows_the_axis_while_it_is_disabled_and_goes_on_from_there(self):
        planner = gp.Planner(SPEC)
        left = planner.hold(8.0, target=5.0).position[-1]
        disabled = planner.hold(0.1, enable=False)
        assert not disabled.outputs["bEnabled"].any() and disabled.outputs["bCommandAborted"][0]
        assert (disabled.position == left).all() and not disabled.velocity.any() and 0.0 < left < 5.0
        assert planner.step(actual_position=2.0, actual_velocity=0.1).velocity == 0.1
        there = {"actual_position": 1.0, "actual_velocity": 0.0}
        again = planner.hold(9.0, enable=True, load_at_rest=True, **there)
        assert (again.position == 1.0).all() and again.promise[-1]  # the command before is forgotten
        assert planner.hold(20.0, target=3.0).position[-1] == 3.0

    def test_what_makes_no_sense_is_refused_in_a_sentence(self, tmp_path):
        planner = gp.Planner(SPEC)
        for given, words in (
            ({"target": 1.0, "stop": True}, "give one of target, velocity, stop and quick_stop"),
            ({"live": {"L2": 1.0}}, "no live parameter 'L2' (known: L1)"),
            ({"live": [6.0]}, "live: give values by name, such as {'L1': 6.0}, found [6.0]"),
            ({"target": "far"}, "target: must be a number, found 'far'"),
            ({"target": "3"}, "target: must be a number, found '3'"),
            ({"stop": "no"}, "stop: must be true or false, found text 'no'"),
            ({"velocity": np.zeros(3)}, "velocity: must be a number or one for each of 250 cycles"),
        ):
            with pytest.raises(gp.SpecError, match=re.escape(words)):
                planner.hold(1.0, **given)
        for seconds in (0.0, -1.0, math.nan, math.inf):
            with pytest.raises(gp.SpecError, match=r"at least one cycle of 0\.004 s"):
                planner.hold(seconds)
        with pytest.raises(gp.SpecError, match="at most 8000 in one go"):
            planner.hold(1e9)
        with pytest.raises(gp.OutputError, match=r"Cannot read the block .*none.st: No such file"):
            gp.Planner(tmp_path / "none.st")
        assert planner.hold(0.1, target=math.nan).error_id[-1] == 3


def test_a_format_without_blocks_is_refused(block):
    with pytest.raises(SpecError, match=r"csv carries no playback block; .* are .*siemens-scl"):
        block_files(block, SPEC, ["csv"])
    with pytest.raises(SpecError, match=r"no form 'csv' \(known: codesys, .*, c, linux, openplc\)"):
        require_forms(["c", "csv"])


@pytest.mark.parametrize("inputs", [10, 70, 130])
def test_every_variable_of_openplc_has_an_address_of_its_own(block, inputs):
    many = "".join(f"    bMore{number} : BOOL;\n" for number in range(inputs))
    before, behind = block.text.rsplit("VAR_INPUT\n", 1)
    (file,) = openplc_files(f"{before}VAR_INPUT\n{many}{behind}", "crane")
    places = re.findall(r"(\w+) AT %(\S+) :", file.content.decode("ascii"))
    assert len(places) > inputs and len({place for _, place in places}) == len(places)
    assert dict(places)["nCycle"] == {10: "ML64", 70: "ML128", 130: "ML192"}[inputs]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("time_s;command;value\n0;stop;\n", "must name time_s, command, value, with commas between"),
        ("time_s,command,value,L1,L1\n0,stop,,5,6\n", "two columns are called 'L1'"),
        ("time_s,command,value\n0,position,1,5\n", "line 2: holds more cells than the first line has names"),
        ("time_s,command,value\n0,position\n", "line 2: value must be a number, found ''."),
        (f"time_s,command,value\n0,stop,{'x' * 200_000}", "commands, line 2: it is no table"),
        (f"time_s,{'x' * 200_000}", "commands, line 1: it is no table"),
        ('time_s,command,value\n0,position,"1,5"\n', "found '1,5'; write a decimal point: 1.5"),
        ("time_s,command,value\n2,stop,\n\n1,stop,\n", "line 4: time_s goes back from 2 to 1"),
        ("time_s,command,value\n1e6,stop,\n", "comes at 1e+06 s, and at most 40000 s are played in one go"),
    ],
)
def test_commands_that_cannot_be_meant_are_refused_with_their_line(block, table, words):
    with pytest.raises(SpecError, match=re.escape(words)):
        play(block.text, table)


@pytest.mark.parametrize("before", ["1,position,0.5", "0,position,0.6\n1,stop,"])
def test_of_commands_at_the_same_time_the_last_one_is_obeyed(block, before):
    issued = play(block.text, f"time_s,command,value\n{before}\n1,position,0.4\n")
    assert float(issued.table.splitlines()[-1].split(",")[1]) == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("time_s,code,value\n1,21,inf\n", "line 2: a time, a whole number and a value are wanted"),
        ("time_s,code,value\n1e300,21,0\n", "line 2: a time, a whole number and a value are wanted"),
        ("time_s,code,value\n1,1e300,0\n", "line 2: a time, a whole number and a value are wanted"),
        ("time_s,code,value,value\n1,21,0,1\n", "two columns are called 'value'"),
    ],
)
def test_events_that_no_block_keeps_are_refused(table, words):
    with pytest.raises(SpecError, match=re.escape(words)):
        read_events(table)


def test_an_event_at_rest_does_not_show_rounding_errors():
    (event,) = read_events("time_s,code,value\n1,12,-4.4e-16\n")
    assert event.words == "1.000 s: the axis moves, from 0"


def test_lines_may_end_as_in_any_system():
    text = "time_s,command,value\n0.5,position,2\n3,stop,\n"
    read = [read_commands(text.replace("\n", end), (BlockAxis(name=""),), ()) for end in ("\n", "\r\n", "\r")]
    assert read[0] == read[1] == read[2] != ()


def test_the_example_of_a_command_has_a_value_for_each_axis():
    axes = [BlockAxis(name=name) for name in "xy"]
    with pytest.raises(SpecError, match=re.escape("such as 0.0,position,1.0,1.0.")):
        read_commands("time_s,command,value_x,value_y\n", axes, ())


@pytest.mark.slow
def test_the_command_line_plays_any_of_them(tmp_path, monkeypatch):
    """And writes none where one is refused."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bay.toml").write_text(BAY)
    refused = run_here(
        "planner", "write", "bay.toml", "--out", "deploy", "--export", "plc", "--export", "csv"
    )
    assert refused.code == 2
    assert not (tmp_path / "deploy").exists()
    formats = [word for name in ("plc", "siemens-scl", "codesys") for word in ("--export", name)]
    written = run_here(
        "planner", "write", "bay.toml", "--out", "deploy", *formats, "--histories", 4, "--json"
    ).document
    (tmp_path / "commands.csv").write_text("time_s,command,value\n0,position,0.5\n")
    block, play = written["files"][0]["path"], ("--commands", "commands.csv", "--out")
    kept = (tmp_path / block).read_bytes()
    for path, words in (("commands.csv", "the file of --commands"), (block, "the file of BLOCK")):
        assert words in error_of("planner", "play", block, *play, path)
    assert (tmp_path / block).read_bytes() == kept
    (tmp_path / "bay.c").write_text("int main(void) { return 0; }\n")
    for other, words in (("bay.c", "a program is not read back"), ("bay.toml", "holds no planner block")):
        assert words in error_of("planner", "play", other, *play, "out.csv", code=5)
    tables = []
    for file in written["files"]:
        if file["path"].endswith(WRAPPERS):
            continue
        run_here("planner", "play", file["path"], "--commands", "commands.csv", "--out", "out.csv", "--json")
        tables.append((tmp_path / "out.csv").read_text())
    assert len(tables) == 3
    assert tables[0].splitlines()[-1].split(",")[1] == "0.5"
    assert "a program is not read back" in run_here("check", "bay.c").err
    assert "a program is not read back" in run_here("report", "bay.c").err
    for file in written["files"]:
        if file["path"].endswith(WRAPPERS):
            assert "holds a planner block's wrapper" in run_here("check", file["path"]).err
    (tmp_path / "hoisting.csv").write_text("time_s,command,value,L1\n0,position,9,5\n5,position,9,6\n")
    hoisting = ("planner", "play", block, "--commands", "hoisting.csv", "--out", "out.csv")
    assert "the load may sway, because a live parameter changed on the way" in run_here(*hoisting).out
    assert run_here(*hoisting, "--json").document["promise"] is False
    assert tables[1] == tables[2] == tables[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "harmless", "harmful", "words"),
    [
        ("a[n] := 1.0; y := a[n];", [0, 2], [-1, 3, 2**30], "beyond the end of an array"),
        ("WHILE n > 0 DO y := 1.0; END_WHILE;", [0], [1], "a loop without end"),
        ("k := 4 / n;", [1, -1], [0], "divides by zero"),
    ],
)
def test_what_would_end_or_hang_the_process_ends_in_a_sentence(body, harmless, harmful, words):
    block = BlockInstance(
        "FUNCTION_BLOCK x VAR_INPUT n : DINT; END_VAR VAR_OUTPUT y : LREAL; END_VAR "
        f"VAR k : DINT; a : ARRAY [0..2] OF LREAL; END_VAR {body} END_FUNCTION_BLOCK"
    )
    block.call(np.array([harmless], dtype=float).T)
    for number in harmful:
        with pytest.raises(ExportError, match=words):
            block.call(np.array([[float(number)]]))
