"""An FMU of ours in memory, by FMPy, with its messages kept."""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import Any

import attrs
from fmpy import calloc, free
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2OK,
)
from fmpy.fmi3 import FMU3Slave

from gen_profile.errors import CosimulationError
from gen_profile_fmu.building.cache import ENVIRONMENT_VARIABLE
from gen_profile_fmu.building.plant_fmu import PlantFmu
from gen_profile_fmu.description.fmu_files import Version

_logger = logging.getLogger(__name__)


@attrs.frozen(kw_only=True, eq=False)
class Instance:
    """An FMU's instance for co-simulation.

    Attributes
    ----------
    fmu : PlantFmu
    version : Version
        That the FMU is of.
    slave : FMU2Slave or FMU3Slave
        Of FMPy.
    messages : list of str
        What the instance has said of failures since this was last cleared.
    logs : bool
        Whether it tells of all that happens in it.
    """

    fmu: PlantFmu
    version: Version
    slave: Any
    messages: list[str]
    logs: bool

    def give_back(self) -> None:
        """Leave the instance to the next run of the same FMU; those of others are freed."""
        while _idle and not _idle[-1].is_like(self.fmu, self.version, logs=self.logs):
            _idle.pop().slave.freeInstance()
        _idle.append(self)

    def is_like(self, fmu: PlantFmu, version: Version, *, logs: bool) -> bool:
        """Whether it is what `instance` would make."""
        asked = (fmu.folder, fmu.guid, version, logs)
        return (self.fmu.folder, self.fmu.guid, self.version, self.logs) == asked


# all of one FMU: loading it takes longer than a run, and every run begins by a reset
_idle: list[Instance] = []


def instance(fmu: PlantFmu, version: Version) -> Instance:
    """Take an idle instance for co-simulation, or load the FMU and make one.

    Parameters
    ----------
    fmu : PlantFmu
        Of this computer.
    version : Version
        That the FMU is of.

    Raises
    ------
    CosimulationError
        It cannot be loaded.
    """
    logs = _logger.isEnabledFor(logging.DEBUG)
    with suppress(IndexError):
        idle = _idle.pop()
        if idle.is_like(fmu, version, logs=logs):
            idle.messages.clear()
            return idle
        idle.give_back()
    messages: list[str] = []

    def log(environment: object, status: int, category: bytes, message: bytes) -> None:
        del environment
        text = message.decode("utf-8", errors="replace")
        if status == fmi2OK:  # FMI 3 has the same numbers
            _logger.debug("%s: %s", category.decode("utf-8"), text)
        else:
            _logger.warning("%s: %s", category.decode("utf-8"), text)
            messages.append(text)

    first = version is Version.FMI2
    reports = {"callbacks": _callbacks(log)} if first else {"logMessage": log}
    try:
        made = (FMU2Slave if first else FMU3Slave)(
            guid=fmu.guid,
            modelIdentifier=fmu.model_identifier,
            unzipDirectory=str(fmu.folder),
            instanceName=fmu.model_identifier,
        )
        made.instantiate(loggingOn=logs, **reports)
    except Exception as error:  # FMPy raises nothing more special
        reason = " ".join(messages) or str(error)
        raise CosimulationError(
            f"The FMU in {fmu.folder} cannot be loaded: {reason} "
            f"If programs must not be loaded from there, name another folder in {ENVIRONMENT_VARIABLE}."
        ) from error
    return Instance(fmu=fmu, version=version, slave=made, messages=messages, logs=logs)


def _callbacks(log: Any) -> Any:
    """Make the callbacks of FMI 2, which names the instance in a message, too."""

    def named(environment: object, instance: bytes, status: int, category: bytes, message: bytes) -> None:
        del instance
        log(environment, status, category, message)

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(named)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    return callbacks
