"""What a planner block was given and issued in a history, and how long each command may take it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.proof.orders import (
    DISABLED,
    NO_MOTION,
    POSITION,
    STOP,
    VELOCITY,
    Ends,
    Flags,
    ReceivedOrders,
    TimedOrder,
    taken_over,
)
from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis
from gen_profile.planner.left_swinging import GivenModes
from gen_profile_exporters.planner.block import SLOTS_PER_PERIOD

EXACT = 1e-9  # m, by which an axis may miss its target, and a stop its stated ends

# Times beyond those that distance, velocity, acceleration and jerk take, in slow periods; in brackets the
# longest met in 6000 histories of twelve machines, but for faults of the block.
FAR = 1.1  # of the way's time at full speed
FROM_REST = 1.8  # (1.7)
ON_WAY = 4.2  # to a target: after changes of mind an axis turns to and fro (4.0)
TO_STICK = 3.4  # to its velocity, as a motion to a target is stopped first (3.2)
AHEAD = 1.5  # before an end of the way, or a slow interval, in which a stick's velocity need not be reached
MORE_AXES = 1.7  # for each further axis, as they are planned one after the other (1.5)
TO_STOP = 2.8  # (2.75)
BEFORE_SLOW = 3.0  # slots at full speed, in which a slow interval's limit holds, too
TO_SLOW = 2.2  # below a new velocity limit: a new target is planned, or a motion stopped, first (1.5)
TO_TURN = 1.9  # (1.6)
RUN_OUT = 0.7  # before a motion that ends soon anyway gives way to another (0.6)
CALMED = 3.0  # more where live parameters change on the way (2.1)
WAY = "on the way"  # a target that is given while an axis moves
ON_AVERAGE = {POSITION: 0.8, WAY: 0.9, VELOCITY: 1.2, STOP: 1.0}  # (0.72, 0.65, 1.1 of a tank, 0.92)
LEAST_REACTION, REACTION = 0.5, 0.6  # s, and periods: where the block states none
ENABLED = 2.2  # s, which a block takes more to get ready (2.1, of a damped crane at 4 ms)
IN_VELOCITY = 1.001e-3  # share of the greatest velocity, by which one counts as reached; the block: 0.001


@attrs.frozen(kw_only=True)
class Zone:
    """An interval that is blocked, or slow (`limit` above 0), in m and s, from a cycle to another."""

    axis: int
    low: float
    high: float
    limit: float
    begin: int
    end: int
    number: int = 1


@attrs.frozen
class GivenMachine:
    """Slowest period in s of the machine that a block is given, and where known, its first and last modes."""

    period: float
    modes: GivenModes | None = None
    last_modes: GivenModes | None = None


@attrs.frozen(kw_only=True)
class Followed:
    """A history as the block saw it, and what it issued.

    Attributes
    ----------
    cycle, period, reaction : float
        s: of the task, of the slowest swing, and in which a new command must be obeyed.
    axes : sequence of BlockAxis
    limits : sequence of Ends
        Of the same axes.
    received : ReceivedOrders
    issued : mapping of str to (cycles,) array
        By names of the block's outputs.
    reserve : float
        Share of the limits for calming while live parameters change, else 0.
    wander : float
        m, that calming may lead away from a target.
    settle : float
        s, by which damping may put off an arrival.
    sway_limit : float
        m, for all that stated errors may leave.
    rest_reports : sequence of int
        Cycles in which the load is seen to hang still.
    zones : sequence of Zone
    drifts, retold : (cycles,) array of bool
        Whether a live parameter is other than at first, and whether plans are for another machine.
    live_changes : sequence of (int, int)
        Cycles in which a live parameter changes for the first time, and from which the block must know of it.
    steps, speeds : (axes, cycles) array
        How far axes are from the setpoints of the cycle before, in m, and how fast they go where they are not
        guided.
    modes, last_modes : GivenModes or None
        Of the machine that the block is given, where that is known: first and, where it is another, last.
    last_known : int
        Cycle from which the block must know the last one.
    """

    cycle: float
    period: float
    reaction: float
    axes: Sequence[BlockAxis]
    limits: Sequence[Ends]
    received: ReceivedOrders
    issued: Mapping[str, Array]
    reserve: float = 0.0
    wander: float = 0.0
    settle: float = 0.0
    sway_limit: float = inf
    rest_reports: Sequence[int] = ()
    zones: Sequence[Zone] = ()
    drifts: Flags = attrs.field(factory=lambda: np.zeros(1, dtype=bool))
    retold: Flags = attrs.field(factory=lambda: np.zeros(1, dtype=bool))
    live_changes: Sequence[tuple[int, int]] = ()
    steps: Array = attrs.field(factory=lambda: np.zeros((1, 0)))
    speeds: Array = attrs.field(factory=lambda: np.zeros((1, 0)))
    modes: GivenModes | None = None
    last_modes: GivenModes | None = None
    last_known: int = 0

    @property
    def enabled(self) -> list[int]:
        """Cycles in which it is."""
        return [0, *(order.end for order in self.orders if order.kind == DISABLED)]

    @property
    def slowest(self) -> float:
        """Least velocity limit of a slow interval, in m/s."""
        return min((zone.limit for zone in self.zones if zone.limit), default=inf)

    def taken_over_at(self, cycle: int) -> list[float]:
        """Tell how fast axes are as they are taken over in a cycle, which is not the first."""
        given = self.speeds[:, cycle - 1 : cycle + 1].tolist()
        return [taken_over(last, own.velocity) for last, own in zip(given, self.limits, strict=True)]

    def moved(self, begin: int, end: int) -> float:
        """Tell how far an axis is moved while it is disabled, relative to its greatest velocity in 1/s."""
        ways = np.abs(np.nansum(self.steps[:, begin : end + 1], axis=1)).tolist()
        return max(float(way) / own.velocity for way, own in zip(ways, self.limits, strict=True))

    @property
    def orders(self) -> Sequence[TimedOrder]:
        """Of the commands that it received."""
        return self.received.orders

    def by_order(self, values: Sequence[Any]) -> NDArray[Any]:
        """Repeat a value of every order for each of its cycles, (cycles, …)."""
        return np.repeat(values, [order.end - order.begin for order in self.orders], axis=0)

    def room(self, axis: int, position: Array, way: Array) -> Array:
        """Tell how far an axis may go from positions, (cycles,), in the direction of ways, (cycles,)."""
        closed = [zone for zone in self.zones if zone.axis == axis and not zone.limit]
        low, high = self.limits[axis].targets
        ahead = np.array(sorted([*(zone.low for zone in closed if zone.low < high), high]))
        behind = np.array(sorted([low, *(zone.high for zone in closed if zone.high > low)]))
        up = ahead[np.searchsorted(ahead, position - EXACT).clip(0, len(ahead) - 1)] - position
        down = position - behind[np.searchsorted(behind, position + EXACT).clip(1) - 1]
        room: Array = np.where(way > 0.0, up, down)
        return room

    def of(self, name: str) -> Array:
        """Give an output of all axes, (axes, cycles)."""
        return np.stack([self.issued[axis.of(name)] for axis in self.axes])

    @cached_property
    def position(self) -> Array:
        """Setpoints, (axes, cycles)."""
        return self.of("fPosition")

    @cached_property
    def velocity(self) -> Array:
        """Of the setpoints, (axes, cycles)."""
        return self.of("fVelocity")

    @cached_property
    def acceleration(self) -> Array:
        """Of the setpoints, (axes, cycles)."""
        return self.of("fAcceleration")

    @cached_property
    def stands(self) -> Flags:
        """Whether all axes do, (cycles,)."""
        return standing(self.velocity, self.acceleration)

    @cached_property
    def guided(self) -> Flags:
        """Whether the block is enabled, (cycles,)."""
        return self.by_order([order.kind != DISABLED for order in self.orders])

    @cached_property
    def goes(self) -> Flags:
        """Whether a position is commanded, (cycles,)."""
        return self.by_order([order.kind == POSITION for order in self.orders])

    @cached_property
    def way(self) -> Array:
        """To that position, (axes, cycles); a stick's velocity where one is commanded, and 0 at a stop."""
        still = (0.0,) * len(self.axes)
        commanded: Array = self.by_order([order.values or still for order in self.orders]).T
        return commanded - self.position * self.goes

    @cached_property
    def away(self) -> Array:
        """Greatest distance of an axis from its position where one is commanded, (cycles,)."""
        return np.asarray(np.abs(self.way).max(axis=0) * self.goes)

    def slow_parts(self, axis: int, begin: float, end: float, beyond: float) -> list[tuple[float, float]]:
        """Give lengths and velocity limits of slow intervals between two places, or a little beyond."""
        low, high = min(begin, end) - beyond, max(begin, end) + beyond
        return [
            (min(zone.high, high) - max(zone.low, low), zone.limit)
            for zone in self.zones
            if zone.axis == axis and zone.limit and zone.low < high and zone.high > low
        ]

    def sensed(self, name: str) -> Flags:
        """Tell when an output of a block with sensors is set, of any axis; never of one without."""
        outputs = [name, *(axis.of(name) for axis in self.axes)]
        issued = [self.issued[output] for output in outputs if output in self.issued]
        return np.asarray(np.any([np.zeros(self.cycles), *issued], axis=0))

    @property
    def cycles(self) -> int:
        """How many there were."""
        return len(self.issued["bBusy"])

    def gives_up(self, cycle: int) -> bool:
        """Tell whether no motion was found for a command that ends in a cycle."""
        return cycle < self.cycles and bool(self.issued["nErrorId"][cycle] == NO_MOTION)

    def after(self, seconds: float) -> int:
        """Cycles that so much time takes at most."""
        return int(np.ceil(seconds / self.cycle - 1e-6))


