"""The planner block as an object in Python: its own text, called cycle by cycle or for whole histories."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen_profile.motion.profile import Array
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import read_block
from gen_profile.planner.interface import SENSOR, BlockAxis, live_inputs, sensed_axes
from gen_profile.spec.arguments import as_numbers, as_values
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import found, suggestion
from gen_profile.support.summary import Sampled, Summarised

PLACE = "fActPosition"
OWN = {  # of each axis
    "position": "fPosition",
    "velocity": "fVelocity",
    "acceleration": "fAcceleration",
    "stop_distance": "fStopDistance",
}
COMMON = {"busy": "bBusy", "done": "bDone", "promise": "bPromise", "error_id": "nErrorId"}
OF_AXES: dict[
    Literal["target", "velocity", "velocity_limit", "actual_position", "actual_velocity"], str
] = {  # inputs of each, by what a caller gives
    "target": "fTarget",
    "velocity": "fVelocityCommand",
    "velocity_limit": "fVelocityLimit",
    "actual_position": PLACE,
    "actual_velocity": "fActVelocity",
}
MOST_CYCLES = 2_000_000  # in one go: each takes some hundred bytes
IDLE = dict.fromkeys(("bExecute", "bVelocity", "bStop", "bQuickStop"), 0.0)  # no command
ZONES = ("aBlockedLow", "aBlockedHigh", "aSlowLow", "aSlowHigh", "aSlowLimit")
OUTPUT_TYPES = {"b": np.bool_, "n": np.int64}  # by the first letter of an output's name; others are real


@attrs.frozen(kw_only=True)
class Setpoint:
    """What a planner issued in one cycle.

    Attributes
    ----------
    position, velocity, acceleration : float or (axes,) array
        m, m/s and m/s² (or rad); a number where there is one axis.
    busy, done, promise : bool
        The axis moves; stands at the target; no sway remains after the motion.
    error_id : int
        0 for none; the block's header explains the others.
    stop_distance : float or (axes,) array
        m, which a stop without sway takes at most.
    outputs : mapping of str to float, int or bool
        All of the block's outputs by their names there.
    """

    position: float | Array
    velocity: float | Array
    acceleration: float | Array
    busy: bool
    done: bool
    promise: bool
    error_id: int
    stop_distance: float | Array
    outputs: Mapping[str, Any] = attrs.field(repr=False)


@attrs.frozen(kw_only=True, eq=False, repr=False)
class SetpointHistory(Sampled):
    """What a planner issued in many cycles: as `Setpoint`, each a (cycles,) array, or (cycles, axes)."""

    position: Array
    velocity: Array
    acceleration: Array
    busy: NDArray[np.bool_]
    done: NDArray[np.bool_]
    promise: NDArray[np.bool_]
    error_id: NDArray[np.int64]
    stop_distance: Array
    outputs: Mapping[str, NDArray[Any]] = attrs.field(repr=False)


class Orders(TypedDict, total=False):
    """What a caller may give for one cycle or many; what is left out goes on as it was.

    Attributes
    ----------
    target : float or (axes,) array
        m (or rad), to move to.
    velocity : float or (axes,) array
        m/s, to follow, as of a stick; over many cycles also (cycles,) or (cycles, axes), its history.
    stop : bool
        Whether to stop without sway.
    quick_stop : bool
        Whether to brake at once: the load swings. At most one of these four; the command before goes on
        where there is none.
    reset : bool
        Whether to acknowledge an error that stopped a command.
    load_at_rest : bool
        Whether the load was seen to hang still, as some time after a quick stop: the promise holds again.
    enable : bool
        Whether the block commands the axis; it does from the start. Where it is not to, it stops commanding
        in the same cycle, forgets its command, and follows the axis; it takes it over when enabled again.
    actual_position, actual_velocity : float or (axes,) array
        m and m/s, of the axis while the block is disabled: by default where the block left it, at rest.
    live : mapping of str to float or (cycles,) array
        Live parameters that change, by name, in their SI units; an array changes on the way.
    override : float
        Share of the greatest velocity. It holds, and so does the next.
    velocity_limit : float or (axes,) array
        m/s; 0 for none but the machine's.
    sensor : float or (cycles,) array
        What the sensor shows in every cycle, in its unit; there is no news where it is not given. Of
        sensors along several axes (axes,) or (cycles, axes).
    """

    target: ArrayLike | None
    velocity: ArrayLike | None
    stop: bool
    quick_stop: bool
    reset: bool
    load_at_rest: bool
    enable: bool
    actual_position: ArrayLike | None
    actual_velocity: ArrayLike | None
    live: Mapping[str, ArrayLike] | None
    override: float | None
    velocity_limit: ArrayLike | None
    sensor: ArrayLike | None


class Planner(Summarised):
    """Plan motions that leave no sway, by the planner block of a spec.

    A command holds until the next one; a target may change on the way, and so may the kind of command. Where
    there are several axes, a number for each takes the place of a number: they move together.

    Parameters
    ----------
    source : Spec, Path or str
        A spec, its file (``.toml``), or the path of a written block in any container.
    position : float or (axes,) array, optional
        m (or rad), where the axis stands before the first cycle; the start of the spec's move if not given.

    Raises
    ------
    SpecError
        The spec states too little, or its machine is not taken.
    ExportError, OutputError
        The file holds no planner block, or cannot be read.
    CosimulationError
        There is no C compiler.

    Examples
    --------
    >>> planner = gp.Planner(gp.preset_spec("bay-crane"))
    >>> history = planner.hold(20.0, target=3.0)  # s, m
    >>> bool(history.done[-1]), float(history.position[-1])
    (True, 3.0)
    """

    def __init__(self, source: Spec | Path | str, position: ArrayLike | None = None) -> None:
        if isinstance(source, str | Path) and Path(source).suffix != ".toml":
            self._text = read_block(Path(source))
        else:
            self._text = planner_block(as_spec(source)).text
        self._block = BlockInstance(self._text)
        self._axes = self._block.axes
        self._inputs = self._block.inputs  # as they are in the next cycle
        self._live = live_inputs(self._inputs, self._axes)
        stands = [self._inputs[axis.of(PLACE)] for axis in self._axes]
        self.restart(position if position is not None else stands if len(stands) > 1 else stands[0])

    def summary(self) -> Mapping[str, object]:
        """Name what it is for, and where it stands."""
        stands = {axis.name or "axis": self._inputs[axis.of(PLACE)] for axis in self._axes}
        return {"cycle": f"{1e3 * self.cycle_time:g} ms", "live": self.live, "stands at": stands}

    @property
    def cycle_time(self) -> float:
        """Of a step, in s."""
        return self._inputs["fCycleTime"]

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes in the order of every array; an empty one where there is but one axis."""
        return tuple(axis.name for axis in self._axes)

    @property
    def live(self) -> dict[str, float]:
        """The live parameters by name, as they are taken for."""
        return {name: self._inputs[given] for name, given in self._live.items()}

    def restart(self, position: ArrayLike) -> None:
        """Begin anew where the axis stands and the load hangs still, as after a quick stop.

        Parameters
        ----------
        position : float or (axes,) array
            m (or rad).
        """
        stands = _columns_of(PLACE, "position", position, self._axes, 1)
        self._block = BlockInstance(self._text)
        self._inputs |= {
            "bEnable": 1.0,
            **{name: float(column[0]) for name, column in stands.items()},
            **IDLE,
        }
        self._target: list[float] | None = None  # of the command that holds
        self._is_due = self._was_given = False  # the rising edge of bExecute; whether it is high
        self._is_enabled = False

    def restrict(
        self,
        *,
        blocked: Sequence[tuple[float, float]] = (),
        slow: Sequence[tuple[float, float, float]] = (),
        axis: int = 0,
    ) -> None:
        """Close intervals of the travel, and limit the velocity in others, until the next call.

        Parameters
        ----------
        blocked : sequence of (float, float)
            m, from and to; no command leads into them.
        slow : sequence of (float, float, float)
            m, from and to, and m/s.
        axis : int
            Place of the axis in `axes`.

        Raises
        ------
        SpecError
            The block has no zones (``planner.zones``), or not so many, or no such axis.
        """
        if isinstance(axis, bool) or axis not in range(len(self._axes)):
            last = len(self._axes) - 1
            raise SpecError(f"axis: must be a place in `axes`, from 0 to {last}, found {axis!r}.")
        columns: dict[str, list[float]] = {}
        for what, rows, names in (("blocked", blocked, ZONES[:2]), ("slow", slow, ZONES[2:])):
            if not isinstance(rows, Iterable):
                raise SpecError(f"{what}: must be rows of {len(names)} numbers, found {rows!r}.")
            numbers = [as_numbers(row, f"{what}, a row") for row in rows]
            if any(len(row) != len(names) for row in numbers):
                raise SpecError(f"{what}: must be rows of {len(names)} numbers, found {list(rows)!r}.")
            columns |= {name: [row[k] for row in numbers] for k, name in enumerate(names)}
        suffix = self._axes[axis].suffix
        for name, values in columns.items():
            places = [known for known in self._inputs if known.startswith(f"{name}{suffix}[")]
            if len(values) > len(places):
                raise SpecError(
                    f"Planner: the block takes {len(places)} such intervals, found {len(values)}"
                    + ("." if places else "; state planner.zones = true.")
                )
            self._inputs |= dict.fromkeys(places, 0.0) | dict(zip(places, values, strict=False))

    def step(self, **orders: Unpack[Orders]) -> Setpoint:
        """Issue the setpoint of the next cycle.

        Parameters
        ----------
        **orders
            See `Orders`.

        Raises
        ------
        SpecError
            More than one command, a parameter that is not live, or what is no number. A number out of range,
            or nan, is the planner's to refuse: by ``error_id``.
        """
        issued = self._issue(orders, 1)
        outputs = {name: column.item() for name, column in issued.items()}
        own = {name: self._own(output, issued)[0] for name, output in OWN.items()}
        if len(self._axes) == 1:
            own = {name: float(value) for name, value in own.items()}
        return Setpoint(
            **own, **{name: outputs[name_in_block] for name, name_in_block in COMMON.items()}, outputs=outputs
        )

    def hold(self, seconds: float, **orders: Unpack[Orders]) -> SetpointHistory:
        """Issue the setpoints of many cycles, in a compiled loop.

        Parameters
        ----------
        seconds : float
            For how long, in whole cycles.
        **orders
            See `Orders`.

        Raises
        ------
        SpecError
            As of `step`; or there is no whole cycle, too many for one go, or an array of another length.
        """
        exact = float(_column("seconds", seconds, 1)[0]) / self.cycle_time
        cycles = round(exact) if math.isfinite(exact) else 0
        if cycles < 1:
            raise SpecError(f"seconds: at least one cycle of {self.cycle_time:g} s, found {seconds!r}.")
        if cycles > MOST_CYCLES:
            most = MOST_CYCLES * self.cycle_time
            raise SpecError(f"seconds: at most {most:g} in one go, found {seconds!r}; call it several times.")
        issued = self._issue(orders, cycles)
        return SetpointHistory(
            outputs=issued,
            **{name: self._own(output, issued) for name, output in OWN.items()},
            **{name: issued[output] for name, output in COMMON.items()},
        )

    def _own(self, output: str, issued: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """Put an output of all axes side by side, or give that of the only one."""
        columns = [issued[axis.of(output)] for axis in self._axes]
        return np.stack(columns, axis=1) if len(columns) > 1 else columns[0]

    def _issue(self, orders: Orders, cycles: int) -> dict[str, NDArray[Any]]:
        """Call the block; nothing has changed where the orders are refused."""
        columns = self._columns(orders, cycles)
        rows = np.tile(list(self._inputs.values()), (cycles, 1))
        self._command(orders, columns)
        columns["bExecute"] = self._edge(cycles)
        for name, column in columns.items():
            rows[:, list(self._inputs).index(name)] = column
        self._inputs |= {name: float(column[-1]) for name, column in columns.items()}
        if self._inputs["bEnable"] and not self._is_enabled:
            # a cycle without a command, with the live parameters of the first one
            first = dict(zip(self._inputs, rows[0], strict=True))
            self._block.call(np.array([list((first | IDLE).values())]))
            self._is_enabled = True
        issued = self._block.call(rows).T
        last = dict(zip(self._block.outputs, issued[:, -1].tolist(), strict=True))
        if last["bEnabled"]:  # where the axes stand if they are not commanded from now on
            for axis in self._axes:
                self._inputs |= {axis.of(PLACE): last[axis.of("fPosition")], axis.of("fActVelocity"): 0.0}
        return {
            name: column.astype(OUTPUT_TYPES.get(name[0], np.float64))
            for name, column in zip(self._block.outputs, issued, strict=True)
        }

    def _columns(self, orders: Orders, cycles: int) -> dict[str, Array]:
        """Give the inputs that orders change, a value per cycle."""
        if unknown := sorted(orders.keys() - Orders.__annotations__.keys()):
            raise TypeError(
                f"The planner takes no {unknown[0]!r}{suggestion(unknown[0], Orders.__annotations__)}"
            )
        if sum(_commands(orders).values()) > 1:
            raise SpecError("Planner: give one of target, velocity, stop and quick_stop, not several.")
        columns: dict[str, Array] = {}
        for switch in ("stop", "quick_stop", "reset", "load_at_rest", "enable"):
            if not isinstance(given := orders.get(switch, False), bool | np.bool_):
                raise SpecError(f"{switch}: must be true or false, found {found(given)}.")
        for what, name in OF_AXES.items():
            if (value := orders.get(what)) is not None:
                columns |= _columns_of(name, what, value, self._axes, cycles)
        if (override := orders.get("override")) is not None:
            columns["rOverride"] = _column("override", override, cycles)
        columns |= self._sensed(orders.get("sensor"), cycles)
        for name, value in as_values(orders.get("live") or {}, "live").items():
            if name not in self._live:
                raise SpecError(
                    f"live: the planner has no live parameter {name!r}{suggestion(name, self._live)}"
                )
            columns[self._live[name]] = _column(f"live.{name}", value, cycles)
        return columns

    def _sensed(self, shown: ArrayLike | None, cycles: int) -> dict[str, Array]:
        """Give what the sensor shows, or that there is no news of it."""
        axes = sensed_axes(self._inputs, self._axes)
        valid = {axis.of(SENSOR[1]): np.full(1, float(shown is not None)) for axis in axes}
        if shown is None:
            return valid
        if not axes:
            raise SpecError("sensor: the planner has none; state planner.sensor.")
        return _columns_of(SENSOR[0], "sensor", shown, axes, cycles) | valid

    def _command(self, orders: Orders, columns: dict[str, Array]) -> None:
        """Let another command take the place of the one that holds; one that was stopped is given anew."""
        reset, commands = orders.get("reset", False), _commands(orders)
        enable = orders.get("enable", bool(self._inputs["bEnable"]))
        levels = {"bReset": reset, "bLoadAtRest": orders.get("load_at_rest", False), "bEnable": enable}
        if reset:
            self._target = None
        if commands.pop("bExecute"):
            target = [float(columns[axis.of("fTarget")][0]) for axis in self._axes]
            self._is_due = self._is_due or target != self._target
            self._target = target
            levels |= commands
        elif any(commands.values()) or not enable:
            self._is_due, self._target = False, None
            levels |= commands
        columns |= {name: np.full(1, float(is_so)) for name, is_so in levels.items() if name in self._inputs}

    def _edge(self, cycles: int) -> Array:
        """Give bExecute: high while a position is commanded, but for a cycle before another one is."""
        execute = np.full(cycles, float(self._target is not None))
        if self._is_due:
            waits = self._was_given
            execute[: int(waits)] = 0.0
            self._is_due = waits and cycles == 1
        self._was_given = bool(execute[-1])
        return execute


def _commands(orders: Orders) -> dict[str, bool]:
    """Tell which of the block's inputs commands are given by."""
    return {
        "bExecute": orders.get("target") is not None,
        "bVelocity": orders.get("velocity") is not None,
        "bStop": bool(orders.get("stop", False)),
        "bQuickStop": bool(orders.get("quick_stop", False)),
    }


def _columns_of(
    name: str, what: str, value: ArrayLike, axes: Sequence[BlockAxis], cycles: int
) -> dict[str, Array]:
    """Give an input of every axis, a value per cycle."""
    if len(axes) == 1:
        return {axes[0].of(name): _column(what, value, cycles)}
    shape = np.shape(np.asarray(value, dtype=object))
    if shape not in ((len(axes),), (cycles, len(axes))):
        named = ", ".join(axis.name for axis in axes)
        each = f", or such a row for each of {cycles} cycles" if cycles > 1 else ""
        found = f"an array {shape}" if shape else repr(value)
        raise SpecError(f"{what}: must be a number for each axis ({named}){each}, found {found}.")
    rows = np.asarray(value, dtype=object).reshape(-1, len(axes)).T.tolist()
    return {
        axis.of(name): _column(f"{what} of {axis.name}", row[0] if len(row) == 1 else row, cycles)
        for axis, row in zip(axes, rows, strict=True)
    }


def _column(what: str, value: ArrayLike, cycles: int) -> Array:
    try:
        given = np.asarray(value)
        if given.dtype.kind in "USbc":  # NumPy would make numbers of them
            raise TypeError
        column = given.astype(np.float64)
    except (TypeError, ValueError):
        raise SpecError(f"{what}: must be a number, found {value!r}.") from None
    if column.shape not in ((), (cycles,)):
        raise SpecError(f"{what}: must be a number or one for each of {cycles} cycles, found {column.shape}.")
    return np.broadcast_to(column, cycles)
