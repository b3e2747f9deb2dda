"""Whether a planner block did what was commanded, in time, and whether what it reported was true."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from math import inf
from pathlib import Path

import numpy as np

from gen_profile.assurance.proof import statements
from gen_profile.assurance.proof.followed import (
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
    arriving,
    calmed,
    greatest,
    reaching,
    runs_of,
    slowing,
)
from gen_profile.assurance.proof.orders import (
    DISABLED,
    POSITION,
    QUICK_STOP,
    STOP,
    VELOCITY,
    Flags,
    TimedOrder,
)
from gen_profile.motion.profile import Array

MORE = 0.1  # of the greatest velocity, by which a plan may exceed a slow stick after its first pulses (0.05)
BACK = 0.03  # likewise, at which an axis may go back (0.013)
LATER = {kind: f"{kind}, on average" for kind in ON_AVERAGE}  # what is measured but not judged by one
STILL = 1e-6  # m, from a target that an axis need not leave for

_LINES = (Path(__file__).parents[2] / "lists" / "obedience.txt").read_text("utf-8").splitlines()
WORDS = {what: words for what, _, words in (line.partition(": ") for line in _LINES)}
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


def measured(run: Followed, reactions: Mapping[int, int | None]) -> Iterator[Allowance]:
    """Measure all that is judged.

    Parameters
    ----------
    run : Followed
    reactions : mapping of int to int or None
        Of some orders' beginnings, how many cycles later the first setpoint came that would not have come
        without the order; None for none at all.
    """
    own = (_arrivals, _directions, _velocity_limits, _sticks, _quick_stops)
    for judge in (*own, *statements.JUDGES):
        yield from judge(run)
    yield from _reactions(run, reactions)


def _arrivals(run: Followed) -> Iterator[Allowance]:
    """Judge targets, velocities and stops at their latest times, of the orders that hold so long."""
    for order in run.orders:
        begin, end = order.begin, order.end
        if (end - begin) * run.cycle < FROM_REST * run.period or run.gives_up(end):
            continue  # it was replaced before, or that is a fault of its own
        place, before = run.position[:, begin], run.velocity[:, begin]
        own, since = slice(begin, end), begin
        match order.kind:
            case "position":
                if not min(order.tops) > 0.0:
                    continue
                allowed = arriving(run, place, before, order)
                there = (run.away[own] <= EXACT) & run.stands[own]
            case "velocity":
                tops = [(1.0 - run.reserve) * top for top in order.tops]
                wanted = [min(max(w, -top), top) for w, top in zip(order.values, tops, strict=True)]
                allowed = reaching(run, before, wanted)
                reached = [_reached(run, k, w, own) for k, w in enumerate(wanted)]
                first, since = max(reached, key=lambda one: one[0] - one[1])
                there = np.arange(begin, end) >= first
            case "stop":
                allowed = slowing(run, before, TO_STOP)
                there = run.stands[own] | _damped_at_rest(run)[own]
            case _:
                continue
        latest = since + run.after(allowed)
        first = begin + int(np.argmax(there)) if there.any() else end
        if order.kind == POSITION:  # it counts from when the way was last damped
            until = min(first, latest + run.after(run.settle))
            since += int(np.flatnonzero(run.sensed("bDamping")[begin:until]).max(initial=0))
        lasts = (first - since) * run.cycle
        if first < end or end > latest:
            yield Allowance(order.kind, begin, lasts, allowed)
        if first == end:
            continue
        yield from _lateness(run, order, lasts - allowed, before)
        if order.kind == POSITION:
            yield from _left(run, (first, end), allowed)


def _damped_at_rest(run: Followed) -> Flags:
    """Tell when a load is damped since its axes stood."""
    at_rest = np.zeros(run.cycles, dtype=bool)
    for begin, end in runs_of(run.sensed("bDamping")):
        at_rest[begin:end] = run.stands[max(0, begin - 1)]
    return at_rest


def _lateness(run: Followed, order: TimedOrder, late: float, before: Array) -> Iterator[Allowance]:
    """Measure by how many periods more than its limits take a command is carried out."""
    kind = WAY if order.kind == POSITION and before.any() else order.kind
    if run.reserve or (kind == STOP and not before.any()):
        return
    late += run.reaction * (kind == POSITION)
    allowed = {POSITION: FROM_REST, WAY: ON_WAY, VELOCITY: TO_STICK, STOP: TO_STOP}[kind]
    yield Allowance(LATER[kind], order.begin, late / run.period + allowed, inf)


def _left(run: Followed, cycles: tuple[int, int], arriving_again: float) -> Iterator[Allowance]:
    """Judge that a target is left but to damp what was measured, and then reached again."""
    first, last = cycles
    damps, away = run.sensed("bDamping"), run.away[first:last]
    for begin, end in runs_of(away > max(EXACT, run.wander)):
        damped = np.flatnonzero(damps[first + begin : first + end])
        if damped.size and damped[0] <= 1:
            returns = (end - begin - int(damped[-1])) * run.cycle
            yield Allowance(POSITION, first + begin, returns, arriving_again)
        else:
            yield Allowance("left", first + begin, float(away[begin:end].max()), EXACT)


def _reached(run: Followed, axis: int, wanted: float, own: slice) -> tuple[int, int]:
    """Tell from when an axis has a velocity, and until when its way's end or a slow interval hindered it."""
    limits, speed = run.limits[axis], abs(wanted)
    position, velocity = run.position[axis, own], run.velocity[axis, own]
    reached = np.abs(velocity - wanted) <= (IN_VELOCITY + run.reserve) * limits.velocity
    first = int(np.argmax(reached)) if reached.any() else len(reached)
    near = speed * (speed / limits.acceleration + limits.acceleration / limits.jerk + AHEAD * run.period)
    hindered = (speed > 0.0) & (run.room(axis, position, np.array(wanted)) <= near)
    for zone in run.zones:
        if zone.axis == axis and 0.0 < zone.limit < speed:
            hindered |= np.maximum(zone.low - position, position - zone.high) <= near
    return own.start + first, own.start + int(np.flatnonzero(hindered[:first]).max(initial=0))


