"""Binaries for other computers: the Windows one is run under Wine, those for ARM and macOS are parsed."""

import io
import os
import shutil
import subprocess
import zipfile
from importlib import import_module
from pathlib import Path

import attrs
import fmpy
import numpy as np
import pytest
from fmu.drivers import Instance
from fmu.kinds import model_of
from fmu.test_fmi2_calls import functions_of_the_standard
from system_parts import program

from gen_profile.plants.registry import find_plant
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building import platforms
from gen_profile_fmu.building.build import build_fmu
from gen_profile_fmu.building.compiler import compile_library, find_compiler
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.building.platforms import PLATFORMS, host_platform
from gen_profile_fmu.description.fmu_files import Version

pytestmark = pytest.mark.slow

SYSTEM, PROFILE = (model_of(kind, find_plant("double-pendulum-crane")) for kind in ("system", "profile"))
WINE = "/usr/lib/wine/wine64"
WINE_LIBRARIES = "/usr/lib/x86_64-linux-gnu/wine/x86_64-windows"


@pytest.fixture
def lief():
    """Load it for who uses it: it takes each process that collects these tests half a second."""
    return import_module("lief")


def binaries(version, *names, model=SYSTEM):
    """Files below binaries/ of an FMU for some platforms."""
    with zipfile.ZipFile(io.BytesIO(build_fmu(model, version, names))) as archive:
        return {
            name.removeprefix("binaries/"): archive.read(name)
            for name in archive.namelist()
            if name.startswith("binaries/")
        }


def exported_by(binary):
    return {symbol.name.removeprefix("_") for symbol in binary.exported_symbols}


def test_linux_on_arm(lief):
    found = binaries(Version.FMI3, "linux-arm64")
    assert list(found) == ["aarch64-linux/paper_system.so"]
    elf = lief.ELF.parse(list(*found.values()))
    assert elf.header.machine_type == lief.ELF.ARCH.AARCH64
    names = exported_by(elf)
    assert {"fmi3DoStep", "fmi3GetAdjointDerivative"} <= names
    assert all(name.startswith("fmi3") for name in names)
    assert set(elf.libraries) <= {"libc.so.6", "libm.so.6", "ld-linux-aarch64.so.1"}
    versions = [v.name for needed in elf.symbols_version_requirement for v in needed.get_auxiliary_symbols()]
    assert versions
    assert all(name == "GLIBC_2.17" for name in versions)


def test_macos_for_both_processors(lief):
    names = ("macos-x86_64", "macos-arm64")
    assert set(binaries(Version.FMI3, *names, model=PROFILE)) == {
        "x86_64-darwin/paper_profile.dylib",
        "aarch64-darwin/paper_profile.dylib",
    }
    found = binaries(Version.FMI2, *names)
    assert list(found) == ["darwin64/paper_system.dylib"]
    universal = lief.MachO.parse(list(*found.values()))  # owns its parts
    both = [universal.at(index) for index in range(universal.size)]
    processors = lief.MachO.Header.CPU_TYPE
    assert [part.header.cpu_type for part in both] == [processors.X86_64, processors.ARM64]
    for part in both:
        trie = (part.dyld_exports_trie or part.dyld_info).exports
        names = {export.symbol.name.removeprefix("_") for export in trie}
        assert names - {"_mh_dylib_header", "__dso_handle"} == functions_of_the_standard()  # the linker's own
        assert part.build_version.minos == [11, 0, 0]
        assert {library.name for library in part.libraries} == {
            "paper_system.dylib",
            "/usr/lib/libSystem.B.dylib",
        }


def test_one_processor_of_macos_needs_no_universal_binary(lief):
    (found,) = binaries(Version.FMI2, "macos-arm64").values()
    universal = lief.MachO.parse(list(found))
    assert universal.size == 1
    assert universal.at(0).header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64


def bare_windows(folder):
    """Make a Windows of Wine's libraries alone, since an installed one takes Wine a minute."""
    (folder / "drive_c" / "windows").mkdir(parents=True)
    (folder / "drive_c" / "windows" / "system32").symlink_to(WINE_LIBRARIES)
    (folder / ".update-timestamp").write_text("disable")
    return folder


def test_windows_runs_under_wine(lief, cache, tmp_path):
    """The same values to 12 digits as this computer's binary computes."""
    wine = program(WINE, "wine64")
    (library,) = binaries(Version.FMI2, "windows-x86_64").values()
    parsed = lief.PE.parse(list(library))
    assert {entry.name for entry in parsed.get_export().entries} == functions_of_the_standard()
    (tmp_path / "system.dll").write_bytes(library)
    shutil.copy(Path(__file__).with_name("windows_runner.c"), tmp_path)
    for header in (Path(fmpy.__file__).parent / "c-code").glob("fmi2*.h"):
        shutil.copy(header, tmp_path)
    compiler = find_compiler("windows-x86_64")
    loads = attrs.evolve(compiler, libraries=(*compiler.libraries, "-lkernel32"))
    compile_library(loads, tmp_path, "windows_runner.c", "runner.dll", zig_cache=cache / "zig")
    fmu = cached_fmu(SYSTEM, Version.FMI2)
    first = SYSTEM.variables.offset("Q_U")
    names = [variable.name for variable in SYSTEM.variables.variables[first:]]
    arguments = ["system.dll", fmu.guid, "200", str(first), str(len(names)), "result.txt"]
    environment = {**os.environ, "WINEPREFIX": str(bare_windows(tmp_path / "wine")), "WINEDEBUG": "-all"}
    command = [wine, "rundll32", "runner.dll,run", *arguments]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (tmp_path / "result.txt").exists(), done.stderr
    found = np.loadtxt(tmp_path / "result.txt")
    instance = Instance(fmu, Version.FMI2, exchange=False)
    instance.begin({})
    expected = []
    for k in range(200):
        instance.fmu.doStep(k * 0.01, 0.01)
        expected.append(instance.read(*names))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    instance.close()


@pytest.mark.parametrize(
    ("system", "processor", "name"),
    [
        ("linux", "x86_64", "linux-x86_64"),
        ("linux", "aarch64", "linux-arm64"),
        ("darwin", "arm64", "macos-arm64"),
        ("win32", "AMD64", "windows-x86_64"),
    ],
)
def test_the_host_is_known(monkeypatch, system, processor, name):
    monkeypatch.setattr(platforms.sys, "platform", system)
    monkeypatch.setattr(platforms, "machine", lambda: processor)
    assert host_platform() == name
    assert name in PLATFORMS


def test_other_computers_are_told_what_to_do(monkeypatch):
    monkeypatch.setattr(platforms, "machine", lambda: "riscv64")
    with pytest.raises(CosimulationError, match=r"riscv64.*linux-x86_64"):
        host_platform()
