"""What a block's sensors meet in a history: a swing, gusts, their own errors and a fault; and a verdict."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Self

import attrs
import numpy as np

from gen_profile.assurance.proof.estimating import unknown
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import driven_modes, planned_axes, sensed_directions
from gen_profile.planner.interface import SENSOR, UNPROVEN, BlockAxis
from gen_profile.planner.stated import damping_room
from gen_profile.spec.model import Spec
from gen_profile.spec.planner import DisturbanceSpec, SensorSpec
from gen_profile_fmu.running.block_run import BlockRun, Measurement

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
NOTICED = ("silent", "away", "no number", "out of range")  # others are noticed where they do harm
SHOW_NOTHING = ("frozen",)  # from the first value on, and nothing is promised then
SHORTEST = 0.5  # s, of a gust
LOST = 0.8  # of the time without news that counts as lost: how long news may fail to come
AWAY = 2.0  # of the same time, for which one is silent that comes back
NOISIER, GREATER, LATER = 10.0, 2.0, 3.0
JUMP = 2.2  # by what a sensor shows of stated swing and gusts, at most: a step below that is none of its own
FAR_OUT = 1e3  # of the same
HARM = 3.5  # of the stated swing: what a load may be left with by a sensor that fails
SHOWS = {"": 1.0, "sign": -1.0, "scale": GREATER, "dead": 0.0}  # of the axis's own motions
TO_NOTICE = 2.0  # longest periods of own motion stronger than what else swings, within which a fault shows
STRONG = 2.5  # own motions by what else swings, root mean square of a period, at which that is known
KNOWN_TO = 1.0 / STRONG  # as no more of what else swings can look like own motions (Cauchy and Schwarz)
LEAKY = 0.3  # damping ratio by which what is shown of them is forgotten
AGAIN, AGAIN_WITH_FAULT = 1, 3  # motions at rest, where a load seems to swing by just too much
TAKEN_UP = 5  # cycles, in which the block shows that it has taken up a command


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
        sensor, disturbance = _stated(spec)
        kind, swing, phase, delay, offset, seed, lost, fails, *others = choices
        random, directions = np.random.default_rng([int(seed * 2**32), 1]), sensed_directions(spec)
        more = random.random((3, len(directions) - 1)).tolist()  # of the second sensor, and so on
        columns = [list(planned_axes(spec)).index(number) for number in directions]
        fault, faults = "", faults_of(len(directions))
        if kind >= SOUND:
            fault = faults[min(int((kind - SOUND) / (1.0 - SOUND) * len(faults)), len(faults) - 1)]
        always = fault == EXCHANGED or (fault in FROM_START and seed < 0.5)
        fails *= not always
        until = last + 0.5 * disturbance.settle
        latest = fails * until if fault else until
        if fault == "silent" and latest <= sensor.drop_out:  # none that no sensor would show
            swing = 0.0
        gusts = list[Gust]()
        for share, long, strong in zip(others[::3], others[1::3], others[2::3], strict=True):
            if disturbance.gust is not None:
                lasts = SHORTEST + long * max(0.0, disturbance.gust.longest - SHORTEST)
                begin = gusts[-1].time + gusts[-1].lasts if gusts else 0.0  # no two push at once
                start = begin + share * (latest - (lasts if fault else 0.0) - begin)  # likewise
                acceleration = _stretched(2.0 * strong - 1.0) * disturbance.gust.acceleration
                along = random.standard_normal(len(columns)) if len(columns) > 1 else np.ones(1)
                shares = np.zeros(len(planned_axes(spec)))
                shares[columns] = along / np.linalg.norm(along)
                if start >= begin:
                    gusts.append(
                        Gust(time=start, lasts=lasts, acceleration=acceleration, along=tuple(shares.tolist()))
                    )
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
        sensor, _ = _stated(spec)
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


def faults_of(sensors: int) -> tuple[str, ...]:
    """List the faults that one of so many sensors may have."""
    return (*FAULTS, *[EXCHANGED] * (sensors > 1))


def sensed(spec: Spec, choices: Sequence[float] | Array) -> bool:
    """Whether some choices are of a history with a sensor."""
    return spec.planner.sensor is not None and bool(choices[0] >= NONE)


def sensor_faults(
    spec: Spec,
    one: SensedHistory,
    run: BlockRun,
    outputs: Sequence[str],
    *,
    cycle: float,
    period: float,
    last: float,
    estimation_error: float,
    resets: Sequence[float] = (),
) -> Iterator[str]:
    """Say what is wrong with how a block used its sensor, each in words that end a sentence.

    Parameters
    ----------
    spec : Spec
    one : SensedHistory
    run : BlockRun
        With its trace, which has these outputs, then the loads' sway.
    outputs : sequence of str
    cycle, period, last : float
        s: a cycle, the slowest swing, and when the last command came, or an input last changed.
    estimation_error : float
        m, by which an estimate may be off beside what it states, from `estimation_error`.
    resets : sequence of float
        s, when bReset was set.
    """
    assert run.trace is not None
    issued = dict(zip(outputs, run.trace.T, strict=False))
    axes, _, disturbance = planned_axes(spec), *_stated(spec)
    for place, (number, direction) in enumerate(sensed_directions(spec).items()):
        axis, fault = axes[number], one.fault if place == one.failing or one.fault == EXCHANGED else ""
        sway = run.trace[:, len(outputs) + direction.end_load]
        if not one.fault:
            yield from _misestimated(axis, issued, sway, estimation_error, cycle)
        if fault in (*SHOWS, EXCHANGED):
            moved = OwnMotion.of(
                axis, issued, sway, disturbance, since=one.fails if fault else 0.0, cycle=cycle, period=period
            )
            if fault in SHOWS and disturbance.gust is not None:
                yield from _misread(axis, issued, moved, fault=fault, resets=resets)
            if fault:
                yield from _unnoticed(
                    axis, issued, moved, fault=fault, swing=min(spec.check.residual_sway.values())
                )
        shown_faults = issued[axis.of("nSensorFault")]
        noticed = np.where(shown_faults == UNPROVEN, 0.0, shown_faults)
        at = int(np.argmax(noticed != 0.0)) * cycle
        if fault:
            found = (
                at if noticed.any() else len(shown_faults) * cycle if shown_faults[-1] == UNPROVEN else None
            )
            yield from _faults_of_a_faulty_one(spec, one, run, sway, noticed=found, cycle=cycle)
            if fault == "away" and noticed[-1]:
                yield f"a sensor that is back is not used again, from {one.fails:.2f} s"
        elif noticed.any():
            yield (
                f"a sound sensor is taken for a faulty one ({axis.of('nSensorFault')} "
                f"{noticed[noticed != 0.0][0]:.0f}), at {at:.2f} s"
            )
    if one.fault or run.stands < 0:
        return
    places = np.stack([issued[axis.of("fPosition")] for axis in axes.values()])
    near = (np.abs(places - places[:, -1:]) <= damping_room(spec)).all(axis=0)
    rests = (issued["bBusy"] == 0.0) | (near & (issued["bDamping"] != 0.0))  # not damped on the way
    first = min(round(last / cycle) + TAKEN_UP, len(rests) - 1)
    arrived = first + int(np.argmax(rests[first:]))
    settled = max(arrived, round(one.ends / cycle)) + round(disturbance.settle / cycle)
    sways = np.abs(run.trace[settled:, len(outputs) :])
    for (load, most), column in zip(spec.check.residual_sway.items(), sways.T, strict=True):
        if len(column) and column.max() > most:
            late = np.flatnonzero(column > most)[-1] * cycle
            yield (
                f"the {load} is damped to check.residual_sway later than allowed by {late:.3g} s, at "
                f"{settled * cycle:.2f} s"
            )


def _misestimated(
    axis: BlockAxis, issued: Mapping[str, Array], sway: Array, estimation_error: float, cycle: float
) -> Iterator[str]:
    """Say whether the estimated sway is off by more than is stated."""
    uncertainty = axis.of("fSwayUncertainty")
    off = np.abs(issued[axis.of("fSwayEstimated")] - sway) - issued[uncertainty] - estimation_error
    off *= issued[axis.of("bSensorUsed")] != 0.0
    at = int(np.argmax(off))
    if off[at] > 0.0:
        yield f"{uncertainty} is too small by {off[at]:.3g} m, at {at * cycle:.2f} s"


@attrs.frozen(kw_only=True, eq=False)
class OwnMotion:
    """How much of a swing the axis's own motions make, since a sensor failed.

    Attributes
    ----------
    own : (cycles, 2) Array
        Mean square in m²/s⁴ of what swings by the motions since then, and by all of them.
    others : float
        m/s², what the strongest gust, and what swung as it failed, show beside it.
    used_for : (cycles,) Array
        s, for how long the sensor has been used.
    since, cycle, period : float
        s.
    """

    own: Array
    others: float
    used_for: Array
    since: float
    cycle: float
    period: float

    @classmethod
    def of(
        cls,
        axis: BlockAxis,
        issued: Mapping[str, Array],
        sway: Array,
        disturbance: DisturbanceSpec,
        *,
        since: float,
        cycle: float,
        period: float,
    ) -> Self:
        """Measure them by what a block issued, and a load's sway."""
        from scipy.signal import cont2discrete, lfilter  # noqa: PLC0415  (half of what the command line takes to start)

        cycles, used = np.arange(len(sway)), issued[axis.of("bSensorUsed")] != 0.0
        rate, used_for = 2.0 * np.pi / period, cycles - np.maximum.accumulate(np.where(used, -1, cycles))
        swings, fades, _ = cont2discrete(([1.0], [1.0, 2.0 * LEAKY * rate, rate**2]), cycle)
        # before, what swung at first and the offset are not known yet
        counts = (cycles * cycle > since) & (used_for * cycle > period)
        moved = issued[axis.of("fAcceleration")][:, None] * np.transpose([counts, np.ones_like(counts)])
        swung = rate**2 * lfilter(swings.ravel(), fades, moved, axis=0)
        share = cycle / period
        before = sway[max(0, round((since - period) / cycle)) : round(since / cycle)]  # shown otherwise later
        gust = disturbance.gust.acceleration if disturbance.gust is not None else 0.0
        return cls(
            own=lfilter([share], [1.0, share - 1.0], swung**2, axis=0),
            others=gust + rate**2 * np.abs(before).max(initial=0.0),
            used_for=np.asarray(used_for * cycle, dtype=float),
            since=since,
            cycle=cycle,
            period=period,
        )


