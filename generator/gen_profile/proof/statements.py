"""Whether what a planner block states of itself is true, in every cycle."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from gen_profile.proof.followed import (
    ENABLED,
    EXACT,
    IN_VELOCITY,
    Allowance,
    Followed,
    IssuedMotion,
    greatest,
    never,
    runs_of,
)
from gen_profile.proof.orders import DISABLED, POSITION, QUICK_STOP, VELOCITY, Flags, TimedOrder

BARELY = 5e-7  # share of the greatest velocity, within which one certainly is reached
FAR_MOVED = 0.01  # share of the greatest velocity times 1 s, by which an axis was certainly moved
NOTICED = 0.2  # periods, in which the end of a motion is
ROUGHLY = 0.25  # of the time to go, by which it may be wrong from early on, and a period beside


def truths(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the outputs that are truth values, and the number of the error."""
    done, busy, aborted, error, enabled = (
        followed.issued[name] != 0.0 for name in ("bDone", "bBusy", "bCommandAborted", "bError", "bEnabled")
    )
    told, number = followed.told, followed.issued["nErrorId"]
    there = told.holds & motion.goes & motion.stands & (motion.away <= EXACT)
    yield from never("disabled", enabled != motion.guided)
    yield from never("error", error != (number != 0.0))
    yield from never("untold", (number != told.error) & (number != 0.0))
    yield from never("refused", (number != told.error) & (number == 0.0))
    yield from never("aborted", aborted & ~told.aborted)
    yield from never("not aborted", told.aborted & ~aborted)
    yield from never("busy", motion.guided & ~(motion.stands | busy))
    yield from never("done", done & (busy | ~there))
    yield from never("vanished", told.holds & motion.goes & ~busy & ~done)
    if not followed.reserve:  # calming goes on as long as it must
        yield from _lasting(followed, "not done", there & ~done)
        yield from _lasting(followed, "not busy", busy & motion.stands & ~(told.holds & motion.goes))


def _lasting(followed: Followed, what: str, flags: Flags) -> Iterator[Allowance]:
    """Measure what must not last after a motion has ended."""
    for begin, end in runs_of(flags):
        yield Allowance(
            what, begin, (end - begin) * followed.cycle, NOTICED * followed.period + 2.0 * followed.cycle
        )


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


def numbers(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the outputs that are distances and times."""
    wrong = followed.of("fDistanceToGo") - motion.way * (motion.goes & followed.told.holds)
    yield from greatest("distance", np.abs(wrong), max(EXACT, followed.wander))
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
        if begun < rests and followed.slowest == inf:
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
    yield from never("lost", (why == 4.0) != ~motion.guided)
    ready, after = np.ones(followed.cycles, dtype=bool), followed.after(ENABLED + followed.reaction)
    for begin in followed.enabled:
        ready[begin : begin + after] = False
    yield from never("lost", (why == 3.0) & ready)
    may_be, must_be = _unknown(followed, motion)
    yield from never("lost", (why == 2.0) & ~may_be)
    yield from never("kept", promise & must_be)
    drifted = np.cumsum(followed.drifts) > 0
    yield from never("lost", (why == 1.0) & ~drifted)


def _unknown(followed: Followed, motion: IssuedMotion) -> tuple[Flags, Flags]:
    """Tell when it may, and when it must be unknown how the load swings."""
    may_be, must_be = np.zeros((2, followed.cycles), dtype=bool)
    for order in followed.orders:
        moving, at = not motion.stands[max(0, order.begin - 1)], order.begin
        if order.kind == DISABLED:
            at = order.end
            moving |= bool(motion.velocity[:, at - 1 : at].any())
            moved = followed.moved(order.begin, at) > 0.0
            may_be[at:] |= moving or moved
            must_be[at:] |= (moving or followed.moved(order.begin, at) > FAR_MOVED) and not followed.reserve
        elif order.kind == QUICK_STOP and moving:
            may_be[at:] = must_be[at:] = True
        later = [at for at in followed.seen if order.begin <= at < order.end and motion.guided[at]]
        for at in later:
            if motion.stands[at]:
                must_be[at:] = False
                may_be[at:] &= followed.issued["bBusy"][at - 1] != 0.0
    return may_be, must_be
