"""The compiler that is chosen, what it says, and that the hand-written C is clean."""

import os
import subprocess
import sys
import tarfile
from functools import partial
from importlib import metadata
from pathlib import Path

import fmu_manipulation_toolbox
import pytest
from fmu.kinds import KINDS, model_of
from system_parts import program

from gen_profile.motion.profile import sample
from gen_profile.plants.registry import find_plant
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building import platforms
from gen_profile_fmu.building.compiler import PACKED, Compiler, compile_library, find_compiler
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.description.fmu_files import SOURCE_FILE, Version, sources, standard_headers
from gen_profile_fmu.running.cosimulation import PlantCosimulation
from gen_profile_fmu.running.instances import loop_sources

CRANE = find_plant("double-pendulum-crane")
STRICT = (
    *("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"),
    *("-Wanon-enum-enum-conversion", "-Wmissing-prototypes", "-Wdouble-promotion", "-Wunreachable-code"),
)
TARGETS = "x86_64-linux-gnu", "x86_64-windows-gnu"
SMALL_STACK = "-Wframe-larger-than=4000"  # bytes; a page, beyond which Windows wants a runtime's probes


HEADERS = Path(fmu_manipulation_toolbox.__file__).parent / "resources" / "fmi"  # unaltered


@pytest.fixture
def written(tmp_path):
    """A folder with all C files of an FMU."""

    def write(plant, kind, version):
        for name, text in sources(model_of(kind, plant), version).code.items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path

    return write


@pytest.fixture
def zig_cc(tmp_path, cache):
    """Run Zig's C compiler on one of the sources; what it writes to its standard output."""

    def run(*arguments):
        caches = dict.fromkeys(("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"), str(cache / "zig"))
        command = [sys.executable, "-m", "ziglang", "cc", *arguments]
        done = subprocess.run(
            command, cwd=tmp_path, env=os.environ | caches, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "kind", "version"),
    [
        *((CRANE, kind, Version.FMI2) for kind in (*KINDS, "planned-system")),  # a planner is a part of that
        *((find_plant(name), "system", Version.FMI3) for name in ("tower-crane", "slosh-tank")),
    ],
)
def test_no_source_has_a_warning(written, zig_cc, plant, kind, version):
    """By Clang's front end; GNU's is asked where importers' compilers are."""
    written(plant, kind, version)
    for target in TARGETS:
        words = ("-target", target, SMALL_STACK, "-isystem", str(HEADERS))
        zig_cc(*STRICT, *words, "-c", SOURCE_FILE, "-o", "object.o")


def test_no_compiled_loop_has_a_warning(tmp_path, zig_cc):
    headers = standard_headers(Version.FMI2)
    texts = loop_sources() | {name: f"#pragma GCC system_header\n{text}" for name, text in headers.items()}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    # Python alone calls what is exported
    zig_cc(*STRICT, "-Wno-missing-prototypes", "-c", "loops.c", "-o", "object.o")


def test_zig_is_the_default():
    compiler = find_compiler()
    assert Path(compiler.command[0]).stem == "zig"
    assert "-target" in compiler.command
    assert compiler.identity.startswith("ziglang\n")


@pytest.mark.slow
def test_a_system_compiler_can_be_named(crane, quintic, monkeypatch, tmp_path):
    system = program("cc", "gcc")
    with PlantCosimulation(crane) as zig:
        expected = zig.run(sample(quintic, 0.01), crane.nominal(), max_step=1e-3, settle=1.0)
        folder = plant_fmu(crane).folder
    monkeypatch.setenv("GEN_PROFILE_CC", f"{system} -DNDEBUG")
    command = find_compiler().command
    assert (command[0], command[-1]) == (system, "-DNDEBUG")
    assert plant_fmu(crane).folder != folder
    with PlantCosimulation(crane) as named:
        found = named.run(sample(quintic, 0.01), crane.nominal(), max_step=1e-3, settle=1.0)
    assert abs(found.sway - expected.sway).max() < 1e-12


def test_a_compiler_that_is_not_there_is_named(crane, monkeypatch):
    monkeypatch.setenv("GEN_PROFILE_CC", "no-such-compiler -O3")
    with pytest.raises(CosimulationError, match="no-such-compiler does not run: No such file"):
        plant_fmu(crane)


def test_what_a_failing_compiler_says_is_passed_on(tmp_path, cache):
    (tmp_path / "fmu.c").write_text("int broken = ;")
    with pytest.raises(CosimulationError, match=r"exit code 1(.|\n)*broken"):
        compile_library(find_compiler(), tmp_path, "fmu.c", "library.so", zig_cache=cache / "zig")


@pytest.fixture
def packed(tmp_path):
    """A folder whose compiler is packed: it writes what its library is to hold."""
    (tmp_path / "zig").write_text("#!/bin/sh\nwhile [ $1 != -o ]; do shift; done; pwd >$2\n")
    (tmp_path / "zig").chmod(0o755)
    with tarfile.open(tmp_path / PACKED, "w:xz") as archive:
        archive.add(tmp_path / "zig", "zig")
    (tmp_path / "zig").unlink()
    (tmp_path / "cache").mkdir()
    command = (str(tmp_path / "zig"), "cc")
    return partial(
        compile_library,
        Compiler(command=command, libraries=(), identity="packed"),
        tmp_path,
        "fmu.c",
        zig_cache=tmp_path / "cache" / "zig",
    )


def test_a_packed_compiler_is_unpacked_once(packed, tmp_path):
    packed("first.so")
    (tmp_path / PACKED).write_bytes(b"no archive any more")
    packed("second.so")
    assert (tmp_path / "second.so").read_text() == (tmp_path / "first.so").read_text() == f"{tmp_path}\n"
    assert [path.name for path in (tmp_path / "cache").iterdir()] == [
        f"ziglang-{metadata.version('ziglang')}"
    ]


def test_a_damaged_packed_compiler_is_a_sentence_and_leaves_nothing(packed, tmp_path):
    whole = (tmp_path / PACKED).read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole[:99] + bytes(9) + whole[108:]):
        (tmp_path / PACKED).write_bytes(damaged)
        with pytest.raises(CosimulationError, match=r"zig.tar.xz is damaged .* unpack gen-profile anew"):
            packed("library.so")
        assert list((tmp_path / "cache").iterdir()) == []


def test_other_computers_are_told_what_to_do(monkeypatch):
    monkeypatch.setattr(platforms, "machine", lambda: "riscv64")
    with pytest.raises(CosimulationError, match=f"{sys.platform} riscv64.*linux-x86_64"):
        find_compiler()