def _directions(run: Followed) -> Iterator[Allowance]:
    """Judge that axes go never the wrong way, nor at rest, for longer than it takes to turn round."""
    wants = np.zeros(run.cycles, dtype=bool)
    held = run.by_order([o.kind == DISABLED or not min(o.tops) > 0.0 for o in run.orders])
    near = max(STILL, run.wander)
    for k, (velocity, position, way, limits) in enumerate(
        zip(run.velocity, run.position, run.way, run.limits, strict=True)
    ):
        slack = (EXACT + 1.5 * run.reserve) * limits.velocity
        room = run.room(k, position, way)
        there = np.where(run.goes, np.abs(way) > near, room * (way != 0.0) > 0.1 * run.period * np.abs(way))
        wants |= there & ~held
        for side in (-1.0, 1.0):  # one command after the other may be of the other side, sooner than it turns
            against = (side * way > 0.0) & (side * velocity < -slack) & (there | ~run.goes) & ~held
            for begin, end in runs_of(against):
                allowed = run.reaction + slowing(run, run.velocity[:, begin], TO_TURN)
                yield Allowance("against", begin, (end - begin) * run.cycle, allowed)
    for begin, end in runs_of(wants & run.stands):
        allowed = run.reaction + ENABLED + calmed(run) * run.period
        if run.gives_up(end):
            yield Allowance("given up", begin, 1.0, 0.0)
        else:
            yield Allowance("idle", begin, (end - begin) * run.cycle, allowed)


def _velocity_limits(run: Followed) -> Iterator[Allowance]:
    """Judge override and velocity limit from when they must be kept."""
    latest, before = 0, tuple(own.velocity for own in run.limits)
    for order in run.orders:
        lowered = any(now < then for now, then in zip(order.tops, before, strict=True))
        if lowered or (order.kind == POSITION and order.begin < latest):  # a new target is planned first
            takes = run.reaction + slowing(run, run.velocity[:, order.begin], TO_SLOW)
            latest = order.begin + run.after(takes)
        before = order.tops
        begin = max(order.begin, latest)
        if begin >= order.end or order.kind not in (POSITION, VELOCITY):
            continue
        for k, (top, own) in enumerate(zip(order.tops, run.limits, strict=True)):
            if top < own.velocity:
                fastest = np.abs(run.velocity[k, begin : order.end])
                at = int(np.argmax(fastest))
                slack = (EXACT + 1.5 * run.reserve) * own.velocity
                yield Allowance("fast", begin + at, float(fastest[at]), top + slack)


