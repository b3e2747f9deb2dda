"""Whether a planner block did what it was told, in time, and whether what it told was true."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis
from gen_profile.proof.orders import POSITION, QUICK_STOP, STOP, VELOCITY, Ends, Order

Flags = NDArray[np.bool_]

EXACT = 1e-9  # m, by which an axis may miss its target, and a stop its stated ends
STILL = 1e-6  # m, from a target that an axis need not leave for
IN_VELOCITY = 2e-6  # share of the greatest velocity, by which one counts as reached
BARELY = 5e-7  # likewise, below which it certainly is

# Times beyond those that distance, velocity, acceleration and jerk take, in slow periods; in brackets the
# longest met in 4000 histories of six machines.
FAR = 1.1  # of the way's time at full speed
FROM_REST = 1.4
ON_WAY = 2.8
TO_STICK = 3.0
TO_STOP = 2.6
TO_SLOWER = 2.6
CALMED = 3.0  # more where live parameters change on the way
LEAST_REACTION, REACTION = 0.5, 0.6  # s, and periods: where the block states none
ENABLED = 0.5  # s, after which a block that is enabled is ready


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
    orders : sequence of Order
    issued : mapping of str to (cycles,) array
        By names of the block's outputs.
    reserve : float
        Share of the limits for calming while live parameters change, else 0.
    wander : float
        m, that calming may lead away from a target.
    """

    cycle: float
    period: float
    reaction: float
    axes: Sequence[BlockAxis]
    limits: Sequence[Ends]
    orders: Sequence[Order]
    issued: Mapping[str, Array]
    reserve: float = 0.0
    wander: float = 0.0

    def of(self, name: str) -> Array:
        """An output of all axes, (axes, cycles)."""
        return np.stack([self.issued[axis.of(name)] for axis in self.axes])

    @property
    def cycles(self) -> int:
        """How many there were."""
        return len(self.issued["bBusy"])

    def after(self, seconds: float) -> int:
        """Cycles that so much time takes at most."""
        return int(np.ceil(seconds / self.cycle - 1e-6))


@attrs.frozen
class Measured:
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


WORDS = {
    POSITION: "a target is reached later than allowed by {over:.3g} s, {at}",
    VELOCITY: "a stick's velocity is reached later than allowed by {over:.3g} s, {at}",
    STOP: "a stop ends later than allowed by {over:.3g} s, {at}",
    "left": "a target is left again by {needed:.3g} m, {at}",
    "against": "an axis moves against its command longer than allowed by {over:.3g} s, {at}",
    "idle": "the axis stands though it is told to move, longer than allowed by {over:.3g} s, {at}",
    "reaction": "a command is obeyed later than stated by {over:.3g} s, {at}",
    "ends": "a stop leaves its stated ends by {over:.3g} m, {at}",
    "loose": "the stated ends of a stop are wider than a stop can be by {over:.3g} m, {at}",
    "fast": "a velocity is above override or velocity limit by {over:.3g} m/s, {at}",
    "done": "bDone is set away from the target or before the axis stands, {at}",
    "not done": "bDone is not set where the axis stands at its target, {at}",
    "busy": "bBusy is not set while the axis moves, {at}",
    "not busy": "bBusy stays set after a stop, {at}",
    "vanished": "none of bBusy, bDone, bCommandAborted and bError tells of a command, {at}",
    "in velocity": "bInVelocity is set without the velocity of the command, {at}",
    "not in velocity": "bInVelocity is not set at the velocity of the command, {at}",
    "aborted": "bCommandAborted is set though no command was replaced, {at}",
    "not aborted": "bCommandAborted is not set though a command was replaced, {at}",
    "error": "bError and nErrorId contradict each other, {at}",
    "refused": "nErrorId does not tell why a command is refused, {at}",
    "untold": "nErrorId tells an error without a cause by {needed:.0f}, {at}",
    "disabled": "bEnabled is not set, {at}",
    "distance": "fDistanceToGo is wrong by {needed:.3g} m, {at}",
    "time": "fTimeToGo is wrong by {needed:.3g} s, {at}",
    "stop distance": "fStopDistance is not the greater distance to the stated ends by {needed:.3g} m, {at}",
    "promise": "bPromise and nPromise contradict each other, {at}",
    "lost": "nPromise tells a reason that is none, {at}",
    "kept": "bPromise is set though it cannot be known, {at}",
    "no number": "an output is no number, {at}",
}


