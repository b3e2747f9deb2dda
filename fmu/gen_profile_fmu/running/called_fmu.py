"""Functions of an FMU for compiled loops, which call them without an interpreter between."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_double, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from gen_profile.motion.profile import Array
from gen_profile_fmu.building.build import compile_texts
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import find_compiler
from gen_profile_fmu.description.fmu_files import Version, digest, standard_headers
from gen_profile_fmu.model.c_sources import hand_written

_HEADER, _SOURCE, _NAME = "called_fmu.h", "loops.c", "loops"
_LOOPS = ("many_runs", "sampled_run", "block_run")  # each a C file and the function in it
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


def doubles(array: Array) -> Any:
    """Point to the numbers of an array, which must outlive the call."""
    return array.ctypes.data_as(POINTER(c_double))


def unsigned(numbers: Sequence[int]) -> Any:
    """Make an array of value references."""
    return (c_uint * len(numbers))(*numbers)


def loop_sources() -> dict[str, str]:
    """Read the loops of this package and their header, by file name; `loops.c` includes all."""
    texts = hand_written("loops", _HEADER, *(f"{name}.c" for name in _LOOPS))
    return {**texts, _SOURCE: "".join(f'#include "{name}.c"\n' for name in _LOOPS)}


@cache
def compiled_loops() -> Any:
    """Compile the loops of this package, or find them in the cache, and load them.

    Raises
    ------
    CosimulationError
        There is no compiler, it fails, or no cache folder can be written.
    """
    compiler, library, texts = find_compiler(), f"{_NAME}{fmpy.sharedLibraryExtension}", loop_sources()
    for version in Version:
        texts |= standard_headers(version)

    def make(cache: Path) -> dict[str, bytes]:
        return {library: compile_texts(texts, _SOURCE, compiler, library, cache)}

    parts = (part.encode("utf-8") for part in (compiler.identity, *texts.values()))
    return ctypes.CDLL(str(cached(f"{_NAME}-{digest(*parts)[:32]}", make) / library))
