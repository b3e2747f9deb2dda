"""What a block's sensors meet in a history: a swing, gusts, their own errors and a fault."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import attrs
import numpy as np

from gen_profile.assurance.proof.estimating import unknown
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import driven_modes, planned_axes, sensed_directions
from gen_profile.planner.interface import SENSOR
from gen_profile.spec.model import Spec
from gen_profile.spec.planner import DisturbanceSpec, SensorSpec
from gen_profile_fmu.running.block_run import Measurement

CHOICES = 14
NONE, SOUND = 0.35, 0.8  # up to which choice there is no sensor, or a sound one; beyond, one that fails
FAULTS = (
    "silent",
    "no number",
    "out of range",
    "frozen",
    "jump",
    "noise",
    "sign",
    "scale",
    "dead",
    "late",
    "drop-outs",
    "away",
)
EXCHANGED = "exchanged"  # two sensors, from the start on
FROM_START = ("sign", "scale", "dead")  # half of these, likewise
SHORTEST = 0.5  # s, of a gust
LOST = 0.8  # of the time without news that counts as lost: how long news may fail to come
AWAY = 2.0  # of the same time, for which one is silent that comes back
NOISIER, GREATER, LATER = 10.0, 2.0, 3.0
JUMP = 2.2  # by what a sensor shows of stated swing and gusts, at most: a step below that is none of its own
FAR_OUT = 1e3  # of the same
AGAIN, AGAIN_WITH_FAULT = 1, 3  # motions at rest, where a load seems to swing by just too much


@attrs.frozen(kw_only=True)
class Gust:
    """A push on all loads in proportion to their masses, half a sine: s, s and m/s² at most.

    `along` are its shares along the axes that the block plans.
    """

    time: float
    lasts: float
    acceleration: float
    along: tuple[float, ...]


@attrs.frozen(kw_only=True)
class SensedHistory:
    """What a sensor meets.

    Attributes
    ----------
    starts : mapping of str to float
        What swings at first, in the slowest mode: coordinates by name, their rates as ``NAME.rate``.
    gusts : tuple of Gust
    delay : float
        s.
    offsets : tuple of float
        Of each sensor in its unit.
    seed : int
        Of their noise.
    lost : float
        s, from which on news fails to come for a while.
    fault : str
        One of `FAULTS`, or empty.
    failing : int
        Which sensor has it.
    fails, innovation : float
        s, when; and what the sensor shows of stated swing, gusts, offset and noise at most, in its unit.
    """

    starts: Mapping[str, float]
    gusts: tuple[Gust, ...]
    delay: float
    offsets: tuple[float, ...]
    seed: int
    lost: float
    fault: str
    failing: int
    fails: float
    innovation: float

    @classmethod
    def of(
        cls,
        spec: Spec,
        choices: Sequence[float],
        last: float,
        parameters: Mapping[str, float],
        places: Sequence[float],
    ) -> Self:
        """Make what some choices say of a history.

        Parameters
        ----------
        spec : Spec
        choices : (CHOICES,) sequence of float
        last : float
            When its last command comes, in s.
        parameters, places
            Of the machine and its axes.
        """
        sensor, disturbance = stated_sensor(spec)
        kind, swing, phase, delay, offset, seed, lost, fails, *others = choices
        random, directions = np.random.default_rng([int(seed * 2**32), 1]), sensed_directions(spec)
        more = random.random((3, len(directions) - 1)).tolist()  # of the second sensor, and so on
        fault, faults = "", faults_of(len(directions))
        if kind >= SOUND:
            fault = faults[min(int((kind - SOUND) / (1.0 - SOUND) * len(faults)), len(faults) - 1)]
        always = fault == EXCHANGED or (fault in FROM_START and seed < 0.5)
        fails *= not always
        until = last + 0.5 * disturbance.settle
        latest = fails * until if fault else until
        if fault == "silent" and latest <= sensor.drop_out:  # none that no sensor would show
            swing = 0.0
        gusts = _gusts(spec, others, latest, random, apart=bool(fault))
        shares_and_phases = zip([swing, *more[0]], [phase, *more[1]], strict=True)
        swings = [(max(0.0, _stretched(a)), 2.0 * np.pi * b) for a, b in shares_and_phases]
        failing = int(random.integers(len(directions)))
        failing_one = list(directions.values())[failing]
        return cls(
            starts=stated_swing(spec, swings, parameters, places),
            gusts=tuple(gusts),
            delay=sensor.delay[0] + min(1.0, 1.1 * delay) * (sensor.delay[1] - sensor.delay[0]),
            offsets=tuple(_stretched(2.0 * each - 1.0) * sensor.offset for each in (offset, *more[2])),
            seed=int(seed * 2**32),
            lost=lost * until,
            fault=fault,
            failing=failing,
            fails=fails * until,
            innovation=unknown(spec, [(parameters, places)], failing_one).shown if fault else 0.0,
        )

    @property
    def blind(self) -> bool:
        """Whether its sensor dies after it was proven, so that nothing tells that the load swings."""
        return self.fault == "dead" and self.fails > 0.0

    @property
    def ends(self) -> float:
        """When the last gust does, or the sensor fails, in s."""
        return max([self.fails if self.fault else 0.0, *(gust.time + gust.lasts for gust in self.gusts)])

    def pushed(self, times: Array) -> Array:
        """Tell by how much in m axes would have to move to push the loads alike, at some times in s.

        Shape (times, axes), or (times, 1) without gusts.
        """
        way = np.zeros((len(times), len(self.gusts[0].along) if self.gusts else 1))
        for gust in self.gusts:
            since, turn = np.maximum(times - gust.time, 0.0), np.pi / gust.lasts
            within = np.minimum(since, gust.lasts)
            speed = gust.acceleration / turn
            alone = speed * (within - np.sin(turn * within) / turn) + 2.0 * speed * (since - within)
            way += np.outer(alone, gust.along)
        return way

    def measurement(self, spec: Spec, inputs: Sequence[str], cycle: float, cycles: int) -> Measurement:
        """Give what sensors tell a block of these inputs in so many cycles, each of `cycle` s."""
        sensor, _ = stated_sensor(spec)
        axes, directions = planned_axes(spec), sensed_directions(spec)
        quantity = {"angle": "{}", "rate": "{}.rate", "sway": "sway.{}"}[sensor.quantity]
        shows, valid = (
            [list(inputs).index(axes[number].of(name)) for number in directions] for name in SENSOR[:2]
        )
        rows = [self._told(sensor, place, cycle, cycles) for place in range(len(directions))]
        names = sensor.names[::-1] if self.fault == EXCHANGED else sensor.names
        pushed = np.zeros((cycles, len(axes)))
        pushed += self.pushed(np.arange(1.0, cycles + 1.0) * cycle)
        return Measurement(
            quantities=[quantity.format(of) for of in names],
            shows=shows,
            valid=valid,
            cycles=np.stack(rows, axis=1),
            pushed=pushed,
            again=AGAIN_WITH_FAULT if self.fault else AGAIN,
        )

    def _told(self, sensor: SensorSpec, place: int, cycle: float, cycles: int) -> Array:
        """Give what one of the sensors makes of its quantity, as a `Measurement` says it."""
        times = np.arange(cycles) * cycle
        random = np.random.default_rng([self.seed, place] if place else self.seed)
        rows = np.zeros((cycles, 4))
        gain, added, age, valid = rows.T
        gain[:], added[:] = 1.0, self.offsets[place] + sensor.noise * random.standard_normal(cycles)
        age[:], valid[:] = round(self.delay / cycle), 1.0
        valid[(times >= self.lost) & (times < self.lost + LOST * sensor.drop_out)] = 0.0
        first = min(round(self.fails / cycle), cycles - 1)
        match self.fault if place == self.failing else "":
            case "silent":
                valid[first:] = 0.0
            case "away":
                valid[first : first + round(AWAY * sensor.drop_out / cycle)] = 0.0
            case "no number":
                added[first:] = np.nan
            case "out of range":
                added[first:] = FAR_OUT * self.innovation
            case "frozen":
                age[first:] += np.arange(cycles - first)
                added[first:] = added[first]
            case "jump":
                added[first:] += JUMP * self.innovation * (self.seed / 2**32)
            case "noise":
                added[first:] = self.offsets[place] + NOISIER * (added[first:] - self.offsets[place])
            case "sign":
                gain[first:] = -1.0
            case "scale":
                gain[first:] = GREATER
            case "dead":  # but for its noise
                gain[first:] = 0.0
            case "late":
                age[first:] = round(LATER * self.delay / cycle)
            case "drop-outs":
                valid[first:] = _coming_and_going(LOST * sensor.drop_out / cycle, cycles - first, random)
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return attrs.asdict(self)


def _gusts(
    spec: Spec, choices: Sequence[float], latest: float, random: np.random.Generator, *, apart: bool
) -> list[Gust]:
    """Let gusts begin, or where they are to be apart from what comes later end, until so many s at most."""
    axes, (_, disturbance), gusts = list(planned_axes(spec)), stated_sensor(spec), list[Gust]()
    columns = [axes.index(number) for number in sensed_directions(spec)]
    if disturbance.gust is None:
        return gusts
    for share, long, strong in zip(choices[::3], choices[1::3], choices[2::3], strict=True):
        lasts = SHORTEST + long * max(0.0, disturbance.gust.longest - SHORTEST)
        begin = gusts[-1].time + gusts[-1].lasts if gusts else 0.0  # no two push at once
        start = begin + share * (latest - lasts * apart - begin)
        acceleration = _stretched(2.0 * strong - 1.0) * disturbance.gust.acceleration
        along = random.standard_normal(len(columns)) if len(columns) > 1 else np.ones(1)
        shares = np.zeros(len(axes))
        shares[columns] = along / np.linalg.norm(along)
        if start >= begin:
            gusts.append(
                Gust(time=start, lasts=lasts, acceleration=acceleration, along=tuple(shares.tolist()))
            )
    return gusts


def faults_of(sensors: int) -> tuple[str, ...]:
    """List the faults that one of so many sensors may have."""
    return (*FAULTS, *[EXCHANGED] * (sensors > 1))


def sensed(spec: Spec, choices: Sequence[float] | Array) -> bool:
    """Whether some choices are of a history with a sensor."""
    return spec.planner.sensor is not None and bool(choices[0] >= NONE)


def _coming_and_going(lost: float, cycles: int, random: np.random.Generator) -> Array:
    """Let news fail to come for so many cycles, and come for fewer, again and again."""
    pieces = [np.zeros(0)]
    while sum(map(len, pieces)) < cycles:
        pieces += [np.zeros(max(1, round(lost))), np.ones(1 + round(lost * random.random()))]
    return np.concatenate(pieces)[:cycles]


def stated_swing(
    spec: Spec,
    swings: Sequence[tuple[float, float]],
    parameters: Mapping[str, float],
    places: Sequence[float],
) -> dict[str, float]:
    """Let the slowest mode swing along each axis with a sensor by a share of what is stated, at a phase.

    Coordinates that swing by name, and their rates as ``NAME.rate``.
    """
    plant, (_, disturbance) = spec.machine(), stated_sensor(spec)
    at, found = linearize(plant, parameters, places), np.zeros((2, len(plant.unactuated)))
    for axis, (share, phase) in zip(sensed_directions(spec), swings, strict=True):
        driven = driven_modes(at, axis)[:, 0]
        shape = driven / driven[np.abs(driven).argmax()]
        by_load = dict(zip(plant.loads, np.abs(at.sway_gain @ shape).tolist(), strict=True))
        most = [swing / by_load[load] for load, swing in disturbance.swing.items() if by_load[load]]
        size = share * min(most)
        found += np.outer([size * np.cos(phase), -size * np.sin(phase) * at.frequencies[0]], shape)
    names = [coordinate.name for coordinate in plant.unactuated]
    rates = zip((f"{name}.rate" for name in names), found[1].tolist(), strict=True)
    return dict(zip(names, found[0].tolist(), strict=True)) | dict(rates)


def stated_sensor(spec: Spec) -> tuple[SensorSpec, DisturbanceSpec]:
    """Give what a spec states of its sensors, and of what moves their loads."""
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    assert sensor is not None and disturbance is not None
    return sensor, disturbance


def _stretched(value: float) -> float:
    """Stretch a number between −1 and 1, so that both ends come up with a share of their own."""
    return min(max(1.1 * value, -1.0), 1.0)
