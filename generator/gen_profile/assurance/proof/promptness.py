"""How soon commands are obeyed, beside the quickest motions that keep the same promise.

What is possible is known of the machine and the spec alone: the axis without loads is a bound from below; a
period of each mode more is one from above, in closed form; and where the machine is known, a linear programme
finds it, from the state in which the command came.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.proof.followed import (
    EXACT,
    IN_VELOCITY,
    LATENESS,
    PLANNING,
    Allowance,
    Followed,
    axes_alone,
    bounded,
    goals,
    in_time,
    limits_of,
    runs_of,
    slow_ways,
    states,
    to_speeds,
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
from gen_profile.methods.quickest.modes import Complex, SwayModes
from gen_profile.methods.quickest.motion import AxisGoal, AxisState, Promise, motion, quickest

FIRST, WAY = "first position", "position on the way"
KINDS = {
    POSITION: "targets from rest",
    FIRST: "targets from rest, just after enabling",
    WAY: "targets on the way",
    VELOCITY: "velocities of a stick",
    STOP: "stops",
}
JUST_ENABLED = 2.0  # periods
NEVER = 2.0  # times what any block may take: a command that holds so long is lost
UNSHOWN = 0.01  # of the allowed sway: a mode that an axis cannot make swing so much is no part of a promise
LONGEST = 1.5  # times the closed form, up to which the linear programme looks for a motion


@attrs.frozen(kw_only=True, eq=False)
class ComparedCommand:
    """What the linear programme is asked: a promise, state and goal of each axis that moves."""

    axes: Sequence[tuple[Promise, AxisState, AxisGoal]]

    def is_possible(self, seconds: float) -> bool:
        """Tell whether every axis can be where it is to be in so much time."""
        return all(
            motion(sized, state, goal, max(int(seconds / sized.piece), 1)) is not None
            for promise, state, goal in self.axes
            for sized in [promise.lasting(seconds)]
        )

    def quickest(self, most: float) -> float | None:
        """Find the least time in s of the slowest axis; none within the most."""
        found = [quickest(*own, most) for own in self.axes]
        known = [time for time in found if time is not None]
        return max(known) if len(known) == len(found) else None


@attrs.frozen(kw_only=True, eq=False)
class Obeyed:
    """How soon a command was obeyed, and how soon it could have been.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    begin, takes : float
        s: from the history's start, and from then on.
    alone, bounded : float
        s, of the axes without loads, and the closed form for all machines.
    period : float
        s, of the slowest swing.
    state : str
        Of the axes as it came, in words.
    case : ComparedCommand or None
        Where the machine and its past are known.
    possible : float or None
        s, by the linear programme, where it was asked.
    """

    kind: str
    begin: float
    takes: float
    alone: float
    bounded: float
    period: float
    state: str
    case: ComparedCommand | None = None
    possible: float | None = None

    @property
    def quickest(self) -> float:
        """What is known to be possible in s."""
        return self.bounded if self.possible is None else self.possible

    @property
    def ratio(self) -> float:
        """Time by what is possible."""
        return self.takes / max(self.quickest, EXACT)

    def is_late(self, lateness: float) -> bool:
        """Tell whether it takes longer than so many times what is possible, and the planning."""
        return self.takes > lateness * self.quickest + PLANNING

    def overdue(self, lateness: float) -> float:
        """Tell by how much, in s; below 0 where it does not."""
        return self.takes - lateness * self.quickest - PLANNING

    def asked(self, lateness: float) -> Obeyed:
        """Ask the linear programme, in one step where no motion is so much quicker."""
        seconds = (self.takes - PLANNING) / lateness
        if self.case is None or seconds <= self.alone or not self.case.is_possible(seconds):
            return self
        return self.compared()

    def compared(self) -> Obeyed:
        """Ask the linear programme for the quickest motion."""
        if self.case is None or self.possible is not None:
            return self
        return attrs.evolve(self, possible=self.case.quickest(LONGEST * self.bounded))

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "command": KINDS[self.kind],
            "time_s": self.begin,
            "state": self.state,
            "takes_s": self.takes,
            "quickest_s": self.possible,
            "closed_form_s": self.bounded,
            "axis_alone_s": self.alone,
        }


def obeyed(run: Followed) -> list[Obeyed]:
    """Time every command that held long enough to be obeyed, or for longer than it may take."""
    swings = _swings(run)
    found = [one for order in run.orders for one in _timed(run, order, swings.get(order.begin))]
    latest = max(found, key=lambda one: one.overdue(LATENESS) if one.case else -np.inf, default=None)
    return [one.asked(LATENESS) if one is latest else one for one in found]


def lost(run: Followed) -> Iterator[Allowance]:
    """Judge that no command is lost, however slow the block, and that no target is left."""
    for order in run.orders:
        since, first = _fulfilled(run, order)
        if since < 0:
            continue
        since = order.begin if order.kind == POSITION else since
        lasts = ((order.end if first is None else first) - since) * run.cycle
        if lasts > NEVER * in_time(run, 0.0):  # else it is not late for any axes
            yield _held(run, order, since, lasts)
        if order.kind == POSITION and first is not None:
            again = to_speeds(run, np.array([own.velocity for own in run.limits]))
            yield from _left(run, (first, order.end), NEVER * in_time(run, again, 2))


def _held(run: Followed, order: TimedOrder, since: int, lasts: float) -> Allowance:
    """Measure for how many s a command held until it was obeyed, or ended."""
    allowed = NEVER * in_time(run, axes_alone(run, order, since), 1 + int(_moves(run, since)))
    if order.kind == POSITION and run.damped[order.begin : order.end].any():
        allowed += run.settle
    return Allowance(order.kind, order.begin, lasts, allowed)


def _timed(run: Followed, order: TimedOrder, swings: Complex | None) -> Iterator[Obeyed]:
    since, first = _fulfilled(run, order)
    moves = since >= 0 and _moves(run, since)
    if since < 0 or (order.kind == STOP and not moves):
        return
    takes = ((order.end if first is None else first) - since) * run.cycle
    own, legs = axes_alone(run, order, since), 0
    if min(own, takes) < run.cycle:
        return  # it is there
    if order.kind == POSITION:
        places = zip(states(run, since), order.values, strict=True)
        legs = max(len(slow_ways(run, k, state, place)) for k, (state, place) in enumerate(places))
    most = bounded(run, own, 1 + legs + (moves and order.kind != STOP))
    one = Obeyed(
        kind=_kind(run, order, since, moves=moves),
        begin=order.begin * run.cycle,
        takes=takes,
        alone=own,
        bounded=most,
        period=run.period,
        state=_words(run, since),
        case=_case(run, order, swings) if since == order.begin and not legs and swings is not None else None,
    )
    if first is not None or one.is_late(LATENESS):
        yield one


def _moves(run: Followed, cycle: int) -> bool:
    return bool(run.velocity[:, max(cycle - 1, 0)].any())


def _kind(run: Followed, order: TimedOrder, since: int, *, moves: bool) -> str:
    if order.kind != POSITION:
        return order.kind
    enabled = max((at for at in run.enabled if at <= since), default=0)
    just = (since - enabled) * run.cycle < JUST_ENABLED * run.period
    return WAY if moves else FIRST if just else POSITION


def _words(run: Followed, cycle: int) -> str:
    own = zip(run.axes, states(run, cycle), strict=True)
    return ", ".join(
        f"{axis.name} at {state.place:.4g} {axis.unit}, {state.velocity:.3g} {axis.unit}/s".lstrip()
        for axis, state in own
    )


def _fulfilled(run: Followed, order: TimedOrder) -> tuple[int, int | None]:
    """Tell from when an order counts, and when it is obeyed; −1 of one that cannot be timed."""
    begin, end = order.begin, order.end
    if order.kind in (QUICK_STOP, DISABLED) or run.gives_up(end) or not min(order.tops) > 0.0:
        return -1, None
    own, since, first = slice(begin, end), begin, end
    match order.kind:
        case "position":
            there = (run.away[own] <= EXACT) & run.stands[own]
        case "velocity":
            wanted = [goal.speed for goal in goals(run, order)]
            reached = [_reached(run, k, w, own) for k, w in enumerate(wanted)]
            first, since = max(reached, key=lambda one: one[0] - one[1])
            there = np.arange(begin, end) >= first
        case _:
            there = run.stands[own] | _damped_at_rest(run)[own]
    obeyed_at = begin + int(np.argmax(there)) if there.any() else None
    damped = np.flatnonzero(run.damped[begin : obeyed_at or end])
    if order.kind == POSITION and len(damped):  # it counts from when the way was last damped
        latest = run.after(in_time(run, axes_alone(run, order, begin), 2) + run.settle)
        since += int(damped[damped < latest].max(initial=0))
    return min(since, end - 1), obeyed_at


def _reached(run: Followed, axis: int, wanted: float, own: slice) -> tuple[int, int]:
    """Tell from when an axis has a velocity, and until when its way's end or a slow interval hindered it."""
    limits, speed = run.limits[axis], abs(wanted)
    position, velocity = run.position[axis, own], run.velocity[axis, own]
    reached = np.abs(velocity - wanted) <= (IN_VELOCITY + run.reserve) * limits.velocity
    first = int(np.argmax(reached)) if reached.any() else len(reached)
    near = speed * bounded(run, to_speeds(run, np.array([speed] * len(run.axes))))
    hindered = (speed > 0.0) & (run.room(axis, position, np.array(wanted)) <= near)
    for zone in run.zones:
        if zone.axis == axis and 0.0 < zone.limit < speed:
            hindered |= np.maximum(zone.low - position, position - zone.high) <= near
    return own.start + first, own.start + int(np.flatnonzero(hindered[:first]).max(initial=0))


