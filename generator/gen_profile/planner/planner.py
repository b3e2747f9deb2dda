"""The planner block as an object in Python: its own text, called cycle by cycle or for whole histories."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen_profile.errors import SpecError
from gen_profile.planner.chebyshev import Array
from gen_profile.planner.commands import live_inputs
from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import read_block
from gen_profile.spec.model import Spec
from gen_profile.suggestion import suggestion

OUTPUTS = {
    "position": "fPosition",
    "velocity": "fVelocity",
    "acceleration": "fAcceleration",
    "busy": "bBusy",
    "done": "bDone",
    "promise": "bPromise",
    "error_id": "nErrorId",
    "stop_distance": "fStopDistance",
}
KINDS = {"b": np.bool_, "n": np.int64}  # by the first letter of an output's name; others are real


@attrs.frozen(kw_only=True)
class Setpoint:
    """What a planner issued in one cycle.

    Attributes
    ----------
    position, velocity, acceleration : float
        m, m/s and m/s².
    busy, done, promise : bool
        The axis moves; stands at the target; no sway remains after the motion.
    error_id : int
        0 for none; the block's header explains the others.
    stop_distance : float
        m, which a stop without sway takes at most.
    outputs : mapping of str to float, int or bool
        All of the block's outputs by their names there.
    """

    position: float
    velocity: float
    acceleration: float
    busy: bool
    done: bool
    promise: bool
    error_id: int
    stop_distance: float
    outputs: Mapping[str, Any] = attrs.field(repr=False)


@attrs.frozen(kw_only=True, eq=False)
class SetpointHistory:
    """What a planner issued in many cycles: as `Setpoint`, each a (cycles,) array."""

    position: Array
    velocity: Array
    acceleration: Array
    busy: NDArray[np.bool_]
    done: NDArray[np.bool_]
    promise: NDArray[np.bool_]
    error_id: NDArray[np.int64]
    stop_distance: Array
    outputs: Mapping[str, NDArray[Any]] = attrs.field(repr=False)


@attrs.frozen(kw_only=True)
class _Orders:
    """What a caller gave; None is for what goes on as it was."""

    target: float | None
    velocity: ArrayLike | None
    stop: bool
    quick_stop: bool
    live: Mapping[str, ArrayLike] | None
    override: float | None
    velocity_limit: float | None


class Planner:
    """Plan motions that leave no sway, by the planner block of a spec.

    A command holds until the next one; a target may change on the way, and so may the kind of command.

    Parameters
    ----------
    source : Spec, Path or str
        A spec, or the path of a written block in any container.
    position : float, optional
        m, where the axis stands before the first cycle; the start of the spec's move if not given.

    Raises
    ------
    SpecError
        The spec states too little, or its machine is not taken.
    ExportError, OutputError
        The file holds no planner block, or cannot be read.
    CosimulationError
        There is no C compiler.
    """

    def __init__(self, source: Spec | Path | str, position: float | None = None) -> None:
        self._text = planner_block(source).text if isinstance(source, Spec) else read_block(Path(source))
        self._inputs = BlockInstance(self._text).inputs  # as they are in the next cycle
        self._live = live_inputs(self._inputs)
        self.restart(self._inputs["fActPosition"] if position is None else position)

    @property
    def cycle_time(self) -> float:
        """Of a step, in s."""
        return self._inputs["fCycleTime"]

    @property
    def live(self) -> dict[str, float]:
        """The live parameters by name, as they are taken for."""
        return {name: self._inputs[given] for name, given in self._live.items()}

    def restart(self, position: float) -> None:
        """Begin anew where the axis stands and the load hangs still, as after a quick stop.

        Parameters
        ----------
        position : float
            m.
        """
        stand = float(_column("position", position, 1)[0])
        self._block = BlockInstance(self._text)
        idle = dict.fromkeys(("bVelocity", "bStop", "bQuickStop"), 0.0)
        self._inputs |= {"bEnable": 1.0, "fActPosition": stand, **idle}
        self._target: float | None = None  # of the command that holds
        self._is_due = self._was_given = False  # the rising edge of bExecute; whether it is high

    def step(
        self,
        *,
        target: float | None = None,
        velocity: float | None = None,
        stop: bool = False,
        quick_stop: bool = False,
        live: Mapping[str, float] | None = None,
        override: float | None = None,
        velocity_limit: float | None = None,
    ) -> Setpoint:
        """Issue the setpoint of the next cycle.

        Parameters
        ----------
        target : float, optional
            m, to move to.
        velocity : float, optional
            m/s, to follow, as of a stick.
        stop : bool
            Whether to stop without sway.
        quick_stop : bool
            Whether to brake at once: the load swings. At most one of these four; the command before goes on
            where there is none.
        live : mapping of str to float, optional
            Live parameters that change, by name, in their SI units.
        override : float, optional
            Share of the greatest velocity. It holds, and so does the next.
        velocity_limit : float, optional
            m/s; 0 for none but the machine's.

        Raises
        ------
        SpecError
            More than one command, a parameter that is not live, or what is no number. A number out of range,
            or nan, is the planner's to refuse: by ``error_id``.
        """
        orders = _Orders(
            target=target,
            velocity=velocity,
            stop=stop,
            quick_stop=quick_stop,
            live=live,
            override=override,
            velocity_limit=velocity_limit,
        )
        issued = {name: column.item() for name, column in self._issue(orders, 1).items()}
        return Setpoint(**{name: issued[output] for name, output in OUTPUTS.items()}, outputs=issued)

    def hold(
        self,
        seconds: float,
        *,
        target: float | None = None,
        velocity: ArrayLike | None = None,
        stop: bool = False,
        quick_stop: bool = False,
        live: Mapping[str, ArrayLike] | None = None,
        override: float | None = None,
        velocity_limit: float | None = None,
    ) -> SetpointHistory:
        """Issue the setpoints of many cycles, in a compiled loop.

        Parameters
        ----------
        seconds : float
            For how long, in whole cycles.
        target, stop, quick_stop, override, velocity_limit
            As of `step`.
        velocity : float or (cycles,) array, optional
            m/s; an array is the history of a stick.
        live : mapping of str to float or (cycles,) array, optional
            As of `step`; an array changes on the way.

        Raises
        ------
        SpecError
            As of `step`; or there is no whole cycle, or an array of another length.
        """
        cycles = round(float(_column("seconds", seconds, 1)[0]) / self.cycle_time)
        if cycles < 1:
            raise SpecError(f"seconds: at least one cycle of {self.cycle_time:g} s, found {seconds!r}.")
        orders = _Orders(
            target=target,
            velocity=velocity,
            stop=stop,
            quick_stop=quick_stop,
            live=live,
            override=override,
            velocity_limit=velocity_limit,
        )
        issued = self._issue(orders, cycles)
        return SetpointHistory(**{name: issued[output] for name, output in OUTPUTS.items()}, outputs=issued)

    def _issue(self, orders: _Orders, cycles: int) -> dict[str, NDArray[Any]]:
        """Call the block; nothing has changed where the orders are refused."""
        columns = self._columns(orders, cycles)
        rows = np.tile(list(self._inputs.values()), (cycles, 1))
        self._command(orders, columns)
        columns["bExecute"] = self._edge(cycles)
        for name, column in columns.items():
            rows[:, list(self._inputs).index(name)] = column
        self._inputs |= {name: float(column[-1]) for name, column in columns.items()}
        issued = self._block.call(rows).T
        return {
            name: column.astype(KINDS.get(name[0], np.float64))
            for name, column in zip(self._block.outputs, issued, strict=True)
        }

    def _columns(self, orders: _Orders, cycles: int) -> dict[str, Array]:
        """Give the inputs that orders change, a value per cycle."""
        commands = (orders.target is not None, orders.velocity is not None, orders.stop, orders.quick_stop)
        if sum(commands) > 1:
            raise SpecError("Planner: give one of target, velocity, stop and quick_stop, not several.")
        given = {
            "fTarget": ("target", orders.target),
            "fVelocityCommand": ("velocity", orders.velocity),
            "rOverride": ("override", orders.override),
            "fVelocityLimit": ("velocity_limit", orders.velocity_limit),
        }
        for name, value in (orders.live or {}).items():
            if name not in self._live:
                raise SpecError(
                    f"live: the planner has no live parameter {name!r}{suggestion(name, self._live)}"
                )
            given[self._live[name]] = (f"live.{name}", value)
        return {
            name: _column(what, value, cycles) for name, (what, value) in given.items() if value is not None
        }

    def _command(self, orders: _Orders, columns: dict[str, Array]) -> None:
        """Let another command take the place of the one that holds."""
        if "fTarget" in columns:
            target = float(columns["fTarget"][0])
            self._is_due = self._is_due or target != self._target
            self._target = target
        elif "fVelocityCommand" in columns or orders.stop or orders.quick_stop:
            self._is_due, self._target = False, None
        else:
            return
        moves = {
            "bVelocity": "fVelocityCommand" in columns,
            "bStop": orders.stop,
            "bQuickStop": orders.quick_stop,
        }
        columns |= {name: np.full(1, float(value)) for name, value in moves.items()}

    def _edge(self, cycles: int) -> Array:
        """Give bExecute: high for the one cycle that begins a motion, and low for one before it."""
        execute = np.zeros(cycles)
        at = int(self._was_given)
        if self._is_due and at < cycles:
            execute[at], self._is_due = 1.0, False
        self._was_given = bool(execute[-1])
        return execute


def _column(what: str, value: ArrayLike, cycles: int) -> Array:
    try:
        column = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise SpecError(f"{what}: must be a number, found {value!r}.") from None
    if column.shape not in ((), (cycles,)):
        raise SpecError(f"{what}: must be a number or one for each of {cycles} cycles, found {column.shape}.")
    return np.broadcast_to(column, cycles)
