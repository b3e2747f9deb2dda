"""Co-simulation of a plant FMU that follows setpoints: by FMPy, or by FMPy's instance in a compiled loop."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from ctypes import POINTER, Structure, byref, c_double, c_size_t, c_uint, sizeof

import attrs
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2True

from gen_profile.dynamics.evaluation.simulation import AT_REST, Response
from gen_profile.motion.profile import Array, SampledProfile, grid_length, grid_times
from gen_profile.plants.plant import Plant
from gen_profile.support.errors import CosimulationError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.instances import Instance, compiled_loops, doubles, instance, unsigned

# blocks of variables that are read after every step, and what a Response calls them
_OBSERVED = {
    "Q_A": "position",
    "DQ_A": "velocity",
    "Q_U": "q_u",
    "DQ_U": "dq_u",
    "SWAY": "sway",
    "ANGLE": "angle",
}


@attrs.frozen(kw_only=True, eq=False)
class Steps:
    """Communication steps, one after the other.

    Step k begins at ``times[k]``, lasts ``sizes[k]`` and leads to ``setpoints[k]`` at ``times[k + 1]``.

    Attributes
    ----------
    times : (steps + 1,) array
        s.
    sizes : (steps,) array
        s.
    setpoints : (steps, axes) array
        m (or rad).
    """

    times: Array
    sizes: Array
    setpoints: Array


class _Steps(Structure):
    """What sampled_run.c calls `Steps`."""

    _fields_ = [
        *((name, c_size_t) for name in ("steps", "n_inputs", "n_outputs")),
        *((name, POINTER(c_double)) for name in ("times", "sizes", "inputs")),
        *((name, POINTER(c_uint)) for name in ("input_references", "output_references")),
    ]


class PlantCosimulation(AbstractContextManager["PlantCosimulation"]):
    """A plant FMU in memory, to be run as often as wanted; a context manager.

    Parameters
    ----------
    plant : Plant
    progress : callable
        Told of a compilation, which takes seconds.

    Raises
    ------
    CosimulationError
        When the FMU cannot be built or loaded.
    """

    def __init__(self, plant: Plant, progress: Progress = no_progress) -> None:
        self._plant = plant
        self._fmu = plant_fmu(plant, progress)
        self._instance: Instance | None = instance(self._fmu)
        self._slave, self._messages = self._instance.slave, self._instance.messages
        self._called = self._instance.called
        variables = self._fmu.variables
        self._setpoints = unsigned(variables.references("INPUTS"))
        self._outputs = unsigned(variables.references(*_OBSERVED))
        self._output_blocks = np.cumsum([len(variables.blocks[block]) for block in _OBSERVED])[:-1]

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance; it cannot be run again."""
        if self._instance is not None:
            self._instance.give_back()
            self._instance = self._slave = None

    def run(
        self,
        setpoints: SampledProfile,
        parameters: Mapping[str, float],
        *,
        tau: float = 0.0,
        max_step: float,
        settle: float,
        output_step: float | None = None,
        initial: Mapping[str, float] = AT_REST,
        final_velocity: Sequence[float] = (),
        by_fmpy: bool = False,
    ) -> Response:
        """Let drives follow the setpoints, then hold the last one, or go on from it.

        Parameters
        ----------
        setpoints : SampledProfile
            Of which only the positions are used: the drives interpolate them linearly (CiA 402, 60C2h).
        parameters : mapping of str to float
            Value of every parameter of the plant.
        tau : float
            Lag of the drives in s; 0 for ideal ones.
        max_step : float
            Longest integration step in s.
        settle : float
            How long to go on after the last setpoint, in s.
        output_step : float, optional
            Spacing of samples after the last setpoint, in s; the cycle time if it is longer or not given.
        initial : mapping of str to float, optional
            What swings at time 0: unactuated coordinates by name, their rates as ``NAME.rate``.
        final_velocity : (axes,) sequence of float, optional
            With which setpoints go on after the last one, in m/s (or rad/s); by default it is held.
        by_fmpy : bool
            Whether FMPy takes every step itself, which gives the same numbers and takes longer.

        Returns
        -------
        Response
            At time 0, after every cycle, and every `output_step` after the last setpoint.

        Raises
        ------
        CosimulationError
            When a parameter is missing, unknown or out of range, or the FMU refuses a step.
        """
        steps = _steps(setpoints, settle, output_step, final_velocity)
        self._begin(setpoints, parameters, {**initial, TAU: tau, MAX_STEP: max_step})
        return Response(times=steps.times, **self._observe(steps, by_fmpy=by_fmpy))

    def _begin(
        self, setpoints: SampledProfile, parameters: Mapping[str, float], values: Mapping[str, float]
    ) -> None:
        """Start anew, at the first setpoint."""
        values = {**self._plant_values(parameters), **self._start_values(setpoints), **values}
        references = self._fmu.variables.named(values)
        if self._slave is None:
            raise CosimulationError("This co-simulation has been closed; make a new one.")
        with self._explained():
            self._slave.reset()
            self._slave.setupExperiment(startTime=0.0)
            self._slave.setReal(references, list(values.values()))
            self._slave.enterInitializationMode()
            self._slave.exitInitializationMode()

    def _observe(self, steps: Steps, *, by_fmpy: bool = False) -> dict[str, Array]:
        """Take steps from where the FMU is; what is observed before the first and after each, by name."""
        samples = self._march_by_fmpy(steps) if by_fmpy else self._march(steps)
        blocks = np.split(samples, self._output_blocks, axis=1)
        return dict(zip(_OBSERVED.values(), blocks, strict=True))

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Make a sentence of a refusal, with the FMU's own words where it has some."""
        self._messages.clear()
        try:
            yield
        except FMICallException as error:
            raise self._refusal(f"{error.function} returned status {error.status}.") from error

    def _refusal(self, reason: str) -> CosimulationError:
        return CosimulationError(
            f"The FMU of plant {self._plant.type} could not go on: {' '.join(self._messages) or reason}"
        )

    def _plant_values(self, parameters: Mapping[str, float]) -> dict[str, float]:
        known = {parameter.name for parameter in self._plant.parameters}
        unknown, missing = sorted(parameters.keys() - known), sorted(known - parameters.keys())
        if unknown or missing:
            faults = [f"no parameter {name}" for name in unknown] + [
                f"no value of {name}" for name in missing
            ]
            raise CosimulationError(
                f"The co-simulation of plant {self._plant.type} needs the values of exactly its parameters "
                f"{', '.join(sorted(known))}: found {', '.join(faults)}."
            )
        return {name: float(value) for name, value in parameters.items()}

    def _start_values(self, setpoints: SampledProfile) -> dict[str, float]:
        axes, columns = self._plant.actuated, setpoints.position.shape[1]
        if columns != len(axes):
            raise CosimulationError(
                f"The setpoints are for {columns} axes, but plant {self._plant.type} has {len(axes)}."
            )
        return {
            f"{axis.name}.{suffix}": float(position)
            for axis, position in zip(axes, setpoints.position[0], strict=True)
            for suffix in ("start", "setpoint")
        }

    def _march(self, steps: Steps) -> Array:
        """Take all steps in a compiled loop; samples before the first and after each."""
        samples = np.empty((len(steps.times), len(self._outputs)))
        loop = compiled_loops().sampled_run
        loop.restype = c_size_t
        plan = _Steps(
            steps=len(steps.sizes),
            n_inputs=len(self._setpoints),
            n_outputs=len(self._outputs),
            times=doubles(steps.times),
            sizes=doubles(steps.sizes),
            inputs=doubles(np.ascontiguousarray(steps.setpoints)),
            input_references=self._setpoints,
            output_references=self._outputs,
        )
        self._messages.clear()
        done = loop(byref(self._called), byref(plan), doubles(samples))
        if done < len(samples):
            raise self._refusal(f"it refused the step at {steps.times[max(done - 1, 0)]:g} s.")
        return samples

    def _march_by_fmpy(self, steps: Steps) -> Array:
        """Take all steps, reading setpoints and writing samples in place; a step costs a few microseconds."""
        fmu, component = self._slave, self._slave.component
        inputs, outputs = self._setpoints, self._outputs
        samples = np.empty((len(steps.times), len(outputs)))
        given = np.array(steps.setpoints)
        first_setpoint, first_sample = c_double.from_buffer(given.data), c_double.from_buffer(samples.data)
        input_row, output_row = len(inputs) * sizeof(c_double), len(outputs) * sizeof(c_double)
        with self._explained():
            fmu.fmi2GetReal(component, outputs, len(outputs), byref(first_sample))
            for k, (time, size) in enumerate(zip(steps.times.tolist(), steps.sizes.tolist(), strict=False)):
                fmu.fmi2SetReal(component, inputs, len(inputs), byref(first_setpoint, k * input_row))
                fmu.fmi2DoStep(component, time, size, fmi2True)
                fmu.fmi2GetReal(component, outputs, len(outputs), byref(first_sample, (k + 1) * output_row))
        return samples


def _steps(
    setpoints: SampledProfile, settle: float, output_step: float | None, final_velocity: Sequence[float]
) -> Steps:
    cycle = setpoints.cycle_time
    hold = cycle if output_step is None else min(output_step, cycle)
    if not (np.isfinite(hold) and hold > 0.0 and np.isfinite(settle) and settle >= 0.0):
        raise CosimulationError(
            "The time to settle must not be negative, and the output step must be positive."
        )
    moving = setpoints.times
    held = grid_times(grid_length(settle, hold), hold)[1:]
    onward = np.array(final_velocity) if len(final_velocity) else np.zeros(setpoints.position.shape[1])
    last = setpoints.position[-1] + held[:, None] * onward
    return Steps(
        times=np.concatenate((moving, moving[-1] + held)),
        sizes=np.concatenate((np.full(len(moving) - 1, cycle), np.full(len(held), hold))),
        setpoints=np.concatenate((setpoints.position[1:], last)),
    )
