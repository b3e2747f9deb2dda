"""Histories of commands that a planner block is proved on.

A history is made of *choices*, shares from 0 to 1: where it starts, live parameters, how much the machine
differs from them, what is commanded when, and how ropes change on the way. So histories are drawn as a Latin
hypercube, corners are choices of 0 and 1, and a search moves through the same cube.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import islice, product
from math import ceil, inf, isfinite
from typing import Any, Self

import attrs
import numpy as np

from gen_profile.assurance.proof import habits
from gen_profile.assurance.proof.habits import GOLDEN_RATIO, Change, Manner, Surroundings, between, widened
from gen_profile.assurance.proof.rhythms import rhythm
from gen_profile.assurance.proof.ropes import LEGS, PER_LEG, hoisted_ropes
from gen_profile.assurance.proof.sensing import CHOICES, SensedHistory, sensed
from gen_profile.assurance.proof.tours import dealt_out, tour
from gen_profile.dynamics.evaluation import phrases
from gen_profile.dynamics.problem.hoisted_plant import hoisted
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.planner.commands import Command
from gen_profile.planner.directions import planned_axes
from gen_profile.planner.interface import BlockAxis
from gen_profile.planner.stated import target_range
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec

COMMANDED = 40.0  # s in which commands come; slow machines take longer, see PERIODS
PERIODS = 5.0  # of the slowest mode, which they come in at least
SOONEST = 0.5  # s until the first command, at most
SHORTEST, LONGEST = 0.02, 3.0  # periods between two commands
SHIFT, PAUSE = 8.0 * 3600.0, 30.0  # s; and periods between two commands of it
MOST_COMMANDS = 16
MANNERS = ((0.85, 0.05, 0.1), (0.05, 0.9, 0.05), (0.4, 0.4, 0.2))  # shares of positions, a stick, and stops
MOST_CORNERS = 10  # ranges up to which all corners are tried where histories are enough
CORNERS_OF_ERRORS, SHAPES = 8, 5  # to which what is left is followed; machines on the way to each
SLOWEST = 0.3  # override, and velocity limit as a share of the machine's
OUTSIDE = 0.03  # share of the histories that begin before the travel, or behind it, by as much of it at most
ROUGH_SHARE = 0.35  # share of the histories in which the load may be left swinging
ALONE = 0.1  # half the share of stick commands that leave one of several axes alone
HOISTED_AFTER, RESTS = 0.4, 8.0  # share of the rhythms after which ropes change; and periods after the stop
HOISTED_ON = 2.0  # periods after the last command in which it still may

Machine = tuple[dict[str, float], list[float]]  # parameters, and places of the axes

_PER_COMMAND = 2  # choices: which, how long; its values; and how slowly, where that is varied
_PER_HABIT = 2  # choices: which, and how


@attrs.frozen(kw_only=True)
class History:
    """Commands to a block, and the machine that follows it.

    Attributes
    ----------
    live : mapping of str to float
        What the block is given of the live parameters.
    parameters : mapping of str to float
        Of the machine.
    places : tuple of float
        Where the machine's axes stand at first, in m (or rad).
    commands : tuple of Command
    axes : mapping of int to BlockAxis
        Which of the machine's axes the block plans.
    hoisting : mapping of str to tuple of (float, float)
        What the block is given of live parameters that change on the way: corners (time in s, value) of a
        line, which begins with the value in `live` and ends constant.
    changes : tuple of Change
        Of inputs, beside the commands.
    sensed : SensedHistory or None
        What the block's sensor meets; without it there is no news of any.
    stops : str
        How axes stop where that is not given: "quiet" or "prompt".
    """

    live: Mapping[str, float]
    parameters: Mapping[str, float]
    places: tuple[float, ...]
    commands: tuple[Command, ...]
    axes: Mapping[int, BlockAxis] = {0: BlockAxis(name="")}
    hoisting: Mapping[str, tuple[tuple[float, float], ...]] = attrs.field(factory=dict)
    changes: tuple[Change, ...] = ()
    sensed: SensedHistory | None = None
    stops: str = "quiet"

    @property
    def starts(self) -> dict[str, float]:
        """Where the planned axes stand at first, by names with their units."""
        return {f"{axis.prefix}start_{axis.unit}": self.places[number] for number, axis in self.axes.items()}

    @property
    def start_words(self) -> str:
        """Where they stand, in words."""
        return ", ".join(
            f"{axis.name} {self.places[number]:.4g} {axis.unit}".lstrip()
            for number, axis in self.axes.items()
        )

    def reported(self, units: Mapping[str, str]) -> str:
        """Say what the block is given of live parameters, whose units are given by name."""
        return ", ".join(
            f"{name} {phrases.number(value)} {units[name]}" + " at first" * (name in self.hoisting)
            for name, value in self.live.items()
        )

    def described(self, command: Command) -> dict[str, Any]:
        """Nest plain values of a command for JSON."""
        axes = list(self.axes.values())
        values = command.values or (0.0,) * len(axes)
        limits = command.velocity_limits or (0.0,) * len(axes)
        return {
            "time_s": command.time,
            "command": command.command,
            **{axis.of("value"): written(value) for axis, value in zip(axes, values, strict=True)},
            "override": command.override,
            **{
                f"{axis.prefix}velocity_limit_{axis.unit}_per_s": limit
                for axis, limit in zip(axes, limits, strict=True)
            },
        }

    @property
    def other_inputs(self) -> list[dict[str, Any]]:
        """Plain values of what differs for some time from the commands, for JSON."""
        return [
            {
                "time_s": change.time,
                "lasts_s": written(change.lasts),
                "inputs": {name: written(value) for name, value in change.inputs.items()},
                **({"noise": dict(change.noise)} if change.noise else {}),
            }
            for change in self.changes
        ]

    @property
    def brakes(self) -> bool:
        """Whether it has a quick stop, after which nothing is promised."""
        stops = any(one.command == "quick-stop" for one in self.commands)
        return stops or self._has("fFollowingLimit") or self._has("bQuickStop")

    @property
    def disturbed(self) -> bool:
        """Whether what becomes of the load cannot be known for another reason."""
        lost = self.sensed is not None and bool(self.sensed.fault)
        return lost or any(map(self._has, ("bEnable", *(f"f{name}" for name in self.live))))

    @property
    def moved(self) -> bool:
        """Whether axes are moved by hand."""
        return self._has("fActVelocity")

    @property
    def misinformed(self) -> bool:
        """Whether it is reported, true or not, that the load hangs still or that a rope is another."""
        given = {name[1:] for change in self.changes if change.lasts > habits.HELD for name in change.inputs}
        blind = self.sensed is not None and self.sensed.blind
        return blind or self._has("bLoadAtRest") or not given.isdisjoint(self.live)

    def _has(self, name: str) -> bool:
        """Whether an input differs for some time from what the commands say."""
        return any(known.startswith(name) for one in self.changes for known in (*one.inputs, *one.noise))


@attrs.frozen(kw_only=True, eq=False)
class Histories:
    """What histories of a spec are made of.

    Attributes
    ----------
    spec : Spec
    axes : mapping of int to BlockAxis
        That the block plans.
    uncertain : mapping of str to (float, float)
        Ranges of the machine's parameters; of a live one, of its ratio to what the block is given.
    period : float
        Of the slowest mode over all ranges, in s.
    fastest : float
        Frequency of the fastest mode there, in rad/s.
    """

    spec: Spec
    axes: Mapping[int, BlockAxis]
    uncertain: Mapping[str, tuple[float, float]]
    period: float
    fastest: float

    @classmethod
    def of(cls, spec: Spec) -> Self:
        """Look at the ranges of a spec, whose limits are stated."""
        live, nominal = spec.planner.live, spec.plant.parameters
        ranges = {
            name: (low / nominal[name], high / nominal[name]) if name in live else (low, high)
            for name, (low, high) in spec.checked_ranges().items()
            # a live one's span says where it may be, and of nothing there is no share
            if not (name in live and (name in spec.check.spans or nominal[name] == 0.0))
        }
        ends = product(*live.values(), *([low, high] for low, high in ranges.values()))
        by_machine = []
        for chosen in islice(ends, 2**MOST_CORNERS):
            live_values = dict(zip(live, chosen, strict=False))
            errors = dict(zip(ranges, chosen[len(live) :], strict=True))
            by_machine.append(linearize(spec.machine(), *_machine(spec, live_values, errors)).frequencies)
        slowest, fastest = float(np.min(by_machine)), float(np.max(by_machine))
        period = 2.0 * np.pi / slowest
        return cls(spec=spec, axes=planned_axes(spec), uncertain=ranges, period=period, fastest=fastest)

    def periods(self, history: History) -> Array:
        """Find the longest period in s of each mode of the machine that a block is given in a history."""
        live, plant = dict(history.live), self.spec.machine()
        ropes = {name: [value for _, value in corners] for name, corners in history.hoisting.items()}
        hoisted_to = [{name: end(values) for name, values in ropes.items()} for end in (min, max) if ropes]
        machines = [_machine(self.spec, live | ends, {}) for ends in ({}, *hoisted_to)]
        slowest = np.min([linearize(plant, *one).distinct_frequencies for one in machines], axis=0)
        return np.asarray(2.0 * np.pi / slowest)

    def machines_of_errors(self, live: Mapping[str, float]) -> list[list[Machine]]:
        """Give machines from the one of some live parameters, evenly, to corners of the stated errors."""
        none = [1.0 if name in live else self.spec.plant.parameters[name] for name in self.uncertain]
        every = [*islice(product(*self.uncertain.values()), 2**MOST_CORNERS)]
        corners = every[:: -(-len(every) // CORNERS_OF_ERRORS)]
        return [
            [
                _machine(self.spec, live, dict(zip(self.uncertain, errors, strict=True)))
                for errors in np.linspace(none, corner, SHAPES).tolist()
            ]
            for corner in corners
        ]

    @property
    def hoisted_names(self) -> tuple[str, ...]:
        """Live parameters that change on the way and are no axes of the machine."""
        return tuple(name for name in self.spec.planner.live_rate if name in self.spec.plant.parameters)

    @property
    def machine(self) -> Plant:
        """The machine that follows, where what is `hoisted_names` are the last axes."""
        return hoisted(self.spec.machine(), self.hoisted_names)

    @property
    def box(self) -> int:
        """Number of choices that make the machine: live parameters and uncertain ones."""
        return len(self.spec.planner.live) + len(self.uncertain)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of choices of a history, in their order.

        Where it starts; the box; when first, how and how often it is commanded; how it ends; then all
        commands, all legs, what a sensor meets, and its tour.
        """
        axes, planner = len(self.axes), self.spec.planner
        commands = MOST_COMMANDS * (_PER_COMMAND + axes + 1 + _PER_HABIT)
        legs = LEGS * PER_LEG * len(planner.live_rate)
        return axes, self.box, 3, axes, commands, legs, CHOICES * (planner.sensor is not None), 1

    @property
    def choices(self) -> int:
        """Number of choices of a history."""
        return sum(self.sizes)

    @property
    def _ends(self) -> int:
        """Number of choices of one end or the other: those of `box`, and a direction for all legs."""
        return self.box + len(self.spec.planner.live_rate)

    def drawn(self, count: int, seed: int) -> Array:
        """Draw choices as a Latin hypercube, the first ones at the corners of the machine's ranges.

        Parameters
        ----------
        count : int
            Of which the corners take up half at most.
        seed : int

        Returns
        -------
        (count, choices) array
        """
        from scipy.stats import qmc  # noqa: PLC0415  # half a second

        random = np.random.default_rng(seed)
        random_choices = qmc.LatinHypercube(self.choices - 1, seed=random).random(count)
        drawn: Array = np.hstack([random_choices, np.zeros((count, 1))])
        corners = self.corners(count)
        every = 2 ** min(self._ends, 62)
        numbers = np.arange(every) if every == corners else random.integers(every, size=corners)
        ends = (numbers[:, None] >> np.arange(self._ends)) & 1
        edges = np.cumsum(self.sizes)[:-1]
        _, box, *_, legs, _, _ = np.split(drawn[:corners], edges, axis=1)
        box[:] = ends[:, : self.box]
        legs[:, ::PER_LEG] = np.repeat(ends[:, self.box :], LEGS, axis=1)
        *_, sensors, tours = np.split(drawn, edges, axis=1)
        manners = drawn[:, edges[1] + 1]
        tours[:, 0] = dealt_out(
            np.array([_swings(manners[k]) + 2 * sensed(self.spec, one) for k, one in enumerate(sensors)])
        )
        return drawn

    def corners(self, count: int) -> int:
        """How many of so many histories are at corners."""
        every: int = 2 ** min(self._ends, MOST_CORNERS)
        return min(every, count // 2)

    def history(self, choices: Array, lasts: float = 0.0) -> History:
        """Make the history of some choices, shape (choices,).

        One that `lasts` so many seconds goes on in a rhythm, or by other choices each time for a `SHIFT`.
        """
        axes, live, uncertain = len(self.axes), self.spec.planner.live, self.uncertain
        *parts, rows, legs, sensor, (touring,) = np.split(choices, np.cumsum(self.sizes)[:-1])
        starts, box, (first, manner, amount), ending = (part.tolist() for part in parts)
        live_values = {
            name: between(ends, fraction) for (name, ends), fraction in zip(live.items(), box, strict=False)
        }
        errors = {
            name: between(ends, fraction)
            for (name, ends), fraction in zip(uncertain.items(), box[len(live) :], strict=True)
        }
        parameters, places = _machine(self.spec, live_values, errors)
        for number, start in zip(self.axes, starts, strict=True):
            travel = self.spec.limits.of(number).travel
            assert travel is not None
            beyond = max(start - 1.0 + OUTSIDE, 0.0) - max(OUTSIDE - start, 0.0)
            places[number] = between(travel, widened(start)) + beyond * (travel[1] - travel[0])
        rows = rows.reshape(MOST_COMMANDS, -1)
        is_sensed = not lasts and sensed(self.spec, sensor)
        rough = (not lasts and _swings(manner)) * (habits.BRAKING if is_sensed else len(habits.ROUGH))
        if 0.0 < lasts < SHIFT:
            given = rhythm(rows.ravel()[: 5 + axes], self._surroundings(rough=0), lasts)
            given += self._hoisted_at_rest(rows.ravel()[5 + axes], habits.commands_in(given)[-1].time)
        else:
            rows = rows[: int(amount * MOST_COMMANDS)] if lasts < SHIFT else _turned(rows, lasts)
            given = tuple(self._given(rows, (first, manner, touring), ending, rough=rough, lasts=lasts))
        commands = habits.commands_in(given)
        found = None
        if is_sensed:
            found = SensedHistory.of(self.spec, sensor.tolist(), commands[-1].time, parameters, places)
        return History(
            live=live_values,
            parameters=parameters,
            places=tuple(places),
            commands=commands,
            axes=self.axes,
            hoisting=hoisted_ropes(
                self.spec.planner, legs, live_values, commands[-1].time + HOISTED_ON * self.period
            ),
            changes=(*self._zones(starts, first, amount), *habits.changes_in(given)),
            sensed=found,
            stops=self.spec.planner.stop,
        )

    def _hoisted_at_rest(self, choice: float, last: float) -> Manner:
        """Tell other live parameters after some of the rhythms, as the axes rest."""
        live = {} if choice > HOISTED_AFTER or self.spec.planner.live_rate else self.spec.planner.live
        given = {f"f{name}": between(ends, choice / HOISTED_AFTER) for name, ends in live.items()}
        change = Change(time=last + RESTS * self.period, lasts=inf, inputs=given)
        return (change,) if given else ()

    def perturbed(self, history: History, errors: Mapping[str, float]) -> dict[str, float]:
        """Parameters of a machine that differs by some errors from what the block is given in a history."""
        return _machine(self.spec, history.live, errors)[0]

    def _given(
        self, rows: Array, how: Sequence[float], ending: Sequence[float], *, rough: int, lasts: float
    ) -> Iterator[Command | Change]:
        """Follow the rows until their time is over, and a tour, then come to rest."""
        first, manner, touring = how
        within, longest = lasts or max(COMMANDED, PERIODS * self.period), PAUSE if lasts else LONGEST
        likely = MANNERS[min(int(manner * len(MANNERS)), len(MANNERS) - 1)]
        time, last = first * SOONEST, 1 + len(self.axes)
        around, earliest = self._surroundings(rough=rough), 0.0
        for row in rows.tolist():
            if time > within:
                break
            command = self._command(time, int(np.searchsorted(np.cumsum(likely), row[0])), row[1:last])
            slowed, which, habit = row[last + 1 :]
            behaviour = habits.habit(self._slowed(command, slowed), which, habit, around)
            yield from behaviour
            time = habits.commands_in(behaviour)[-1].time
            earliest = time + 2.0 * around.cycle
            time += self.period * SHORTEST * (longest / SHORTEST) ** row[last]
        time = max(min(time, within), earliest)
        if not lasts:
            led = tour(touring, time, around)
            yield from led
            time = habits.commands_in(led)[-1].time + 0.5 * self.period
        end, *others = ending
        if end < 0.05:
            yield Command(time=time, command="quick-stop")
        else:
            yield self._command(time, 0 if end < 0.5 else 2, [(end - 0.05) / 0.45, *others])

    def _zones(self, starts: Sequence[float], *shares: float) -> Iterator[Change]:
        """Block intervals beyond where the axes start, and make others slow."""
        around = self._surroundings(rough=0)
        if not self.spec.planner.zones:
            return
        for k, start in enumerate(starts):
            place, width = ((fraction + GOLDEN_RATIO * (k + 1)) % 1.0 for fraction in shares)
            zone = around.zone(
                k, 0.8 + 0.15 * place if start < 0.5 else 0.05 + 0.1 * place, 0.3 * width, 0, slow=False
            )
            zone |= around.zone(k, 0.2 + 0.5 * width, place, 1, slow=True)
            yield Change(time=0.0, lasts=inf, inputs=zone)

    def _surroundings(self, *, rough: int) -> Surroundings:
        return Surroundings(
            cycle=self.spec.export.cycle_time,
            period=self.period,
            targets=self._targets,
            speeds=tuple((-speed, speed) for speed in self._speeds),
            suffixes=tuple(axis.suffix for axis in self.axes.values()),
            live=self.spec.planner.live,
            hoists=bool(self.spec.planner.live_rate),
            zones=self.spec.planner.zones,
            sensors=self.spec.planner.sensor is not None,
            other_stops=other_stops(self.spec),
            rough=rough,
        )

    def _slowed(self, command: Command, choice: float) -> Command:
        """Limit one command in four by the override, and one in four by the velocity limit."""
        if choice < 0.5:
            return command
        if choice < 0.75:
            return attrs.evolve(command, override=between((SLOWEST, 1.0), 4.0 * choice - 2.0))
        fraction = between((SLOWEST, 1.0), 4.0 * choice - 3.0)
        return attrs.evolve(command, velocity_limits=tuple(fraction * speed for speed in self._speeds))

    def _command(self, time: float, which: int, values: Sequence[float]) -> Command:
        match which:
            case 0:
                places = (between(ends, widened(v)) for ends, v in zip(self._targets, values, strict=True))
                return Command(time=time, command="position", values=tuple(places))
            case 1:
                ends = ((-speed, speed) for speed in self._speeds)
                speeds = (between(own, self._stick(v)) for own, v in zip(ends, values, strict=True))
                return Command(time=time, command="velocity", values=tuple(speeds))
        return Command(time=time, command="stop")

    @cached_property
    def _speeds(self) -> tuple[float, ...]:
        """Of the axes, the greatest in m/s."""
        return tuple(self.spec.limits.of(number).velocity or 0.0 for number in self.axes)

    @cached_property
    def _targets(self) -> tuple[tuple[float, float], ...]:
        """Ranges of each axis's targets in m."""
        return tuple(target_range(self.spec, number) for number in self.axes)

    def _stick(self, choice: float) -> float:
        """Choose a share from end to end; of several axes, each is left alone now and then."""
        alone = len(self.axes) > 1 and abs(choice - 0.5) < ALONE
        return 0.5 if alone else widened(choice, 0.25)


def other_stops(spec: Spec) -> float | None:
    """Give `bPromptStop` for stops of the kind that is not usual; None where a block has no such input."""
    planner = spec.planner
    return None if planner.live_rate or planner.sensor else float(planner.stop == "quiet")


def written(value: float) -> float | str:
    """Write a number as JSON can: what is none, in words."""
    return value if isfinite(value) else str(value)


def _swings(manner: float) -> bool:
    """Whether the load may be left swinging in a history commanded in some manner."""
    return manner * len(MANNERS) % 1.0 < ROUGH_SHARE


def _turned(rows: Array, lasts: float) -> Array:
    """Repeat rows of choices, other ones each time, so many that each may last a second."""
    times = ceil(lasts / len(rows))
    return (np.tile(rows, (times, 1)) + GOLDEN_RATIO * np.repeat(np.arange(times), len(rows))[:, None]) % 1.0


def _machine(spec: Spec, live: Mapping[str, float], errors: Mapping[str, float]) -> Machine:
    """Parameters of a machine and places of its axes: as the block is given, but for the errors."""
    plant, parameters = spec.machine(), dict(spec.plant.parameters)
    for known in plant.parameters:
        name, value = known.name, live.get(known.name, parameters[known.name])
        value = errors[name] * (value if name in live else 1.0) if name in errors else value
        parameters[name] = min(max(value, known.lower), known.upper)
    axes = zip(plant.actuated, spec.move.start, strict=True)
    return parameters, [live.get(axis.name, start) for axis, start in axes]
