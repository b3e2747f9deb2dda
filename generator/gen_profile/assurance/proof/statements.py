"""Whether what a planner block states of itself is true, in every cycle, and axes are where they may be."""

from collections import Counter
from collections.abc import Iterator
from math import inf

import numpy as np

from gen_profile.assurance.proof.followed import (
    EXACT,
    IN_VELOCITY,
    NOTHING,
    SLOT,
    UNKNOWN,
    Allowance,
    Followed,
    Zone,
    braking,
    came_nearer,
    greatest,
    in_time,
    never,
    runs_of,
    to_speeds,
)
from gen_profile.assurance.proof.orders import (
    BLOCKED,
    DISABLED,
    NO_MOTION,
    POSITION,
    QUICK_STOP,
    VELOCITY,
    Flags,
    TimedOrder,
)
from gen_profile.planner.events import KEPT_EVENTS

BARELY = 9.99e-4  # share of the greatest velocity, within which one certainly is reached
FAR_MOVED = 0.01  # share of the greatest velocity times 1 s, by which an axis was certainly moved
LED_ON = 2.0  # slots, for which an axis surely has room where its stick leads it
NOTICED = 0.2  # periods, in which the end of a motion is
ROUGHLY = 0.25  # of the time to go, by which it may be wrong from early on, and a period beside
ADDED_UP = 5.0  # nPromise: errors may leave more than is allowed
LEFT, OVERSTATED = "left by errors", "overstated"  # what is measured but not judged
UNDISTURBED = 1e-3  # of the allowed sway, that may be left on the machine as given
AT_ONCE = 2  # cycles, in which an axis must be braked where there is no room for anything else
TAKEN_UP = 2  # cycles, in which a blocked interval is
SHOWN = (10, 20, 21, 22, *range(50, 60), *range(60, 67), 70)  # codes of events that other outputs show, too
COMMANDED = (21, 22)  # those whose value is the first axis's target or velocity
PLANNED = (32, 33, 34)  # those whose value is fTimeToGo


def truths(run: Followed) -> Iterator[Allowance]:
    """Judge the outputs that are truth values, and the number of the error."""
    done, busy, aborted, error, enabled = (
        run.issued[name] != 0.0 for name in ("bDone", "bBusy", "bCommandAborted", "bError", "bEnabled")
    )
    received, number = run.received, run.issued["nErrorId"]
    there = received.holds & run.goes & run.stands & (run.away <= EXACT)
    yield from never("disabled", enabled != run.guided)
    yield from never("error", error != (number != 0.0))
    yield from never("wrong error", number != received.error)
    yield from never("aborted", aborted != received.aborted)
    yield from never("busy", run.guided & ~(run.stands | busy))
    yield from never("done", done & (busy | ~there))
    yield from never("vanished", received.holds & run.goes & ~busy & ~done)
    yield from never("vanished", run.led_by_stick(slots=LED_ON) & ~busy)
    if not run.reserve:  # calming goes on as long as it must
        yield from _lasting(run, "not done", there & ~done)
        asked = received.holds & run.goes | run.led_by_stick() | run.damped  # it is about to move
        yield from _lasting(run, "not busy", busy & run.stands & ~asked)


def _lasting(run: Followed, what: str, flags: Flags) -> Iterator[Allowance]:
    """Measure what must not last after a motion has ended."""
    for begin, end in runs_of(flags):
        yield Allowance(what, begin, (end - begin) * run.cycle, NOTICED * run.period + 2.0 * run.cycle)


def velocities(run: Followed) -> Iterator[Allowance]:
    """BInVelocity where the stick's velocity is issued, and nowhere else."""
    shown = run.issued["bInVelocity"] != 0.0
    sticks = run.by_order([order.kind == VELOCITY for order in run.orders])
    apart = np.zeros(run.cycles)
    for velocity, wanted, limits in zip(run.velocity, run.way, run.limits, strict=True):
        np.maximum(apart, np.abs(velocity - wanted) / limits.velocity, out=apart)
    yield from never("not in velocity", sticks & (apart <= BARELY) & ~shown)
    yield from never("in velocity", shown & ~(sticks & (apart <= IN_VELOCITY)))


