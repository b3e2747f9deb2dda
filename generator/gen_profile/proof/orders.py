"""What a planner block is told, from its inputs alone: which command holds from which cycle to which."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf

import attrs

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis

POSITION, VELOCITY, STOP, QUICK_STOP = "position", "velocity", "stop", "quick-stop"
FOLLOWING = 7  # error
FOLLOWED = ("fFollowingLimit", "fActPosition")
ROOM = 100.0  # m (or rad) beyond the targets, where no setpoint is


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
    refused : int
        Error for which it is a stop.
    denied : bool
        Whether it begins with a rising edge of bExecute that cannot be obeyed.
    edge : int
        Cycle in which the command came; before `begin` where but the velocity limits have changed since.
    """

    begin: int
    end: int
    kind: str
    values: tuple[float, ...]
    tops: tuple[float, ...]
    edge: int
    refused: int = 0
    denied: bool = False


@attrs.frozen(kw_only=True)
class Ends:
    """Between which a block may move an axis, in its unit and s; `quick`: deceleration and jerk."""

    velocity: float
    acceleration: float
    jerk: float
    targets: tuple[float, float]
    quick: tuple[float, float] = (inf, inf)


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
    """

    names: Sequence[str]
    axes: Sequence[BlockAxis]
    limits: Sequence[Ends]
    live: Mapping[str, tuple[float, float]] = attrs.field(factory=dict)
    held: int = 0
    cycle: float = inf


def orders(begins: Sequence[int], rows: Array, inputs: Inputs, last: int) -> tuple[TimedOrder, ...]:
    """Read rows of inputs as the block's header tells.

    Parameters
    ----------
    begins : (rows,) sequence of int
        From which cycle each row holds.
    rows : (rows, inputs) array
    inputs : Inputs
    last : int
        Cycle after the last one.
    """
    found = list[TimedOrder]()
    for order in sorted(_changes(begins, rows, inputs), key=lambda order: order.begin):
        if found and found[-1].begin == order.begin:
            found.pop()
        if not found or not _same(order, found[-1]):
            found.append(order)
    ends = [*(order.begin for order in found[1:]), last]
    return tuple(attrs.evolve(order, end=end) for order, end in zip(found, ends, strict=True))


def _same(order: TimedOrder, before: TimedOrder) -> bool:
    """Whether nothing new is told; stops know no velocity limit."""
    again = (order.kind, order.values, order.refused) == (before.kind, before.values, before.refused)
    return again and not order.denied and (order.kind in (STOP, QUICK_STOP) or order.tops == before.tops)


def _changes(begins: Sequence[int], rows: Array, inputs: Inputs) -> Iterator[TimedOrder]:
    """Give an order for every row, and one where wrong values have lasted too long."""
    place = {name: number for number, name in enumerate(inputs.names)}

    def of(name: str) -> list[int]:
        return [place[axis.of(name)] for axis in inputs.axes]

    targets, sticks, slow = of("fTarget"), of("fVelocityCommand"), of("fVelocityLimit")
    reset = place.get("bReset")
    kind, values, execute, edge, since, latched = STOP, tuple[float, ...](), False, 0, -1, 0
    neutral = True  # the stick, since an error stopped the axis
    full = tops = tuple(own.velocity for own in inputs.limits)
    for begin, end, row in zip(begins, [*begins[1:], begins[-1]], rows.tolist(), strict=True):
        given, wrong = [row[number] for number in slow], _wrong(row, place, slow, inputs.live)
        since = -1 if not wrong else begin if since < 0 else since
        if reset is None or row[reset]:
            latched = 0
        if _strays(row, place, inputs):
            latched = FOLLOWING
        if not wrong:
            tops = tuple(
                min(row[place["rOverride"]] * most, limit or most)
                for most, limit in zip(full, given, strict=True)
            )
        at_rest = not row[place["bVelocity"]] or not any(row[number] for number in sticks)
        was, rises = (kind, values), bool(row[place["bExecute"]]) and not execute
        execute, refused = bool(row[place["bExecute"]]), latched or _mistimed(row, place, inputs)
        neutral = not refused and (neutral or at_rest)
        denied = rises and bool(refused or row[place["bStop"]] or row[place["bQuickStop"]])
        if row[place["bQuickStop"]] or latched == FOLLOWING:
            kind, values = QUICK_STOP, ()
        elif refused or row[place["bStop"]] or not row[place["bEnable"]]:
            kind, values = STOP, ()
        elif row[place["bVelocity"]] and neutral:
            kind, values = VELOCITY, tuple(row[number] for number in sticks)
        elif rises:
            kind, values = POSITION, tuple(row[number] for number in targets)
            within = zip(values, (own.targets for own in inputs.limits), strict=True)
            if not all(low <= value <= high for value, (low, high) in within):
                kind, values, refused = STOP, (), 3
        elif kind in (VELOCITY, QUICK_STOP):
            kind, values = STOP, ()
        if was != (kind, values):
            edge = begin
        yield TimedOrder(
            begin=begin,
            end=begin,
            kind=kind,
            values=values,
            tops=tops,
            edge=edge,
            refused=refused,
            denied=denied,
        )
        if wrong and not latched and end > since + inputs.held:
            kind, values, latched, edge, neutral = STOP, (), wrong, since + inputs.held, False
            yield TimedOrder(
                begin=edge, end=edge, kind=kind, values=values, tops=tops, edge=edge, refused=wrong
            )


def _strays(row: Sequence[float], place: Mapping[str, int], inputs: Inputs) -> bool:
    """Whether an axis is farther from wherever its setpoint may be than its limit allows."""
    for axis, own in zip(inputs.axes, inputs.limits, strict=True):
        most, now = (row[place[name]] if (name := axis.of(of)) in place else 0.0 for of in FOLLOWED)
        low, high = own.targets
        if most > 0.0 and not low - most - ROOM <= now <= high + most + ROOM:
            return True
    return False


def _mistimed(row: Sequence[float], place: Mapping[str, int], inputs: Inputs) -> int:
    """Give the error of a task that has another cycle time; 0 for none."""
    cycle = row[place["fCycleTime"]] if "fCycleTime" in place else inputs.cycle
    return int(inputs.cycle < inf and not abs(cycle - inputs.cycle) <= 1e-6 * inputs.cycle)


def _wrong(
    row: Sequence[float],
    place: Mapping[str, int],
    slow: Sequence[int],
    live: Mapping[str, tuple[float, float]],
) -> int:
    """Give the error of values that cannot be, if they last; 0 for none."""
    if not all(low <= row[place[f"f{name}"]] <= high for name, (low, high) in live.items()):
        return 2
    good = 0.0 <= row[place["rOverride"]] <= 1.0 and all(row[number] >= 0.0 for number in slow)
    return 0 if good else 5
