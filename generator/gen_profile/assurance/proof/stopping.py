"""Whether stops lead no farther than a planner block states, and than any need."""

from collections.abc import Iterator

import numpy as np

from gen_profile.assurance.proof.followed import (
    EXACT,
    LATENESS,
    MISJUDGED,
    NOTHING,
    SLOT,
    Allowance,
    Followed,
    bounded,
    greatest,
    runs_of,
    to_speeds,
)
from gen_profile.assurance.proof.orders import POSITION, QUICK_STOP, STOP, VELOCITY, Flags, TimedOrder
from gen_profile.motion.profile import Array

ACTS = 2.0  # slots, in which what a stick asked for is led to
# slowest periods: no motion is shorter that leaves nothing (ZV, Smith 1957; Singer and Seering 1990), so that
# what an axis has begun is not replaced by such a one sooner, whatever a block states of itself
TAKEN_UP = 0.5
CALMS = 0.5  # of the room for calming, by which that may leave the stated ends of a stop


def stops(run: Followed) -> Iterator[Allowance]:
    """Judge where a stop leads by the ends that are stated in every cycle."""
    low, high = run.of("fStopLow"), run.of("fStopHigh")
    applies = run.guided & ~_fenced(run)
    up, down = (high - run.position) * applies, (run.position - low) * applies
    apart = np.abs(run.of("fStopDistance") - np.maximum(high - run.position, run.position - low))
    yield from greatest("stop distance", apart, EXACT)
    yield from greatest("ends", -np.minimum(up, down), NOTHING * run.sway_limit)
    widest = max(limits.margin for limits in run.limits) + EXACT
    apart = np.maximum(high - run.position, run.position - low) * ~run.guided
    yield from greatest("loose", apart, widest)
    targets = list[tuple[float, ...]]()
    for order in run.orders:
        if order.kind in (POSITION, VELOCITY) and not run.reserve:  # else it may be calmed beyond
            yield from _within_travel(run, slice(order.begin, order.end), low, high)
        # the ends that an interlock saw as it stopped the axis
        begin = max(0, order.begin - (order.kind == STOP))
        own = slice(begin, order.end)
        if order.kind == POSITION:
            targets.append(order.values)
        if order.kind not in (STOP, QUICK_STOP):
            continue
        place = run.position[:, own]
        highest, lowest = _later(np.maximum, place), _later(np.minimum, place)
        if not (run.reserve and _just_taken_over(run, order.begin)):  # else what swings then is calmed
            leaves = np.maximum(low[:, own] - lowest, highest - high[:, own]) * applies[own]
            yield from greatest("ends", leaves, _unseen(run), begin)
        if order.kind == QUICK_STOP:
            # it brakes on when another order comes, unless it is let go
            after = begin + np.flatnonzero(run.stands[begin:] | ~run.guided[begin:])[:1]
            last = [*after, order.end - 1][0]
            rest = run.position[:, last][:, None]
            highest, lowest = np.maximum(highest, rest), np.minimum(lowest, rest)
            wide = np.maximum(high[:, own] - highest, lowest - low[:, own]) * applies[own] * run.guided[last]
            margin = max(limits.margin for limits in run.limits)
            yield from greatest("loose", wide, margin + EXACT, begin)
        known = np.abs(np.array([*targets, place[:, 0]]) - place[:, 0]).max(axis=0)
        yield from _no_wider(run, order, own, known, np.maximum(up, down))


def _no_wider(run: Followed, order: TimedOrder, own: slice, known: Array, wide: Array) -> Iterator[Allowance]:
    """Judge how wide the ends of a stop are, as it begins and once the axes rest.

    Parameters
    ----------
    known : (axes,) array
        m, to the farthest target so far: a stop that is not planned yet may end beyond it.
    wide : (axes, cycles) array
        m, from the axes to the farther ends.
    """
    takes = _stops_in_time(run, _until_taken_up(run, own.start))
    rests = run.stands[own] & (run.issued["bBusy"][own] == 0.0)
    for k, limits in enumerate(run.limits):
        leads = known[k] + limits.velocity * takes
        yield Allowance("loose", own.start, wide[k, order.begin], leads)
        yield from greatest("loose", wide[k, own] * rests, limits.margin + EXACT, own.start)


def _stops_in_time(run: Followed, speeds: Array) -> float:
    """Tell in s what a stop from speeds, (axes,), may take any block, until it is taken up included."""
    return TAKEN_UP * run.period + LATENESS * bounded(run, to_speeds(run, speeds))


def _until_taken_up(run: Followed, cycle: int) -> Array:
    """Tell how fast axes may become before a stop is taken up, (axes,)."""
    fastest = np.array([own.velocity for own in run.limits])
    gained = TAKEN_UP * run.period * np.array([own.acceleration for own in run.limits])
    return np.asarray(np.minimum(np.abs(run.velocity[:, cycle]) + gained, fastest))