def numbers(run: Followed) -> Iterator[Allowance]:
    """Judge the outputs that are distances and times."""
    wrong = run.of("fDistanceToGo") - run.way * (run.goes & run.received.holds)
    yield from greatest("distance", np.abs(wrong), max(EXACT, run.wander))
    if run.reserve:
        return  # calming goes on as long as it must
    time, slot = run.issued["fTimeToGo"], 2.0 * run.cycle
    for order in run.orders:
        moving = np.flatnonzero(~run.stands[order.begin : order.end])
        if not len(moving) or run.damped[order.begin : order.end].any():
            continue
        rests = order.begin + int(moving[-1]) + 1
        if rests + 1 >= order.end or not _is_end(run, order, rests):  # another may begin in that cycle
            continue
        takes = run.reaction + 2.0 * SLOT * run.period  # a plan takes over with a slot
        changes = np.flatnonzero(np.diff(run.prompt[order.begin : rests])) + 1  # of how it is to stop
        since = order.begin + int(changes.max(initial=0))
        planned = since + run.after(takes)  # before, it tells of the former motion
        first = min(rests, max(planned, rests - run.after(0.5 * run.period)))
        error = np.abs(time[first : rests + 1] - (rests - np.arange(first, rests + 1)) * run.cycle)
        yield Allowance("time", first + int(np.argmax(error)), float(error.max()), slot)
        begun = since + run.after(run.reaction + run.period)
        if begun < rests and run.slowest == inf:
            left = (rests - np.arange(begun, rests)) * run.cycle
            over = time[begun:rests] - left
            if not _waits(run, order):
                over = np.abs(over)
            over -= ROUGHLY * left
            yield Allowance("time", begun + int(np.argmax(over)), float(over.max()), run.period)
        after = np.abs(time[rests + 1 : order.end])
        yield Allowance("time", rests + 1, float(after.max(initial=0.0)), EXACT)


def _waits(run: Followed, order: TimedOrder) -> bool:
    """Whether errors may leave so much that a plan's share of it is not free: it waits, or is slower."""
    left = run.issued.get("fSwayLeft", np.zeros(1))
    return bool(left[order.begin : order.end].max(initial=0.0) > run.sway_limit - run.share)


def _is_end(run: Followed, order: TimedOrder, at: int) -> bool:
    """Whether an axis that stands has nowhere else to go."""
    if order.kind == POSITION:
        return bool(np.abs(run.position[:, at] - order.values).max() <= EXACT)
    return not any(order.values)


def promises(run: Followed) -> Iterator[Allowance]:
    """Judge the promise, and why it is dropped."""
    promise, why = run.issued["bPromise"] != 0.0, run.issued["nPromise"]
    yield from never("promise", promise != (why == 0.0))
    yield from never("lost", (why == 4.0) != ~run.guided)
    ready, after = np.ones(run.cycles, dtype=bool), run.after(run.settles + run.reaction)
    for begin in run.enabled:
        ready[begin : begin + after] = False
    yield from never("lost", (why == 3.0) & ready)
    stated = run.issued.get("fSwayLeft", np.zeros(run.cycles))
    left = stated <= run.sway_limit if "fSwayLeft" in run.issued else np.arange(run.cycles) < run.stopped_from
    yield from never("lost", (why == ADDED_UP) & left)
    yield from never("kept", promise & ((stated > run.sway_limit) | run.damped))
    may_be, must_be = _unknown(run)
    yield from never("lost", (why == UNKNOWN) & ~may_be)
    yield from never("kept", promise & must_be)
    drifted = np.cumsum(run.drifts) > 0
    yield from never("lost", (why == 1.0) & ~drifted)
    for begin, known in run.live_changes:
        ends = [*run.rest_reports, *run.enabled[1:], run.cycles]
        until = min(end for end in ends if end >= begin)
        if begin and known < until and (run.guided & ~run.stands)[begin - 1 : known].all():
            yield from greatest("kept", 1.0 * promise[known:until], 0.0, known)


def events(run: Followed) -> Iterator[Allowance]:
    """Judge the events that are kept by the other outputs: each in its cycle, and no others."""
    issued = run.issued
    if "nEvents" not in issued:
        return
    found, expected = Counter[tuple[int, int]](), Counter(_shown(run))
    given = {order.begin: order.values[0] for order in run.orders if order.values}
    for cycle in np.flatnonzero(np.diff(issued["nEvents"], prepend=0.0)).tolist():
        count = int(issued["nEvents"][cycle])
        for k in range(int(issued["nEvents"][cycle - 1]) if cycle else 0, count):
            time, code, value = (
                float(issued[f"aEvent{of}[{k % KEPT_EVENTS}]"][cycle]) for of in ("Time", "Code", "Value")
            )
            yield Allowance("event", cycle, abs(time - (cycle + 1) * run.cycle), 1e-6 * run.cycle * cycle)
            if code in PLANNED:
                yield Allowance("event", cycle, abs(value - issued["fTimeToGo"][cycle]), EXACT)
            if code in COMMANDED and cycle in given:
                yield Allowance("event", cycle, abs(value - given[cycle]), EXACT)
            found[cycle, int(code)] += 1
    judged = Counter({one: times for one, times in found.items() if one[1] in SHOWN})
    for cycle, _ in (judged - expected) + (expected - judged):
        yield Allowance("event", cycle, 1.0, 0.0)


