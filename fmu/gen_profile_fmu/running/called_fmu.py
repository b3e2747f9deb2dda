"""Functions of an FMU for compiled loops, which call them without an interpreter between."""

from __future__ import annotations

import ctypes
from ctypes import Structure, c_void_p
from pathlib import Path
from typing import Any

import fmpy

from gen_profile_fmu.building.build import compile_texts
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import find_compiler
from gen_profile_fmu.description.fmu_files import Version, digest, standard_headers
from gen_profile_fmu.model.c_sources import FOLDER

_HEADER = "called_fmu.h"
_FUNCTIONS = {
    Version.FMI2: (
        "fmi2Reset",
        "fmi2SetupExperiment",
        "fmi2EnterInitializationMode",
        "fmi2ExitInitializationMode",
        "fmi2SetReal",
        "fmi2GetReal",
        "fmi2DoStep",
    ),
    Version.FMI3: (
        "fmi3Reset",
        "fmi3EnterInitializationMode",
        "fmi3ExitInitializationMode",
        "fmi3SetFloat64",
        "fmi3GetFloat64",
        "fmi3DoStep",
    ),
}


class CalledFmu(Structure):
    """What called_fmu.h calls `Fmu`: functions of one version, those of the other null, and the instance."""

    _fields_ = [
        *((name, c_void_p) for names in _FUNCTIONS.values() for name in names),
        ("instance", c_void_p),
    ]


def called(slave: Any, version: Version) -> CalledFmu:
    """Take the functions of an instance in memory."""
    fmu = CalledFmu(instance=slave.component)
    for name in _FUNCTIONS[version]:
        setattr(fmu, name, ctypes.cast(getattr(slave.dll, name), c_void_p).value)
    return fmu


def compiled_loop(name: str) -> Any:
    """Compile a loop of this package, or find it in the cache, and load it.

    Parameters
    ----------
    name : str
        Of its C file without suffix, and of the function there.

    Raises
    ------
    CosimulationError
        There is no compiler, it fails, or no cache folder can be written.
    """
    compiler, library, source = find_compiler(), f"{name}{fmpy.sharedLibraryExtension}", f"{name}.c"
    texts = {file: (FOLDER / file).read_text(encoding="utf-8") for file in (source, _HEADER)}
    for version in Version:
        texts |= standard_headers(version)

    def make(cache: Path) -> dict[str, bytes]:
        return {library: compile_texts(texts, source, compiler, library, cache)}

    parts = (part.encode("utf-8") for part in (compiler.identity, *texts.values()))
    return getattr(ctypes.CDLL(str(cached(f"{name}-{digest(*parts)[:32]}", make) / library)), name)
