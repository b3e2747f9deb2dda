"""Whether a planner block did what was commanded, in time, and whether what it reported was true."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from gen_profile.assurance.proof import statements, stopping
from gen_profile.assurance.proof.followed import (
    EXACT,
    MISJUDGED,
    SLOT,
    Allowance,
    Followed,
    bounded,
    greatest,
    in_time,
    runs_of,
    to_speeds,
)
from gen_profile.assurance.proof.orders import DISABLED, POSITION, QUICK_STOP, STOP, VELOCITY, TimedOrder
from gen_profile.assurance.proof.promptness import lost

STILL = 1e-6  # m, from a target that an axis need not leave for
FIXED = 1.5  # slots, for which a ramp goes on once an order is obeyed
FASTER = 0.02  # of the greatest velocity, by which corrections may make an axis faster that stops promptly

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
    own = (lost, _directions, _velocity_limits, _sticks, _quick_stops)
    for judge in (*own, *stopping.JUDGES, *statements.JUDGES):
        yield from judge(run)
    yield from _reactions(run, reactions)
    yield from _prompt_stops(run, reactions)


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
        there = np.where(
            run.goes, np.abs(way) > near, room * (way != 0.0) > 2.0 * SLOT * run.period * np.abs(way)
        )
        wants |= there & ~held
        for side in (-1.0, 1.0):  # one command after the other may be of the other side, sooner than it turns
            against = (side * way > 0.0) & (side * velocity < -slack) & (there | ~run.goes) & ~held
            for begin, end in runs_of(against):
                allowed = in_time(run, to_speeds(run, run.velocity[:, begin]))
                yield Allowance("against", begin, (end - begin) * run.cycle, allowed)
    for begin, end in runs_of(wants & run.stands):
        allowed = run.reaction + run.settles
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
            takes = in_time(run, to_speeds(run, run.velocity[:, order.begin]))
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
        if before.kind == VELOCITY or run.damped[begin - 1 : end].any():
            continue  # its last tap still counts, or what was measured
        for k, way in enumerate(run.way[:, begin].tolist()):
            velocity = run.velocity[k, begin:end]
            if not way:
                yield from greatest("unasked", np.abs(velocity), 0.0, begin)
            elif order.kind == VELOCITY:
                top = abs(way) + MISJUDGED * run.limits[k].velocity
                yield from greatest("beyond", velocity * np.sign(way), top, begin)
            elif not run.issued["bBusy"][begin - 1]:
                back = MISJUDGED * run.limits[k].velocity
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
        allowed = run.reaction
        if before.any() or run.reserve:
            allowed += bounded(run, to_speeds(run, before))
        if reacted_after is None:
            continue
        takes = reacted_after * run.cycle
        if takes > allowed and _obeys_anyway(run, order, order.begin + run.after(allowed)):
            continue  # what came before ends or goes on as the order asks
        yield Allowance("reaction", order.begin, takes, allowed)


def _prompt_stops(run: Followed, reactions: Mapping[int, int | None]) -> Iterator[Allowance]:
    """Judge that an axis which is to stop promptly becomes no faster once it obeys.

    Of one axis alone it is known from when on it does; of several, only how long that may take.
    """
    for k, own in enumerate(run.limits):
        speed = np.abs(run.velocity[k])
        for begin, end in runs_of(run.prompt_stops[k]):
            reacted = reactions.get(begin) if len(run.limits) == 1 else None
            if reacted is None:
                at = max(begin, 1)
                slack = MISJUDGED * own.velocity
                fastest = float(speed[at - 1 : begin + run.after(run.reaction)].max())
            else:
                at = max(begin + reacted, 1)
                if at > end:  # it was replaced before it was obeyed
                    continue
                velocity, gains = float(run.velocity[k, at - 1]), float(run.acceleration[k, at - 1])
                slack = FASTER * own.velocity
                goes_on = velocity + gains * (FIXED * SLOT * run.period + 0.5 * abs(gains) / own.jerk)
                fastest = max(abs(velocity), abs(goes_on))  # also where it turns round
            yield from greatest("hurries", speed[at - 1 : end], fastest + slack, at - 1)


def _obeys_anyway(run: Followed, order: TimedOrder, at: int) -> bool:
    """Whether axes go on as before, and slow down or go the right way."""
    velocity = run.velocity[:, at]
    right = velocity == 0.0
    if order.kind != STOP:
        wanted = np.array(order.values) - (run.position[:, at] if order.kind == POSITION else 0.0)
        right = velocity * wanted >= 0.0
    return bool((right | (velocity * run.acceleration[:, at] < 0.0)).all())