def _damped_at_rest(run: Followed) -> Flags:
    """Tell when a load is damped since its axes stood."""
    at_rest = np.zeros(run.cycles, dtype=bool)
    for begin, end in runs_of(run.damped):
        at_rest[begin:end] = run.stands[max(0, begin - 1)]
    return at_rest


def _left(run: Followed, cycles: tuple[int, int], arriving_again: float) -> Iterator[Allowance]:
    """Judge that a target is left but to damp what was measured, and then reached again."""
    first, last = cycles
    damps, away = run.damped, run.away[first:last]
    for begin, end in runs_of(away > max(EXACT, run.wander)):
        damped = np.flatnonzero(damps[first + begin : first + end])
        if damped.size and damped[0] <= 1:
            returns = (end - begin - int(damped[-1])) * run.cycle
            yield Allowance(POSITION, first + begin, returns, arriving_again)
        else:
            yield Allowance("left", first + begin, float(away[begin:end].max()), EXACT)


def _machines(run: Followed) -> SwayModes | None:
    """Give the modes of the machines that a motion's promise is of: as given, and of stated errors."""
    if run.modes is None:
        return None
    rows, own = [0, *([] if run.share else [run.modes.near]), *run.modes.ends], run.modes.modes
    return SwayModes(poles=own.poles[rows], gains=own.gains[rows])


