"""Whether a planner block's axes are where they may be: stops within their ends, zones, taking over."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.proof.followed import (
    EXACT,
    TO_SLOW,
    TO_STOP,
    Allowance,
    Followed,
    IssuedMotion,
    Zone,
    greatest,
    slowing,
)
from gen_profile.proof.orders import BLOCKED, DISABLED, POSITION, QUICK_STOP, STOP, Flags

TURNING = 0.05  # of the greatest velocity, below which a plan may begin that turns an axis round
CALMS = 0.5  # of the room for calming, by which that may leave the stated ends of a stop
STILL = 1e-9  # m/s2


def stops(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge where a stop leads by the ends that are stated in every cycle."""
    low, high = followed.of("fStopLow"), followed.of("fStopHigh")
    told, turns = motion.guided & ~_fenced(followed, motion), _turning(followed, motion)
    up, down = (high - motion.position) * told, (motion.position - low) * told
    apart = np.abs(followed.of("fStopDistance") - np.maximum(high - motion.position, motion.position - low))
    yield from greatest("stop distance", apart, EXACT)
    yield from greatest("ends", -np.minimum(up, down) - turns, EXACT)
    targets = list[tuple[float, ...]]()
    for order in followed.orders:
        begin, own = order.begin, slice(order.begin, order.end)
        if order.kind == POSITION:
            targets.append(order.values)
        if order.kind not in (STOP, QUICK_STOP):
            continue
        place = motion.position[:, own]
        lowest, highest = (
            most.accumulate(place[:, ::-1], axis=1)[:, ::-1] for most in (np.minimum, np.maximum)
        )
        if not (followed.reserve and begin in followed.enabled):  # what swings as it is taken over is calmed
            leaves = np.maximum(low[:, own] - lowest, highest - high[:, own]) * told[own] - turns[:, own]
            calms = CALMS * max(limits.margin for limits in followed.limits)
            yield from greatest("ends", leaves, EXACT + calms, begin)
        known = np.abs(np.array([*targets, place[:, 0]]) - place[:, 0]).max(axis=0)
        takes = followed.reaction + slowing(followed, motion.velocity[:, begin], TO_STOP)
        rests = motion.stands[own] & (followed.issued["bBusy"][own] == 0.0)
        for k, limits in enumerate(followed.limits):
            leads = known[k] + limits.velocity * takes  # a stop that is not planned yet may end there
            yield Allowance("loose", begin, max(up[k, begin], down[k, begin]), leads)
            yield from greatest(
                "loose", np.maximum(up[k, own], down[k, own]) * rests, limits.margin + EXACT, begin
            )


def _turning(followed: Followed, motion: IssuedMotion) -> Array:
    """Tell how far axes go on that turn round where a plan takes over, (axes, cycles)."""
    slow = np.array([[TURNING * limits.velocity] for limits in followed.limits])
    velocity, acceleration = motion.velocity, np.abs(motion.acceleration)
    turns = (velocity * motion.acceleration < 0.0) & (np.abs(velocity) < slow)
    way: Array = np.where(turns, velocity**2 / np.maximum(acceleration, STILL), 0.0)
    return way


def _fenced(followed: Followed, motion: IssuedMotion) -> Flags:
    """Tell when an axis is within an interval that was blocked where it was, or beyond its travel."""
    found = np.zeros(followed.cycles, dtype=bool)
    for place, limits in zip(motion.position, followed.limits, strict=True):
        low, high = limits.targets
        found |= (place < low - limits.margin) | (place > high + limits.margin)
    for zone in followed.zones:
        own, place = slice(zone.begin, zone.end), motion.position[zone.axis, zone.begin : zone.end]
        found[own] |= (not zone.limit) & (place > zone.low) & (place < zone.high)
    return found


def blocked(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge that no axis goes into a blocked interval, nor says that a stop may lead there."""
    low, high = followed.of("fStopLow"), followed.of("fStopHigh")
    for zone, begin in _in_force(followed, motion, TO_STOP):
        own = slice(begin, zone.end)
        place, guided = motion.position[zone.axis, own], motion.guided[own]
        within = np.minimum(place - zone.low, zone.high - place)
        if not len(within) or within[0] > 0.0:
            continue  # from within it may leave
        yield from greatest("blocked", within * guided, EXACT, begin)
        above = place >= zone.high - EXACT
        leads = np.where(above, zone.high - low[zone.axis, own], high[zone.axis, own] - zone.low)
        yield from greatest("blocked", leads * guided, EXACT, begin)
    if followed.zones:
        wrong = followed.issued["nErrorId"] == BLOCKED
        for at in np.flatnonzero(np.diff(wrong, prepend=False) & wrong).tolist():
            number = int(followed.issued["nZone"][at])
            yield Allowance(
                "zone", at, float(not any(z.number == number for z in followed.zones if not z.limit)), 0.0
            )


def slowed(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge the velocity within slow intervals."""
    for zone, begin in _in_force(followed, motion, TO_SLOW):
        own = slice(begin, zone.end)
        place = motion.position[zone.axis, own]
        within = (place > zone.low) & (place < zone.high) & motion.guided[own]
        slack = (EXACT + 1.5 * followed.reserve) * followed.limits[zone.axis].velocity
        if within.any():
            speed = np.abs(motion.velocity[zone.axis, own]) * within
            yield from greatest("fast", speed, zone.limit + slack, begin)


def _in_force(followed: Followed, motion: IssuedMotion, periods: float) -> Iterator[tuple[Zone, int]]:
    """Give zones of both kinds with the cycle from which they must be kept."""
    for zone in followed.zones:
        if bool(zone.limit) == (periods == TO_SLOW) and zone.begin < followed.cycles:
            takes = followed.reaction + slowing(followed, motion.velocity[:, zone.begin], periods)
            begin = zone.begin + followed.after(takes) * (zone.begin > 0)
            if begin < min(zone.end, followed.cycles):
                yield zone, begin


def taken_over(followed: Followed, motion: IssuedMotion) -> Iterator[Allowance]:
    """Judge that a disabled block follows its axes, and takes them over where and as fast as they go."""
    for order in followed.orders:
        if order.kind != DISABLED or not order.begin:
            continue
        last = min(order.end, followed.cycles - 1)
        own = slice(order.begin, last + 1)
        x, v = motion.position[:, order.begin - 1 : last + 1], motion.velocity[:, own]
        known = np.isfinite(followed.steps[:, own] + followed.speeds[:, own]).all(axis=0)
        apart = np.abs(np.diff(x, axis=1) - np.where(known, followed.steps[:, own], 0.0))
        braked = [limits.quick[1] * followed.cycle**3 for limits in followed.limits]
        apart[:, -1] -= np.abs(v[:, -1]) * followed.cycle + braked
        yield from greatest("taken over", apart, EXACT, order.begin)
        allowed = np.array([[limits.quick[0]] for limits in followed.limits]) * followed.cycle
        wrong = np.abs(v - np.where(known, followed.speeds[:, own], v))
        yield from greatest("taken over", wrong[:, :-1], EXACT, order.begin)
        yield from greatest("taken over", wrong[:, -1:] - allowed, EXACT, last)