def faults(followed: Followed, reactions: Mapping[int, int | None]) -> Iterator[str]:
    """Say what is wrong, each in words that end a sentence; each kind once, where it is worst."""
    worst: dict[str, Measured] = {}
    for met in measured(followed, reactions):
        if not met.needed <= met.allowed:
            known = worst.get(met.what)
            if known is None or met.needed - met.allowed > known.needed - known.allowed:
                worst[met.what] = met
    for what, met in worst.items():
        at = f"at {met.cycle * followed.cycle:.2f} s"
        yield WORDS[what].format(needed=met.needed, allowed=met.allowed, over=met.needed - met.allowed, at=at)


def measured(followed: Followed, reactions: Mapping[int, int | None]) -> Iterator[Measured]:
    """Measure all that is judged.

    Parameters
    ----------
    followed : Followed
    reactions : mapping of int to int or None
        Of some orders' beginnings, how many cycles later the first setpoint came that would not have come
        without the order; None for none at all.
    """
    motion = Motion.of(followed)
    if not np.isfinite(motion.position.sum() + motion.velocity.sum() + motion.acceleration.sum()):
        yield Measured("no number", 0, 1.0, 0.0)
        return
    for judge in (_arrivals, _directions, _velocity_limits, _stops, _states, _numbers, _promises):
        yield from judge(followed, motion)
    yield from _reactions(followed, motion, reactions)


@attrs.frozen(kw_only=True)
class Motion:
    """Setpoints, each (axes, cycles), and since when all axes have stood in each cycle."""

    position: Array
    velocity: Array
    acceleration: Array
    stands: Flags

    @classmethod
    def of(cls, followed: Followed) -> Motion:
        """Take them from what was issued."""
        velocity, acceleration = followed.of("fVelocity"), followed.of("fAcceleration")
        stands = ~(velocity.any(axis=0) | acceleration.any(axis=0))
        return cls(position=followed.of("fPosition"), velocity=velocity, acceleration=acceleration, stands=stands)


# Times


def slowing(followed: Followed, before: Array, periods: float) -> float:
    """Time in s in which axes stop from some velocities, (axes,)."""
    return max(
        abs(v) / own.acceleration + own.acceleration / own.jerk for v, own in zip(before, followed.limits, strict=True)
    ) + (periods + _calmed(followed)) * followed.period


def reaching(followed: Followed, before: Array, wanted: Sequence[float]) -> float:
    """Time in s in which axes come from some velocities to others, each (axes,)."""
    return max(
        abs(v - w) / own.acceleration + own.acceleration / own.jerk
        for v, w, own in zip(before, wanted, followed.limits, strict=True)
    ) + (TO_STICK + _calmed(followed)) * followed.period


def arriving(followed: Followed, place: Array, before: Array, order: Order) -> float:
    """Time in s in which axes come from some places and velocities to an order's targets, each (axes,)."""
    moves = bool(before.any())
    periods = (ON_WAY if moves else FROM_REST) + _calmed(followed)
    slowest = 0.0
    for x, v, target, top, own in zip(place, before, order.values, order.tops, followed.limits, strict=True):
        top *= 1.0 - followed.reserve
        slowest = max(slowest, FAR * abs(target - x) / top + top / own.acceleration + abs(v) / own.acceleration + own.acceleration / own.jerk)
    return slowest + periods * followed.period


def _calmed(followed: Followed) -> float:
    return CALMED if followed.reserve else 0.0


# Judges


