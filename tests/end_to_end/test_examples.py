"""Every example runs by itself, in a folder of its own; what a page shows of one is what it prints."""

import ast
import json
import re
import runpy
import sys
from pathlib import Path

import pytest

from gen_profile.studies.sweep import run as sweep

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
SHOWN = {"07_every_machine": ROOT / "docs" / "machines.md"}
SOME = {"07_every_machine": ["flexible-joint"]}  # all take a minute


def test_there_are_examples():
    assert len(EXAMPLES) >= 3


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_runs(example, tmp_path, monkeypatch, capsys):
    """In this process, which has loaded the libraries; a warning is an error here, too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example), *SOME.get(example.stem, [])])
    monkeypatch.setattr(sweep, "CPU_COUNT", 1)  # a second process takes longer to start than it saves
    runpy.run_path(str(example), run_name="__main__")
    printed_here, complaints = capsys.readouterr()
    assert complaints == ""
    assert printed_here.strip()
    if example.stem in SHOWN:
        printed = table(printed_here)
        written = [
            row
            for row in table(SHOWN[example.stem].read_text("utf-8"))
            if len(row) == len(printed[0]) and row[0] in {line[0] for line in printed}
        ]
        assert len(printed) == 2 + 3 * len(SOME[example.stem])
        assert [row[:2] for row in printed] == [row[:2] for row in written]
        for new, old in zip(printed[2:], written[2:], strict=True):
            # but for the last column, which is rounding; other libraries round the last digits otherwise
            for one, other in zip(map(number, new[2:-1]), map(number, old[2:-1]), strict=True):
                assert one == pytest.approx(other, rel=0.03, abs=0.011), (new, old)


def table(text):
    return [line[1:-1].split("|") for line in text.splitlines() if line.startswith("|")]


def number(cell):
    return float(re.match(r"[0-9.]+", cell)[0])


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_its_cells_end_with(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    document = json.loads(notebook.read_text("utf-8"))
    scope = {"__name__": "__main__"}
    cells = ["".join(cell["source"]) for cell in document["cells"] if cell["cell_type"] == "code"]
    shown = [run_cell(cell, scope) for cell in cells]
    assert any(shown)
    assert all(cell.get("outputs", []) == [] for cell in document["cells"])  # they would grow old


def run_cell(source, scope):
    """Run a cell as a notebook does: what its last line is worth is shown, in HTML if it can be."""
    *statements, last = ast.parse(source).body
    ends_in_value = isinstance(last, ast.Expr)
    exec(compile(ast.Module([*statements, *([] if ends_in_value else [last])], []), "cell", "exec"), scope)
    if not ends_in_value:
        return None
    value = eval(compile(ast.Expression(last.value), "cell", "eval"), scope)
    in_html = getattr(value, "_repr_html_", lambda: None)()
    return in_html or (None if value is None else repr(value))
