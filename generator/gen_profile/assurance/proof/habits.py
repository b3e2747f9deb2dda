"""How operators and controllers give commands: again and again, by taps, in a rhythm, on second thoughts."""

from collections.abc import Callable, Iterator, Mapping
from math import inf, nan
from typing import Any

import attrs

from gen_profile.assurance.proof.orders import ZONES
from gen_profile.planner.commands import Command

REPEATED = 16  # commands
CREEPING = 40
LONGEST_WAIT = 0.6  # s, from one of them to the next
SOON = 100  # cycles, in which a mind is changed
STOPS = 4
HELD = 0.15  # s, at most, in which the last good ones are held in place of values that cannot be
WRONG = 0.5  # s, at least, in which values count that cannot be
OUTSIDE = 10.0  # m (or rad) beyond the targets
FAR = 1e6  # m (or rad)
HAND = 0.2  # of the greatest velocity, by which an axis is moved by hand
MEASURED = 0.5  # share of the take-overs in which position and velocity are measured, not setpoints
NOISY = (1e-3, 0.3)  # of the greatest velocity, by which a measured one is off
OLD = 0.02  # s, at most, that a measured position is old
SPIKE = 5.0  # times the greatest velocity, in one cycle
OFTEN = 3  # so often some habits are taken

GOLDEN_RATIO = 0.6180339887  # steps by it spread evenly over 0 to 1, however many there are


@attrs.frozen(kw_only=True)
class Change:
    """Inputs that differ for some time from what the commands say.

    Attributes
    ----------
    time, lasts : float
        s; less than a cycle is one.
    inputs : mapping of str to float
        By the block's names.
    noise : mapping of str to float
        By how much inputs are off at most, in each cycle by another amount.
    """

    time: float
    lasts: float
    inputs: Mapping[str, float]
    noise: Mapping[str, float] = attrs.field(factory=dict)


Manner = tuple[Command | Change, ...]  # what becomes of a command: commands in its place, and changes


def commands_in(manner: Manner) -> tuple[Command, ...]:
    """Leave out what is no command."""
    return tuple(one for one in manner if isinstance(one, Command))


def changes_in(manner: Manner) -> tuple[Change, ...]:
    """Leave out what is no change."""
    return tuple(one for one in manner if isinstance(one, Change))


@attrs.frozen(kw_only=True)
class Surroundings:
    """What a manner depends on.

    Attributes
    ----------
    cycle, period : float
        s, of the task and of the slowest swing.
    targets, speeds : tuple of (float, float)
        Ends of each axis's targets, and of its velocities.
    suffixes : tuple of str
        Of the names of each axis's inputs.
    live : mapping of str to (float, float)
        Ranges of the live parameters.
    hoists : bool
        Whether they change on the way.
    zones, sensors : bool
        Whether the block knows of any.
    other_stops : float or None
        `bPromptStop` for stops of the kind that is not usual; None where there is no such input.
    rough : int
        How many of the habits may be taken that leave the load swinging.
    """

    cycle: float
    period: float
    targets: tuple[tuple[float, float], ...]
    speeds: tuple[tuple[float, float], ...]
    suffixes: tuple[str, ...]
    live: Mapping[str, tuple[float, float]]
    hoists: bool
    zones: bool
    sensors: bool
    other_stops: float | None
    rough: int

    def zone(self, axis: int, place: float, width: float, number: int, *, slow: bool) -> dict[str, float]:
        """Choose an interval of an axis that is blocked, or slow."""
        (low, high), (_, fastest) = self.targets[axis], self.speeds[axis]
        kind, end = "Slow" if slow else "Blocked", f"{self.suffixes[axis]}[{number}]"
        begin = low + place * (high - low)
        until = begin + (0.02 + 0.15 * width) * (high - low)
        limit = {f"aSlowLimit{end}": fastest * (0.2 + 0.6 * width)} if slow else {}
        return {f"a{kind}Low{end}": begin, f"a{kind}High{end}": until, **limit}

    def target(self, fraction: float) -> tuple[float, ...]:
        """Choose a place."""
        ends = enumerate(self.targets)
        return tuple(low + _fraction(fraction, k) * (high - low) for k, (low, high) in ends)

    def speed(self, fraction: float) -> tuple[float, ...]:
        """Choose a velocity of at least a third of the greatest."""
        return tuple(
            (high if _fraction(fraction, k) > 0.5 else low) * (0.3 + 0.7 * _fraction(fraction, k + 1))
            for k, (low, high) in enumerate(self.speeds)
        )

    @property
    def neutral(self) -> tuple[float, ...]:
        """A stick that is let go."""
        return (0.0,) * len(self.speeds)

    def part(self, fraction: float, number: int) -> float:
        """Choose a part of a period, in s."""
        return self.period * _fraction(fraction, number)

    def brief(self, fraction: float, periods: float) -> float:
        """Choose a time in s, from a cycle to so many periods."""
        return _log(self.cycle, periods * self.period, fraction)


