"""An FMU instance at the level of FMI's own functions, with its log kept."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from gen_profile_fmu.building.plant_fmu import PlantFmu

# setpoints that most tests follow
MOVE = [0.001 * k**2 for k in range(1, 30)]


class _Logged:
    """FMPy's instances, by variable names, with messages as (status, category, text)."""

    def __init__(self, fmu: PlantFmu) -> None:
        super().__init__(
            guid=fmu.guid,
            modelIdentifier=fmu.model_identifier,
            unzipDirectory=str(fmu.folder),
            instanceName="crane",
        )
        self.references = {variable.name: i for i, variable in enumerate(fmu.variables.variables)}
        self.messages: list[tuple[int, str, str]] = []
        self.allocated: set[int] = set()
        self.allocations_left = 100
        self.own_callbacks = fmi2.fmi2CallbackFunctions()
        self.own_callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self.own_callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(self._allocate)
        self.own_callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(self._free)

    def _log(self, environment, instance, status, category, message):
        assert instance in {b"crane", b""}
        self.messages.append((status, category.decode(), message.decode()))

    def _allocate(self, count, size):
        if self.allocations_left == 0:
            return None
        self.allocations_left -= 1
        address = fmpy.calloc(count, size)
        self.allocated.add(address)
        return address

    def _free(self, address):
        self.allocated.remove(address)
        fmpy.free(address)

    @property
    def last_message(self) -> str:
        return self.messages[-1][2]

    def start(self, **values: float) -> Self:
        """Instantiate and initialise."""
        self.instantiate(callbacks=self.own_callbacks)
        return self.initialise(**values)

    def initialise(self, **values: float) -> Self:
        self.setupExperiment(startTime=0.0)
        self.write(**values)
        self.enterInitializationMode()
        self.exitInitializationMode()
        return self

    def write(self, **values: float) -> None:
        """Set variables; a dot in a name is written as two underscores."""
        names = [name.replace("__", ".") for name in values]
        self.setReal([self.references[name] for name in names], list(values.values()))

    def read(self, *names: str) -> list[float]:
        return self.getReal([self.references[name] for name in names or self.references])

    def follow(self, positions: list[float], time: float, step: float) -> list[list[float]]:
        """Step through setpoints; the values of all variables after each."""
        rows = []
        for k, position in enumerate(positions):
            self.write(cart__setpoint=position)
            self.doStep(time + k * step, step)
            rows.append(self.read())
        return rows


# FMPy reads the version of FMI off the beginning of a class's name
class FMU2LoggedSlave(_Logged, fmi2.FMU2Slave):
    """For co-simulation."""


class FMU2LoggedModel(_Logged, fmi2.FMU2Model):
    """For model exchange."""


@contextmanager
def open_slave(fmu: PlantFmu, kind: type = FMU2LoggedSlave) -> Iterator[FMU2LoggedSlave | FMU2LoggedModel]:
    """A started instance, and proof that it frees what it took."""
    slave = kind(fmu).start()
    yield slave
    slave.fmi2FreeInstance(slave.component)
    assert not slave.allocated
    slave.freeLibrary()


def status_of(call, *arguments) -> int:
    """Status of a call, which FMPy turns into an exception."""
    try:
        return call(*arguments) or fmi2.fmi2OK
    except FMICallException as error:
        return error.status
