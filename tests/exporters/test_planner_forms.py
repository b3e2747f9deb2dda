"""The forms of the planner block: containers, C99 and Python do what its Structured Text says."""

import ctypes
import math
import subprocess
import sys

import numpy as np
import pytest
from command_line import run_here
from lxml import etree
from system_parts import program as program_of

from gen_profile.errors import SpecError
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files, read_block
from gen_profile.spec.reading import parse_spec
from gen_profile_exporters.registry import containers
from gen_profile_exporters.st_to_c import translate

BAY = """
name = "bay 3"
plant = { type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }
move = { distance = 8.0, duration = 14.0 }
limits = { velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }
planner = { live = { L1 = [5.0, 7.0] } }
export = { cycle_time = 0.004 }
"""
SPEC = parse_spec(BAY)
TYPES = {"BOOL": ctypes.c_bool, "DINT": ctypes.c_int32, "LREAL": ctypes.c_double}


@pytest.fixture(scope="module")
def block():
    return planner_block(SPEC)


@pytest.fixture(scope="module")
def program(block):
    return translate(block.text)


@pytest.mark.parametrize("format_", containers())
def test_every_container_reads_back_as_the_same_program(block, program, format_, tmp_path):
    """Compared as C, which leaves nothing of the text's layout, but variables in their order."""
    (file,) = block_files(block, SPEC, [format_])
    path = tmp_path / file.filename
    path.write_bytes(file.content)
    assert translate(read_block(path)) == program


def test_xml_is_valid(block, tc6_schema):
    for file in block_files(block, SPEC, ["plcopen-xml", "codesys"]):
        tc6_schema.assertValid(etree.fromstring(file.content.replace(b"/tc6_0200", b"/tc6_0201")))


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


def test_exported_c_issues_the_same_bits_without_a_warning(block, program, tmp_path):
    files = [tmp_path / file.filename for file in block_files(block, SPEC, ["c"])]
    for path, file in zip(files, block_files(block, SPEC, ["c"]), strict=True):
        path.write_bytes(file.content)
    assert [path.name for path in files] == ["bay 3.c", "bay 3.h"]
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    clang = [sys.executable, "-m", "ziglang", "cc"]
    subprocess.run([*clang, *strict, "-c", files[0], "-o", tmp_path / "bay.o"], check=True)
    command = [program_of("cc", "gcc"), *strict, "-shared", "-fPIC", files[0], "-o", tmp_path / "bay.so"]
    subprocess.run([*command, "-lm"], check=True)
    exported, oracle = Exported(program, ctypes.CDLL(tmp_path / "bay.so"), "bay_3"), BlockInstance(block.text)
    assert exported.values(exported.given) == list(oracle.inputs.values())
    inputs = oracle.inputs | {"bEnable": 1.0}
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
        rows = np.tile(list(inputs.values()), (cycles, 1))
        assert [exported.call(row) for row in rows.tolist()] == oracle.call(rows).tolist()


def test_c_plus_plus_takes_the_header(block, tmp_path):
    (_, header) = block_files(block, SPEC, ["c"])
    (tmp_path / header.filename).write_bytes(header.content)
    (tmp_path / "user.cpp").write_text(
        f'#include "{header.filename}"\nvoid f(bay_3_state *s, bay_3_inputs *in) {{ bay_3_init(s, in); }}\n'
    )
    command = [sys.executable, "-m", "ziglang", "c++", "-Wall", "-Werror", "-c", "user.cpp", "-o", "user.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert b"_Z10bay_3_init" not in (tmp_path / "user.o").read_bytes()  # the mangled name


def test_a_format_without_blocks_is_refused(block):
    with pytest.raises(SpecError, match=r"csv carries no playback block; .* are .*siemens-scl"):
        block_files(block, SPEC, ["csv"])


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
    tables = []
    for file in written["files"]:
        run_here("planner", "play", file["path"], "--commands", "commands.csv", "--out", "out.csv", "--json")
        tables.append((tmp_path / "out.csv").read_text())
    assert len(tables) == 3
    assert tables[0].splitlines()[-1].split(",")[1] == "0.5"
    assert tables[1] == tables[2] == tables[0]
