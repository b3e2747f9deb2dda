"""Whether a planner block did what was commanded, in time, and whether what it reported was true."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from math import inf

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.proof import statements
from gen_profile.proof.followed import (
    AHEAD,
    ENABLED,
    EXACT,
    FROM_REST,
    IN_VELOCITY,
    ON_AVERAGE,
    ON_WAY,
    RUN_OUT,
    TO_SLOW,
    TO_STICK,
    TO_STOP,
    TO_TURN,
    WAY,
    Allowance,
    Followed,
    IssuedMotion,
    arriving,
    calmed,
    greatest,
    reaching,
    runs_of,
    slowing,
)
from gen_profile.proof.orders import DISABLED, POSITION, QUICK_STOP, STOP, VELOCITY, Flags, TimedOrder

MORE = 0.1  # of the greatest velocity, by which a plan may exceed a slow stick after its first pulses (0.05)
BACK = 0.03  # likewise, at which an axis may go back (0.013)
LATER = {kind: f"{kind}, on average" for kind in ON_AVERAGE}  # what is measured but not judged by one
STILL = 1e-6  # m, from a target that an axis need not leave for

WORDS = {
    POSITION: "a target is reached later than allowed by {over:.3g} s",
    VELOCITY: "a stick's velocity is reached later than allowed by {over:.3g} s",
    STOP: "a stop ends later than allowed by {over:.3g} s",
    "left": "a target is left again by {needed:.3g} m",
    "unasked": "an axis moves that was not commanded to by {needed:.3g} m/s",
    "back": "an axis goes back on its way from rest by {needed:.3g} m/s",
    "beyond": "a velocity is above the stick's by {over:.3g} m/s",
    "against": "an axis moves against its command longer than allowed by {over:.3g} s",
    "idle": "the axis stands though it is commanded to move, longer than allowed by {over:.3g} s",
    "given up": "the block gives a command up (error 9), as any motion might leave more sway than allowed",
    "reaction": "a command is obeyed later than stated by {over:.3g} s",
    "ends": "a stop leaves its stated ends by {over:.3g} m",
    "loose": "the stated ends of a stop are wider than a stop can be by {over:.3g} m",
    "outside": "an axis leaves the range of its targets by {needed:.3g} m",
    "fast": "a velocity is above override or velocity limit by {over:.3g} m/s",
    "done": "bDone is set away from the target or before the axis stands",
    "not done": "bDone is set later than the axis stands at its target by {needed:.3g} s",
    "busy": "bBusy is not set while the axis moves",
    "not busy": "bBusy is reset later than the motion ends by {needed:.3g} s",
    "vanished": "none of bBusy, bDone, bCommandAborted and bError tells of a command",
    "in velocity": "bInVelocity is set without the velocity of the command",
    "not in velocity": "bInVelocity is not set at the velocity of the command",
    "aborted": "bCommandAborted does not tell what became of the command",
    "error": "bError and nErrorId contradict each other",
    "wrong error": "nErrorId does not tell the error that there is, or one without a cause",
    "disabled": "bEnabled is not what bEnable asks for",
    "blocked": "the axis or the stated end of a stop lies within a blocked interval by {needed:.3g} m",
    "no way": "a target is kept behind a blocked interval",
    "zone": "nZone is not the number of the blocked interval",
    "taken over": "a setpoint is not where the axis is taken over by {needed:.3g} m",
    QUICK_STOP: "a quick stop ends later than allowed by {over:.3g} s",
    "jump": "a position is not the integral of the velocity in a quick stop by {needed:.3g} m",
    "distance": "fDistanceToGo is wrong by {needed:.3g} m",
    "time": "fTimeToGo is wrong by {needed:.3g} s",
    "stop distance": "fStopDistance is not the greater distance to the stated ends by {needed:.3g} m",
    "swings": "a motion leaves the machine as given swinging by {needed:.3g} m",
    "sway left": "fSwayLeft is wrong by {needed:.3g} m",
    "understated": "errors leave more than fSwayLeft states by {needed:.3g} m",
    "event": "the events that are kept are not those that happened",
    "promise": "bPromise and nPromise contradict each other",
    "lost": "nPromise tells a reason that is none",
    "kept": "bPromise is set though it cannot be known",
}
LATE = POSITION, VELOCITY, STOP, "idle", "reaction"  # of these: what a plan that takes many cycles makes


def faults(measurements: Iterable[Allowance], cycle: float) -> Iterator[str]:
    """Say what is wrong, each in words that end a sentence; each kind once, where it is worst."""
    worst: dict[str, Allowance] = {}
    for met in measurements:
        if not met.needed <= met.allowed:
            known = worst.get(met.what)
            if known is None or met.needed - met.allowed > known.needed - known.allowed:
                worst[met.what] = met
    for what, met in worst.items():
        words = WORDS[what].format(needed=met.needed, over=met.needed - met.allowed)
        yield f"{words}, at {met.cycle * cycle:.2f} s"


def measured(followed: Followed, reactions: Mapping[int, int | None]) -> Iterator[Allowance]:
    """Measure all that is judged.

    Parameters
    ----------
    followed : Followed
    reactions : mapping of int to int or None
        Of some orders' beginnings, how many cycles later the first setpoint came that would not have come
        without the order; None for none at all.
    """
    motion = IssuedMotion.of(followed)
    for judge in (
        _arrivals,
        _directions,
        _velocity_limits,
        _sticks,
        _quick_stops,
        statements.truths,
        statements.velocities,
        statements.stops,
        statements.numbers,
        statements.promises,
        statements.remains,
        statements.events,
        statements.blocked,
        statements.slowed,
        statements.taken_over,
    ):
        yield from judge(followed, motion)
    yield from _reactions(followed, motion, reactions)


def _arrivals(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge targets, velocities and stops at their latest times, of the orders that hold so long."""
    for order in followed.orders:
        begin, end = order.begin, order.end
        if (end - begin) * followed.cycle < FROM_REST * followed.period or followed.gives_up(end):
            continue  # it was replaced before, or that is a fault of its own
        place, before = motion.position[:, begin], motion.velocity[:, begin]
        own, since = slice(begin, end), begin
        match order.kind:
            case "position":
                if not min(order.tops) > 0.0:
                    continue
                allowed = arriving(followed, place, before, order)
                there = (motion.away[own] <= EXACT) & motion.stands[own]
            case "velocity":
                tops = [(1.0 - followed.reserve) * top for top in order.tops]
                wanted = [min(max(w, -top), top) for w, top in zip(order.values, tops, strict=True)]
                allowed = reaching(followed, before, wanted)
                reached = [_reached(followed, motion, k, w, own) for k, w in enumerate(wanted)]
                first, since = max(reached, key=lambda one: one[0] - one[1])
                there = np.arange(begin, end) >= first
            case "stop":
                allowed = slowing(followed, before, TO_STOP)
                there = motion.stands[own] | _damped_at_rest(followed, motion)[own]
            case _:
                continue
        latest = since + followed.after(allowed)
        first = begin + int(np.argmax(there)) if there.any() else end
        if order.kind == POSITION:  # it counts from when the way was last damped
            until = min(first, latest + followed.after(followed.settle))
            since += int(np.flatnonzero(followed.sensed("bDamping")[begin:until]).max(initial=0))
        lasts = (first - since) * followed.cycle
        if first < end or end > latest:
            yield Allowance(order.kind, begin, lasts, allowed)
        if first == end:
            continue
        yield from _lateness(followed, order, lasts - allowed, before)
        if order.kind == POSITION:
            yield from _left(followed, motion, (first, end), allowed)


