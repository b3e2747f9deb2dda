"""An FMU of ours in memory, by FMPy, with its messages kept."""

from __future__ import annotations

import logging
from typing import Any

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


def slave(fmu: PlantFmu, version: Version, messages: list[str]) -> Any:
    """Load an FMU and make an instance for co-simulation.

    Parameters
    ----------
    fmu : PlantFmu
        Of this computer.
    version : Version
        That the FMU is of.
    messages : list of str
        Takes what the instance says of failures, then and later.

    Returns
    -------
    FMU2Slave or FMU3Slave

    Raises
    ------
    CosimulationError
        It cannot be loaded.
    """

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
        made.instantiate(loggingOn=_logger.isEnabledFor(logging.DEBUG), **reports)
    except Exception as error:  # FMPy raises nothing more special
        reason = " ".join(messages) or str(error)
        raise CosimulationError(
            f"The FMU in {fmu.folder} cannot be loaded: {reason} "
            f"If programs must not be loaded from there, name another folder in {ENVIRONMENT_VARIABLE}."
        ) from error
    return made


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
