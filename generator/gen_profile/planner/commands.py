"""Playing a table of commands to a written planner block, and the table of setpoints that it issues."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.events import COLUMNS, events_of, require_events
from gen_profile.planner.execution import BlockInstance, block_inputs
from gen_profile.planner.interface import SENSED, BlockAxis, block_axes, live_inputs, sensed_axes
from gen_profile.planner.sensor_log import SensorLog, read_rows, read_sensor_log
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import number_meant

COMMANDS = ("position", "velocity", "stop", "quick-stop")
FIRST = ("time_s", "command")
WHOLE = ("b", "n")  # first letters of outputs that are whole numbers
CHUNK = 10_000  # cycles between looks at whether the axis stands
LONGEST_TAIL = 3600.0  # s, of what follows the last command
MOST_CYCLES = 10_000_000  # before the last command
STANDSTILL_TIME = 0.5  # s of standing after which nothing more is expected


@attrs.frozen(kw_only=True)
class Command:
    """What holds from a time on.

    Attributes
    ----------
    time : float
        s.
    command : str
        One of `COMMANDS`.
    values : tuple of float
        Of each axis, in m or m/s (or rad); none of a stop.
    live : mapping of str to float
        Live parameters that change.
    override : float
        Of the greatest velocity.
    velocity_limits : tuple of float
        Of each axis; 0, or none given, for none but the machine's.
    """

    time: float
    command: str
    values: tuple[float, ...] = ()
    live: Mapping[str, float] = attrs.field(factory=dict)
    override: float = 1.0
    velocity_limits: tuple[float, ...] = ()

    def begin(self, cycle: float) -> int:
        """Tell in which cycle, of so many seconds, it begins."""
        return math.ceil(self.time / cycle - 1e-9)


def read_commands(text: str, axes: Sequence[BlockAxis], live: Collection[str]) -> tuple[Command, ...]:
    """Read the table of commands.

    Parameters
    ----------
    text : str
        CSV with the columns ``time_s, command``, ``value`` (of several axes, one each: ``value_x``), and one
        for each live parameter that changes.
    axes : sequence of BlockAxis
        The block's.
    live : collection of str
        Likewise.

    Raises
    ------
    SpecError
        With the line and the cure.
    """
    required = (*FIRST, *(axis.of("value") for axis in axes))
    names, rows = read_rows(text, "commands", required)
    if unknown := [name for name in names if name not in (*required, *live)]:
        known = ", ".join(live) or "none"
        raise SpecError(f"commands: the block has no live parameter {unknown[0]!r}; it has {known}.")
    commands: list[Command] = []
    for line, row in rows:
        command = _command(row, line, axes, live)
        if commands and command.time < commands[-1].time:
            back = f"time_s goes back from {commands[-1].time:g} to {command.time:g}"
            raise SpecError(f"commands, line {line}: {back}.")
        commands.append(command)
    if not commands:
        raise SpecError(f"commands: there is no row; write one such as 0.0,position{',1.0' * len(axes)}.")
    return tuple(commands)


def _command(
    row: Mapping[str, str | None], line: int, axes: Sequence[BlockAxis], live: Collection[str]
) -> Command:
    if None in row:  # where DictReader puts them
        raise SpecError(f"commands, line {line}: holds more cells than the first line has names.")
    command = (row["command"] or "").strip()
    if command not in COMMANDS:
        known = ", ".join(COMMANDS)
        raise SpecError(f"commands, line {line}: unknown command {command!r}; known are {known}.")
    time = _number(row["time_s"], "time_s", line)
    if not 0.0 <= time <= 1e6:
        raise SpecError(f"commands, line {line}: time_s must lie between 0 and 1e6 s, found {time:g}.")
    valued = [axis.of("value") for axis in axes] if command in ("position", "velocity") else []
    values = tuple(_number(row[name], name, line) for name in valued)
    given = {name: _number(text, name, line) for name in live if (text := row.get(name)) and text.strip()}
    return Command(time=time, command=command, values=values, live=given)


def _number(text: str | None, name: str, line: int) -> float:
    """Read a number; nan is one, as a controller may be given it."""
    try:
        return float(text or "")
    except ValueError:
        seen_text = f"found {text or ''!r}{number_meant(text or '')}"
        raise SpecError(f"commands, line {line}: {name} must be a number, {seen_text}.") from None


@attrs.frozen(kw_only=True)
class IssuedSetpoints:
    """What a block issued.

    Attributes
    ----------
    table : str
        CSV, one row per cycle.
    cycles : int
    errors : tuple of int
        Error ids that it showed, in their order.
    unpromised : int
        Its nPromise at the end: 0 where no sway remains.
    events : str
        CSV of its events, if they were asked for.
    """

    table: str
    cycles: int
    errors: tuple[int, ...]
    unpromised: int
    events: str = ""


def play(
    text: str, commands_text: str, *, with_events: bool = False, sensor_text: str | None = None
) -> IssuedSetpoints:
    """Execute a written block under a table of commands.

    Parameters
    ----------
    text : str
        The block.
    commands_text : str
        Table of commands; each row holds until the next, and the last one until the axis stands still.
    with_events : bool
        Whether its events are wanted, too.
    sensor_text : str, optional
        Log of its sensor, as `gen_profile.planner.sensor_log` reads it; there is no news without.

    Raises
    ------
    ExportError, SpecError, CosimulationError
    """
    inputs, axes = block_inputs(text), block_axes(text)
    commands = read_commands(commands_text, axes, live_inputs(inputs, axes))
    cycle = inputs["fCycleTime"]
    if commands[-1].begin(cycle) > MOST_CYCLES:
        at, most = f"{commands[-1].time:g} s", f"{MOST_CYCLES * cycle:g} s"
        raise SpecError(f"commands: the last one comes at {at}, and at most {most} are played in one go.")
    sensed = sensed_axes(inputs, axes)
    log = None if sensor_text is None else read_sensor_log(sensor_text, sensed)
    if with_events:
        require_events(text)
    block = BlockInstance(text)  # compiled only for tables that can be played
    columns = _columns(axes) | ({"damping": "bDamping"} if sensed else {})
    columns |= {axis.prefix + name: axis.of(output) for axis in sensed for name, output in SENSED.items()}
    places = {name: block.outputs.index(output) for name, output in columns.items()}
    lines, promise = ["time_s," + ",".join(columns)], block.outputs.index("nPromise")
    shown: dict[int, None] = {}  # as an ordered set
    issued = list(_issued(block, commands, cycle, log))
    events = events_of(block.outputs, np.concatenate(issued)) if with_events else ()
    for number, row in enumerate(chain.from_iterable(issued)):
        cells = (
            str(int(row[places[name]])) if output.startswith(WHOLE) else repr(float(row[places[name]]))
            for name, output in columns.items()
        )
        lines.append(f"{number * cycle:.9g}," + ",".join(cells))
        shown[int(row[places["error_id"]])] = None
    errors = tuple(error for error in shown if error)
    return IssuedSetpoints(
        table="\n".join(lines) + "\n",
        cycles=len(lines) - 1,
        errors=errors,
        unpromised=int(row[promise]),
        events="\n".join([",".join(COLUMNS), *(f"{e.time:.9g},{e.code},{e.value!r}" for e in events), ""]),
    )


def _columns(axes: Sequence[BlockAxis]) -> dict[str, str]:
    """Name the columns of the setpoints, and the block's outputs that stand in them."""
    columns: dict[str, str] = {}
    for axis in axes:
        columns |= {
            f"{axis.prefix}position_{axis.unit}": axis.of("fPosition"),
            f"{axis.prefix}velocity_{axis.unit}_per_s": axis.of("fVelocity"),
            f"{axis.prefix}acceleration_{axis.unit}_per_s2": axis.of("fAcceleration"),
        }
    columns |= {"busy": "bBusy", "done": "bDone", "error_id": "nErrorId", "promise": "bPromise"}
    return columns | {f"{axis.prefix}stop_distance_{axis.unit}": axis.of("fStopDistance") for axis in axes}


