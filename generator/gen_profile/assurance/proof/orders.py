"""What a planner block is commanded, from its inputs: which command holds from which cycle to which.

Beside its inputs, what a command means depends on what the block did: one that is done ends with bExecute,
and none is taken while a quick stop lasts. Before a run nothing is known of that.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from math import copysign, inf

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis

POSITION, VELOCITY, STOP = "position", "velocity", "stop"
QUICK_STOP, DISABLED = "quick-stop", "disabled"
# values of nErrorId
MISTIMED, LIVE, REFUSED, NO_NUMBER, LIMITS = range(1, 6)
CONTRADICTORY, FOLLOWING, BLOCKED, NO_MOTION = range(6, 10)
OF_COMMANDS = (REFUSED, CONTRADICTORY, BLOCKED)  # which go with them
REPLACED, ABORTED_POSITION, ABORTED_VELOCITY = 3, 1, 2  # why bCommandAborted is set
ZONES = 8  # intervals of each kind
ROUNDING = 1e-9  # m (or rad)
STILL = 1e-3  # of the greatest velocity, that counts as standing
NUMBERS = 1e9  # m (or rad), up to which an axis may be somewhere

Flags = NDArray[np.bool_]
Interval = tuple[float, float]


@attrs.frozen(kw_only=True)
class TimedOrder:
    """A command that holds, and how fast it may be followed.

    Attributes
    ----------
    begin, end : int
        Cycles; the end is that of the next one's begin.
    kind : str
        One of those above.
    values : tuple of float
        Of each axis the target or the velocity; none of a stop.
    tops : tuple of float
        Of each axis the greatest velocity, by limit, override and velocity limit; 0 holds.
    edge : int
        Cycle in which the command came; before `begin` where but the velocity limits have changed since.
    """

    begin: int
    end: int
    kind: str
    values: tuple[float, ...]
    tops: tuple[float, ...]
    edge: int


@attrs.frozen(kw_only=True)
class Ends:
    """Between which a block may move an axis, in its unit and s; `quick`: deceleration and jerk."""

    velocity: float
    acceleration: float
    jerk: float
    targets: Interval
    quick: tuple[float, float] = (inf, inf)
    margin: float = 0.0


def taken_over(speeds: Sequence[float], most: float) -> float:
    """Tell the velocity with which an axis is taken over: the lesser of the last two, within its limit.

    None that two of different sign leave, or that counts as standing.
    """
    least = min(most, *map(abs, speeds))
    same = all(v > 0.0 for v in speeds) or all(v < 0.0 for v in speeds)
    return copysign(least, speeds[0]) if same and least > STILL * most else 0.0


@attrs.frozen(kw_only=True)
class Inputs:
    """What is known of a block's inputs.

    Attributes
    ----------
    names : sequence of str
    axes : sequence of BlockAxis
    limits : sequence of Ends
        Of the same axes.
    live : mapping of str to (float, float)
        Ranges of the live parameters.
    held : int
        Cycles in which wrong values of them, of override and of velocity limit do not count.
    cycle : float
        s, of the task.
    patience : int
        Cycles after which a command is given up that no motion is found for.
    """

    names: Sequence[str]
    axes: Sequence[BlockAxis]
    limits: Sequence[Ends]
    live: Mapping[str, Interval]
    held: int
    cycle: float
    patience: int = 10**9


@attrs.frozen(kw_only=True)
class Facts:
    """What a block issued, as far as commands depend on it.

    Attributes
    ----------
    done, stands : (cycles,) array of bool
    errors : (cycles,) array
    position, low, high : (axes, cycles) array
        Setpoints, and where a stop would lead.
    withdrawn : (cycles,) array of bool
        Whether there is no promise as it is not known how the load swings.
    """

    done: Flags
    stands: Flags
    errors: Array
    position: Array
    low: Array
    high: Array
    withdrawn: Flags

    def led_into(self, axis: int, cycle: int, interval: Interval) -> bool:
        """Whether a stop would have led an axis into an interval, as was stated in the cycle before."""
        low, high = interval
        lowest, highest = self.low[axis, cycle - 1], self.high[axis, cycle - 1]
        return bool(lowest < high - ROUNDING and highest > low + ROUNDING)


@attrs.frozen(kw_only=True)
class ReceivedOrders:
    """The commands that a block receives, and what it must report of them.

    Attributes
    ----------
    orders : tuple of TimedOrder
    aborted : (cycles,) array of bool
    error : (cycles,) array of int
    holds : (cycles,) array of bool
        Whether a command does.
    """

    orders: tuple[TimedOrder, ...]
    aborted: Flags
    error: NDArray[np.int64]
    holds: Flags


def read_orders(
    start_cycles: Sequence[int], rows: Array, inputs: Inputs, last: int, facts: Facts | None = None
) -> ReceivedOrders:
    """Read rows of inputs as the block's header tells.

    Parameters
    ----------
    start_cycles : (rows,) sequence of int
        From which cycle each row holds.
    rows : (rows, inputs) array
    inputs : Inputs
    last : int
        Cycle after the last one.
    facts : Facts, optional
        Of the run that these inputs led to.
    """
    reader, timed = _Reader(inputs, facts), list[TimedOrder]()
    flags_by_cycle = list[tuple[int, bool, int, bool]]()
    places, row, values, due = [*start_cycles, last], 0, rows.tolist(), None
    pending = sorted({*start_cycles, *(_events(start_cycles, facts) if facts else ())}, reverse=True)
    while pending and (cycle := pending.pop()) < last:
        while places[row + 1] <= cycle:
            row += 1
        order = reader.step(cycle, dict(zip(inputs.names, values[row], strict=False)))
        for at in (cycle + 1 if cycle == due else None, due := reader.due):
            if at is not None and cycle < at < (pending[-1] if pending else last):
                pending.append(at)
        flags_by_cycle.append(
            (cycle, reader.aborted > 0, reader.error, reader.command in (POSITION, VELOCITY))
        )
        if not timed or not _same(order, timed[-1]):
            timed.append(order)
    ends = [*(order.begin for order in timed[1:]), last]
    cycles, *flags = zip(*flags_by_cycle, strict=True)
    lengths = np.diff([*cycles, last])
    aborted, error, holds = (np.repeat(flag, lengths) for flag in flags)
    orders = tuple(attrs.evolve(order, end=end) for order, end in zip(timed, ends, strict=True))
    return ReceivedOrders(orders=orders, aborted=aborted, error=error, holds=holds)


def _events(start_cycles: Sequence[int], facts: Facts) -> list[int]:
    """Cycles in which something may change though no input does."""
    errors = [facts.errors == BLOCKED, facts.errors == NO_MOTION]
    flags = np.stack([facts.done, facts.stands, facts.withdrawn, *errors])
    changes = np.flatnonzero(np.diff(flags, prepend=False).any(axis=0)).tolist()
    return [begin + 1 for begin in start_cycles] + [at + k for at in changes for k in (0, 1)]


def _same(order: TimedOrder, before: TimedOrder) -> bool:
    """Whether nothing new is commanded; stops know no velocity limit."""
    again = (order.kind, order.values, order.edge) == (before.kind, before.values, before.edge)
    return again and (order.kind not in (POSITION, VELOCITY) or order.tops == before.tops)


class _Reader:
    """Reads inputs cycle by cycle, those left out in which nothing changes."""

    def __init__(self, inputs: Inputs, facts: Facts | None) -> None:
        self._inputs, self._facts = inputs, facts
        self.aborted, self.error, self.command = 0, 0, STOP
        self.due: int | None = None  # the cycle in which wrong values begin to count
        self._latched = self._execute = self._velocity = self._braking = self._in_the_way = self._nearer = (
            False
        )
        self._neutral, self._enabled, self._edge = False, False, 0
        self._fences, self._fenced = list[list[Interval]](), False
        self._since = {LIVE: -1, LIMITS: -1}  # cycles from which values are wrong
        self._goal, self._kind = tuple[float, ...](), STOP
        self._tops = tuple(own.velocity for own in inputs.limits)
        self._speeds: Sequence[float] | None = None
        self._names = cache(lambda name: [axis.of(name) for axis in inputs.axes])

    def step(self, cycle: int, row: Mapping[str, float]) -> TimedOrder:
        before, goal = self._kind, self._goal
        self._kind = self._read(cycle, row)
        if self._kind not in (POSITION, VELOCITY):
            self._goal = ()
        if (before, goal) != (self._kind, self._goal):
            self._edge = cycle
        self._execute, self._velocity = bool(row["bExecute"]), bool(row["bVelocity"])
        self._speeds = self._of(row, "fActVelocity")
        return TimedOrder(
            begin=cycle, end=cycle, kind=self._kind, values=self._goal, tops=self._tops, edge=self._edge
        )

    def _of(self, row: Mapping[str, float], name: str) -> tuple[float, ...]:
        return tuple(row[given] for given in self._names(name))

    def _read(self, cycle: int, row: Mapping[str, float]) -> str:
        facts = self._facts
        done = bool(facts is not None and cycle and facts.done[cycle - 1])
        self._braking = self._braking and not (facts is None or facts.stands[cycle - 1])
        self._braking |= self._is_braked(cycle, row)
        if done and not row["bExecute"]:
            self.command = STOP
        if not (row["bExecute"] if self.aborted == 1 else self.aborted == 2 and row["bVelocity"]):
            self.aborted = 0
        live = self._inputs.live.items()
        self._count(LIVE, cycle, good=all(low <= row[f"f{name}"] <= high for name, (low, high) in live))
        if not row["bEnable"]:
            self._abort(done)
            self.error, self._latched, self._enabled, self._neutral = 0, False, False, False
            return DISABLED
        if not self._enabled:
            self.error = self._hinders(row)
            if self.error:
                return DISABLED
            self._enabled = True
            self._braking = any(self._taken_over(row))
        fault = self._fault(cycle, row)
        self._neutral = self._neutral or not row["bVelocity"]
        rises = bool(row["bExecute"]) and not self._execute
        if row["bStop"] or row["bQuickStop"] or self._latched or fault or self._braking:
            self._abort(done)
            if rises:
                self.aborted = ABORTED_POSITION
            self._neutral = not row["bVelocity"]
        elif row["bVelocity"]:
            self._take_stick(row, rises, done)
        elif rises:
            self._take_target(row, done, cycle)
        elif self.command == VELOCITY:
            self.command = STOP
        quick = row["bQuickStop"] or fault == FOLLOWING
        if quick and not (facts is None or (cycle and facts.stands[cycle - 1])):
            self._braking = True
        return QUICK_STOP if quick or self.error == FOLLOWING else self.command

    def _count(self, error: int, cycle: int, *, good: bool) -> None:
        """Remember from when values are wrong."""
        self._since[error] = -1 if good else cycle if self._since[error] < 0 else self._since[error]

    def _taken_over(self, row: Mapping[str, float]) -> Iterator[float]:
        """Tell how fast axes are as they are taken over."""
        now = self._of(row, "fActVelocity")
        for speeds, own in zip(zip(now, self._speeds or now, strict=True), self._inputs.limits, strict=True):
            yield taken_over(speeds, own.velocity)

    def _mistimed(self, row: Mapping[str, float]) -> bool:
        cycle = self._inputs.cycle
        return not abs(row["fCycleTime"] - cycle) <= 1e-6 * cycle

    def _hinders(self, row: Mapping[str, float]) -> int:
        """Give the error for which axes are not taken over; 0 for none."""
        names = (*self._names("fActPosition"), *self._names("fActVelocity"))
        if not all(abs(row.get(name, 0.0)) <= NUMBERS for name in names):
            return NO_NUMBER
        return MISTIMED * self._mistimed(row)

    def _abort(self, done: bool) -> None:
        if self.command != STOP and not done:
            self.aborted = ABORTED_POSITION if self.command == POSITION else ABORTED_VELOCITY
        self.command = STOP

    def _fault(self, cycle: int, row: Mapping[str, float]) -> int:
        """Take limits and errors; give the fault of this cycle."""
        given = self._of(row, "fVelocityLimit")
        good = 0.0 <= row["rOverride"] <= 1.0 and all(limit >= 0.0 for limit in given)
        if good:
            self._tops = tuple(
                min(row["rOverride"] * own.velocity, limit or own.velocity)
                for own, limit in zip(self._inputs.limits, given, strict=True)
            )
        self._count(LIMITS, cycle, good=good)
        counts = {since + self._inputs.held: error for error, since in self._since.items() if since >= 0}
        self.due = min((at for at in counts if at > cycle), default=None)
        if row.get("bReset"):
            self.error, self._latched = 0, False
        fault = MISTIMED * self._mistimed(row) or NO_MOTION * self._gives_up(cycle)
        fault = max((error for at, error in counts.items() if at <= cycle), default=fault)
        if self._is_in_the_way(cycle, row) and not self._latched:
            fault = BLOCKED
        if self._strays(row):
            fault = FOLLOWING
        if fault:
            self._latched |= fault == FOLLOWING or (fault > MISTIMED and self.command != STOP)
            self.error = fault
        elif not self._latched and not (self.error in OF_COMMANDS and (row["bExecute"] or row["bVelocity"])):
            self.error = 0
        return fault

    def _gives_up(self, cycle: int) -> bool:
        """Whether the block does, where it may: the axes have stood for so long though they are to move."""
        facts, begin = self._facts, cycle - self._inputs.patience
        to_move = self.command == POSITION or (self.command == VELOCITY and any(self._goal))
        if facts is None or facts.errors[cycle] != NO_MOTION or not to_move or begin < 0:
            return False
        return bool(facts.stands[begin:cycle].all()) and min(self._tops) > 0.0

    def _strays(self, row: Mapping[str, float]) -> bool:
        """Whether an axis is farther from its setpoint than its limit allows."""
        pairs = zip(self._of(row, "fFollowingLimit"), self._of(row, "fActPosition"), strict=True)
        return any(limit > 0.0 and not abs(apart) <= limit for limit, apart in pairs)

    def _take_stick(self, row: Mapping[str, float], rises: bool, done: bool) -> None:
        speeds = self._of(row, "fVelocityCommand")
        if self.error == REFUSED or not self._velocity:
            self.error = 0
        if not all(abs(speed) <= NUMBERS for speed in speeds):
            self.error = REFUSED
        if rises:
            self.error = CONTRADICTORY
        self._neutral = (self._neutral or not any(speeds)) and not self.error
        if self.command == POSITION or not self._neutral:
            self._abort(done)
        self.command, self._goal = (VELOCITY, speeds) if self._neutral else (STOP, ())

    def _take_target(self, row: Mapping[str, float], done: bool, cycle: int) -> None:
        targets = self._of(row, "fTarget")
        self.error = 0
        for k, (target, own) in enumerate(zip(targets, self._inputs.limits, strict=True)):
            if not own.targets[0] <= target <= own.targets[1]:
                self.error = REFUSED
            if self._is_closed(k, target, row, cycle):
                self.error = BLOCKED
        self.aborted = ABORTED_POSITION if self.error else 0
        if self.error:
            self.command = STOP
        elif self.command != POSITION or targets != self._goal:
            if self.command == POSITION and not done:
                self.aborted = REPLACED
            self.command, self._goal = POSITION, targets

    def _closed(self, row: Mapping[str, float], axis: int) -> list[Interval]:
        """Blocked intervals of an axis."""
        low, high = (self._names(name)[axis] for name in ("aBlockedLow", "aBlockedHigh"))
        if f"{low}[0]" not in row:
            return []
        ends = [(row[f"{low}[{k}]"], row[f"{high}[{k}]"]) for k in range(ZONES)]
        return [(begin, end) for begin, end in ends if begin < end]

    def _is_closed(self, axis: int, target: float, row: Mapping[str, float], cycle: int) -> bool:
        """Whether a target lies within or behind a blocked interval."""
        margin, facts = self._inputs.limits[axis].margin, self._facts
        for low, high in self._closed(row, axis):
            beyond, before = target > low - margin, target < high + margin
            if beyond and before:
                return True
            if facts is None:
                continue
            lowest, highest = facts.low[axis, cycle - 1], facts.high[axis, cycle - 1]
            if (beyond and highest <= low + ROUNDING) or (before and lowest >= high - ROUNDING):
                touches = min(abs(highest - low), abs(lowest - high)) <= ROUNDING
                return not touches or facts.errors[cycle] == BLOCKED  # else it is reported a cycle later
        return False

    def _is_in_the_way(self, cycle: int, row: Mapping[str, float]) -> bool:
        """Whether one is that was set after the first cycle; the block tells when it is."""
        fences = [self._closed(row, axis) for axis in range(len(self._inputs.axes))]
        facts, self._fenced = self._facts, self._fenced or bool(cycle and fences != self._fences)
        self._fences = fences
        if facts is None or not any(fences) or facts.errors[cycle] != BLOCKED:
            self._in_the_way = False
            return False
        starts = facts.errors[cycle - 1] != BLOCKED and not (row["bExecute"] and not self._execute)
        is_cause = any(
            self._leads_into(facts, k, cycle - 1, fence) for k, own in enumerate(fences) for fence in own
        )
        self._in_the_way |= starts and is_cause and (self._fenced or cycle == self._edge + 1)
        return self._in_the_way

    def _is_braked(self, cycle: int, row: Mapping[str, float]) -> bool:
        """Whether axes are since the cycle before: an interval came nearer than the stated ends of a stop."""
        facts, last = self._facts, cycle - 1
        if facts is None or not cycle:
            return False
        closed = [(k, one) for k in range(len(self._inputs.axes)) for one in self._closed(row, k)]
        nearer = self._nearer or any(facts.led_into(k, cycle, one) for k, one in closed)
        self._nearer = nearer and not facts.stands[last]
        return self._nearer and bool(facts.withdrawn[last] and not facts.withdrawn[max(last - 1, 0)])

    def _leads_into(self, facts: Facts, axis: int, cycle: int, fence: Interval) -> bool:
        """Whether the goal of an axis lies within or behind an interval, or a stop would lead there."""
        (low, high), place = fence, facts.position[axis, cycle]
        lowest, highest = facts.low[axis, cycle], facts.high[axis, cycle]
        if facts.led_into(axis, cycle + 1, fence):
            return True
        goal = self._goal[axis] if self._kind == POSITION else place  # from within it may be on its way out
        ahead = goal > low and min(place, highest) <= low + ROUNDING
        behind = goal < high and max(place, lowest) >= high - ROUNDING
        return bool(ahead or behind)
