"""What a planner block was given and issued in a history, and how long each command may take it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.proof.left_swinging import GivenModes
from gen_profile.assurance.proof.orders import (
    DISABLED,
    NO_MOTION,
    POSITION,
    QUICK_STOP,
    STOP,
    VELOCITY,
    Ends,
    Flags,
    ReceivedOrders,
    TimedOrder,
    taken_over,
)
from gen_profile.methods.quickest.axis_alone import AxisLimits, braked
from gen_profile.methods.quickest.modes import Complex
from gen_profile.methods.quickest.motion import AxisGoal, AxisState, alone
from gen_profile.motion.profile import Array
from gen_profile.planner.interface import UNPROVEN, BlockAxis

EXACT = 1e-9  # m, by which an axis may miss its target, and a stop its stated ends
# of the allowed sway, too little to be seen: stated bounds of sway and stops may be left by so much
NOTHING = 0.01
MISJUDGED = 0.1  # of the greatest velocity, which an operator takes for the stick's own, or for standing

LATENESS = 1.5  # times what is possible, that any machine may take where its spec does not say otherwise
PLANNING = 1.0  # s, beside that, as a motion has to be planned first
SLOT = 0.05  # periods: what docs/planner.md calls a slot
CALMING = 0.1  # share of the limits that docs/planner.md keeps for calming where live parameters change
BEFORE_SLOW = 3.0  # slots at full speed, in which a slow interval's limit holds, too, as docs/planner.md says
IN_VELOCITY = 1.001e-3  # share of the greatest velocity, by which one counts as reached; documented: 0.001
ENDS_WITHIN = 2  # cycles, as braking begins and ends within one
UNKNOWN = 2.0  # nPromise: it is not known how the load swings
LEAST_REACTION, REACTION = 0.5, 0.6  # s, and periods: where the block states none


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
    """Longest periods in s of the modes that a block is given, and where known, its first and last modes."""

    periods: tuple[float, ...]
    modes: GivenModes | None = None
    last_modes: GivenModes | None = None


@attrs.frozen(kw_only=True)
class Followed:
    """A history as the block saw it, and what it issued.

    Attributes
    ----------
    cycle, reaction : float
        s: of the task, and in which a new command must be obeyed, as the block states.
    periods : tuple of float
        s, of each mode, the longest where it changes.
    axes : sequence of BlockAxis
    limits : sequence of Ends
        Of the same axes.
    received : ReceivedOrders
    issued : mapping of str to (cycles,) array
        By names of the block's outputs.
    prompt : (cycles,) array of bool
        Whether stops are to be prompt.
    reserve : float
        Share of the limits for calming while live parameters change, else 0.
    wander : float
        m, that calming may lead away from a target.
    settle : float
        s, by which damping may put off an arrival.
    sway_limit, share : float
        m, for all that stated errors may leave, and for what a motion may.
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
    periods: tuple[float, ...]
    reaction: float
    axes: Sequence[BlockAxis]
    limits: Sequence[Ends]
    received: ReceivedOrders
    issued: Mapping[str, Array]
    prompt: Flags = attrs.field(factory=lambda: np.zeros(1, dtype=bool))
    reserve: float = 0.0
    wander: float = 0.0
    settle: float = 0.0
    sway_limit: float = inf
    share: float = 0.0
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
    def period(self) -> float:
        """Of the slowest swing, in s."""
        return max(self.periods)

    @property
    def settles(self) -> float:
        """A period of each mode in s: what it takes to let an axis's motion leave none, whatever the motion.

        Two half periods a mode are the length of the shaper that leaves nothing to first order of its error
        (ZVD, Singer and Seering 1990), and shaped motions keep the limits that the unshaped ones keep.
        """
        return sum(self.periods)

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

    @cached_property
    def brakings(self) -> list[int]:
        """Cycles in which axes begin to be braked: an interval came nearer than the stated ends of a stop."""
        lost = self.issued["nPromise"] == UNKNOWN
        begun = np.flatnonzero(lost[1:] & ~lost[:-1] & ~self.stands[:-1]) + 1
        nearer = [zone for zone in self.zones if came_nearer(self, zone)]
        return [at for at in begun.tolist() if any(_is_braked(self, zone, at) for zone in nearer)]

    @cached_property
    def unknown_from(self) -> int:
        """Cycle from which on it is not known how the load of the machine as given swings."""
        lost = [order.begin for order in self.orders if order.kind in (QUICK_STOP, DISABLED)]
        lost += self.brakings
        lost += np.flatnonzero(self.issued["nPromise"] == UNKNOWN)[:1].tolist()
        lost += [*self.rest_reports, *np.flatnonzero(self.retold)[:1].tolist()]
        return min(lost, default=self.cycles)

    @cached_property
    def prompt_stops(self) -> Flags:
        """Whether each axis is to stop promptly, (axes, cycles)."""
        axes = range(len(self.axes))
        stops = [
            [
                one.kind == STOP or not max(one.tops) > 0.0 or (one.kind == VELOCITY and not one.values[k])
                for k in axes
            ]
            for one in self.orders
        ]
        guided = self.by_order([one.kind not in (QUICK_STOP, DISABLED) for one in self.orders])
        return np.asarray(self.by_order(stops).T & guided & self.prompt & ~self.stands)

    @cached_property
    def stopped_from(self) -> int:
        """Cycle from which on a stop may have left the machine as given swinging.

        A prompt one; one for which errors had left less than half of the allowed sway, as it may use that; or
        one nearer to the travel's end than a stop leads that slows down evenly and leaves nothing. A stick at
        0 is a stop of its axis.
        """
        left = self.issued.get("fSwayLeft", np.zeros(self.cycles))
        stops = (
            max(one.begin - 1, 0)
            for one in self.orders
            if one.kind == STOP or (one.kind == VELOCITY and not all(one.values))
        )
        crowded = (at for at in stops if left[at] > 0.5 * self.sway_limit or self._is_near_an_end(at))
        return min(int(np.argmax(np.append(self.prompt_stops.any(axis=0), True))), next(crowded, self.cycles))

    def _is_near_an_end(self, cycle: int) -> bool:
        speeds, (low, high) = self.velocity[:, cycle], np.transpose([own.targets for own in self.limits])
        ends = self.position[:, cycle] + 0.5 * bounded(self, to_speeds(self, speeds)) * speeds
        return bool(((speeds != 0.0) & ((ends < low) | (ends > high))).any())

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

    def led_by_stick(self, slots: float = 0.0) -> Flags:
        """Tell when a stick leads an axis that has room for so many slots of its velocity, (cycles,)."""
        sticks = self.by_order([order.kind == VELOCITY and min(order.tops) > 0.0 for order in self.orders])
        led = np.zeros(self.cycles, dtype=bool)
        for k, (position, way) in enumerate(zip(self.position, self.way, strict=True)):
            room = self.room(k, position, way) - slots * SLOT * self.period * np.abs(way)
            led |= (way != 0.0) & (room > EXACT)
        return np.asarray(sticks & led & self.received.holds)

    def slow_parts(self, axis: int, begin: float, end: float, beyond: float) -> list[tuple[float, float]]:
        """Give lengths and velocity limits of slow intervals between two places, or a little beyond."""
        low, high = min(begin, end) - beyond, max(begin, end) + beyond
        return [
            (min(zone.high, high) - max(zone.low, low), zone.limit)
            for zone in self.zones
            if zone.axis == axis and zone.limit and zone.low < high and zone.high > low
        ]

    @property
    def damped(self) -> Flags:
        """Whether what sensors show is damped, of any axis, (cycles,)."""
        return self.sensed("bDamping")

    def sensed(self, name: str) -> Flags:
        """Tell when an output of a block with sensors is set, of any axis; never of one without."""
        outputs = [name, *(axis.of(name) for axis in self.axes)]
        issued = [self.issued[output] for output in outputs if output in self.issued]
        return np.any(issued, axis=0) if issued else np.zeros(self.cycles, dtype=bool)

    @property
    def lost_sensors(self) -> Flags:
        """Tell when a sensor is not used for a fault."""
        shown_faults = [axis.of("nSensorFault") for axis in self.axes]
        issued = [self.issued[name] % UNPROVEN for name in shown_faults if name in self.issued]
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


