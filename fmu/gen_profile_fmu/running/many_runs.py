"""Many co-simulations of an FMU by a compiled loop over its own functions, as for Monte Carlo."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from ctypes import POINTER, Structure, byref, c_double, c_size_t, c_uint
from typing import Any

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building.plant_fmu import PlantFmu
from gen_profile_fmu.running.instances import CalledFmu, Instance, compiled_loops, doubles, instance, unsigned

ZONE = 17  # numbers of a zone
NO_ZONES = np.empty((0, ZONE))


class _PerRun(Structure):
    _fields_ = [("values", POINTER(c_double)), ("size", c_size_t)]


class _Plan(Structure):
    _fields_ = [
        *((name, _PerRun) for name in ("times", "inputs", "parameters")),
        *((name, c_size_t) for name in ("steps", "n_inputs", "n_parameters", "n_outputs")),
        *(
            (name, POINTER(c_uint))
            for name in ("input_references", "parameter_references", "output_references")
        ),
        ("n_components", c_size_t),
        ("since", c_double),
        ("zones", POINTER(c_double)),
        ("n_zones", c_size_t),
    ]


class ManyRuns(AbstractContextManager["ManyRuns"]):
    """An FMU in memory, for runs that differ in their parameters or inputs; a context manager.

    Parameters
    ----------
    fmu : PlantFmu
        Of this computer, and of FMI 2.
    workers : int
        Instances that share the runs, each in a thread: compiled code, they run side by side. What is found
        does not depend on their number.

    Raises
    ------
    CosimulationError
        When the FMU cannot be loaded, or the loop cannot be compiled (once).
    """

    def __init__(self, fmu: PlantFmu, *, workers: int = 1) -> None:
        self._variables, self._loop = fmu.variables, _loop()
        self._workers = [instance(fmu) for _ in range(workers)]
        self._threads = ThreadPoolExecutor(workers)  # which start when they are needed

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown()
        for worker in self._workers:
            worker.give_back()

    def peaks(
        self,
        times: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, Array | float],
        outputs: Sequence[str],
        *,
        since: float = 0.0,
        components: int = 0,
        zones: Array = NO_ZONES,
    ) -> Array:
        """Simulate all runs, and keep the greatest magnitude of each output.

        Parameters
        ----------
        times : (samples,) or (runs, samples) array
            Communication points in s, rising; those of all runs, or of each.
        inputs : mapping of str to (samples - 1,) or (runs, samples - 1) array
            Held from each point to the next; a setpoint is reached at the step's end.
        parameters : mapping of str to (runs,) array or float
            Start values, of each run or of all; what is not named keeps the value of the model description.
        outputs : sequence of str
        since : float
            Time in s from which peaks count.
        components : int
            So many of the last outputs are the components of a vector: its greatest length at any time, also
            before `since`, is one more column.
        zones : (zones, ZONE) array
            Where bodies may not be; the least room to them at any time, that time in s and the zone's number
            are three more columns. Numbers of the outputs that are a body's x, y and z; a height; 1 where
            they may not be below it, −1 where not above; from and to in x and in y; twice likewise where it
            may be all the same.

        Returns
        -------
        (runs, outputs) array, or with more columns

        Raises
        ------
        CosimulationError
            A name is unknown, lengths differ, or the FMU refuses a value or a step.
        """
        given = _given(times, inputs, parameters)
        plan = _Plan(
            **{name: _per_run(rows) for name, rows in given.items()},
            steps=given["times"].shape[1] - 1,
            n_inputs=len(inputs),
            n_parameters=len(parameters),
            n_outputs=len(outputs),
            input_references=unsigned(self._variables.named(inputs)),
            parameter_references=unsigned(self._variables.named(parameters)),
            output_references=unsigned(self._variables.named(outputs)),
            n_components=components,
            since=since * (1.0 - 1e-12),
            zones=doubles(zones),
            n_zones=len(zones),
        )
        runs = next((len(rows) for rows in given.values() if len(rows) != 1), 1)
        return self._run(plan, np.empty((runs, len(outputs) + (components > 0) + 3 * (len(zones) > 0))))

    def _run(self, plan: _Plan, rows: Array) -> Array:
        """Let the workers fill the rows of what is to be found."""
        edges = [len(rows) * number // len(self._workers) for number in range(len(self._workers) + 1)]
        shares = list(zip(self._workers, edges, edges[1:], strict=False))
        if len(shares) == 1:
            reached = [self._fill(plan, rows, *shares[0])]
        else:
            reached = list(self._threads.map(lambda share: self._fill(plan, rows, *share), shares))
        for run, (worker, _, end) in zip(reached, shares, strict=True):
            if run < end:
                reason = " ".join(worker.messages)
                raise CosimulationError(f"The FMU could not go on in run {run}, counted from 0: {reason}")
        return rows

    def _fill(self, plan: _Plan, rows: Array, worker: Instance, first: int, end: int) -> int:
        """Have a worker fill rows of what is to be found; the first bad run, or `end`."""
        worker.messages.clear()
        room = np.empty(2 * plan.n_outputs)
        return int(self._loop(byref(worker.called), byref(plan), first, end, doubles(room), doubles(rows)))


def _given(
    times: Array, inputs: Mapping[str, Array], parameters: Mapping[str, Array | float]
) -> dict[str, Array]:
    """Order and check what a caller gives: arrays of one row for all runs, or one row for each of them."""
    points = np.ascontiguousarray(np.atleast_2d(times), dtype=np.float64)
    columns = {name: np.reshape(values, (-1, 1)) for name, values in parameters.items()}
    rows = {
        "times": points,
        "inputs": _stacked("inputs", inputs, points.shape[1] - 1),
        "parameters": _stacked("parameters", columns, 1),
    }
    counts = {len(array) for array in rows.values()} - {1}
    if len(counts) > 1:
        raise CosimulationError(f"Times, inputs and parameters are of {sorted(counts)} runs.")
    return rows


def _stacked(what: str, arrays: Mapping[str, Array], length: int) -> Array:
    """Join arrays, each (length,) or (runs, length), to one of (runs or 1, length, arrays)."""
    rows = [np.atleast_2d(array) for array in arrays.values()]
    shapes = {row.shape for row in rows} | {(1, length)}
    if len({size for _, size in shapes}) > 1 or len({runs for runs, _ in shapes} - {1}) > 1:
        raise CosimulationError(f"The {what} of many runs differ in length: {sorted(shapes)}.")
    joined = np.empty((max(runs for runs, _ in shapes), length, len(rows)))
    for column, row in enumerate(rows):
        joined[:, :, column] = row
    return joined


def _per_run(rows: Array) -> _PerRun:
    return _PerRun(values=doubles(rows), size=rows[0].size if len(rows) > 1 else 0)


def _loop() -> Any:
    function = compiled_loops().many_runs
    places = (POINTER(c_double), POINTER(c_double))
    function.argtypes = [POINTER(CalledFmu), POINTER(_Plan), c_size_t, c_size_t, *places]
    function.restype = c_size_t
    return function
