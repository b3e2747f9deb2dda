"""Rare inputs taken through every state of a block, so that each proof has tried them there.

A tour leads the axes to a target, by a stick and to a stop, and gives one rare input in each of these states,
and as the block is switched on. Of histories in which the load may be left swinging it goes on to a quick
stop, and through bEnable. They are dealt out in turn: random draws alone would miss some.
"""

from collections.abc import Callable, Iterator, Sequence
from math import inf, nan

import attrs
import numpy as np

from gen_profile.assurance.proof.habits import HELD, Change, Manner, Surroundings, between
from gen_profile.motion.profile import Array
from gen_profile.planner.commands import Command
from gen_profile.planner.stated import LEAST_RATE

BEGUN = 0.6  # s, and as many of the periods below, after which a command has led to a motion
PART = 0.3  # periods
MILLIONTH = 0.9e-6  # of fCycleTime, by which it may be off
MANY = 12  # cycles in a row with another command each
AT_ONCE = 2  # cycles after the block is switched on

Event = Callable[[float, Surroundings], Iterator[Change]]


def _given(**inputs: float) -> Change:
    return Change(time=0.0, lasts=0.0, inputs=inputs)


def _each(names: Sequence[str], value: float, lasts: float = 0.0) -> Change:
    return Change(time=0.0, lasts=lasts, inputs=dict.fromkeys(names, value))


def _of(name: str, around: Surroundings) -> list[str]:
    return [f"{name}{suffix}" for suffix in around.suffixes]


def _live(around: Surroundings, share: float) -> dict[str, float]:
    """Choose live parameters, each of another share of its range."""
    shares = enumerate(around.live.items())
    return {f"f{name}": between(ends, (share + 0.3 * k) % 1.0) for k, (name, ends) in shares}


def _reset(how: float, around: Surroundings) -> Iterator[Change]:
    yield _given(bReset=1.0)


def _a_millionth_off(how: float, around: Surroundings) -> Iterator[Change]:
    cycle = around.cycle * (1.0 + MILLIONTH * (1.0 if how < 0.5 else -1.0))
    yield attrs.evolve(_given(fCycleTime=cycle), lasts=0.5 * PART * around.period)


def _two_cycles_long(how: float, around: Surroundings) -> Iterator[Change]:
    yield _given(fCycleTime=2.0 * around.cycle)


def _no_override(how: float, around: Surroundings) -> Iterator[Change]:
    yield attrs.evolve(_given(rOverride=(nan, -0.1, 1.5)[int(3.0 * how)]), lasts=how * HELD)


def _no_limit(how: float, around: Surroundings) -> Iterator[Change]:
    yield _each(_of("fVelocityLimit", around), (nan, -1e-3)[int(2.0 * how)], how * HELD)


def _no_live(how: float, around: Surroundings) -> Iterator[Change]:
    yield _each([f"f{name}" for name in around.live], (nan, inf, -inf)[int(3.0 * how)], how * HELD)


def _spike(how: float, around: Surroundings) -> Iterator[Change]:
    yield _given(**_live(around, how))


def _exchanged(how: float, around: Surroundings) -> Iterator[Change]:
    names = [f"f{name}" for name in around.live]
    values = [between(ends, how) for ends in around.live.values()]
    yield Change(time=0.0, lasts=0.0, inputs=dict(zip(names, values[1:] + values[:1], strict=True)))


def _noise(how: float, around: Surroundings) -> Iterator[Change]:
    """Let live parameters be off by less than counts as a change."""
    noise = {f"f{name}": 0.3 * LEAST_RATE * high for name, (_, high) in around.live.items()}
    yield attrs.evolve(_given(), lasts=MANY * around.cycle, noise=noise)


def _targets_in_every_cycle(how: float, around: Surroundings) -> Iterator[Change]:
    for k in range(MANY):
        targets = dict(zip(_of("fTarget", around), around.target(how + 0.01 * k), strict=True))
        yield Change(time=k * around.cycle, lasts=0.0, inputs={"bExecute": k % 2.0, **targets})


def _sticks_in_every_cycle(how: float, around: Surroundings) -> Iterator[Change]:
    for k in range(MANY):
        speeds = dict(zip(_of("fVelocityCommand", around), around.speed(how + 0.1 * k), strict=True))
        yield Change(time=k * around.cycle, lasts=0.0, inputs={"bVelocity": 1.0, **speeds})


def _other_live(how: float, around: Surroundings) -> Iterator[Change]:
    yield attrs.evolve(_given(**_live(around, how)), lasts=inf if how < 0.5 else PART * around.period)


def _strays(how: float, around: Surroundings) -> Iterator[Change]:
    yield _each(_of("fFollowingLimit", around), 0.1)
    yield _each(_of("fActPosition", around), (nan, 0.11, -0.11)[int(3.0 * how)])
    yield Change(time=2.0 * around.cycle, lasts=0.0, inputs={"bReset": 1.0})