def _sticks(run: Followed) -> Iterator[Allowance]:
    """Judge that from rest no axis is faster than its stick or goes back, and that one left alone stays."""
    for before, order in pairwise(run.orders):
        begin, end = order.begin, order.end
        if order.kind not in (POSITION, VELOCITY) or not run.stands[begin - 1] or run.reserve:
            continue
        if run.issued["fTimeToGo"][begin - 1] > 0.0:
            continue  # a motion has just begun
        if before.kind == VELOCITY or run.sensed("bDamping")[begin - 1 : end].any():
            continue  # its last tap still counts, or what was measured
        for k, way in enumerate(run.way[:, begin].tolist()):
            velocity = run.velocity[k, begin:end]
            if not way:
                yield from greatest("unasked", np.abs(velocity), 0.0, begin)
            elif order.kind == VELOCITY:
                top = abs(way) + MORE * run.limits[k].velocity
                yield from greatest("beyond", velocity * np.sign(way), top, begin)
            elif not run.issued["bBusy"][begin - 1]:
                back = BACK * run.limits[k].velocity
                yield from greatest("back", -velocity * np.sign(way), back, begin)


def _quick_stops(run: Followed) -> Iterator[Allowance]:
    """Judge quick stops: at once, on the straightest way."""
    for order in run.orders:
        if order.kind != QUICK_STOP:
            continue
        begin, end = max(order.begin, 1), order.end
        stands = run.stands[begin:end]
        rests = begin + int(np.argmax(stands)) if stands.any() else end
        before = (run.velocity[:, begin - 1].tolist(), run.acceleration[:, begin - 1].tolist())
        braked = zip(*before, (own.quick for own in run.limits), strict=True)
        allowed = 3.0 * run.cycle + max(
            (abs(v) + 0.5 * a * a / jerk) / deceleration + (abs(a) + deceleration) / jerk
            for v, a, (deceleration, jerk) in braked
        )
        yield Allowance(QUICK_STOP, order.begin, min(rests - begin, (end - begin)) * run.cycle, allowed)
        if rests == begin:
            continue
        for x, v, own in zip(run.position, run.velocity, run.limits, strict=True):
            steps = np.diff(x[begin - 1 : rests]) - 0.5 * run.cycle * (
                v[begin - 1 : rests - 1] + v[begin:rests]
            )
            jump = np.abs(steps)
            if len(jump):
                allowed = own.quick[1] * run.cycle**3
                yield Allowance("jump", begin + int(np.argmax(jump)), float(jump.max()), EXACT + allowed)


def _reactions(run: Followed, reactions: Mapping[int, int | None]) -> Iterator[Allowance]:
    """Judge setpoints that would not have come without the order, in time."""
    for order in run.orders:
        if order.begin not in reactions:
            continue
        reacted_after, until = reactions[order.begin], order.begin + run.after(run.reaction)
        before = np.abs(run.velocity[:, order.begin : until]).max(axis=1)  # what is committed goes on
        before *= run.velocity[:, order.begin] != 0.0
        allowed = run.reaction + calmed(run) * run.period
        if before.any():
            allowed = run.reaction + slowing(run, before, RUN_OUT)
        if reacted_after is None:
            continue
        takes = reacted_after * run.cycle
        if takes > allowed and _obeys_anyway(run, order, order.begin + run.after(allowed)):
            continue  # what came before ends or goes on as the order asks
        yield Allowance("reaction", order.begin, takes, allowed)


def _obeys_anyway(run: Followed, order: TimedOrder, at: int) -> bool:
    """Whether axes go on as before, and slow down or go the right way."""
    velocity = run.velocity[:, at]
    right = velocity == 0.0
    if order.kind != STOP:
        wanted = np.array(order.values) - (run.position[:, at] if order.kind == POSITION else 0.0)
        right = velocity * wanted >= 0.0
    return bool((right | (velocity * run.acceleration[:, at] < 0.0)).all())