def _shown(run: Followed) -> Iterator[tuple[int, int]]:
    """Give cycles and codes of the events that other outputs and the commands tell of."""
    for name, first, code in (("nErrorId", 0.0, 50), ("nPromise", 4.0, 60), ("bEnabled", 0.0, 0)):
        values = run.issued[name]
        for cycle in np.flatnonzero(np.diff(values, prepend=first)).tolist():
            if code or not values[cycle]:
                yield cycle, int(values[cycle]) + code if code else 10
    done = run.issued["bDone"]
    yield from ((cycle, 70) for cycle in np.flatnonzero(np.diff(done, prepend=0.0) > 0.0).tolist())
    before, target = 20, 0.0
    for order in run.orders:
        code = {POSITION: 21, VELOCITY: 22}.get(order.kind, 20)
        if code != before or (code == 21 and order.values[0] != target):
            yield order.begin, code
        before, target = code, order.values[0] if code == 21 else target


def _unknown(run: Followed) -> tuple[Flags, Flags]:
    """Tell when it may, and when it must be unknown how the load swings."""
    may_be, must_be = np.zeros((2, run.cycles), dtype=bool)
    used = [run.sensed(axis.of("bSensorUsed")) for axis in run.axes]
    sees = np.all(used, axis=0) & run.stands
    for order in run.orders:
        moving, at = not run.stands[max(0, order.begin - 1)], order.begin
        if order.kind == DISABLED:
            at = order.end
            moved = run.moved(order.begin, at) > 0.0 and not (run.reserve and _moves_as_stated(run, order))
            begun = bool(run.issued["bBusy"][max(0, order.begin - 1)])  # to move in the next cycle
            refused = bool((run.issued["nErrorId"][: order.begin] == NO_MOTION).any())
            goes = run.taken_over_at(at)
            may_be[at:] |= moving or moved or begun or refused or any(goes)
            must_be[at:] |= (any(goes) or run.moved(order.begin, at) > FAR_MOVED) and not run.reserve
        elif order.kind == QUICK_STOP:
            may_be[at:] |= moving or bool(run.issued["bBusy"][max(0, at - 1)])
            must_be[at:] |= moving
        later = [at for at in run.rest_reports if order.begin <= at < order.end and run.guided[at]]
        for at in later:
            if run.stands[at]:
                must_be[at:] = False
                may_be[at:] &= run.issued["bBusy"][at - 1] != 0.0
        if sees[order.begin : order.end].any():
            must_be[order.begin + int(np.argmax(sees[order.begin : order.end])) :] = False
    # after braking; and once too much has added up, which no motion makes up for, and which may be forgotten
    left = run.issued.get("fSwayLeft", np.zeros(run.cycles))  # which another reason may hide
    added_up = (run.issued["nPromise"] == ADDED_UP) | (left > run.sway_limit)
    for begin in (*run.brakings, *np.flatnonzero(added_up)[:1]):
        reports = (at for at in run.rest_reports if at >= begin and run.guided[at] and run.stands[at])
        may_be[begin : min(reports, default=run.cycles)] = True
    return may_be | (np.cumsum(run.lost_sensors) > 0), must_be


def _moves_as_stated(run: Followed, order: TimedOrder) -> bool:
    """Whether axes that are moved by hand go where their stated velocities lead, from a standstill on."""
    steps = run.steps[:, order.begin : order.end + 1]
    speeds = run.speeds[:, order.begin : order.end + 1]
    led = run.cycle * np.cumsum(speeds - 0.5 * np.diff(speeds, prepend=0.0), axis=1)
    apart = np.abs(np.cumsum(steps, axis=1) - led).max(axis=1)
    return all(gap < BARELY * own.velocity for gap, own in zip(apart.tolist(), run.limits, strict=True))


