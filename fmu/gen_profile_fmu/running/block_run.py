"""Co-simulations of a plant that follows a controller's function block, by a compiled loop over both."""

import ctypes
from collections.abc import Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from ctypes import POINTER, Structure, byref, c_bool, c_double, c_int, c_long, c_size_t, c_uint, c_void_p
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.building.plant_fmu import PlantFmu
from gen_profile_fmu.running.instances import compiled_loops, doubles, instance, unsigned

NO_NUMBER = -1  # a block's fault: a setpoint is none, or beyond all that a machine can follow


@attrs.frozen(kw_only=True, eq=False)
class CalledBlock:
    """A function block in memory.

    Attributes
    ----------
    play : int
        Address of a C function ``int (void *block, const double *inputs, long cycles, double *outputs)``
        that calls the block and returns 0, or what it did that no block may do.
    memory : buffer
        The instance, begun.
    outputs : sequence of str
        Their names, in the order in which the function writes them.
    axes : (axes, 3) sequence of str
        Outputs that are position, velocity and acceleration of an axis.
    states : (4,) sequence of str
        Outputs that tell whether it is busy, whether its promise holds, the number of its error, and whether
        it guides its axes: without that, nothing is asked of what it issues.
    """

    play: int
    memory: Any = attrs.field(repr=False)
    outputs: Sequence[str]
    axes: Sequence[Sequence[str]]
    states: Sequence[str]


@attrs.frozen(kw_only=True, eq=False)
class Measurement:
    """What a block's sensors tell it of the plant, and how the air pushes the loads.

    Attributes
    ----------
    quantities : (sensors,) sequence of str
        Names of the plant's variables that are measured.
    shows, valid : (sensors,) sequence of int
        Places of the block's inputs that take them, and that say whether there is news.
    cycles : (cycles, sensors, 4) array
        Of each cycle that there may be: gain and offset of the sensor, how many cycles ago the value is of,
        and whether there is news.
    pushed : (cycles, axes) array
        By how much, in m, the block's axes are moved unseen: to the loads, which see accelerations alone,
        that is a force in proportion to their masses.
    again : int
        How often the axes may move on after they came to rest, as a sensor may show: what counts is the rest
        that lasts.
    """

    quantities: Sequence[str]
    shows: Sequence[int]
    valid: Sequence[int]
    cycles: Array
    pushed: Array
    again: int = 0


@attrs.frozen(kw_only=True, eq=False)
class Script:
    """What a block is given.

    Attributes
    ----------
    cycle : float
        s.
    start_cycles : (rows,) array of int
        Cycle from which each row of inputs holds; the first is 0.
    inputs : (rows, inputs) array
        Of the block, and behind them what else axes follow.
    actual : (axes,) sequence of int
        Places of the inputs that say where the axes are, given relative to the setpoints of the cycle before.
    longest : int
        Cycles after the last row within which the axes must stand.
    settle, watch : int
        Cycles of standing before sway counts as residual, and while it does.
    measured : Measurement or None
    """

    cycle: float
    start_cycles: Sequence[int]
    inputs: Array
    actual: Sequence[int]
    longest: int
    settle: int
    watch: int
    measured: Measurement | None = None

    @property
    def last(self) -> int:
        """Last cycle that there may be."""
        return self.start_cycles[-1] + self.longest + self.settle + self.watch


@attrs.frozen(kw_only=True)
class Hoist:
    """An axis that follows not what the block issues, but a column of the script.

    Attributes
    ----------
    axis : int
        Of the plant.
    column : int
        Place of the column.
    ratio : float
        Of the axis's position to its values.
    """

    axis: int
    column: int
    ratio: float


@attrs.frozen(kw_only=True, eq=False)
class AxisExtremes:
    """What an axis came to, in m and s.

    Attributes
    ----------
    velocity, acceleration, jerk : float
        Greatest magnitudes.
    lowest, highest : float
        Positions.
    gap : float
        By how much, in m, a cycle's position is not the integral of the velocity, nor this that of the
        acceleration.
    creep : float
        How far it moved while it stood.
    """

    velocity: float
    acceleration: float
    jerk: float
    lowest: float
    highest: float
    gap: float
    creep: float


