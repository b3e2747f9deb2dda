"""Every format by the command line: written together, checked one by one, refused in a sentence."""

import json

import numpy as np
import pytest
from command_line import run_here

from gen_profile_exporters.registry import BUILT_IN


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("deploy")
    words = [word for name in BUILT_IN for word in ("--export", name)]
    outcome = run_here(*words, "--cycle-time", "0.004", "--out", folder, "--json")
    assert (outcome.code, outcome.errors) == (0, [])
    return folder


@pytest.fixture(scope="module")
def artefacts(folder):
    """The first artefact of each format, which is the one that can be checked."""
    listed = json.loads((folder / "manifest.json").read_text("utf-8"))["artefacts"]
    return {artefact["format"]: artefact["path"] for artefact in reversed(listed)}


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_each_first_artefact_passes_its_check(folder, artefacts, name):
    outcome = run_here("check", folder / artefacts[name], "--json")
    assert (outcome.code, outcome.errors) == (0, [])
    assert outcome.document["artefact"]["format"] == name
    assert outcome.document["check"]["error_bound_m"] < 20e-6


@pytest.mark.parametrize("layout", ["segments", "samples", "counts"])
def test_the_layout_is_chosen_on_the_command_line(tmp_path, layout):
    outcome = run_here("--export", "plc", "--plc-layout", layout, "--no-check", "--out", tmp_path)
    assert outcome.code == 0
    spec = json.loads((tmp_path / "manifest.json").read_text("utf-8"))["spec"]
    assert spec["export"]["plc_layout"] == layout
    assert ("cPower5" in (tmp_path / "paper.st").read_text("ascii")) == (layout == "segments")


@pytest.mark.slow
def test_velocities_alone_pass_their_check(tmp_path):
    assert run_here("--csv-columns", "velocity", "--out", tmp_path).code == 0
    table = np.loadtxt(tmp_path / "paper.csv", delimiter=",", skiprows=1)
    assert table.shape == (3001, 2)
    assert run_here("check", tmp_path / "paper.csv").code == 0


def test_a_dialect_is_chosen_on_the_command_line(tmp_path):
    words = ("--csv-dialect", "sew", "--csv-columns", " position", "--no-check")
    assert run_here(*words, "--out", tmp_path).code == 0
    assert (tmp_path / "paper.csv").read_bytes().startswith(b"3001\r\n0.000;0.0\r\n")


def test_what_a_dialect_cannot_hold_is_refused_before_anything_is_written(tmp_path):
    outcome = run_here("--csv-dialect", "sew", "--out", tmp_path / "deploy")
    assert outcome.code == 5
    assert "sew holds one quantity of one axis" in outcome.errors[-1]
    assert not (tmp_path / "deploy").exists()


def test_an_altered_block_is_refused(folder, tmp_path):
    text = (folder / "paper.st").read_text("ascii")
    start = text.index("cPower3 : ")
    digit = next(at for at in range(start + 60, len(text)) if text[at] in "12345678")
    (tmp_path / "paper.st").write_text(text[:digit] + "9" + text[digit + 1 :], "ascii")
    (tmp_path / "manifest.json").write_bytes((folder / "manifest.json").read_bytes())
    outcome = run_here("check", tmp_path / "paper.st")
    assert outcome.code == 5
    assert "would refuse to start (nErrorId 5)" in outcome.errors[-1]