def habit(command: Command, which: float, how: float, around: Surroundings) -> Manner:
    """Give a command as it is, in half of all cases, or by one of the habits.

    Parameters
    ----------
    command : Command
    which, how : float
        Shares from 0 to 1.
    around : Surroundings
    """
    if which < 0.5:
        return (command,)
    rough = [
        *ROUGH[: around.rough],
        *[_otherwise_stopped] * (around.other_stops is not None and around.rough > 0),
    ]
    habits = [*GENTLE, *[_fenced] * around.zones * OFTEN, *rough * OFTEN]
    return habits[min(int(2.0 * len(habits) * (which - 0.5)), len(habits) - 1)](command, how, around)


def between(ends: tuple[float, float], fraction: float) -> float:
    """Choose a value by its share of the way from one end to the other."""
    low, high = ends
    return float(low + fraction * (high - low)) if fraction < 1.0 else high


def widened(fraction: float, margin: float = 0.05) -> float:
    """Stretch, so that both ends are chosen with a share of `margin` each."""
    return min(max((fraction - margin) / (1.0 - 2.0 * margin), 0.0), 1.0)


def _fraction(fraction: float, number: int) -> float:
    return (fraction + GOLDEN_RATIO * (number + 1)) % 1.0


def _log(low: float, high: float, fraction: float) -> float:
    return float(low * (high / low) ** fraction)


def _towards(command: Command, fraction: float, around: Surroundings) -> Command:
    """Give the command, or one to a position where it is another."""
    if command.command == "position":
        return command
    return attrs.evolve(command, command="position", values=around.target(fraction))


def _followed(first: Command, after: float, **changes: Any) -> Command:
    return attrs.evolve(first, time=first.time + after, **changes)


def _stopped(first: Command, after: float, command: str = "stop") -> Command:
    return _followed(first, after, command=command, values=())


def _stick(command: Command, how: float, around: Surroundings) -> Command:
    return attrs.evolve(command, command="velocity", values=around.speed(how))


def _change(command: Command, after: float, lasts: float, inputs: Mapping[str, float]) -> Change:
    return Change(time=command.time + after, lasts=lasts, inputs=inputs)


def _inwards(value: float, ends: tuple[float, float]) -> float:
    """Tell by its sign which way the middle is."""
    return 1.0 if value < 0.5 * (ends[0] + ends[1]) else -1.0


def _again(command: Command, how: float, around: Surroundings) -> Manner:
    """Give the same target cyclically, as a panel does."""
    wait = _log(2.0 * around.cycle, LONGEST_WAIT, how)
    first = _towards(command, how, around)
    return tuple(_followed(first, k * wait) for k in range(REPEATED))