def goals(followed: Followed, order: TimedOrder) -> list[AxisGoal]:
    """Give each axis's goal of a command; a stick's velocity only as far as the limits let it."""
    usable = 1.0 - followed.reserve
    match order.kind:
        case "position":
            return [AxisGoal(place=place) for place in order.values]
        case "velocity":
            tops = [usable * top for top in order.tops]
            return [AxisGoal(speed=min(max(v, -top), top)) for v, top in zip(order.values, tops, strict=True)]
    return [AxisGoal() for _ in followed.axes]


def limits_of(followed: Followed, order: TimedOrder) -> list[AxisLimits]:
    """Give the limits that each axis may use for a command."""
    usable = 1.0 - followed.reserve
    tops = order.tops if order.kind == POSITION else [own.velocity for own in followed.limits]
    return [
        AxisLimits(
            velocity=max(usable * top, EXACT),
            acceleration=usable * own.acceleration,
            jerk=usable * own.jerk,
        )
        for top, own in zip(tops, followed.limits, strict=True)
    ]


def states(followed: Followed, cycle: int, moved: Complex | None = None) -> list[AxisState]:
    """Give each axis's state before a cycle, with what it has made of modes, (axes, machines, modes)."""
    at = max(cycle - 1, 0)
    setpoints = (followed.position, followed.velocity, followed.acceleration)
    axes = zip(*(one[:, at].tolist() for one in setpoints), strict=True)
    swings = [None] * len(followed.axes) if moved is None else moved
    return [
        AxisState(place=x, velocity=v, acceleration=a, moved=np.asarray(own))
        for (x, v, a), own in zip(axes, swings, strict=True)
    ]


