"""The forms of the planner block: containers, C99 and Python do what its Structured Text says."""

import pytest
from command_line import run_here
from lxml import etree

from gen_profile.errors import SpecError
from gen_profile.planner.design import planner_block
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
    written = run_here("planner", "write", "bay.toml", "--out", "deploy", *formats, "--json").document
    (tmp_path / "commands.csv").write_text("time_s,command,value\n0,position,0.5\n")
    tables = []
    for file in written["files"]:
        run_here("planner", "play", file["path"], "--commands", "commands.csv", "--out", "out.csv", "--json")
        tables.append((tmp_path / "out.csv").read_text())
    assert len(tables) == 3
    assert tables[0].splitlines()[-1].split(",")[1] == "0.5"
    assert tables[1] == tables[2] == tables[0]