@attrs.frozen
class Allowance:
    """What was needed of what is allowed: a fault where it is more.

    Attributes
    ----------
    what : str
        Of `WORDS`.
    cycle : int
    needed, allowed : float
    """

    what: str
    cycle: int
    needed: float
    allowed: float


def never(what: str, flags: Flags) -> Iterator[Allowance]:
    """Measure what must not be, in any cycle."""
    if flags.any():
        yield Allowance(what, int(np.argmax(flags)), 1.0, 0.0)


def greatest(what: str, needed: Array, allowed: float, begin: int = 0) -> Iterator[Allowance]:
    """Measure the greatest of values, (cycles,) or (axes, cycles), from the first of these cycles on."""
    most = needed if needed.ndim == 1 else needed.max(axis=0)
    at = int(np.argmax(most))
    yield Allowance(what, begin + at, float(most[at]), allowed)


def standing(velocity: Array, acceleration: Array) -> Flags:
    """Tell when all axes stand, (cycles,), by their velocities and accelerations, each (axes, cycles)."""
    return np.asarray(~((velocity != 0.0) | (acceleration != 0.0)).any(axis=0))


def runs_of(flags: Flags) -> list[tuple[int, int]]:
    """Find where flags are set, as pairs of first and behind last."""
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def slowing(followed: Followed, before: Array, periods: float) -> float:
    """Tell the time in s in which axes stop from some velocities, (axes,)."""
    slowest = max(
        abs(v) / own.acceleration + own.acceleration / own.jerk
        for v, own in zip(map(float, before), followed.limits, strict=True)
    )
    return slowest + (periods + calmed(followed)) * followed.period