def blocked(run: Followed) -> Iterator[Allowance]:
    """Judge that no axis goes into a blocked interval, nor says that a stop may lead there."""
    low, high = run.of("fStopLow"), run.of("fStopHigh")
    for zone, stopped in _in_force(run, slow=False):
        before = max(zone.begin - 1, 0)
        led = low[zone.axis, before] < zone.high and high[zone.axis, before] > zone.low
        begin = stopped if led and not _is_kept_out(run, zone) else zone.begin
        own = slice(begin, zone.end)
        place, guided = run.position[zone.axis, own], run.guided[own]
        within = np.minimum(place - zone.low, zone.high - place)
        if not len(within) or within[0] > 0.0:
            continue  # from within it may leave
        yield from greatest("blocked", within * guided, EXACT, begin)
        above = place >= zone.high - EXACT
        leads = np.where(above, zone.high - low[zone.axis, own], high[zone.axis, own] - zone.low)
        yield from greatest("blocked", leads * guided, EXACT, begin)
    kept = run.guided & run.goes & run.received.holds
    for zone in run.zones:
        own = slice(zone.begin, zone.end if not zone.limit else 0)
        place, goal = run.position[zone.axis, own], (run.position + run.way)[zone.axis, own]
        ahead = (place <= zone.low) & (goal > zone.low + EXACT)
        behind = (place >= zone.high) & (goal < zone.high - EXACT)
        for begin, end in runs_of(kept[own] & (ahead | behind)):
            yield Allowance("no way", own.start + begin, end - begin, TAKEN_UP)
    if run.zones:
        wrong = run.issued["nErrorId"] == BLOCKED
        for at in np.flatnonzero(np.diff(wrong, prepend=False) & wrong).tolist():
            number = int(run.issued["nZone"][at])
            yield Allowance(
                "zone", at, float(not any(z.number == number for z in run.zones if not z.limit)), 0.0
            )


def _is_kept_out(run: Followed, zone: Zone) -> bool:
    """Whether braking its axis within the limits keeps it out of an interval that is blocked on its way."""
    if not came_nearer(run, zone):
        return False
    _, way = braking(run, zone.begin)[zone.axis]
    place, velocity = (float(one[zone.axis, zone.begin - 1]) for one in (run.position, run.velocity))
    end = place + way + AT_ONCE * run.cycle * velocity
    below, above = place <= zone.low and end <= zone.low, place >= zone.high and end >= zone.high
    return way * velocity > 0.0 and (below or above)


def slowed(run: Followed) -> Iterator[Allowance]:
    """Judge the velocity within slow intervals."""
    for zone, begin in _in_force(run, slow=True):
        own = slice(begin, zone.end)
        place = run.position[zone.axis, own]
        within = (place > zone.low) & (place < zone.high) & run.guided[own]
        slack = (EXACT + 1.5 * run.reserve) * run.limits[zone.axis].velocity
        if within.any():
            speed = np.abs(run.velocity[zone.axis, own]) * within
            yield from greatest("fast", speed, zone.limit + slack, begin)


def _in_force(run: Followed, *, slow: bool) -> Iterator[tuple[Zone, int]]:
    """Give zones of both kinds with the cycle from which they must be kept."""
    for zone in run.zones:
        if bool(zone.limit) == slow and zone.begin < run.cycles:
            takes = in_time(run, to_speeds(run, run.velocity[:, zone.begin]))
            begin = zone.begin + run.after(takes) * (zone.begin > 0)
            if begin < min(zone.end, run.cycles):
                yield zone, begin


def taken_over(run: Followed) -> Iterator[Allowance]:
    """Judge that a disabled block follows its axes, and takes them over where and as fast as they go."""
    for order in run.orders:
        if order.kind != DISABLED or not order.begin:
            continue
        last = min(order.end, run.cycles - 1)
        own = slice(order.begin, last + 1)
        x, v = run.position[:, order.begin - 1 : last + 1], run.velocity[:, own]
        known = np.isfinite(run.steps[:, own] + run.speeds[:, own]).all(axis=0)
        most = np.array([[limits.velocity] for limits in run.limits])
        speeds = np.clip(run.speeds[:, own], -most, most)
        if order.end < run.cycles:
            speeds[:, -1] = run.taken_over_at(order.end)
        apart = np.abs(np.diff(x, axis=1) - np.where(known, run.steps[:, own], 0.0))
        braked = [limits.quick[1] * run.cycle**3 for limits in run.limits]
        apart[:, -1] -= np.abs(v[:, -1]) * run.cycle + braked
        yield from greatest("taken over", apart, EXACT, order.begin)
        allowed = np.array([[limits.quick[0]] for limits in run.limits]) * run.cycle
        wrong = np.abs(v - np.where(known, speeds, v))
        yield from greatest("taken over", wrong[:, :-1], EXACT, order.begin)
        yield from greatest("taken over", wrong[:, -1:] - allowed, EXACT, last)