@attrs.frozen(kw_only=True, eq=False)
class BlockRun:
    """What became of a run.

    Attributes
    ----------
    axes : tuple of AxisExtremes
    on_the_way, residual : (loads,) arrays
        Greatest sway in m, at any time, and once the axes stand; with a sensor, since it was promised first
        while they do.
    cycles : int
    stands : int
        Cycle from which the axes stand for good; -1 if they never do.
    promise : bool
        At the end.
    error : int
        The last that the block showed; 0 for none.
    fault : int
        What the block did that no block may do: 0 for nothing, `NO_NUMBER`, or as its function returns.
    trace : (cycles, outputs + loads) array or None
    copies : (marks, bytes) array or None
        Of the block's instance, as they were before marked cycles.
    shown : (cycles, sensors) array
        What sensors measure of, at the beginning of each cycle.
    """

    axes: tuple[AxisExtremes, ...]
    on_the_way: Array
    residual: Array
    cycles: int
    stands: int
    promise: bool
    error: int
    fault: int
    trace: Array | None = None
    copies: NDArray[np.uint8] | None = None
    shown: Array = attrs.field(factory=lambda: np.zeros((0, 0)))


class _Block(Structure):
    _fields_ = [
        *((name, c_void_p) for name in ("play", "instance")),
        *((name, c_size_t) for name in ("n_inputs", "n_outputs", "n_axes")),
        ("axes", POINTER(c_size_t)),
        *((name, c_size_t) for name in ("busy", "promise", "error", "enabled", "size")),
    ]


class _History(Structure):
    _fields_ = [
        ("cycle", c_double),
        ("n_rows", c_size_t),
        ("start_cycles", POINTER(c_long)),
        ("inputs", POINTER(c_double)),
        ("actual", POINTER(c_size_t)),
        *((name, c_long) for name in ("longest", "settle", "watch")),
        *((name, c_size_t) for name in ("n_parameters", "n_setpoints", "n_loads")),
        *((f"{name}_references", POINTER(c_uint)) for name in ("parameter", "setpoint", "load")),
        ("parameters", POINTER(c_double)),
        ("setpoints", POINTER(c_double)),
        ("led", POINTER(c_size_t)),
        ("n_hoists", c_size_t),
        *((name, POINTER(c_size_t)) for name in ("hoists", "columns")),
        ("ratios", POINTER(c_double)),
        ("n_marks", c_size_t),
        ("marks", POINTER(c_long)),
        ("n_sensors", c_size_t),
        *((name, POINTER(c_double)) for name in ("measured", "pushed")),
        ("quantities", POINTER(c_uint)),
        *((name, POINTER(c_size_t)) for name in ("shows", "valid")),
        ("shown", POINTER(c_double)),
        ("again", c_long),
    ]


class _Outcome(Structure):
    _fields_ = [
        *((name, POINTER(c_double)) for name in ("axes", "on_the_way", "residual", "trace")),
        ("copies", c_void_p),
        *((name, c_long) for name in ("n_rows", "stands", "cycles")),
        *((name, c_int) for name in ("status", "fault", "error")),
        ("promise", c_bool),
    ]