def start_cycles_of(commands: Sequence[Command], cycle: float) -> list[int]:
    """Tell in which cycles commands begin.

    A stick waits for a cycle in which the block is enabled without it, as one that is deflected then does not
    count. A position waits for a cycle without bExecute, to be an edge. Of several at once each begins a
    cycle after the one before.
    """
    start_cycles, edge, free = list[int](), -2, 0
    for command in commands:
        begin = max(command.begin(cycle), free, int(command.command == "velocity"))
        if command.command == "position":
            edge = begin = begin + (begin == edge + 1)
        start_cycles.append(begin)
        free = begin + 1
    return start_cycles


def input_rows(
    commands: Sequence[Command], axes: Sequence[BlockAxis], values: Mapping[str, float], cycle: float
) -> tuple[list[int], Array]:
    """Turn commands into inputs that hold from a cycle to the next.

    Parameters
    ----------
    commands : sequence of Command
    axes : sequence of BlockAxis
    values : mapping of str to float
        All inputs by name, in the block's order, as they are before the first command.
    cycle : float
        s.

    Returns
    -------
    start_cycles : list of int
        Rising cycles; the first is 0.
    inputs : (rows, inputs) array
    """
    values = dict(values)
    rows = {0: list(values.values())}
    for command, begin in zip(commands, start_cycles_of(commands, cycle), strict=True):
        if command.command == "position" and values["bExecute"]:
            values["bExecute"] = 0.0  # for a cycle, so that there is an edge
            rows[begin - 1] = list(values.values())
        values |= inputs_of(command, axes)
        rows[begin] = list(values.values())
    return list(rows), np.array(list(rows.values()), dtype=np.float64)


