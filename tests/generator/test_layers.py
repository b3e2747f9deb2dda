"""Import layers: every module stands in one, and what must start fast does."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "gen_profile": ROOT / "generator",
    "gen_profile_fmu": ROOT / "fmu",
    "gen_profile_exporters": ROOT / "exporters",
    "gen_profile_recheck": ROOT / "recheck",
}

SAYING = (ast.Raise, ast.Yield)  # of errors, and of warnings


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


def test_every_module_stands_in_a_layer():
    tops = tuple(f"{layer}." for layer in layers())
    assert [name for name in modules() if not f"{name}.".startswith(tops)] == ["gen_profile"]


@pytest.mark.parametrize("layer", layers())
def test_every_layer_exists(layer):
    assert layer in set(modules())


def printed(script, **environment):
    """Run Python in a process of its own, and give what it prints."""
    return subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@cache
def loaded_by(*imported):
    return set(printed(f"import sys, {', '.join(imported)}; print(*sys.modules)").split())


@pytest.mark.parametrize("heavy", ["casadi", "scipy", "fmpy", "matplotlib"])
def test_reading_a_spec_or_an_artefact_loads_nothing_heavy(heavy):
    assert heavy not in loaded_by(
        "gen_profile.spec.reading", "gen_profile_exporters.registry", "gen_profile.motion.profile"
    )


@pytest.mark.parametrize("heavy", ["casadi", "scipy"])
def test_shapers_need_numpy_only(heavy):
    assert heavy not in loaded_by("gen_profile.methods.shapers.shaped_move")


@pytest.mark.slow
@pytest.mark.parametrize("slow", ["scipy.stats", "scipy.special", "matplotlib", "plotly", "distributed"])
def test_the_main_job_does_not_wait_for_what_it_seldom_needs(slow):
    assert slow not in loaded_by("gen_profile.delivery.designs.design")


FAULTY = """
import sys
from gen_profile.cli import main
sys.argv = ["gen-profile", *{arguments!r}]
try:
    main()
except SystemExit as stop:
    print(stop.code, *sys.modules)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "plant.m1=-1"],
        ["--export", "cvs"],
        ["compare", "--set", "L1=5"],
        ["fmu", "plant", "no.toml"],
    ],
)
def test_a_fault_of_a_spec_waits_for_nothing_heavy(arguments):
    code, *loaded = printed(FAULTY.format(arguments=arguments)).split()
    assert code == "2"
    assert not {"casadi", "scipy", "fmpy", "rich", "filelock", "lxml", "can"} & {*loaded}


def test_help_waits_for_no_library_of_other_commands():
    code, *loaded = printed(FAULTY.format(arguments=["--help"])).split("\n")[-2].split()
    assert code == "0"
    assert not {"numpy", "importlib.metadata", "email", "zipfile", "socket"} & {*loaded}


def test_that_test_would_see_casadi():
    assert "casadi" in loaded_by("gen_profile.dynamics.problem.linearization")


@pytest.mark.slow
def test_every_module_loads_where_the_system_lacks_what_only_some_have_and_none_loads_scipy_stats():
    """Which takes half a second: who uses it loads it then."""
    imports = "\n".join(f"import {name}" for name in modules())
    hidden = os.pathsep.join([str(ROOT / "tests" / "other_systems"), os.environ.get("PYTHONPATH", "")])
    shown = "print(hasattr(os, 'fork'), 'scipy.stats' in sys.modules)"
    assert printed(f"import os, sys\n{imports}\n{shown}", PYTHONPATH=hidden) == "False False\n"


@cache
def words_of(module):
    """All words of a module, and names of the modules in it; none where there is no such module."""
    home = PACKAGES[module.partition(".")[0]].joinpath(*module.split("."))
    file = home / "__init__.py" if home.is_dir() else home.with_suffix(".py")
    return {
        *re.findall(r"\w+", file.read_text("utf-8") if file.exists() else ""),
        *(p.stem for p in home.glob("*")),
    }


@pytest.mark.slow
def test_every_name_that_tests_and_benchmarks_import_exists():
    """Benchmarks and the programs of other kernels run seldom, and would not show it."""
    missing = [
        (str(file.relative_to(ROOT)), one.name)
        for file in (ROOT / "tests").rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in PACKAGES
        for one in node.names
        if one.name not in words_of(node.module)
    ]
    assert missing == []


def test_the_table_in_the_documentation_lists_the_layers():
    listed = printed(
        f"import runpy; runpy.run_path({str(ROOT / 'docs' / 'list_layers.py')!r}, run_name='__main__')"
    )
    assert listed in (ROOT / "docs" / "architecture.md").read_text("utf-8")
    assert all(f"`{layer.removeprefix('gen_profile.')}`" in listed for layer in layers())


@pytest.mark.slow
def test_no_name_of_a_class_has_two_meanings():
    homes = defaultdict(set)
    for package, root in PACKAGES.items():
        for file in (root / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.ClassDef):
                    homes[node.name].add(str(file.relative_to(root)))
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}


@pytest.mark.slow
def test_only_the_command_line_names_flags_in_errors():
    for package, root in PACKAGES.items():
        for file in set((root / package).rglob("*.py")) - set((root / package / "cli").rglob("*.py")):
            nodes = ast.walk(ast.parse(file.read_text("utf-8")))
            said = [part for node in nodes if isinstance(node, SAYING) for part in ast.walk(node)]
            texts = [str(part.value) for part in said if isinstance(part, ast.Constant)]
            assert not [text for text in texts if re.search(r"(^|[ (])--([a-z]|$)", text)], file