def axes_alone(followed: Followed, order: TimedOrder, cycle: int) -> float:
    """Tell the least time in s in which axes without loads carry a command out, from a cycle on."""
    slowest = 0.0
    own = zip(limits_of(followed, order), states(followed, cycle), goals(followed, order), strict=True)
    for axis, (limits, state, goal) in enumerate(own):
        time = alone(limits, state, goal)
        if goal.place is not None:
            slow = slow_ways(followed, axis, state, goal.place)
            time += sum(way * max(0.0, 1.0 / limit - 1.0 / limits.velocity) for way, limit in slow)
        slowest = max(slowest, time)
    return slowest


def slow_ways(followed: Followed, axis: int, state: AxisState, place: float) -> list[tuple[float, float]]:
    """Give lengths and limits of slow intervals that an axis may pass on its way to a place."""
    limits = followed.limits[axis]
    beyond = BEFORE_SLOW * SLOT * followed.period * limits.velocity
    turns = abs(state.velocity) * bounded(followed, abs(state.velocity) / limits.acceleration)
    return followed.slow_parts(axis, state.place, place, max(beyond, turns * (state.velocity != 0.0)))


def bounded(followed: Followed, alone_time: float, motions: int = 1) -> float:
    """Tell in s what so many motions, which axes alone make in some time, need take without any sway.

    A closed form for all machines and states: nothing is as quick as the axis alone, and no motion need take
    longer than a period of each mode more.
    """
    return alone_time + motions * followed.settles


def in_time(followed: Followed, alone_time: float, motions: int = 1) -> float:
    """Tell in s what so many motions may take any block, its reaction included."""
    return followed.reaction + LATENESS * bounded(followed, alone_time, motions)


def came_nearer(followed: Followed, zone: Zone) -> bool:
    """Whether an interval was blocked where it had been stated that a stop leads."""
    before = zone.begin - 1
    if zone.limit or not 0 <= before < followed.cycles - 1:
        return False
    low, high = (followed.of(name)[zone.axis, before] for name in ("fStopLow", "fStopHigh"))
    return bool(low < zone.high - EXACT and high > zone.low + EXACT)


def _is_braked(followed: Followed, zone: Zone, cycle: int) -> bool:
    """Whether axes are braked to rest from a cycle on, which is soon after an interval came nearer."""
    until = zone.begin + followed.after(
        in_time(followed, to_speeds(followed, followed.velocity[:, zone.begin]))
    )
    if not zone.begin <= cycle < until or followed.stands[zone.begin : cycle].any():
        return False
    takes = max(time for time, _ in braking(followed, cycle))
    rests = cycle + followed.after(takes) + ENDS_WITHIN
    return bool(followed.stands[cycle : rests + 1].any()) or rests >= followed.cycles


def braking(followed: Followed, cycle: int) -> list[tuple[float, float]]:
    """Tell the time in s and the way in m in which each axis is braked from its state before a cycle on."""
    before = zip(
        followed.velocity[:, cycle - 1], followed.acceleration[:, cycle - 1], followed.limits, strict=True
    )
    return [
        braked(
            float(v),
            float(a),
            AxisLimits(velocity=own.velocity, acceleration=own.acceleration, jerk=own.jerk),
        )
        for v, a, own in before
    ]


def to_speeds(followed: Followed, before: Array, wanted: Sequence[float] | None = None) -> float:
    """Tell the least time in s in which axes come from velocities, (axes,), to others, or to rest."""
    return max(
        abs(v - w) / own.acceleration + own.acceleration / own.jerk
        for v, w, own in zip(map(float, before), wanted or [0.0] * len(before), followed.limits, strict=True)
    )