def _quick_stop(how: float, around: Surroundings) -> Iterator[Change]:
    yield _given(bQuickStop=1.0)


def _disabled(how: float, around: Surroundings) -> Iterator[Change]:
    yield attrs.evolve(_given(bEnable=0.0), lasts=how * PART * around.period)


def _other_stops(how: float, around: Surroundings) -> Iterator[Change]:
    inputs = {"bPromptStop": around.other_stops or 0.0}
    yield Change(time=0.0, lasts=2.0 * how * PART * around.period, inputs=inputs)


def _load_at_rest(how: float, around: Surroundings) -> Iterator[Change]:
    yield _given(bLoadAtRest=1.0)


GENTLE: tuple[Event, ...] = (
    _reset,
    _a_millionth_off,
    _two_cycles_long,
    _no_override,
    _no_limit,
    _targets_in_every_cycle,
    _sticks_in_every_cycle,
)
LIVE: tuple[Event, ...] = (_no_live, _spike, _noise, _exchanged)
BRAKING: tuple[Event, ...] = (_quick_stop, _strays)  # the load swings then
ROUGH: tuple[Event, ...] = (_disabled, _load_at_rest, _other_live)
ALSO: tuple[Event, ...] = (_reset, _two_cycles_long)  # whose quick stops and bEnable count, too
POWERED_UP = ("bExecute", "bVelocity", "bStop", "bQuickStop", "bReset")


def events(around: Surroundings) -> tuple[Event, ...]:
    """List the rare inputs that tours of a history may be of."""
    live = () if around.hoists or not around.live else LIVE
    if not around.rough:
        return (*GENTLE, *live)
    others = () if around.rough == len(BRAKING) else ROUGH[: 1 if around.hoists else 3 if around.live else 2]
    if others and around.sensors:  # the rest comes in histories with a sensor
        return (*others, *ALSO)
    stops = (_other_stops,) * (around.other_stops is not None)
    return (*BRAKING, *others, *ALSO, *live[:1], *stops)


def tour(choice: float, time: float, around: Surroundings) -> Manner:
    """Give one rare input in every state, from a time on.

    Parameters
    ----------
    choice : float
        Share from 0 to 1, of which input and how.
    time : float
        s.
    around : Surroundings
    """
    among = events(around)
    event, how = among[min(int(choice * len(among)), len(among) - 1)], choice * len(among) % 1.0
    part, given, at = BEGUN + PART * around.period, list[Command | Change](), [AT_ONCE * around.cycle]
    for command, values in _steps(how, around):
        given.append(Command(time=time, command=command, values=values))
        brakes = command in ("stop", "quick-stop")
        at.append(time + (AT_ONCE * around.cycle if brakes else part))
        time += part if brakes else 1.5 * part
    if event in (*BRAKING, *ROUGH):  # nothing that follows is as it was led to
        at = [[*at[:4], at[-1]][int(5.0 * how)]]
    elif around.rough > len(BRAKING):
        at.append(time + 0.5 * part)
    if around.rough > len(BRAKING):
        given.append(Change(time=time, lasts=part, inputs={"bEnable": 0.0}))
        time += 2.0 * part
    given.append(Command(time=time, command="stop"))
    given += [attrs.evolve(one, time=begin + one.time) for begin in at for one in event(how, around)]
    if how > 0.5 and not around.rough:  # switched on as inputs are set already
        set_inputs = {name: 1.0 for k, name in enumerate(POWERED_UP) if int(how * 64.0) >> k & 1}
        given.append(Change(time=0.0, lasts=AT_ONCE * around.cycle, inputs=set_inputs))
    return tuple(given)


def _steps(how: float, around: Surroundings) -> list[tuple[str, tuple[float, ...]]]:
    """Lead to a target, back by a stick, and to a stop; in rough tours on to a quick stop."""
    first, middle = around.target(how), [0.5 * (low + high) for low, high in around.targets]
    back = zip(around.speed(how), first, middle, strict=True)
    speeds = tuple(-abs(speed) if place > half else abs(speed) for speed, place, half in back)
    steps: list[tuple[str, tuple[float, ...]]] = [("position", first), ("velocity", speeds), ("stop", ())]
    second = tuple(low + high - x for x, (low, high) in zip(first, around.targets, strict=True))
    return [*steps, ("position", second), ("quick-stop", ())] if around.rough else steps


def dealt_out(classes: Array) -> Array:
    """Deal out choices of tours evenly within each class of histories, (histories,)."""
    found = np.zeros(len(classes))
    for own in np.unique(classes):
        among = np.flatnonzero(classes == own)
        found[among] = (np.arange(len(among)) + 0.5) / len(among)
    return found