def _creeping(command: Command, how: float, around: Surroundings) -> Manner:
    """Let a target creep towards the middle, every few cycles."""
    wait, first = _log(2.0 * around.cycle, 20.0 * around.cycle, how), _towards(command, how, around)
    step = _log(5e-6, 1e-3, _fraction(how, 5))

    def crept(k: int) -> tuple[float, ...]:
        return tuple(
            min(max(value + k * step * (high - low) * _inwards(value, (low, high)), low), high)
            for value, (low, high) in zip(first.values, around.targets, strict=True)
        )

    return tuple(_followed(first, k * wait, values=crept(k)) for k in range(CREEPING))


def _tap(command: Command, how: float, around: Surroundings) -> Manner:
    """Tap the stick."""
    stick = _stick(command, how, around)
    return stick, _followed(stick, around.brief(how, 0.5), values=around.neutral)


def _reversal(command: Command, how: float, around: Surroundings) -> Manner:
    """Throw the stick over for a short time."""
    stick, back = _stick(command, how, around), around.period * (0.3 + _fraction(how, 4))
    over = _followed(stick, back, values=tuple(-value for value in stick.values))
    return stick, over, _followed(stick, back + around.brief(how, 0.5))


def _changed_mind(command: Command, how: float, around: Surroundings) -> Manner:
    """Command something else before the first was planned."""
    wait, first = _log(around.cycle, SOON * around.cycle, how), _towards(command, how, around)
    others = (
        ("position", around.target(_fraction(how, 6))),
        ("stop", ()),
        ("velocity", around.speed(how)),
        ("position", first.values),
    )
    commands = [
        _followed(first, (k + 1) * wait, command=kind, values=values)
        for k, (kind, values) in enumerate(others)
    ]
    return (first, *commands)[: 2 + int(3.0 * _fraction(how, 7))]


def _stop_and_go(command: Command, how: float, around: Surroundings) -> Manner:
    """Stop on the way to one target, by a button or a stick at 0, and go on."""
    wait, first = _log(2.0 * around.cycle, around.period, how), _towards(command, how, around)
    kind, values = ("stop", ()) if _fraction(how, 3) < 0.5 else ("velocity", around.neutral)
    commands = [first]
    for k in range(STOPS):
        commands.append(_followed(first, (2 * k + 1) * wait, command=kind, values=values))
        commands.append(_followed(first, (2 * k + 2) * wait))
    return tuple(commands)


def _slowed_on_the_way(command: Command, how: float, around: Surroundings) -> Manner:
    """Change override or velocity limit while the axis moves, without a new command."""
    later, lasts = 3.0 * around.period * _fraction(how, 3), around.period * (1.0 + 6.0 * _fraction(how, 4))
    fraction = 0.3 + 0.5 * how
    inputs = {"rOverride": fraction}
    if _fraction(how, 5) < 0.5:
        limited = zip(around.suffixes, around.speeds, strict=True)
        inputs = {f"fVelocityLimit{end}": fraction * most for end, (_, most) in limited}
    return command, _followed(command, later + lasts), _change(command, later, lasts, inputs)


def _patient(command: Command, how: float, around: Surroundings) -> Manner:
    """Wait for what a command comes to."""
    return command, _followed(command, around.period * (3.0 + 7.0 * how))


def _held(command: Command, how: float, around: Surroundings) -> Manner:
    """Hold by an override of 0, tap the stick then or not, and go on."""
    later, lasts = around.part(how, 3), around.brief(how, 3.0)
    tap = _followed(_stick(command, how, around), later + 0.2 * lasts)
    taps = (tap, _followed(tap, 0.6 * lasts, values=around.neutral)) if _fraction(how, 4) > 0.5 else ()
    return command, *taps, _change(command, later, lasts, {"rOverride": 0.0})


def _wild(command: Command, how: float, around: Surroundings) -> Manner:
    """Give shortly a live parameter, override or velocity limit that cannot be, or a spike for one cycle."""
    lasts = _log(around.cycle, HELD, _fraction(how, 9))
    values = [("rOverride", nan, lasts), ("rOverride", 1.5, lasts)]
    values += [(f"fVelocityLimit{around.suffixes[0]}", -1.0, lasts)]
    for name, (low, high) in around.live.items():
        values += [(f"f{name}", wild, lasts) for wild in (nan, inf, 0.9 * low - 1.0, 1.001 * high)]
        values += [(f"f{name}", low + _fraction(how, 8) * (high - low), 0.0)] * 2
    name, wild, lasts = values[int(how * len(values)) % len(values)]
    return command, _change(command, around.part(how, 3), lasts, {name: wild})


