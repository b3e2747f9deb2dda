"""The README's commands, word for word, after those that install the program and run these tests."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from command_line import PROGRAM

pytestmark = pytest.mark.slow

README = Path(__file__).parents[2] / "README.md"
BLOCKS = re.findall(r"^```sh\n(.*?)^```$", README.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def test_the_first_two_blocks_install_and_test():
    """CI runs them on a fresh machine, see .ci/run."""
    install, test, *tour = BLOCKS
    assert "pip install" in install and "gen-profile --export plc" in install
    assert "pip install" in test and "pytest" in test
    assert tour


def test_the_tour_runs_from_top_to_bottom(tmp_path):
    path = os.pathsep.join([str(PROGRAM.parent), os.environ["PATH"]])
    for block in BLOCKS[2:]:
        done = subprocess.run(
            ["bash", "-euc", block],
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == 0, f"{block}\n{done.stderr}"
    assert (tmp_path / "gen-profile-out" / "manifest.json").exists() or (tmp_path / "deploy").exists()


def linked_files():
    return sorted(set(re.findall(r"\]\((?!https?:)([^)#]+)", README.read_text("utf-8"))))


@pytest.mark.parametrize("name", linked_files())
def test_what_it_links_to_is_there(name):
    assert (README.parent / name).exists()
