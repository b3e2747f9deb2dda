"""The picture of a comparison."""

import os
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import run_here, run_process
from matplotlib import image

FEW = ("--set", "cost.sway_weight=0", "--set", "robustness={}")


def test_a_bitmap_shows_lines_of_many_colours(tmp_path):
    assert run_here("compare", "--plot", tmp_path / "picture.png").code == 0
    pixels = image.imread(tmp_path / "picture.png")
    height, width, _ = pixels.shape
    assert height > 800 and width > 800
    bytes_ = (255 * pixels[..., :3]).astype(int).reshape(-1, 3)
    colours, counts = np.unique(bytes_, axis=0, return_counts=True)
    vivid = (np.ptp(colours, axis=1) > 80) & (counts > 100)
    assert vivid.sum() >= 5  # one colour per method
    rows_with_ink = (pixels[..., :3].min(axis=2) < 0.9).any(axis=1)
    assert rows_with_ink.mean() > 0.8


def test_a_vector_picture_is_well_formed_and_names_what_it_shows(tmp_path):
    assert run_here("compare", "--plot", tmp_path / "picture.svg").code == 0
    root = ElementTree.parse(tmp_path / "picture.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    paths = root.findall(".//{http://www.w3.org/2000/svg}path")
    assert sum(len(path.get("d", "")) > 2000 for path in paths) >= 15  # three curves per method


@pytest.mark.parametrize("name", ["picture.xyz", "no/such/folder/picture.png"])
def test_a_picture_that_cannot_be_written_is_a_sentence(tmp_path, name):
    outcome = run_here("compare", *FEW, "--plot", tmp_path / name)
    assert outcome.code == 2
    (error,) = outcome.errors
    assert error.startswith(f"Error: --plot {tmp_path / name}: ")
    assert error.endswith(".")
    assert list(tmp_path.iterdir()) == []


INSTALL = "Error: --plot needs Matplotlib: pip install 'gen-profile[plot]'."


def test_without_matplotlib_the_sentence_tells_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    outcome = run_here("compare", *FEW, "--plot", tmp_path / "picture.png")
    assert (outcome.code, outcome.errors) == (2, [INSTALL])
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_installed_program_says_so_too(tmp_path):
    blocked = tmp_path / "blocked"
    blocked.mkdir()
    (blocked / "matplotlib.py").write_text("raise ImportError('not installed here')\n")
    paths = [str(blocked), *filter(None, [os.environ.get("PYTHONPATH")])]
    words = ("compare", *FEW, "--plot", "picture.png")
    outcome = run_process(*words, cwd=tmp_path, PYTHONPATH=os.pathsep.join(paths))
    assert (outcome.code, outcome.errors) == (2, [INSTALL])
    assert not (tmp_path / "picture.png").exists()