def _wrong(command: Command, how: float, around: Surroundings) -> Manner:
    """Give a live parameter, override or velocity limit that cannot be for long; acknowledge the error."""
    later, lasts = around.part(how, 3), WRONG * (1.0 + _fraction(how, 4))
    limit = f"fVelocityLimit{around.suffixes[-1]}"
    values = [("rOverride", -0.1), ("rOverride", 1.01), (limit, nan), (limit, -1e-3)]
    for name, (low, high) in around.live.items() if not around.hoists else ():  # then the promise is lost
        values += [(f"f{name}", wrong) for wrong in (0.99 * low - 1e-3, 1.01 * high, nan)]
    name, wrong = values[int(how * len(values)) % len(values)]
    reset = _change(command, later + lasts + 2.0 * around.cycle, 0.0, {"bReset": 1.0})
    commands = [command, _followed(command, later + lasts + 10.0 * around.cycle)]
    if command.command == "velocity":  # a stick must have been at 0 before it counts again
        wait = 0.3 * around.period
        commands.append(_followed(commands[-1], wait, values=around.neutral))
        commands.append(_followed(commands[1], 2.0 * wait))
    return *commands, _change(command, later, lasts, {name: wrong}), reset


def _correction(command: Command, how: float, around: Surroundings) -> Manner:
    """Give the last axis alone another target, not far away, on the way or after the arrival."""
    first, (low, high) = _towards(command, how, around), around.targets[-1]
    *others, last = first.values
    step = _log(1e-4, 0.1, _fraction(how, 3)) * (high - low) * _inwards(last, (low, high))
    wait = around.period * (1.0 + 8.0 * _fraction(how, 4))
    return first, _followed(first, wait, values=(*others, last + step))


def _refused(command: Command, how: float, around: Surroundings) -> Manner:
    """Give a target that is none, on the way to another."""
    first, wait = _towards(command, how, around), around.part(how, 3)
    low, high = around.targets[-1]
    wrong = (*first.values[:-1], (nan, inf, low - OUTSIDE, high + OUTSIDE)[int(4.0 * how) % 4])
    return first, _followed(first, wait, values=wrong), _followed(first, wait + 0.5 * around.period)


def _denied(command: Command, how: float, around: Surroundings) -> Manner:
    """Command a position while the axis is to stop."""
    stop = _stopped(command, around.period * (0.2 + _fraction(how, 3)))
    edge = _change(stop, around.part(how, 4), around.brief(how, 0.3), {"bExecute": 1.0})
    return command, stop, _followed(stop, 1.5 * around.period), edge


def _mistimed(command: Command, how: float, around: Surroundings) -> Manner:
    """Call the block in another task for a while."""
    later, lasts = around.part(how, 3), around.brief(how, 0.5)
    wrong = _change(command, later, lasts, {"fCycleTime": around.cycle * (0.5 if how < 0.5 else 1.01)})
    return command, _stopped(command, later + lasts + 10.0 * around.cycle), wrong


def _strayed(command: Command, how: float, around: Surroundings) -> Manner:
    """Let the last axis be elsewhere than its setpoint: with a limit of that, and before without one."""
    first, suffix, limit = _towards(command, how, around), around.suffixes[-1], 0.1 + how
    begin, before = around.period * (0.2 + _fraction(how, 3)), 0.1 * around.period
    places = (nan, -FAR, FAR, -1.01 * limit, 1.01 * limit, 0.99 * limit)
    away = {f"fActPosition{suffix}": places[int(6.0 * how) % 6]}
    most, within = {f"fFollowingLimit{suffix}": limit}, around.period * (1.0 + _fraction(how, 5))
    return (
        first,
        _stopped(first, begin + within),
        _change(first, begin - before, before, away),
        _change(first, begin, around.part(how, 4), away | most),
        _change(first, begin + within - 4.0 * around.cycle, 0.0, {"bReset": 1.0}),
    )


