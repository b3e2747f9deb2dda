"""Every command and code block of every page, in its order, in a folder that the page itself fills."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from command_line import STANDALONE, run_here
from documentation import PAGES, ROOT, blocks, run
from end_to_end.studios import studio

from gen_profile.assurance.proof import prove
from gen_profile.studies.sweep import run as sweep

README = PAGES[0]


def tour(page):
    """Leave out what the README tells to install the program and to run these tests: .ci/run does so."""
    return blocks(page)[3:] if page == README else blocks(page)


def test_the_first_blocks_install_and_test():
    install, on_windows, test = blocks(README)[:3]
    assert "pip install" in install.text and "gen-profile --export plc" in install.text
    assert on_windows.language == "powershell"
    assert "pip install" in test.text and "pytest" in test.text


def with_its_turn(page):
    """Run a page when it has changed and else in its own turn, not with all others."""
    return pytest.param(page, marks=pytest.mark.page(page.relative_to(ROOT).as_posix()), id=page.stem)


@pytest.mark.slow
@pytest.mark.parametrize("page", [with_its_turn(page) for page in PAGES if tour(page)])
def test_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(prove, "HISTORIES", 8)  # what the pages' commands do is the same
    monkeypatch.setattr(sweep, "CPU_COUNT", 1)
    scope = {}
    for block in tour(page):
        if block.title == "until Ctrl-C":
            with studio(*block.text.split()[2:]):
                pass
        else:
            run(block, scope)


def test_a_table_of_another_program_is_judged(tmp_path, monkeypatch):
    """The quintic move leaves what a shaper's base move leaves, whatever the file's dialect."""
    monkeypatch.chdir(tmp_path)
    script, commands = blocks(ROOT / "docs" / "python.md")[-2:]
    run(script, {"np": np})
    peaks = []
    for command in commands.text.splitlines()[1::2]:
        outcome = run_here(*shlex.split(command)[1:], "--json")
        assert outcome.code == 4, outcome.err
        peaks.append([row["residual_peaks_m"]["payload"] for row in outcome.document["check"]["scenarios"]])
    assert peaks[0][:3] == pytest.approx([0.00975, 0.02101, 0.00099], rel=0.01)
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-9)


if STANDALONE:

    def test_the_folder_is_as_small_as_its_page_says():
        size = sum(512 * path.lstat().st_blocks for path in [Path(STANDALONE), *Path(STANDALONE).rglob("*")])
        page = (ROOT / "docs" / "standalone.md").read_text("utf-8")
        stated = int(re.search(r"takes (\d+) MB unpacked", page)[1])
        assert size < 1e6 * stated < 350e6


def test_no_command_hides():
    """One in an indented block would not be run."""
    assert [page.name for page in PAGES if "\n    gen-profile " in page.read_text("utf-8")] == []
