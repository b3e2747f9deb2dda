"""Import layers: every module stands in one, and what must start fast does."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "gen_profile": ROOT / "generator",
    "gen_profile_fmu": ROOT / "fmu",
    "gen_profile_exporters": ROOT / "exporters",
}


def layers():
    """Modules that the layers name, in their order."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (contract,) = (contract for contract in contracts if contract["type"] == "layers")
    return [
        name for layer in contract["layers"] for name in layer.replace("|", ":").replace(" ", "").split(":")
    ]


def modules():
    """Every module of the three packages, by its dotted name."""
    for package, root in PACKAGES.items():
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_no_layer_is_named_twice():
    assert len(set(layers())) == len(layers())


@pytest.mark.parametrize("module", [name for name in modules() if name != "gen_profile"])
def test_every_module_stands_in_a_layer(module):
    assert [layer for layer in layers() if f"{module}.".startswith(f"{layer}.")] != []


@pytest.mark.parametrize("layer", layers())
def test_every_layer_exists(layer):
    assert layer in set(modules())


def loaded_by(*imported):
    script = f"import sys, {', '.join(imported)}; print(*sys.modules)"
    return set(
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=True
        ).stdout.split()
    )


@pytest.mark.parametrize("heavy", ["casadi", "scipy", "fmpy", "matplotlib"])
def test_reading_a_spec_or_an_artefact_loads_nothing_heavy(heavy):
    assert heavy not in loaded_by(
        "gen_profile.spec_reading", "gen_profile_exporters.registry", "gen_profile.profile"
    )


@pytest.mark.parametrize("heavy", ["casadi", "scipy"])
def test_shapers_need_numpy_only(heavy):
    assert heavy not in loaded_by("gen_profile.shapers.shaped_move")


def test_that_test_would_see_casadi():
    assert "casadi" in loaded_by("gen_profile.problem.linearization")
