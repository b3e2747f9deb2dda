"""The picture of a comparison."""

import os
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import run_here, run_process
from matplotlib import image

from gen_profile.errors import OutputError
from gen_profile.spec_reading import preset_spec
from gen_profile.workflows.compare import Comparison
from gen_profile.workflows.comparison_plot import draw

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


@pytest.mark.parametrize(("preset", "load"), [("paper-beta0", "payload"), ("gantry-crane", "load")])
def test_a_load_with_two_directions_is_drawn_as_a_whole(tmp_path, preset, load):
    picture = tmp_path / "picture.svg"
    assert run_here("compare", "--preset", preset, *FEW, "--plot", picture).code == 0
    text = picture.read_text("utf-8")
    assert f"<!-- worst residual sway of the {load} (mm) -->" in text
    assert f"<!-- {load} sway (mm), nominal machine -->" in text
    assert "payload-" not in text


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_of_one_comparison_are_alike_to_the_byte(tmp_path, suffix, monkeypatch):
    pictures = []
    for clock in (1e9, 1.1e9):
        monkeypatch.setattr("time.time", lambda clock=clock: clock)
        assert run_here("compare", *FEW, "--plot", tmp_path / f"picture{suffix}").code == 0
        pictures.append((tmp_path / f"picture{suffix}").read_bytes())
    assert pictures[0] == pictures[1]


@pytest.mark.parametrize("name", ["picture.xyz", "picture"])
def test_a_picture_of_unknown_kind_is_refused_before_the_work(tmp_path, name):
    outcome = run_here("compare", "--plot", tmp_path / name)
    assert (outcome.code, len(outcome.err.splitlines())) == (2, 1)
    assert outcome.errors == [f"Error: --plot {tmp_path / name}: name a file that ends in .png, .svg, .pdf."]


def test_a_picture_that_cannot_be_written_is_a_sentence(tmp_path):
    outcome = run_here("compare", *FEW, "--plot", tmp_path / "no" / "picture.png")
    assert outcome.code == 2
    (error,) = outcome.errors
    assert error.endswith("cannot write the picture: No such file or directory.")
    assert list(tmp_path.iterdir()) == []


HIDE = """
import sys
from importlib.machinery import PathFinder

find = PathFinder.find_spec
PathFinder.find_spec = lambda name, *more: None if name == "matplotlib" else find(name, *more)
"""
INSTALL = "Error: --plot needs Matplotlib: pip install 'gen-profile[plot]'."


def test_without_matplotlib_the_sentence_tells_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("gen_profile.workflows.picture.find_spec", lambda _: None)
    outcome = run_here("compare", *FEW, "--plot", tmp_path / "picture.png")
    assert (outcome.code, outcome.errors) == (2, [INSTALL])


def test_where_matplotlib_is_not_installed_the_program_says_so_too(tmp_path):
    """A start-up file of Python hides it."""
    (tmp_path / "sitecustomize.py").write_text(HIDE, "utf-8")
    paths = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    words = ("compare", *FEW, "--plot", "picture.png")
    outcome = run_process(*words, cwd=tmp_path, PYTHONPATH=os.pathsep.join(paths))
    assert (outcome.code, outcome.errors) == (2, [INSTALL])
    assert not (tmp_path / "picture.png").exists()


def test_where_no_method_has_a_motion_there_is_nothing_to_draw(tmp_path):
    nothing = Comparison(
        spec=preset_spec("paper"), rows=(), left_out={}, efficient=frozenset(), recommended={}
    )
    with pytest.raises(OutputError, match="no method has a motion for this move"):
        draw(nothing, tmp_path / "picture.png")
    assert list(tmp_path.iterdir()) == []