def _misread(
    axis: BlockAxis, issued: Mapping[str, Array], moved: OwnMotion, *, fault: str, resets: Sequence[float]
) -> Iterator[str]:
    """Say whether what a sensor is found to show of the axis's own motions is wrong since it has a fault."""
    cycle, period, cycles = moved.cycle, moved.period, np.arange(len(moved.own))
    strength = np.sqrt(moved.own[:, 0]) / moved.others
    strength *= (moved.used_for > 2.0 * period) & (cycles * cycle > moved.since + 2.0 * period)
    strength *= cycles < min((round(time / cycle) for time in resets), default=len(cycles))  # when it forgets
    at = int(np.argmax(strength))
    scale = axis.of("fSensorScale")
    # of what it showed before it failed
    remembered = max(0.0, 1.0 - moved.own[at, 0] / max(moved.own[at, 1], 1e-300))
    wrong = abs(issued[scale][at] - SHOWS[fault] - remembered * (1.0 - SHOWS[fault]))
    if strength[at] > STRONG and wrong > KNOWN_TO:
        yield f"{scale} is wrong by {wrong:.3g}, at {at * cycle:.2f} s"


def _unnoticed(
    axis: BlockAxis, issued: Mapping[str, Array], moved: OwnMotion, *, fault: str, swing: float
) -> Iterator[str]:
    """Say whether a faulty sensor confirms more of the axis's own motion than is stated.

    Swings below `swing` in m do no harm.
    """
    confirms = (issued[axis.of("bSensorUsed")] != 0.0) & (issued[axis.of("nSensorFault")] == 0.0)
    others = max(moved.others, (2.0 * np.pi / moved.period) ** 2 * swing)
    strong = confirms & (moved.own[:, 0] > others**2)
    seconds = moved.cycle * np.cumsum(strong)
    allowed = TO_NOTICE * moved.period
    if seconds[-1] > allowed:
        yield (
            f"a faulty sensor ({fault}) confirms strong motions of its axis for too long by "
            f"{seconds[-1] - allowed:.3g} s, at {np.argmax(seconds > allowed) * moved.cycle:.2f} s"
        )


