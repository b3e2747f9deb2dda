"""Formats and machines of other distributions, found by their entry points."""

import os

import pytest
from command_line import run_process

FORMAT = """
from gen_profile_exporters.registry import Format

TEXT = Format(module="plugin_text", summary="positions, one a line", proof="untested", suffix=".txt")
"""
EXPORTER = """
import numpy as np
from gen_profile.motion.profile import SampledProfile, sample
from gen_profile_exporters.exporter import File

def encode(profile, target):
    lines = [repr(target.cycle_time), *map(repr, sample(profile, target.cycle_time).position[:, 0].tolist())]
    return (File(filename=f"{target.name}.txt", content="\\n".join(lines).encode()),)

def replay(content, target):
    cycle, *positions = map(float, content.split())
    return SampledProfile(cycle_time=cycle, position=np.array(positions)[:, None])
"""
MACHINE = '''
import numpy as np
from gen_profile.plants.plant import Coordinate, Equations, Outputs, Parameter, Plant

def equations(q_u, dq_u, q_a, dq_a, p):
    """l φ̈ + g sin φ = ẍ cos φ."""
    (phi,) = q_u
    return Equations(M_uu=[[p.length]], M_au=[[-np.cos(phi)]], K_u=[-p.g * np.sin(phi)], G_u=[0.0])

def outputs(q_u, q_a, p):
    (phi,) = q_u
    return Outputs(
        sway=[p.length * np.sin(phi)], height=[-p.length * np.cos(phi)], angle=[phi]
    )

PLANT = Plant(
    type="pendulum",
    summary="a load on a rope",
    parameters=(
        Parameter(name="length", unit="m", description="rope", nominal=1.0, lower=0.1, upper=10.0),
        Parameter(name="g", unit="m/s^2", description="gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(Coordinate(name="cart", unit="m"),),
    unactuated=(Coordinate(name="phi", unit="rad"),),
    loads=("load",),
    equations=equations,
    outputs=outputs,
)
'''
SPEC = """
name = "plugged"
[plant]
type = "pendulum"
[move]
distance = 1.0
duration = 5.0
[robustness]
uncertain = { length = 0.1 }
"""


@pytest.fixture
def installed(tmp_path):
    """A folder as pip would leave it: modules, and metadata with entry points."""
    site = tmp_path / "site"
    metadata = site / "plugin-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[gen_profile.exporters]\ntext = plugin_format:TEXT\n"
        "[gen_profile.plants]\npendulum = plugin_machine:PLANT\n"
    )
    (site / "plugin_format.py").write_text(FORMAT, "utf-8")
    (site / "plugin_text.py").write_text(EXPORTER, "utf-8")
    (site / "plugin_machine.py").write_text(MACHINE, "utf-8")
    (tmp_path / "plugged.toml").write_text(SPEC, "utf-8")
    return tmp_path


def run(folder, *words):
    paths = [str(folder / "site"), *filter(None, [os.environ.get("PYTHONPATH")])]
    return run_process(*words, cwd=folder, PYTHONPATH=os.pathsep.join(paths))


@pytest.mark.slow
def test_they_are_listed(installed):
    assert run(installed, "formats", "--json").document["formats"]["text"]["suffix"] == ".txt"
    assert run(installed, "plants", "--json").document["plants"]["pendulum"]["loads"] == ["load"]


@pytest.mark.slow
def test_they_design_export_and_check(installed):
    outcome = run(installed, "plugged.toml", "--export", "text", "--export", "csv", "--json")
    assert outcome.code == 0, outcome.err
    assert [row["path"] for row in outcome.document["artefacts"]] == [
        "gen-profile-out/plugged.txt",
        "gen-profile-out/plugged.csv",
    ]
    judged = run(installed, "check", "gen-profile-out/plugged.txt", "--json")
    assert judged.code == 0, judged.err
    assert judged.document["artefact"] == {
        "format": "text",
        "path": "gen-profile-out/plugged.txt",
        "manifest": "matches",
        "companions": {},
    }


@pytest.mark.slow
def test_without_them_the_spec_names_what_is_known(installed):
    outcome = run_process("plugged.toml", cwd=installed)
    assert outcome.code == 2
    assert "plant.type: unknown machine 'pendulum'" in outcome.err
    assert "double-pendulum-crane" in outcome.err


@pytest.mark.slow
def test_a_broken_one_is_a_sentence_and_blocks_only_itself(installed):
    (installed / "site" / "plugin_format.py").write_text("import nonexistent\n")
    outcome = run(installed, "--preset", "paper", "--export", "text")
    assert outcome.code == 2
    (error,) = outcome.errors
    assert "'text'" in error and "update or uninstall the package" in error
    assert run(installed, "--preset", "paper", "--export", "csv").code == 0