def reaching(followed: Followed, before: Array, wanted: Sequence[float]) -> float:
    """Tell the time in s in which axes come from some velocities, by a stop, to others, each (axes,)."""
    slowest = max(
        (abs(v) + abs(w)) / own.acceleration + own.acceleration / own.jerk
        for v, w, own in zip(map(float, before), wanted, followed.limits, strict=True)
    )
    periods = TO_STICK + MORE_AXES * (len(followed.axes) - 1) + calmed(followed)
    return slowest + periods * followed.period


def arriving(followed: Followed, place: Array, before: Array, order: TimedOrder) -> float:
    """Tell the time in s in which axes come from places and velocities, (axes,), to an order's targets."""
    periods = (ON_WAY if before.any() else FROM_REST) + calmed(followed)
    usable, moves = 1.0 - followed.reserve, zip(place.tolist(), order.values, before.tolist(), strict=True)
    slowest = 0.0
    for k, ((begin, end, v), top, own) in enumerate(zip(moves, order.tops, followed.limits, strict=True)):
        rise = (top + abs(v)) / own.acceleration + own.acceleration / own.jerk
        slows = BEFORE_SLOW * own.velocity * followed.period / SLOTS_PER_PERIOD
        slow = followed.slow_parts(k, begin, end, max(slows, abs(v) * (rise + followed.period)))
        time = abs(end - begin) / top + sum(way * max(0.0, 1.0 / limit - 1.0 / top) for way, limit in slow)
        legs = len(slow) * (rise + FROM_REST * followed.period)
        slowest = max(slowest, FAR * time / usable + rise + legs)
    return slowest + periods * followed.period + (0.0 if before.any() else followed.reaction)


def calmed(followed: Followed) -> float:
    """Tell how many periods more it takes where live parameters change on the way."""
    return CALMED if followed.reserve else 0.0