def inputs_of(command: Command, axes: Sequence[BlockAxis]) -> dict[str, float]:
    """Turn a command into the inputs that it changes, by name. bExecute stays until the next one."""
    input_name = "fTarget" if command.command == "position" else "fVelocityCommand"
    limits = command.velocity_limits or (0.0,) * len(axes)
    return {
        **{f"f{name}": value for name, value in command.live.items()},
        "bVelocity": float(command.command == "velocity"),
        "bStop": float(command.command == "stop"),
        "bQuickStop": float(command.command == "quick-stop"),
        "bExecute": float(command.command == "position"),
        **{axis.of(input_name): value for axis, value in zip(axes, command.values, strict=False)},
        "rOverride": command.override,
        **{axis.of("fVelocityLimit"): limit for axis, limit in zip(axes, limits, strict=True)},
    }


def _issued(
    block: BlockInstance, commands: tuple[Command, ...], cycle: float, log: SensorLog | None
) -> Iterator[Array]:
    """Give the outputs, row of inputs by row of inputs."""
    start_cycles, rows = input_rows(commands, block.axes, block.inputs | {"bEnable": 1.0}, cycle)
    if log is not None and log.cycles(cycle) > start_cycles[-1]:
        start_cycles, rows = [*start_cycles, log.cycles(cycle)], np.vstack([rows, rows[-1]])
    for row, begin, end in zip(rows, start_cycles, start_cycles[1:], strict=False):
        for first in range(begin, end, CHUNK):
            repeated = np.tile(row, (min(CHUNK, end - first), 1))
            yield block.call(repeated if log is None else log.given(repeated, block.inputs, first, cycle))
    yield from _until_still(block, rows[-1], cycle)


def _until_still(block: BlockInstance, row: Array, cycle: float) -> Iterator[Array]:
    telling = [block.outputs.index(name) for name in ("bBusy", *(a.of("fVelocity") for a in block.axes))]
    still = math.ceil(STANDSTILL_TIME / cycle)
    most = math.ceil(LONGEST_TAIL / cycle)
    done = 0
    while done < most:
        issued = block.call(np.tile(row, (min(CHUNK, most - done), 1)))
        moving = (issued[:, telling] != 0.0).any(axis=1)
        last = int(np.flatnonzero(moving)[-1]) + 1 if moving.any() else 0
        if last + still <= len(issued):
            yield issued[: last + still]
            return
        yield issued
        done += len(issued)