def _faults_of_a_faulty_one(
    spec: Spec, one: SensedHistory, run: BlockRun, sway: Array, *, noticed: float | None, cycle: float
) -> Iterator[str]:
    """Say what is wrong where a sensor is: noticed too late, or the load made to sway."""
    sensor, disturbance = _stated(spec)
    late = (noticed if noticed is not None else np.inf) - one.fails - sensor.drop_out
    if one.fault in NOTICED and late > sensor.drop_out:  # as much later, where news failed to come before
        yield f"the sensor's fault is not noticed ({one.fault}, at {one.fails:.2f} s)"
    if noticed is None and not run.promise and one.fault not in SHOW_NOTHING:
        yield f"the sensor's fault is neither noticed nor harmless ({one.fault}, at {one.fails:.2f} s)"
    swings = float(np.abs(sway[round(one.fails / cycle) :]).max(initial=0.0))
    if swings > HARM * min(disturbance.swing.values()):
        yield f"a faulty sensor ({one.fault}) makes the load swing by {swings:.3g} m, at {one.fails:.2f} s"


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
    plant, (_, disturbance) = spec.machine(), _stated(spec)
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


def _stated(spec: Spec) -> tuple[SensorSpec, DisturbanceSpec]:
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    assert sensor is not None and disturbance is not None
    return sensor, disturbance


def _stretched(value: float) -> float:
    """Stretch a number between −1 and 1, so that both ends come up with a share of their own."""
    return min(max(1.1 * value, -1.0), 1.0)