def remains(run: Followed) -> Iterator[Allowance]:
    """Judge what is left swinging where axes stand, by integrals of the accelerations that were issued."""
    yield from _remains_at_last(run)
    yield from _swings_on(run)
    until = run.unknown_from
    rests = [(begin, min(end, until)) for begin, end in runs_of(run.stands) if 0 < begin < until]
    ends = [begin for begin, _ in rests]
    if run.modes is None or not ends:
        return
    as_given, at_most, apart = run.modes.left(run.acceleration, ends, run.cycle)
    limit, stated = run.sway_limit, run.issued.get("fSwayLeft")
    if not run.modes.modes.damped:
        as_given = as_given * (np.array(ends) < run.stopped_from)
        worst = int(np.argmax(as_given))
        yield Allowance("swings", ends[worst], float(as_given[worst]), UNDISTURBED * limit)
    if stated is not None and not run.modes.modes.damped:
        above = stated[ends] / np.maximum(
            apart, NOTHING * limit
        )  # which is safe, and gives promises up early
        if np.ptp(run.modes.modes.poles, axis=0).any():  # else no error is stated
            yield Allowance(OVERSTATED, ends[int(np.argmax(above))], float(above.max()), inf)
        promised = run.issued["bPromise"][ends] != 0.0
        yield Allowance(LEFT, ends[-1], float((at_most * promised).max()), inf)
        below = at_most - [stated[begin:end].min() for begin, end in rests]  # as nothing decays
        worst = int(np.argmax(below))
        yield Allowance("understated", ends[worst], float(below[worst]), NOTHING * limit)


def _remains_at_last(run: Followed) -> Iterator[Allowance]:
    """Judge what motions leave that begin and end at rest after the last live parameters were given."""
    if run.last_modes is None or run.last_modes.modes.damped:
        return
    if run.stopped_from < run.cycles:
        return
    lost = [*run.brakings, *(order.end for order in run.orders if order.kind in (QUICK_STOP, DISABLED))]
    known = max(run.last_known, *lost, 0)
    rests = [max(begin, known) for begin, end in runs_of(run.stands) if end > known]
    if len(rests) > 1:
        ends = [at - rests[0] for at in rests[1:]]
        left, *_ = run.last_modes.left(run.acceleration[:, rests[0] :], ends, run.cycle)
        worst = int(np.argmax(left))
        yield Allowance("swings", rests[1 + worst], float(left[worst]), UNDISTURBED * run.sway_limit)


def _swings_on(run: Followed) -> Iterator[Allowance]:
    """Judge what is stated where live parameters change at rest.

    A rope that is hoisted slowly keeps the action of each mode, its energy by its frequency, so that its sway
    goes with 1/√ω; so does that of a load that loses mass, and of one that gains some less is left.
    """
    stated = run.issued.get("fSwayLeft")
    if stated is None or run.modes is None or run.last_modes is None or run.modes.modes.damped:
        return
    after = run.last_known + run.after(run.settles + run.reaction)
    starts = {begin for begin, known in run.live_changes if known == run.last_known}
    if not starts or after >= run.cycles or len({*run.live_changes}) > 1:
        return
    own = slice(min(starts) - 1, after + 1)
    reported = any(own.start < at <= after for at in run.rest_reports)
    withdrawn = reported or (run.issued["nPromise"][own] == UNKNOWN).any()
    if not (run.stands & run.guided)[own].all() or withdrawn or own.start >= run.unknown_from:
        return
    before, now = ([0, *one.ends] for one in (run.modes, run.last_modes))
    rates = run.modes.modes.poles[before].imag / run.last_modes.modes.poles[now].imag
    moved = run.modes.modes.moved(run.acceleration, [own.start], run.cycle) * np.sqrt(rates.min(axis=0))
    left = float(run.modes.modes.sway(moved).max())
    yield Allowance("understated", after, left - float(stated[after]), NOTHING * run.sway_limit)


JUDGES = (truths, velocities, numbers, promises, remains, events, blocked, slowed, taken_over)
