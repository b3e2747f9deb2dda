"""An FMU of ours in memory (FMI 2), by FMPy, with its messages kept, and its functions for compiled loops."""

import ctypes
import logging
from collections.abc import Sequence
from contextlib import suppress
from ctypes import POINTER, Structure, c_double, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import fmpy
from fmpy import calloc, free
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2OK,
)

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError
from gen_profile.support.private_folder import ENVIRONMENT_VARIABLE
from gen_profile_fmu.building.build import compile_texts
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import find_compiler
from gen_profile_fmu.building.plant_fmu import PlantFmu
from gen_profile_fmu.description.fmu_files import Version, digest, standard_headers
from gen_profile_fmu.model.c_sources import hand_written

_logger = logging.getLogger(__name__)
_HEADER, _SOURCE, _NAME = "called_fmu.h", "loops.c", "loops"
_LOOPS = ("many_runs", "sampled_run", "block_run")  # each a C file and the function in it
_FUNCTIONS = (
    "fmi2Reset",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2SetReal",
    "fmi2GetReal",
    "fmi2DoStep",
)


class CalledFmu(Structure):
    """What called_fmu.h calls `Fmu`: functions of an FMU, and the instance."""

    _fields_ = [*((name, c_void_p) for name in _FUNCTIONS), ("instance", c_void_p)]


@attrs.frozen(kw_only=True, eq=False)
class Instance:
    """An FMU's instance for co-simulation.

    Attributes
    ----------
    fmu : PlantFmu
    slave : FMU2Slave
        Of FMPy.
    called : CalledFmu
        The same for compiled loops.
    messages : list of str
        What the instance has said of failures since this was last cleared.
    logs : bool
        Whether it tells of all that happens in it.
    """

    fmu: PlantFmu
    slave: Any
    called: CalledFmu
    messages: list[str]
    logs: bool

    def give_back(self) -> None:
        """Leave the instance to the next run of the same FMU; those of others are freed."""
        while _idle and not _idle[-1].is_like(self.fmu, logs=self.logs):
            _idle.pop().slave.freeInstance()
        _idle.append(self)

    def is_like(self, fmu: PlantFmu, *, logs: bool) -> bool:
        """Whether it is what `instance` would make."""
        return (self.fmu.folder, self.fmu.guid, self.logs) == (fmu.folder, fmu.guid, logs)


# all of one FMU: loading it takes longer than a run, and every run begins by a reset
_idle: list[Instance] = []


def instance(fmu: PlantFmu) -> Instance:
    """Take an idle instance for co-simulation, or load the FMU and make one.

    Parameters
    ----------
    fmu : PlantFmu
        Of this computer, and of FMI 2.

    Raises
    ------
    CosimulationError
        It cannot be loaded.
    """
    logs = _logger.isEnabledFor(logging.DEBUG)
    with suppress(IndexError):
        idle = _idle.pop()
        if idle.is_like(fmu, logs=logs):
            idle.messages.clear()
            return idle
        idle.give_back()
    messages: list[str] = []

    def log(environment: object, instance: bytes, status: int, category: bytes, message: bytes) -> None:
        text = message.decode("utf-8", errors="replace")
        if status == fmi2OK:
            _logger.debug("%s: %s", category.decode("utf-8"), text)
        else:
            _logger.info("%s: %s", category.decode("utf-8"), text)
            messages.append(text)

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(log)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    try:
        made = FMU2Slave(
            guid=fmu.guid,
            modelIdentifier=fmu.model_identifier,
            unzipDirectory=str(fmu.folder),
            instanceName=fmu.model_identifier,
        )
        made.instantiate(loggingOn=logs, callbacks=callbacks)
    except Exception as error:  # FMPy raises nothing more special
        reason = " ".join(messages) or str(error)
        raise CosimulationError(
            f"The FMU in {fmu.folder} cannot be loaded: {reason} "
            f"If programs must not be loaded from there, name another folder in {ENVIRONMENT_VARIABLE}."
        ) from error
    addresses = {name: ctypes.cast(getattr(made.dll, name), c_void_p).value for name in _FUNCTIONS}
    called = CalledFmu(instance=made.component, **addresses)
    return Instance(fmu=fmu, slave=made, called=called, messages=messages, logs=logs)


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
    texts |= standard_headers(Version.FMI2)

    def make(cache: Path) -> dict[str, bytes]:
        return {library: compile_texts(texts, _SOURCE, compiler, library, cache)}

    parts = (part.encode("utf-8") for part in (compiler.identity, *texts.values()))
    return ctypes.CDLL(str(cached(f"{_NAME}-{digest(*parts)[:32]}", make) / library))