def _swings(run: Followed) -> dict[int, Complex]:
    """Tell what axes have made of these modes before orders, where nothing else has made loads swing."""
    machines = _machines(run)
    starts = [order.begin for order in run.orders if 0 < order.begin < run.unknown_from]
    if machines is None or run.zones or not starts:
        return {}
    moved = machines.moved(run.acceleration, [begin - 1 for begin in starts], run.cycle)
    return dict(zip(starts, moved, strict=True))


def _case(run: Followed, order: TimedOrder, swings: Complex) -> ComparedCommand | None:
    """Put a command to the linear programme, by what swings as it comes."""
    machines, own = _machines(run), []
    assert machines is not None
    limits, targets = limits_of(run, order), goals(run, order)
    for axis, state in enumerate(states(run, order.begin, swings)):
        gains = np.abs(machines.gains[:, :, axis]).max(axis=1)
        most = 2.0 * limits[axis].acceleration * gains[0] / machines.poles[0].imag
        shown = np.flatnonzero(most > UNSHOWN * run.sway_limit)
        if not len(shown):
            continue
        (low, high), margin = run.limits[axis].targets, run.limits[axis].margin
        promise = Promise(
            poles=machines.poles[:, shown],
            gains=gains[:, shown],
            exact=1 if run.share else 2,
            left=run.share or run.sway_limit,
            limits=limits[axis],
            travel=(low - margin, high + margin),
        )
        own.append((promise, attrs.evolve(state, moved=state.moved[:, shown]), targets[axis]))
    return ComparedCommand(axes=own) if own else None