def _just_taken_over(run: Followed, cycle: int) -> bool:
    """Whether the axes have not stood since they were taken over, but for the cycle before."""
    begun = max(at for at in run.enabled if at <= cycle)
    return not run.stands[begun : max(begun, cycle - 1)].any()


def let_go(run: Followed) -> Iterator[Allowance]:
    """Judge that an axis whose stick is at 0, also beside another's, keeps within what a stop may take."""
    low, high = run.of("fStopLow"), run.of("fStopHigh")
    applies, acts = run.guided & ~_fenced(run), run.after(ACTS * SLOT * run.period)
    for k, position in enumerate(run.position):
        rests = run.by_order([order.kind == VELOCITY and not order.values[k] for order in run.orders])
        for begin, end in runs_of(rests):
            if run.reserve and _just_taken_over(run, begin):
                continue  # what swings then is calmed
            own = slice(max(0, begin - 1), end)
            highest, lowest = _later(np.maximum, position[own]), _later(np.minimum, position[own])
            leaves = np.maximum(low[k, own] - lowest, highest - high[k, own]) * applies[own]
            leaves[: begin - own.start + acts] -= _asked(run, k, begin)
            yield from greatest("ends", leaves, _unseen(run), own.start)


def _later(most: np.ufunc, places: Array) -> Array:
    """Give the greatest, or least, place from each cycle on, (…, cycles)."""
    found: Array = most.accumulate(places[..., ::-1], axis=-1)[..., ::-1]
    return found


def _unseen(run: Followed) -> float:
    """Tell in m how far an axis may leave the stated ends of a stop: unseen, and to calm the load."""
    return NOTHING * run.sway_limit + CALMS * max(limits.margin for limits in run.limits)


def _asked(run: Followed, axis: int, begin: int) -> float:
    """Tell how far in m a stick that is let go of may lead an axis on, by what it asked for last."""
    lasts = ACTS * (SLOT * run.period + 0.5 * run.cycle)  # of whole cycles
    since = begin - run.after(lasts)
    sticks = (o for o in run.orders if o.kind == VELOCITY and since < o.end and o.begin < begin)
    return lasts * max((min(abs(o.values[axis]), o.tops[axis]) for o in sticks), default=0.0)


def _within_travel(run: Followed, own: slice, lows: Array, highs: Array) -> Iterator[Allowance]:
    """Measure how far stated ends of a stop lie beyond the travel, and axes beyond the targets' range."""
    since = slice(max(0, own.start - 1), own.stop)
    for k, (low, high, limits) in enumerate(zip(lows, highs, run.limits, strict=True)):
        first, last = limits.targets[0] - limits.margin, limits.targets[1] + limits.margin
        place, beyond = run.position[k, own], np.maximum(first - low[since], high[since] - last)
        beyond *= beyond[0] <= EXACT  # else it is on its way back from there
        yield from greatest("loose", beyond, EXACT, own.start)
        first, last = limits.targets
        damps = run.damped[since].any()
        if first <= place[0] <= last and run.stands[own.start - 1] and not damps:
            beyond = np.maximum(first - place, place - last)
            yield from greatest("outside", beyond, limits.margin + EXACT, own.start)  # room to damp in


def _fenced(run: Followed) -> Flags:
    """Tell when an axis is within an interval that was blocked where it was, or beyond its travel."""
    fenced = np.zeros(run.cycles, dtype=bool)
    for place, limits in zip(run.position, run.limits, strict=True):
        low, high = limits.targets
        fenced |= (place < low - limits.margin) | (place > high + limits.margin)
    for zone in run.zones:
        own, place = slice(zone.begin, zone.end), run.position[zone.axis, zone.begin : zone.end]
        fenced[own] |= (not zone.limit) & (place > zone.low) & (place < zone.high)
    return fenced


def far(run: Followed) -> Iterator[Allowance]:
    """Judge that an axis which is to stop, alone or beside others, goes no farther than a stop takes in time.

    Where it slows down evenly in that time, it goes half as far as at its velocity; and what is fast enough
    to end what swings is what made that swing, since the axes last stood.
    """
    began = np.maximum.accumulate(np.where(run.stands, np.arange(run.cycles), 0)).tolist()
    for k, own in enumerate(run.limits):
        speed, position = np.abs(run.velocity[k]), run.position[k]
        stops = [o.kind == STOP or (o.kind == VELOCITY and not o.values[k]) for o in run.orders]
        for begin, end in runs_of(run.by_order(stops) & ~run.damped):
            taken_up = min(begin + run.after(TAKEN_UP * run.period), end)
            fastest = max(float(speed[began[begin] : taken_up].max()), MISJUDGED * own.velocity)
            takes = 0.5 * (TAKEN_UP * run.period + _stops_in_time(run, np.array([fastest] * len(run.limits))))
            way = np.abs(position[begin:end] - position[begin])
            yield from greatest("far", way, fastest * takes + run.wander, begin)


JUDGES = (stops, let_go, far)
