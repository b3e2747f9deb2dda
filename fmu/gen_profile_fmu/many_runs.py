"""Many co-simulations of one FMU instance by a compiled loop over its own functions, as for Monte Carlo."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Mapping, Sequence
from ctypes import POINTER, Structure, byref, c_double, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from gen_profile.errors import CosimulationError
from gen_profile.profile import Array
from gen_profile_fmu.c_sources import FOLDER
from gen_profile_fmu.cache import cached
from gen_profile_fmu.compiler import compile_library, find_compiler
from gen_profile_fmu.fmu_files import Version, digest, standard_headers
from gen_profile_fmu.plant_fmu import PlantFmu

_SOURCE = "many_runs.c"
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


class _Fmu(Structure):
    _fields_ = [
        *((name, c_void_p) for names in _FUNCTIONS.values() for name in names),
        ("instance", c_void_p),
    ]


class _Plan(Structure):
    _fields_ = [
        *((name, c_size_t) for name in ("runs", "steps", "inputs", "parameters", "outputs")),
        *((name, POINTER(c_double)) for name in ("times", "input_values", "parameter_values")),
        *(
            (name, POINTER(c_uint))
            for name in ("input_references", "parameter_references", "output_references")
        ),
        ("first", c_size_t),
    ]


class ManyRuns:
    """An FMU in memory, for runs that differ in their parameters; a context manager.

    Parameters
    ----------
    fmu : PlantFmu
        Of this computer.
    version : Version
        That the FMU is of.

    Raises
    ------
    CosimulationError
        When the FMU cannot be loaded, or the loop cannot be compiled (once).
    """

    def __init__(self, fmu: PlantFmu, version: Version) -> None:
        self._references = {variable.name: i for i, variable in enumerate(fmu.variables.variables)}
        self._loop = _loop()
        kind = FMU2Slave if version is Version.FMI2 else FMU3Slave
        try:
            self._slave = kind(
                guid=fmu.guid,
                modelIdentifier=fmu.model_identifier,
                unzipDirectory=str(fmu.folder),
                instanceName=fmu.model_identifier,
            )
            self._slave.instantiate()
        except Exception as error:  # FMPy raises nothing more special
            raise CosimulationError(f"The FMU in {fmu.folder} cannot be loaded: {error}") from error
        self._fmu = _Fmu(instance=self._slave.component)
        for name in _FUNCTIONS[version]:
            setattr(self._fmu, name, ctypes.cast(getattr(self._slave.dll, name), c_void_p).value)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._slave.freeInstance()

    def peaks(
        self,
        times: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, Array],
        outputs: Sequence[str],
        *,
        since: float = 0.0,
    ) -> Array:
        """Run once per set of parameters, and keep the greatest magnitude of each output.

        Parameters
        ----------
        times : (samples,) array
            Communication points in s, rising.
        inputs : mapping of str to (samples - 1,) array
            Held from each point to the next; a setpoint is reached at the step's end.
        parameters : mapping of str to (runs,) array
            Start values; what is not named keeps the value of the model description.
        outputs : sequence of str
        since : float
            Time in s from which peaks count.

        Returns
        -------
        (runs, outputs) array

        Raises
        ------
        CosimulationError
            A name is unknown, lengths differ, or the FMU refuses a value or a step.
        """
        times = np.ascontiguousarray(times, dtype=np.float64)
        given = _columns(inputs, len(times) - 1, "inputs")
        varied = _columns(parameters, None, "parameters")
        found, room = np.empty((len(varied), len(outputs))), np.empty(len(outputs))
        keep = [self._numbers(names) for names in (inputs, parameters, outputs)]
        plan = _Plan(
            runs=len(varied),
            steps=len(times) - 1,
            inputs=len(inputs),
            parameters=len(parameters),
            outputs=len(outputs),
            times=_doubles(times),
            input_values=_doubles(given),
            parameter_values=_doubles(varied),
            input_references=keep[0],
            parameter_references=keep[1],
            output_references=keep[2],
            first=int(np.searchsorted(times, since * (1.0 - 1e-12))),
        )
        good = self._loop(byref(self._fmu), byref(plan), _doubles(room), _doubles(found))
        if good < len(varied):
            values = {name: float(column[good]) for name, column in parameters.items()}
            raise CosimulationError(f"The FMU could not go on in run {good}, with {values}.")
        return found

    def _numbers(self, names: Sequence[str] | Mapping[str, Array]) -> Any:
        unknown = [name for name in names if name not in self._references]
        if unknown:
            raise CosimulationError(f"The FMU has no variable {unknown[0]!r}.")
        return (c_uint * len(names))(*(self._references[name] for name in names))


def _columns(arrays: Mapping[str, Array], length: int | None, what: str) -> Array:
    """Join arrays as columns."""
    columns = [np.asarray(column, dtype=np.float64) for column in arrays.values()]
    lengths = {len(column) for column in columns} | ({length} if length is not None else set())
    if len(lengths) != 1:
        raise CosimulationError(f"The {what} of many runs differ in length: {sorted(lengths)}.")
    return np.ascontiguousarray(np.column_stack(columns) if columns else np.empty((lengths.pop(), 0)))


def _doubles(array: Array) -> Any:
    return array.ctypes.data_as(POINTER(c_double))


@cache
def _loop() -> Any:
    """Compile the loop, or find it in the cache, and load it."""
    compiler, name = find_compiler(), f"many_runs{fmpy.sharedLibraryExtension}"
    texts = {_SOURCE: (FOLDER / _SOURCE).read_text(encoding="utf-8")}
    for version in Version:
        texts |= standard_headers(version)

    def make(folder: Path) -> dict[str, bytes]:
        with tempfile.TemporaryDirectory(dir=folder, prefix="build-") as build:
            for file, text in texts.items():
                Path(build, file).write_text(text, encoding="utf-8", newline="\n")
            compile_library(compiler, Path(build), _SOURCE, name, zig_cache=folder / "zig")
            return {name: Path(build, name).read_bytes()}

    parts = (part.encode("utf-8") for part in (compiler.identity, *texts.values()))
    function = ctypes.CDLL(str(cached(f"many-runs-{digest(*parts)[:32]}", make) / name)).many_runs
    function.argtypes = [POINTER(_Fmu), POINTER(_Plan), POINTER(c_double), POINTER(c_double)]
    function.restype = c_size_t
    return function
