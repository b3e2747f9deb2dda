"""Simulations of FMUs by FMI's own functions: co-simulation, and model exchange by a fixed-step method.

The same few names for FMI 2 and 3; what FMPy's classes call differently is distinguished here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_double, c_int32, c_uint32
from itertools import pairwise

import numpy as np
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2EventInfo
from fmpy.fmi3 import FMU3Model, FMU3Slave

from gen_profile_fmu.building.plant_fmu import PlantFmu
from gen_profile_fmu.description.fmu_files import Version

Array = np.ndarray


class Instance:
    """An instance for one of the interfaces of FMI, by variables' names."""

    def __init__(self, fmu: PlantFmu, version: Version, *, exchange: bool, **options: object) -> None:
        self.version, self.exchange = version, exchange
        self.references = {variable.name: i for i, variable in enumerate(fmu.variables.variables)}
        self.states = fmu.variables.states
        kind = {
            (Version.FMI2, True): FMU2Model,
            (Version.FMI2, False): FMU2Slave,
            (Version.FMI3, True): FMU3Model,
            (Version.FMI3, False): FMU3Slave,
        }[version, exchange]
        self.fmu = kind(
            guid=fmu.guid,
            modelIdentifier=fmu.model_identifier,
            unzipDirectory=str(fmu.folder),
            instanceName="test",
        )
        self.fmu.instantiate(**options)

    def initialise(self, start: float = 0.0, **booleans: bool) -> None:
        if self.version is Version.FMI2:
            self.fmu.setupExperiment(startTime=start)
        for name, value in booleans.items():
            self.set_boolean(name, value)
        self.fmu.enterInitializationMode(**({"startTime": start} if self.version is Version.FMI3 else {}))

    def begin(self, values: Mapping[str, float], start: float = 0.0, **booleans: bool) -> None:
        """Set parameters and initialise."""
        self.write(values)
        self.initialise(start, **booleans)
        self.fmu.exitInitializationMode()

    def write(self, values: Mapping[str, float]) -> None:
        references = [self.references[name] for name in values]
        setter = self.fmu.setReal if self.version is Version.FMI2 else self.fmu.setFloat64
        setter(references, list(values.values()))

    def set_boolean(self, name: str, value: bool) -> None:
        self.fmu.setBoolean([self.references[name]], [value])

    def get_boolean(self, name: str) -> bool:
        return bool(self.fmu.getBoolean([self.references[name]])[0])

    def read_integers(self, *names: str) -> list[int]:
        getter = self.fmu.getInteger if self.version is Version.FMI2 else self.fmu.getInt32
        return list(getter([self.references[name] for name in names]))

    def read(self, *names: str) -> Array:
        references = [self.references[name] for name in names]
        getter = self.fmu.getReal if self.version is Version.FMI2 else self.fmu.getFloat64
        return np.array(getter(references))

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> Array:
        arguments = [self.references[name] for name in unknowns], [self.references[name] for name in knowns]
        return np.array(self.fmu.getDirectionalDerivative(*arguments, list(seed)))

    def slopes(self, name: str, *values: float) -> None:
        """Set an input's time derivatives from the first order on (FMI 2)."""
        n = len(values)
        self.fmu.fmi2SetRealInputDerivatives(
            self.fmu.component,
            (c_uint32 * n)(*[self.references[name]] * n),
            n,
            (c_int32 * n)(*range(1, n + 1)),
            (c_double * n)(*values),
        )

    def output_derivative(self, name: str, order: int) -> float:
        """Time derivative of an output."""
        value = c_double()
        arguments = (
            self.fmu.component,
            (c_uint32 * 1)(self.references[name]),
            1,
            (c_int32 * 1)(order),
            byref(value),
        )
        if self.version is Version.FMI2:
            self.fmu.fmi2GetRealOutputDerivatives(*arguments)
        else:
            self.fmu.fmi3GetOutputDerivatives(*arguments, 1)
        return value.value

    def events(self) -> float | None:
        """Handle what happens now; the next event's time."""
        if self.version is Version.FMI2:
            info = fmi2EventInfo()
            self.fmu.fmi2NewDiscreteStates(self.fmu.component, byref(info))
            return info.nextEventTime if info.nextEventTimeDefined else None
        *_, defined, time = self.fmu.updateDiscreteStates()
        return time if defined else None

    def x(self) -> Array:
        values = (c_double * len(self.states))()
        self.fmu.getContinuousStates(values, len(values))
        return np.array(values)

    def rates(self, time: float, x: Array) -> Array:
        self.fmu.setTime(time)
        values = (c_double * len(x))(*x)
        self.fmu.setContinuousStates(values, len(x))
        result = (c_double * len(x))()
        getter = (
            self.fmu.getDerivatives
            if self.version is Version.FMI2
            else self.fmu.getContinuousStateDerivatives
        )
        getter(result, len(x))
        return np.array(result)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def cosimulate(
    instance: Instance, times: Array, before: Callable[[float, float], None], names: Sequence[str]
) -> Array:
    """Step from time to time; `before` takes the step's beginning and end. The outputs at all times."""
    rows = [instance.read(*names)]
    for time, end in pairwise(times):
        before(time, end)
        instance.fmu.doStep(time, end - time)
        rows.append(instance.read(*names))
    return np.array(rows)


def exchange(
    instance: Instance,
    times: Array,
    before: Callable[[float], None],
    names: Sequence[str],
    step: float,
) -> Array:
    """Integrate by the classical Runge-Kutta method, from event to event; the outputs at all times.

    `before` sets the inputs for a time, at every stage.
    """
    time, rows = float(times[0]), []
    before(time)
    event = instance.events()
    instance.fmu.enterContinuousTimeMode()
    for target in times:
        while time < target:
            end = min(time + step, float(target), np.inf if event is None else event)
            end = float(target) if target - end < 1e-12 and (event is None or event > target) else end
            advance(instance, time, end - time, before)
            time = end
            if event is not None and time >= event:
                instance.fmu.enterEventMode()
                event = instance.events()
                instance.fmu.enterContinuousTimeMode()
        instance.fmu.setTime(time)
        before(time)
        rows.append(instance.read(*names))
    return np.array(rows)


def advance(instance: Instance, time: float, step: float, before: Callable[[float], None]) -> None:
    x = instance.x()

    def rates(offset: float, y: Array) -> Array:
        instance.fmu.setTime(time + offset)
        before(time + offset)
        return instance.rates(time + offset, y) if len(y) else y

    k1 = rates(0.0, x)
    k2 = rates(0.5 * step, x + 0.5 * step * k1)
    k3 = rates(0.5 * step, x + 0.5 * step * k2)
    k4 = rates(step, x + step * k3)
    end = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    rates(step, end)
    instance.fmu.completedIntegratorStep()
