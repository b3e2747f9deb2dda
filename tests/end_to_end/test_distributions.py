"""Wheel and source archive: the same bytes from wherever they are built, and nothing left out."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import gen_profile

ROOT = Path(__file__).parents[2]
SOURCES = [ROOT / folder for folder in ("generator", "fmu", "exporters", "recheck")]


def build(source, folder, *targets):
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder), *targets]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_who_cites_names_this_version():
    assert f"\nversion: {gen_profile.__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


@pytest.mark.slow
def test_a_wheel_from_the_source_archive_is_that_from_the_checkout(tmp_path):
    build(ROOT, tmp_path / "checkout")
    (archive,) = (tmp_path / "checkout").glob("*.tar.gz")
    subprocess.run(["tar", "-xf", archive, "-C", tmp_path], check=True)
    build(tmp_path / archive.name.removesuffix(".tar.gz"), tmp_path / "archive", "-t", "wheel")
    (one,), (other,) = (tuple((tmp_path / name).glob("*.whl")) for name in ("checkout", "archive"))
    assert one.read_bytes() == other.read_bytes()
    ours = {
        str(file.relative_to(source))
        for source in SOURCES
        for file in source.rglob("*")
        if file.is_file() and file.suffix != ".pyc" and ".egg-info" not in str(file)
    }
    with zipfile.ZipFile(one) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name} - {"gen_profile/commit.txt"}
        licences = [name for name in wheel.namelist() if name.endswith("/LICENSE")]
    pages = {f"gen_profile/docs/{file.name}" for file in (ROOT / "docs").glob("*.md")}
    pictures = {
        name for name in held - ours if name.startswith("gen_profile/docs/") and name.endswith(".png")
    }
    assert held == ours | pages | pictures
    assert {name.rpartition("/")[2] for name in pictures} >= {"studio.png", "bay-crane.png"}
    assert any("dist-info/licenses/LICENSE" in name for name in licences)
    assert any("uPlot" in name and "dist-info" in name for name in licences)