def _braked(command: Command, how: float, around: Surroundings) -> Manner:
    """Brake at once, or as a stop is planned; and say that the load hangs still, true or not."""
    first, wait = _towards(command, how, around), around.period * (0.3 + _fraction(how, 3))
    rest_report = _change(first, 2.5 * wait, 0.0, {"bLoadAtRest": 1.0})
    before = _log(around.cycle, min(SOON * around.cycle, wait), _fraction(how, 4))
    stop = [_stopped(first, wait - before)] * (how < 0.5)
    commands = first, *stop, _stopped(first, wait, "quick-stop"), _stopped(first, 3.0 * wait)
    return commands if around.hoists else (*commands, rest_report)  # one that calms by a model believes that


def _otherwise_stopped(command: Command, how: float, around: Surroundings) -> Manner:
    """Stop by button or stick, promptly or not, which is chosen before, as it stops, or for a moment."""
    first, wait = _towards(command, how, around), around.part(how, 3) + 0.5 * around.period * (how > 0.3)
    first = _stick(command, how, around) if _fraction(how, 6) < 0.4 else first
    kind, values = ("velocity", around.neutral) if first.command == "velocity" else ("stop", ())
    stop = _followed(first, wait, command=kind, values=values)
    lasts = around.brief(_fraction(how, 4), 4.0)
    chosen = max(-first.time, wait - lasts * _fraction(how, 5))
    inputs = {"bPromptStop": around.other_stops or 0.0}
    again = _followed(first, wait + around.period * (0.3 + 2.0 * _fraction(how, 7)))
    return first, stop, again, _change(first, chosen, 2.0 * lasts, inputs)


def _released(command: Command, how: float, around: Surroundings) -> Manner:
    """Drop bExecute, on the way or long before it rises again."""
    lasts = around.brief(_fraction(how, 3), 3.0)
    dropped = _change(command, 5.0 * around.period * how, lasts, {"bExecute": 0.0})
    return _towards(command, how, around), dropped


def _contradicted(command: Command, how: float, around: Surroundings) -> Manner:
    """Give a stick that is none, or a position while it is deflected; then let it go."""
    stick, gone = _stick(command, how, around), 0.8 * around.period
    wrong = (
        {"bExecute": 1.0} if how < 0.5 else {f"fVelocityCommand{around.suffixes[-1]}": (nan, inf)[how > 0.75]}
    )
    return (
        stick,
        _followed(stick, gone, values=around.neutral),
        _followed(stick, 1.2 * gone),
        _change(stick, around.part(how, 4), around.brief(how, 0.3), wrong),
    )


def _fenced(command: Command, how: float, around: Surroundings) -> Manner:
    """Block an interval for some time, or make it slow, wherever the axis is, or where it is to go."""
    later, lasts = around.part(how, 3), around.period * (2.0 + 6.0 * _fraction(how, 4))
    aims = command.command == "position" and how > 0.5
    k = int((32.0 if aims else 1.0) * how) % len(around.suffixes)
    (low, high), place = around.targets[k], _fraction(how, 5)
    if aims:
        place = max(0.0, (command.values[k] - low) / (high - low) - 0.1 * _fraction(how, 8))
    zone = around.zone(k, place, _fraction(how, 6), ZONES - 1, slow=_fraction(how, 7) < 0.5)
    reset = _change(command, later + lasts + 2.0 * around.cycle, 0.0, {"bReset": 1.0})
    again = _followed(command, later + lasts + 0.5 * around.period)
    return command, again, _change(command, later, lasts, zone), reset