class BlockFollower(AbstractContextManager["BlockFollower"]):
    """A plant FMU in memory that follows blocks, one run after the other; a context manager.

    Parameters
    ----------
    fmu : PlantFmu
        FMI 2, of this computer.

    Raises
    ------
    CosimulationError
        The FMU cannot be loaded, or the loop cannot be compiled (once).
    """

    def __init__(self, fmu: PlantFmu) -> None:
        self._variables = fmu.variables
        self._loads = [v.name for v in fmu.variables.blocks["SWAY"]]
        self._setpoints = [v.name for v in fmu.variables.blocks["INPUTS"]]
        self._instance = instance(fmu)
        self._messages = self._instance.messages

    def __exit__(self, *_: object) -> None:
        self._instance.give_back()

    def run(
        self,
        block: CalledBlock,
        script: Script,
        values: Mapping[str, float],
        led: Sequence[int],
        *,
        hoists: Sequence[Hoist] = (),
        rows: int = 0,
        marks: Sequence[int] = (),
    ) -> BlockRun:
        """Let the plant follow a block.

        Parameters
        ----------
        block : CalledBlock
            Begun, and of no more use afterwards.
        script : Script
        values : mapping of str to float
            Start values of the FMU's variables, its setpoints among them.
        led : (axes,) sequence of int
            Which axis of the plant each axis of the block is.
        hoists : sequence of Hoist
        rows : int
            Cycles of which everything is to be kept, at most.
        marks : sequence of int
            Rising cycles, before which the block's instance is to be copied.

        Raises
        ------
        CosimulationError
            A name is unknown, or the FMU refuses a value or a step.
        """
        self._messages.clear()
        loads, outputs = len(self._loads), len(block.outputs)
        kept = {
            "axes": np.zeros((len(block.axes), 7)),
            "on_the_way": np.zeros(loads),
            "residual": np.zeros(loads),
            "trace": np.empty((outputs + loads, rows)),
        }
        size = ctypes.sizeof(block.memory)
        copies = np.empty((len(marks), size), dtype=np.uint8)
        shown = np.zeros((0, 0) if script.measured is None else script.measured.cycles.shape[:2])
        outcome = _Outcome(
            **{name: doubles(array) for name, array in kept.items() if array.size},
            copies=copies.ctypes.data,
            n_rows=rows,
        )
        axes, inputs = len(block.axes), script.inputs.shape[1]
        room = np.empty(2 * outputs + loads + axes + inputs + len(self._setpoints))
        compiled_loops().block_run(
            byref(self._instance.called),
            byref(_called(block, script)),
            byref(self._history(script, values, led, hoists, marks=marks, shown=shown)),
            doubles(room),
            byref(outcome),
        )
        if outcome.status:
            raise self._failure(outcome.cycles)
        return BlockRun(
            axes=tuple(
                AxisExtremes(**dict(zip(_EXTREMES, row, strict=True))) for row in kept["axes"].tolist()
            ),
            on_the_way=kept["on_the_way"],
            residual=kept["residual"],
            trace=kept["trace"][:, : outcome.cycles].T if rows else None,
            copies=copies if marks else None,
            shown=shown[: outcome.cycles],
            **{name: getattr(outcome, name) for name in _SIMPLE},
        )

    def _failure(self, cycles: int) -> CosimulationError:
        reason = " ".join(self._messages)
        far = " The loads swing farther than can be followed; lower the limits of the axes."
        cure = far if "no longer finite" in reason else ""
        return CosimulationError(f"The FMU could not go on after cycle {cycles}: {reason}{cure}")

    def _history(
        self,
        script: Script,
        values: Mapping[str, float],
        led: Sequence[int],
        hoists: Sequence[Hoist],
        *,
        marks: Sequence[int],
        shown: Array,
    ) -> _History:
        start_cycles = (c_long * len(script.start_cycles))(*script.start_cycles)
        setpoints = [values[name] for name in self._setpoints]
        return _History(
            cycle=script.cycle,
            n_rows=len(start_cycles),
            start_cycles=start_cycles,
            inputs=doubles(script.inputs),
            actual=(c_size_t * len(script.actual))(*script.actual),
            longest=script.longest,
            settle=script.settle,
            watch=script.watch,
            n_parameters=len(values),
            n_setpoints=len(setpoints),
            n_loads=len(self._loads),
            parameter_references=self._numbers(values),
            setpoint_references=self._numbers(self._setpoints),
            load_references=self._numbers(self._loads),
            parameters=(c_double * len(values))(*values.values()),
            setpoints=(c_double * len(setpoints))(*setpoints),
            led=(c_size_t * len(led))(*led),
            n_hoists=len(hoists),
            hoists=(c_size_t * len(hoists))(*(hoist.axis for hoist in hoists)),
            columns=(c_size_t * len(hoists))(*(hoist.column for hoist in hoists)),
            ratios=(c_double * len(hoists))(*(hoist.ratio for hoist in hoists)),
            n_marks=len(marks),
            marks=(c_long * len(marks))(*marks),
            **self._measured(script.measured, shown),
        )

    def _measured(self, measured: Measurement | None, shown: Array) -> dict[str, Any]:
        if measured is None:
            return {"n_sensors": 0}
        sensors = len(measured.quantities)
        return {
            "n_sensors": sensors,
            "measured": doubles(measured.cycles),
            "pushed": doubles(measured.pushed),
            "quantities": self._numbers(measured.quantities),
            "shows": (c_size_t * sensors)(*measured.shows),
            "valid": (c_size_t * sensors)(*measured.valid),
            "shown": doubles(shown),
            "again": measured.again,
        }

    def _numbers(self, names: Collection[str]) -> Any:
        return unsigned(self._variables.named(names))


_EXTREMES = [field.name for field in attrs.fields(AxisExtremes)]
_SIMPLE = ("stands", "cycles", "promise", "error", "fault")


def _called(block: CalledBlock, script: Script) -> _Block:
    places = [block.outputs.index(name) for axis in block.axes for name in axis]
    busy, promise, error, enabled = (block.outputs.index(name) for name in block.states)
    return _Block(
        play=block.play,
        instance=ctypes.addressof(block.memory),
        n_inputs=script.inputs.shape[1],
        n_outputs=len(block.outputs),
        n_axes=len(block.axes),
        axes=(c_size_t * len(places))(*places),
        busy=busy,
        promise=promise,
        error=error,
        enabled=enabled,
        size=ctypes.sizeof(block.memory),
    )
