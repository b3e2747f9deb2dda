"""Whether what a planner block states of itself is true, in every cycle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gen_profile.proof.followed import (
    ENABLED,
    EXACT,
    IN_VELOCITY,
    TO_STOP,
    Allowance,
    Followed,
    IssuedMotion,
    never,
    slowing,
)
from gen_profile.proof.orders import POSITION, QUICK_STOP, STOP, VELOCITY, TimedOrder

BARELY = 5e-7  # share of the greatest velocity, within which one certainly is reached
ROUGHLY = 0.25  # of the time to go, by which it may be wrong from early on, and a period beside


def truths(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the outputs that are truth values."""
    done, busy, aborted, error, enabled = (
        followed.issued[name] != 0.0 for name in ("bDone", "bBusy", "bCommandAborted", "bError", "bEnabled")
    )
    yield from never("busy", ~(motion.stands | busy))
    yield from never("error", error != (followed.issued["nErrorId"] != 0.0))
    yield from never("disabled", ~enabled)
    yield from never("done", done & (busy | ~motion.stands | (motion.away > EXACT)))
    rises = done.copy()
    rises[1:] &= ~done[:-1]
    yield from never("done", rises & ~motion.goes)  # it may last after the command, but not begin
    told = done | busy | aborted | error
    quiet, there = motion.goes & ~told, motion.goes & motion.stands & (motion.away <= EXACT)
    may_be, wrong = np.zeros((2, followed.cycles), dtype=bool)
    before, stands, over = None, False, False  # whether a refusal still counts; whether the command has ended
    for order in followed.orders:
        own = slice(order.begin, order.end)
        stands = bool(order.refused) or (stands and order.kind == STOP)  # until the next command
        wrong[own] = stands
        if order.refused:
            shown = followed.issued["nErrorId"][order.begin : order.end][:2]  # in that cycle or the next
            yield Allowance("refused", order.begin, float((shown != order.refused).all()), 0.0)
        if order.denied:
            shown = aborted[order.begin] or error[order.begin]
            yield Allowance("unanswered", order.begin, float(not shown), 0.0)
            may_be[order.begin :] = True
        if before and before.kind in (POSITION, VELOCITY):
            may_be[order.begin :] = True
            if before.kind == POSITION and order.edge == order.begin and not over:
                yield Allowance("not aborted", order.begin, float(not aborted[order.begin]), 0.0)
        over, ended = over and order.edge < order.begin, (done | error)[own]
        if order.kind == POSITION and not over and quiet[own].any():
            until = int(np.argmax(ended)) if ended.any() else len(ended)
            yield from never("vanished", quiet[own][:until], order.begin)
        arrives = order.kind == POSITION and there[order.begin + 1 : order.end].any()
        if arrives and not (over or followed.reserve or done[own].any()):
            yield Allowance("not done", order.begin, 1.0, 0.0)
        over = over or bool(ended.any())
        if order.kind == STOP and not followed.reserve:
            latest = order.begin + followed.after(slowing(followed, motion.velocity[:, order.begin], TO_STOP))
            if latest < order.end:
                yield from never(
                    "not busy", busy[latest : order.end] & motion.stands[latest : order.end], latest
                )
        before = order
    yield from never("untold", error & ~wrong)
    yield from never("aborted", aborted & ~may_be & ~error)


