"""docs/planner-algorithm.md, against the headings and names of the planner's blocks."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BLOCKS = ROOT / "exporters/gen_profile_exporters/planner/blocks"
PAGE = (ROOT / "docs/planner-algorithm.md").read_text("utf-8")
FIGURES = re.findall(r"(?s)^```text\n(.*?)^```", PAGE, re.MULTILINE)


def test_its_table_of_decisions_is_that_of_the_heading():
    table = runpy.run_path(str(ROOT / "docs/list_decisions.py"))["table"]()
    assert table.count("\n") > 10
    assert table in PAGE


def test_its_figures_show_all_blocks_phases_states_and_commands():
    blocks, phases, states = FIGURES
    own = {path.stem for path in BLOCKS.glob("*.st")} - {
        "interface",
        "motion_constants",
        "planner",
        "live_account",
    }
    assert {name for name in own if name not in blocks} == set()
    planner, shell = ((BLOCKS / f"{name}.st").read_text("ascii") for name in ("planner", "shell"))
    named = {re.sub("(?<=[a-z])O", " o", name) for name in re.findall(r"\bcPhase(\w+) : DINT", planner)}
    assert {name for name in named if name not in phases} == set()
    heading = shell[shell.index("state      setpoints") : shell.index("What voids a committed motion")]
    rows = re.findall(r"(?m)^   (?!Command)([A-Z]\w+) ", heading)
    assert len(rows) == 7
    assert {name for name in rows if name not in states} == set()


@pytest.mark.parametrize("block", ["setpoints", "modes", "linear_programme", "rope_model", "observer"])
def test_equations_that_it_numbers_are_in_the_headings(block):
    numbers = set(re.findall(rf"\({block} (\d)\)$", PAGE, re.MULTILINE))
    heading = (BLOCKS / f"{block}.st").read_text("ascii").split("*)")[0]
    assert numbers
    assert {number for number in numbers if f"({number})" not in heading} == set()