def _damped_at_rest(followed: Followed, motion: IssuedMotion) -> Flags:
    """Tell when a load is damped since its axes stood."""
    at_rest = np.zeros(followed.cycles, dtype=bool)
    for begin, end in runs_of(followed.sensed("bDamping")):
        at_rest[begin:end] = motion.stands[max(0, begin - 1)]
    return at_rest


def _lateness(followed: Followed, order: TimedOrder, late: float, before: Array) -> Iterator[Allowance]:
    """Measure by how many periods more than its limits take a command is carried out."""
    kind = WAY if order.kind == POSITION and before.any() else order.kind
    if followed.reserve or (kind == STOP and not before.any()):
        return
    late += followed.reaction * (kind == POSITION)
    allowed = {POSITION: FROM_REST, WAY: ON_WAY, VELOCITY: TO_STICK, STOP: TO_STOP}[kind]
    yield Allowance(LATER[kind], order.begin, late / followed.period + allowed, inf)


def _left(
    followed: Followed, motion: IssuedMotion, cycles: tuple[int, int], arriving_again: float
) -> Iterator[Allowance]:
    """Judge that a target is left but to damp what was measured, and then reached again."""
    first, last = cycles
    damps, away = followed.sensed("bDamping"), motion.away[first:last]
    for begin, end in runs_of(away > max(EXACT, followed.wander)):
        damped = np.flatnonzero(damps[first + begin : first + end])
        if damped.size and damped[0] <= 1:
            returns = (end - begin - int(damped[-1])) * followed.cycle
            yield Allowance(POSITION, first + begin, returns, arriving_again)
        else:
            yield Allowance("left", first + begin, float(away[begin:end].max()), EXACT)


