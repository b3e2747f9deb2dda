"""The compiler that is chosen, what it says, and that the hand-written C is clean."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

import gen_profile_fmu
from gen_profile.errors import CosimulationError
from gen_profile.problem.dynamics import dynamics
from gen_profile.profile import sample
from gen_profile_fmu import compiler as compiler_module
from gen_profile_fmu.c_sources import c_sources, identity_header
from gen_profile_fmu.compiler import compile_library, find_compiler
from gen_profile_fmu.cosimulation import PlantCosimulation
from gen_profile_fmu.plant_fmu import plant_fmu
from gen_profile_fmu.variables import plant_variables

STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")


@pytest.fixture
def sources(crane, tmp_path):
    """A folder with all C files of the crane's FMU."""
    texts = c_sources(crane, dynamics(crane), plant_variables(crane))
    for name, text in {**texts, "identity.h": identity_header("0")}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    for header in (Path(fmpy.__file__).parent / "c-code").glob("fmi2*.h"):
        shutil.copy(header, tmp_path)
    return tmp_path


@pytest.fixture
def zig_cc(sources, cache):
    """Run Zig's C compiler on one of the sources; what it writes to its standard output."""

    def run(*arguments):
        caches = dict.fromkeys(("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"), str(cache / "zig"))
        command = [sys.executable, "-m", "ziglang", "cc", *arguments]
        done = subprocess.run(
            command, cwd=sources, env=os.environ | caches, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.mark.parametrize(
    "name", sorted(path.name for path in Path(gen_profile_fmu.__file__).parent.glob("*.c"))
)
def test_hand_written_c_has_no_warning(zig_cc, name):
    zig_cc(*STRICT, "-c", name, "-o", "object.o")


@pytest.mark.parametrize("name", ["plant_acceleration", "plant_jump", "plant_outputs"])
def test_equations_are_not_exported_on_windows(zig_cc, name):
    text = zig_cc("-target", "x86_64-windows-gnu", "-E", f"{name}.c")
    assert f"int {name}(const double** arg" in text
    assert "dllexport" not in text.partition("casadi")[2]


def test_zig_is_the_default():
    compiler = find_compiler()
    assert Path(compiler.command[0]).stem == "zig"
    assert "-target" in compiler.command
    assert compiler.identity.startswith("ziglang\n")


def test_a_system_compiler_can_be_named(crane, quintic, monkeypatch, tmp_path):
    system = shutil.which("cc")
    assert system, "This test needs a system C compiler; install gcc."
    with PlantCosimulation(crane) as zig:
        expected = zig.run(sample(quintic, 0.01), crane.nominal(), max_step=1e-3, settle=1.0)
        folder = plant_fmu(crane).folder
    monkeypatch.setenv("GEN_PROFILE_CC", f"{system} -DNDEBUG")
    assert find_compiler().command[:2] == (system, "-DNDEBUG")
    assert plant_fmu(crane).folder != folder
    with PlantCosimulation(crane) as named:
        found = named.run(sample(quintic, 0.01), crane.nominal(), max_step=1e-3, settle=1.0)
    assert abs(found.sway - expected.sway).max() < 1e-12


def test_a_compiler_that_is_not_there_is_named(crane, monkeypatch):
    monkeypatch.setenv("GEN_PROFILE_CC", "no-such-compiler -O3")
    with pytest.raises(CosimulationError, match="no-such-compiler does not run: No such file"):
        plant_fmu(crane)


def test_what_a_failing_compiler_says_is_passed_on(sources, cache):
    (sources / "driven_plant.c").write_text("int broken = ;")
    with pytest.raises(CosimulationError, match=r"exit code 1(.|\n)*broken"):
        compile_library(find_compiler(), sources, "library.so", zig_cache=cache / "zig")


def test_other_computers_are_told_what_to_do(monkeypatch):
    monkeypatch.setattr(compiler_module, "machine", lambda: "riscv64")
    with pytest.raises(CosimulationError, match=f"{sys.platform} riscv64.*ziglang.*GEN_PROFILE_CC"):
        find_compiler()
