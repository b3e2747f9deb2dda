"""Every example runs by itself, in a folder of its own; what a page shows of one is what it prints."""

import re
import runpy
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))
SHOWN = {"07_every_machine": ROOT / "docs" / "machines.md"}
SOME = {"07_every_machine": ["flexible-joint"]}  # all take a minute


def test_there_are_examples():
    assert len(EXAMPLES) >= 3


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_runs(example, tmp_path, monkeypatch, capsys):
    """In this process, which has loaded the libraries; a warning is an error here, too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example), *SOME.get(example.stem, [])])
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