def _reached(
    followed: Followed, motion: IssuedMotion, axis: int, wanted: float, own: slice
) -> tuple[int, int]:
    """Tell from when an axis has a velocity, and until when its way's end or a slow interval hindered it."""
    limits, speed = followed.limits[axis], abs(wanted)
    position, velocity = motion.position[axis, own], motion.velocity[axis, own]
    reached = np.abs(velocity - wanted) <= (IN_VELOCITY + followed.reserve) * limits.velocity
    first = int(np.argmax(reached)) if reached.any() else len(reached)
    near = speed * (speed / limits.acceleration + limits.acceleration / limits.jerk + AHEAD * followed.period)
    hindered = (speed > 0.0) & (followed.room(axis, position, np.array(wanted)) <= near)
    for zone in followed.zones:
        if zone.axis == axis and 0.0 < zone.limit < speed:
            hindered |= np.maximum(zone.low - position, position - zone.high) <= near
    return own.start + first, own.start + int(np.flatnonzero(hindered[:first]).max(initial=0))


def _directions(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge that axes go never the wrong way, nor at rest, for longer than it takes to turn round."""
    wants, held = np.zeros((2, followed.cycles), dtype=bool)
    for order in followed.orders:
        held[order.begin : order.end] = order.kind == DISABLED or not min(order.tops) > 0.0
    near = max(STILL, followed.wander)
    for k, (velocity, position, way, limits) in enumerate(
        zip(motion.velocity, motion.position, motion.way, followed.limits, strict=True)
    ):
        slack = (EXACT + 1.5 * followed.reserve) * limits.velocity
        room = followed.room(k, position, way)
        there = np.where(
            motion.goes, np.abs(way) > near, room * (way != 0.0) > 0.1 * followed.period * np.abs(way)
        )
        wants |= there & ~held
        for side in (-1.0, 1.0):  # one command after the other may be of the other side, sooner than it turns
            against = (side * way > 0.0) & (side * velocity < -slack) & (there | ~motion.goes) & ~held
            for begin, end in runs_of(against):
                allowed = followed.reaction + slowing(followed, motion.velocity[:, begin], TO_TURN)
                yield Allowance("against", begin, (end - begin) * followed.cycle, allowed)
    for begin, end in runs_of(wants & motion.stands):
        allowed = followed.reaction + ENABLED + calmed(followed) * followed.period
        if followed.gives_up(end):
            yield Allowance("given up", begin, 1.0, 0.0)
        else:
            yield Allowance("idle", begin, (end - begin) * followed.cycle, allowed)


def _velocity_limits(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge override and velocity limit from when they must be kept."""
    latest, before = 0, tuple(own.velocity for own in followed.limits)
    for order in followed.orders:
        lowered = any(now < then for now, then in zip(order.tops, before, strict=True))
        if lowered or (order.kind == POSITION and order.begin < latest):  # a new target is planned first
            takes = followed.reaction + slowing(followed, motion.velocity[:, order.begin], TO_SLOW)
            latest = order.begin + followed.after(takes)
        before = order.tops
        begin = max(order.begin, latest)
        if begin >= order.end or order.kind not in (POSITION, VELOCITY):
            continue
        for k, (top, own) in enumerate(zip(order.tops, followed.limits, strict=True)):
            if top < own.velocity:
                fastest = np.abs(motion.velocity[k, begin : order.end])
                at = int(np.argmax(fastest))
                slack = (EXACT + 1.5 * followed.reserve) * own.velocity
                yield Allowance("fast", begin + at, float(fastest[at]), top + slack)


def _sticks(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge that from rest no axis is faster than its stick or goes back, and that one left alone stays."""
    for before, order in pairwise(followed.orders):
        begin, end = order.begin, order.end
        if order.kind not in (POSITION, VELOCITY) or not motion.stands[begin - 1] or followed.reserve:
            continue
        if followed.issued["fTimeToGo"][begin - 1] > 0.0:
            continue  # a motion has just begun
        if before.kind == VELOCITY or followed.sensed("bDamping")[begin - 1 : end].any():
            continue  # its last tap still counts, or what was measured
        for k, way in enumerate(motion.way[:, begin].tolist()):
            velocity = motion.velocity[k, begin:end]
            if not way:
                yield from greatest("unasked", np.abs(velocity), 0.0, begin)
            elif order.kind == VELOCITY:
                top = abs(way) + MORE * followed.limits[k].velocity
                yield from greatest("beyond", velocity * np.sign(way), top, begin)
            elif not followed.issued["bBusy"][begin - 1]:
                back = BACK * followed.limits[k].velocity
                yield from greatest("back", -velocity * np.sign(way), back, begin)


def _quick_stops(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge quick stops: at once, on the straightest way."""
    for order in followed.orders:
        if order.kind != QUICK_STOP:
            continue
        begin, end = max(order.begin, 1), order.end
        stands = motion.stands[begin:end]
        rests = begin + int(np.argmax(stands)) if stands.any() else end
        allowed = 3.0 * followed.cycle + max(
            (abs(v) + 0.5 * a * a / jerk) / deceleration + (abs(a) + deceleration) / jerk
            for v, a, (deceleration, jerk) in zip(
                motion.velocity[:, begin - 1].tolist(),
                motion.acceleration[:, begin - 1].tolist(),
                (own.quick for own in followed.limits),
                strict=True,
            )
        )
        yield Allowance(QUICK_STOP, order.begin, min(rests - begin, (end - begin)) * followed.cycle, allowed)
        if rests == begin:
            continue
        for x, v, own in zip(motion.position, motion.velocity, followed.limits, strict=True):
            steps = np.diff(x[begin - 1 : rests]) - 0.5 * followed.cycle * (
                v[begin - 1 : rests - 1] + v[begin:rests]
            )
            jump = np.abs(steps)
            if len(jump):
                allowed = own.quick[1] * followed.cycle**3
                yield Allowance("jump", begin + int(np.argmax(jump)), float(jump.max()), EXACT + allowed)


def _reactions(
    followed: Followed, motion: IssuedMotion, reactions: Mapping[int, int | None]
) -> Iterator[Allowance]:
    """Judge setpoints that would not have come without the order, in time."""
    for order in followed.orders:
        if order.begin not in reactions:
            continue
        reacted_after, until = reactions[order.begin], order.begin + followed.after(followed.reaction)
        before = np.abs(motion.velocity[:, order.begin : until]).max(axis=1)  # what is committed goes on
        before *= motion.velocity[:, order.begin] != 0.0
        allowed = followed.reaction + calmed(followed) * followed.period
        if before.any():
            allowed = followed.reaction + slowing(followed, before, RUN_OUT)
        late = followed.after(allowed)
        if reacted_after is None or (
            reacted_after > late and _obeys_anyway(motion, order, order.begin + late)
        ):
            continue  # what came before ends or goes on as the order asks
        yield Allowance("reaction", order.begin, reacted_after * followed.cycle, allowed)


def _obeys_anyway(motion: IssuedMotion, order: TimedOrder, at: int) -> bool:
    """Whether axes go on as before, and slow down or go the right way."""
    velocity = motion.velocity[:, at]
    right = velocity == 0.0
    if order.kind != STOP:
        wanted = np.array(order.values) - (motion.position[:, at] if order.kind == POSITION else 0.0)
        right = velocity * wanted >= 0.0
    return bool((right | (velocity * motion.acceleration[:, at] < 0.0)).all())