def _arrivals(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """Targets, velocities and stops, at their latest times, of the orders that hold so long."""
    for order in followed.orders:
        begin, end = order.begin, order.end
        place, before = motion.position[:, begin], motion.velocity[:, begin]
        own = slice(begin, end)
        match order.kind:
            case "position":
                if not min(order.tops) > 0.0:
                    continue
                allowed = arriving(followed, place, before, order)
                target = np.array(order.values)[:, None]
                away = np.abs(motion.position[:, own] - target).max(axis=0)
                there = (away <= EXACT) & motion.stands[own]
            case "velocity":
                wanted = [min(max(w, -top), top) for w, top in zip(order.values, order.tops, strict=True)]
                wanted = [w * (1.0 - followed.reserve) if abs(w) > (1.0 - followed.reserve) * l.velocity else w for w, l in zip(wanted, followed.limits, strict=True)]
                allowed = reaching(followed, before, wanted)
                there = np.ones(end - begin, dtype=bool)
                for k, w in enumerate(wanted):
                    there &= _near(followed, motion, k, w, own)
            case _:
                if order.kind == QUICK_STOP:
                    continue
                allowed = slowing(followed, before, TO_STOP)
                there = motion.stands[own]
        latest = begin + followed.after(allowed)
        first = begin + int(np.argmax(there)) if there.any() else end
        if first < end:
            yield Measured(order.kind, begin, (first - begin) * followed.cycle, allowed)
        elif end > latest:
            yield Measured(order.kind, begin, (end - begin) * followed.cycle, allowed)
        if first < end and order.kind == POSITION:
            yield Measured("left", first, float(away[first - begin :].max()), max(EXACT, followed.wander))


def _near(followed: Followed, motion: Motion, axis: int, wanted: float, own: slice) -> Flags:
    """Whether an axis has a velocity, or is at the end of its way."""
    limits = followed.limits[axis]
    reached = np.abs(motion.velocity[axis, own] - wanted) <= IN_VELOCITY * limits.velocity + followed.reserve * limits.velocity
    low, high = limits.targets
    if not wanted or reached[-1]:
        return reached
    room = high - motion.position[axis, own] if wanted > 0.0 else motion.position[axis, own] - low
    speed = abs(wanted)
    return reached | (room <= speed * (speed / limits.acceleration + limits.acceleration / limits.jerk + TO_STICK * followed.period))


def _directions(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """Never the wrong way, nor at rest, for longer than it takes to turn round."""
    against, idle = np.zeros((2, followed.cycles), dtype=bool)
    for order in followed.orders:
        if order.kind not in (POSITION, VELOCITY) or not min(order.tops) > 0.0:
            continue
        own = slice(order.begin, order.end)
        wants = np.zeros(order.end - order.begin, dtype=bool)
        for k, (value, limits) in enumerate(zip(order.values, followed.limits, strict=True)):
            velocity, slack = motion.velocity[k, own], (EXACT + 1.5 * followed.reserve) * limits.velocity
            if order.kind == POSITION:
                way = value - motion.position[k, own]
                against[own] |= (velocity * np.sign(way) < -slack) & (np.abs(way) > max(STILL, followed.wander))
                wants |= np.abs(way) > max(STILL, followed.wander)
            elif value:
                against[own] |= velocity * np.sign(value) < -slack
                low, high = limits.targets
                room = high - motion.position[k, own] if value > 0.0 else motion.position[k, own] - low
                wants |= room > 0.1 * abs(value) * followed.period
        idle[own] = wants & motion.stands[own]
    for begin, end in _runs(against):
        allowed = followed.reaction + slowing(followed, motion.velocity[:, begin], TO_STOP)
        yield Measured("against", begin, (end - begin) * followed.cycle, allowed)
    for begin, end in _runs(idle):
        ready = ENABLED if begin < followed.after(ENABLED) else 0.0
        yield Measured("idle", begin, (end - begin) * followed.cycle, followed.reaction + ready + _calmed(followed) * followed.period)


def _runs(flags: Flags) -> list[tuple[int, int]]:
    """Find where flags are set, as pairs of first and behind last."""
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _velocity_limits(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """Override and velocity limit, from when they must be kept."""
    latest, before = 0, tuple(own.velocity for own in followed.limits)
    for order in followed.orders:
        if any(now < then for now, then in zip(order.tops, before, strict=True)):
            takes = followed.reaction + slowing(followed, motion.velocity[:, order.begin], TO_SLOWER)
            latest = order.begin + followed.after(takes)
        before = order.tops
        begin = max(order.begin, latest)
        if begin >= order.end or order.kind in (STOP, QUICK_STOP):
            continue
        for k, (top, own) in enumerate(zip(order.tops, followed.limits, strict=True)):
            if top < own.velocity:
                fastest = np.abs(motion.velocity[k, begin : order.end])
                at = int(np.argmax(fastest))
                slack = (EXACT + 1.5 * followed.reserve) * own.velocity
                yield Measured("fast", begin + at, float(fastest[at]), top + slack)


def _stops(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """Stops within the ends that were stated when they came."""
    stated = f"fStopLow{followed.axes[0].suffix}" in followed.issued
    targets = list[tuple[float, ...]]()
    for order in followed.orders:
        if order.kind == POSITION:
            targets.append(order.values)
        if order.kind != STOP:
            continue
        known = np.abs(np.array([*targets, motion.position[:, order.begin]]) - motion.position[:, order.begin]).max(axis=0)
        begin, own = order.begin, slice(order.begin, order.end)
        takes = followed.reaction + slowing(followed, motion.velocity[:, begin], TO_STOP)
        for k, axis in enumerate(followed.axes):
            place = motion.position[k, own]
            if stated:
                low, high = (float(followed.issued[axis.of(name)][begin]) for name in ("fStopLow", "fStopHigh"))
            else:
                distance = float(followed.issued[axis.of("fStopDistance")][begin])
                low, high = place[0] - distance, place[0] + distance
            yield Measured("ends", begin, max(low - place.min(), place.max() - high), EXACT)
            leads = known[k] + followed.limits[k].velocity * takes  # a stop that is not planned yet may end there
            yield Measured("loose", begin, max(place[0] - low, high - place[0]), leads)


def _states(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """The outputs that are truth values."""
    done, busy, aborted, error, enabled = (
        followed.issued[name] != 0.0 for name in ("bDone", "bBusy", "bCommandAborted", "bError", "bEnabled")
    )
    yield from _never("busy", ~(motion.stands | busy))
    yield from _never("error", error != (followed.issued["nErrorId"] != 0.0))
    yield from _never("disabled", ~enabled)
    yield from _never("done", done & ~motion.stands)
    yield from _never("done", done & busy)
    yield from _velocities(followed, motion)
    told = done | busy | aborted | error
    wrong = np.zeros(followed.cycles, dtype=bool)
    may_be_aborted = np.zeros(followed.cycles, dtype=bool)
    alone, before = np.zeros(followed.cycles, dtype=bool), None
    for order in followed.orders:
        own = slice(order.begin, order.end)
        if order.refused:
            wrong[own] = True
            yield Measured("refused", order.begin, float(followed.issued["nErrorId"][order.begin] != order.refused), 0.0)
        if before and before.kind == POSITION and order.edge == order.begin and not done[order.begin - 1]:
            if not (done | error)[before.begin : before.end].any():
                yield Measured("not aborted", order.begin, float(not aborted[order.begin]), 0.0)
        if before and before.kind in (POSITION, VELOCITY):
            may_be_aborted[order.begin :] = True
        if order.kind == POSITION:
            away = np.abs(motion.position[:, own] - np.array(order.values)[:, None]).max(axis=0)
            yield from _never("done", done[own] & (away > EXACT), order.begin)
            ended = (done | error)[own]
            until = order.begin + int(np.argmax(ended)) if ended.any() else order.end
            yield from _never("vanished", ~told[order.begin : until + 1][: order.end - order.begin], order.begin)
            arrives = motion.stands[own] & (away <= EXACT)
            if arrives[1:].any() and not done[own].any() and not followed.reserve:
                yield Measured("not done", order.begin + 1 + int(np.argmax(arrives[1:])), 1.0, 0.0)
        elif order.kind == STOP and not followed.reserve:
            latest = order.begin + followed.after(slowing(followed, motion.velocity[:, order.begin], TO_STOP))
            yield from _never("not busy", busy[latest : order.end] & motion.stands[latest : order.end], latest)
        if order.kind != POSITION and order.begin:  # it may last, but not begin
            yield from _never("done", done[own] & ~done[order.begin - 1 : order.end - 1], order.begin)
        before = order
    yield from _never("untold", error & ~wrong)
    yield from _never("aborted", aborted & ~may_be_aborted & ~error)


def _velocities(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """bInVelocity where the stick's velocity is issued, and nowhere else."""
    shown, expected = followed.issued["bInVelocity"] != 0.0, np.zeros(followed.cycles, dtype=bool)
    for order in followed.orders:
        if order.kind == VELOCITY:
            own = slice(order.begin, order.end)
            apart = [
                np.abs(motion.velocity[k, own] - w) / followed.limits[k].velocity for k, w in enumerate(order.values)
            ]
            most = np.max(apart, axis=0)
            expected[own] = most <= IN_VELOCITY
            yield from _never("not in velocity", (most <= BARELY) & ~shown[own], order.begin)
    yield from _never("in velocity", shown & ~expected)


def _never(what: str, flags: Flags, begin: int = 0) -> Iterator[Measured]:
    if flags.any():
        yield Measured(what, begin + int(np.argmax(flags)), 1.0, 0.0)


def _numbers(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """The outputs that are distances and times."""
    to_go = followed.of("fDistanceToGo")
    time = followed.issued["fTimeToGo"]
    for order in followed.orders:
        own = slice(order.begin, order.end)
        if order.kind == POSITION:
            done = followed.issued["bDone"][own] != 0.0
            until = order.begin + int(np.argmax(done)) if done.any() else order.end
            expected = np.array(order.values)[:, None] - motion.position[:, order.begin : until]
            if until > order.begin:
                error = np.abs(to_go[:, order.begin : until] - expected).max(axis=0)
                yield Measured("distance", order.begin + int(np.argmax(error)), float(error.max()), EXACT)
        rests = motion.stands[own]
        if rests.any() and not rests[0] and not followed.reserve:
            moving = np.flatnonzero(~rests)
            at = int(moving[-1]) + 1  # rests for good in this order
            if at < len(rests) and _is_end(motion, order, order.begin + at):
                first = max(0, at - followed.after(0.5 * followed.period))
                left = (at - np.arange(first, at)) * followed.cycle
                error = np.abs(time[order.begin + first : order.begin + at] - left)
                yield Measured("time", order.begin + first + int(np.argmax(error)), float(error.max()), 0.1 * followed.period + 2 * followed.cycle)
                yield Measured("time", order.begin + at + 1, float(np.abs(time[order.begin + at + 1 : order.end]).max(initial=0.0)), EXACT)


def _is_end(motion: Motion, order: Order, at: int) -> bool:
    """Whether an axis that stands has nowhere else to go."""
    if order.kind == POSITION:
        return bool(np.abs(motion.position[:, at] - order.values).max() <= EXACT)
    return not any(order.values)


def _promises(followed: Followed, motion: Motion) -> Iterator[Measured]:
    """The promise, and why it is dropped."""
    promise, why = followed.issued["bPromise"] != 0.0, followed.issued["nPromise"]
    yield from _never("promise", promise != (why == 0.0))
    ready = followed.after(ENABLED + followed.reaction)
    yield from _never("lost", why[ready:] > 2.0, ready)
    yield from _never("lost", why == 1.0)  # live parameters keep their stated rates, but for spikes
    braked = next((order.begin for order in followed.orders if order.kind == QUICK_STOP), followed.cycles)
    yield from _never("lost", why[: braked] == 2.0)
    if braked < followed.cycles and not motion.stands[max(0, braked - 1)]:
        yield from _never("kept", promise[braked:], braked)


def _reactions(followed: Followed, motion: Motion, reactions: Mapping[int, int | None]) -> Iterator[Measured]:
    """Setpoints that would not have come without the order, in time."""
    late = followed.after(followed.reaction)
    for order in followed.orders:
        if order.begin not in reactions:
            continue
        found = reactions[order.begin]
        if found is None or (found > late and _obeys_anyway(motion, order, order.begin + late)):
            continue  # what came before ends or goes on as the order asks
        yield Measured("reaction", order.begin, found * followed.cycle, followed.reaction)


def _obeys_anyway(motion: Motion, order: Order, at: int) -> bool:
    """Whether axes go on as before, and the right way."""
    velocity = motion.velocity[:, at]
    if order.kind == STOP:
        return False
    wanted = np.array(order.values) - (motion.position[:, at] if order.kind == POSITION else 0.0)
    return bool((velocity * wanted >= 0.0).all())