def _disabled(command: Command, how: float, around: Surroundings) -> Manner:
    """Drop bEnable, mostly on the way; let the axis stand, or move it by hand, until it is set again."""
    later, lasts = around.part(how, 3), around.brief(_fraction(how, 4), 1.0)
    taken = dict[str, float]()
    if how < 0.6:
        for k, ((_, most), suffix) in enumerate(zip(around.speeds, around.suffixes, strict=True)):
            speed = most * HAND * max(0.0, 1.5 * _fraction(how, 5 + k) - 0.5) * (1.0 if how < 0.45 else -1.0)
            taken |= {f"fActPosition{suffix}": speed * around.cycle, f"fActVelocity{suffix}": speed}
    goes = how > 0.3  # still, as it is taken over
    nowhere = how > 0.8 and not around.hoists  # and so not taken over yet
    if nowhere:
        name, k = "fActPosition" if how < 0.9 else "fActVelocity", int(100.0 * how) % len(around.suffixes)
        taken = {f"{name}{around.suffixes[k]}": nan} if how < 0.95 else {"fCycleTime": 0.5 * around.cycle}
    disabled = lasts + 4.0 * around.cycle * (not goes)
    manner = (
        command,
        _followed(command, later + lasts + around.period),
        _change(command, later, disabled, {"bEnable": 0.0}),
        _change(command, later, lasts + 1.5 * around.cycle * goes, taken),
        *(() if nowhere else _measured(command, how, around, later=later, lasts=disabled)),
        _change(command, later + lasts + 3.0 * around.period, 0.0, {"bLoadAtRest": 1.0}),
    )
    return manner[:-1] if around.hoists else manner


def _measured(
    command: Command, how: float, around: Surroundings, *, later: float, lasts: float
) -> Iterator[Change]:
    """Measure where a disabled axis is, and how fast: with noise, old values, a step and a spike."""
    if _fraction(how, 10) > MEASURED:
        return
    size, old, fault = _log(*NOISY, _fraction(how, 11)), OLD * _fraction(how, 12), _fraction(how, 13)
    for (_, most), suffix in zip(around.speeds, around.suffixes, strict=True):
        noise = {f"fActVelocity{suffix}": size * most, f"fActPosition{suffix}": size * most * old}
        yield attrs.evolve(_change(command, later, lasts + 1.5 * around.cycle, {}), noise=noise)
        if fault < 1.0 / 3.0:
            step = {f"fActPosition{suffix}": most * old}
            yield _change(command, later + lasts * 3.0 * fault, 0.0, step)
        elif fault < 2.0 / 3.0:
            yield _change(command, later + lasts, 0.0, {f"fActVelocity{suffix}": SPIKE * most})


def _respooled(command: Command, how: float, around: Surroundings) -> Manner:
    """Tell another live parameter on the way, faster than may be, and later that of before, or not."""
    later, lasts = around.part(how, 3), _log(0.1, around.period, _fraction(how, 4))
    if how > 0.3:  # for good; some together with the command
        later, lasts = later * (how < 0.6), inf
    times = [later]
    if how > 0.85:  # again and again
        lasts = 0.05 * around.period
        times = [k * lasts for k in range(CREEPING)]
    shares = [_fraction(how, 5) * (1.0 - k / CREEPING) for k in range(len(times))]
    given = [{f"f{name}": between(ends, share) for name, ends in around.live.items()} for share in shares]
    changes = [_change(command, time, lasts, inputs) for time, inputs in zip(times, given, strict=True)]
    return (command, *changes) if around.live and not around.hoists else (command,)


Habit = Callable[[Command, float, Surroundings], Manner]
GENTLE: tuple[Habit, ...] = (
    _patient,
    _patient,
    _again,
    _creeping,
    _tap,
    _reversal,
    _changed_mind,
    _stop_and_go,
    _slowed_on_the_way,
    _held,
    _wild,
    _wrong,
    _correction,
    _refused,
    _denied,
    _mistimed,
    _released,
    _contradicted,
)
ROUGH: tuple[Habit, ...] = (_strayed, _braked, _disabled, _respooled)  # the load swings then
BRAKING = 2  # the first of these