def velocities(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """BInVelocity where the stick's velocity is issued, and nowhere else."""
    shown = followed.issued["bInVelocity"] != 0.0
    sticks = np.zeros(followed.cycles, dtype=bool)
    for order in followed.orders:
        sticks[order.begin : order.end] = order.kind == VELOCITY
    apart = np.zeros(followed.cycles)
    for velocity, wanted, limits in zip(motion.velocity, motion.way, followed.limits, strict=True):
        np.maximum(apart, np.abs(velocity - wanted) / limits.velocity, out=apart)
    yield from never("not in velocity", sticks & (apart <= BARELY) & ~shown)
    yield from never("in velocity", shown & ~(sticks & (apart <= IN_VELOCITY)))


def stops(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge stops by the ends that were stated when they came."""
    stated = f"fStopLow{followed.axes[0].suffix}" in followed.issued
    if stated:
        ends = np.maximum(
            followed.of("fStopHigh") - motion.position, motion.position - followed.of("fStopLow")
        )
        apart = np.abs(followed.of("fStopDistance") - ends).max(axis=0)
        yield Allowance("stop distance", int(np.argmax(apart)), float(apart.max()), EXACT)
    targets = list[tuple[float, ...]]()
    for order in followed.orders:
        if order.kind == POSITION:
            targets.append(order.values)
        if order.kind != STOP:
            continue
        known = np.abs(
            np.array([*targets, motion.position[:, order.begin]]) - motion.position[:, order.begin]
        ).max(axis=0)
        begin, own = order.begin, slice(order.begin, order.end)
        takes = followed.reaction + slowing(followed, motion.velocity[:, begin], TO_STOP)
        for k, axis in enumerate(followed.axes):
            place = motion.position[k, own]
            if stated:
                low, high = (
                    float(followed.issued[axis.of(name)][begin]) for name in ("fStopLow", "fStopHigh")
                )
            else:
                distance = float(followed.issued[axis.of("fStopDistance")][begin])
                low, high = place[0] - distance, place[0] + distance
            yield Allowance("ends", begin, max(low - place.min(), place.max() - high), EXACT)
            leads = (
                known[k] + followed.limits[k].velocity * takes
            )  # a stop that is not planned yet may end there
            yield Allowance("loose", begin, max(place[0] - low, high - place[0]), leads)


def numbers(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the outputs that are distances and times."""
    wrong = np.abs(followed.of("fDistanceToGo") - motion.way).max(axis=0) * motion.goes
    at = int(np.argmax(wrong))
    yield Allowance("distance", at, float(wrong[at]), max(EXACT, followed.wander))
    if followed.reserve:
        return  # calming goes on as long as it must
    time, slot = followed.issued["fTimeToGo"], 0.1 * followed.period + 2.0 * followed.cycle
    for order in followed.orders:
        moving = np.flatnonzero(~motion.stands[order.begin : order.end])
        if not len(moving):
            continue
        rests = order.begin + int(moving[-1]) + 1
        if rests >= order.end or not _is_end(motion, order, rests):
            continue
        first = max(order.begin, rests - followed.after(0.5 * followed.period))
        error = np.abs(time[first:rests] - (rests - np.arange(first, rests)) * followed.cycle)
        yield Allowance("time", first + int(np.argmax(error)), float(error.max()), slot)
        begun = order.begin + followed.after(followed.reaction + followed.period)
        if begun < rests:
            left = (rests - np.arange(begun, rests)) * followed.cycle
            over = np.abs(time[begun:rests] - left) - ROUGHLY * left
            yield Allowance("time", begun + int(np.argmax(over)), float(over.max()), followed.period)
        after = np.abs(time[rests + 1 : order.end])
        yield Allowance("time", rests + 1, float(after.max(initial=0.0)), EXACT)


def _is_end(motion: IssuedMotion, order: TimedOrder, at: int) -> bool:
    """Whether an axis that stands has nowhere else to go."""
    if order.kind == POSITION:
        return bool(np.abs(motion.position[:, at] - order.values).max() <= EXACT)
    return not any(order.values)


def promises(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the promise, and why it is dropped."""
    promise, why = followed.issued["bPromise"] != 0.0, followed.issued["nPromise"]
    yield from never("promise", promise != (why == 0.0))
    ready = followed.after(ENABLED + followed.reaction)
    yield from never("lost", why[ready:] > 2.0, ready)
    yield from never("lost", why == 1.0)  # live parameters keep their stated rates, but for spikes
    braked = [order.begin for order in followed.orders if order.kind == QUICK_STOP]
    yield from never("lost", why[: min(braked, default=followed.cycles)] == 2.0)
    seen = [at for at in followed.seen if motion.stands[at] and not followed.issued["bBusy"][at - 1]]
    for begin in braked:
        if not motion.stands[max(0, begin - 1)]:
            end = next((at for at in seen if at >= begin), followed.cycles)
            yield from never("kept", promise[begin:end], begin)
    for at in seen:
        yield Allowance("not given back", at, float(why[at] == 2.0), 0.0)
