"""What a planner block has to know of a sensor of the load: an observer's gains, and when to damp.

Each mode is followed in the sway z of the load that shows it most, z'' = push a − ω² z, and measured as
y = Σ shown z (or of z') + offset. The gains are those of the steady Kalman filter of these and the offset
(Kalman and Bucy 1961); they are functions of the live parameters, as the frequencies are.
"""

from collections.abc import Mapping, Sequence
from itertools import accumulate, product

import attrs
import numpy as np
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov

from gen_profile.motion.profile import Array
from gen_profile.planner.chebyshev import Interpolant, interpolate
from gen_profile.planner.directions import (
    SensedDirection,
    driven_modes,
    linearized,
    planned_axes,
    sensed_directions,
    shown_of_modes,
)
from gen_profile.planner.machine import DEGREES, MOST_TERMS, SYMMETRIC, frequency_errors
from gen_profile.planner.stated import damping_room
from gen_profile.spec.model import Spec
from gen_profile.spec.planner import DisturbanceSpec, SensorSpec
from gen_profile.support.errors import SpecError
from gen_profile_exporters.planner.sensor_constants import (
    MEMORY,
    SensorConstants,
    model_rows,
)

# Bandwidth of the observer at most, by the slowest frequency: where delay and frequency are known, and where
# not. A quicker one takes an unknown delay and a wrong rope for sway.
QUICK, USUAL = 2.5, 1.0
KNOWN = 0.05  # rad, of both together: the greatest uncertainty at which it is quicker
FAST = 3.0  # how much other modes may swing otherwise than is known, by what the sensor shows of them
OFFSET_TIME = 0.35  # slow periods, in which an offset is learnt
NOISE_TIME = 0.01  # s, for which a sensor's noise counts as the same, where cycles are shorter
LIGHT = 0.02  # damping that modes are taken to have at least, so that one that is not shown is no obstacle
# Of the allowed sway: where damping begins on arrival, later at rest, and after a period of that; and ends.
BEGIN, AGAIN, ROUSED, END = 0.4, 0.7, 0.85, 0.27
SURE = 4.0  # standard deviations of what is estimated, that lie between the first two
NOISES = 8.0  # standard deviations of the noise that no value is off by
STUCK = 4.0  # of them, by which what is expected may change while the value stays the same
MISREAD = 0.5  # share by which what it shows of the axis's own motions may differ from what is expected
FADES = 0.35  # rate by which fSwayUncertainty declines, by the slowest frequency (sensor.st)
SURE_OTHERS = 6.0  # standard deviations of the noise that look like own motions
UPDATE = 0.1  # s between new values at most, from which steps are judged
LEAST_SHOWN = 1e-3  # of the slowest mode, by what the sensor shows of the others
LARGEST_DELAY, UNKNOWN_DELAY = 0.7, 0.25  # rad of the slowest mode
ACCURATE = 5e-3  # of what the sensor shows, between the points of interpolation
IMPULSE_STEP, IMPULSE_PHASE = 0.1, 40.0  # rad of the fastest and the slowest mode: of an impulse's response
MOST_EXPECTED = 4000  # cycles in which a value may be as old as the oldest


@attrs.frozen(kw_only=True, eq=False)
class SensedModes:
    """The modes at a point of the live ranges, as the block follows them.

    Attributes
    ----------
    frequencies, decays : (modes,) arrays
        In rad/s and 1/s.
    push, shown, end_load : (modes,) arrays
        What an acceleration does to z, what the sensor shows of it, and the end load's sway by it.
    swing : float
        m, stated for z of the slowest mode.
    bandwidth : float
        rad/s, of the observer at most.
    """

    frequencies: Array
    decays: Array
    push: Array
    shown: Array
    end_load: Array
    swing: float
    bandwidth: float


def sensor_constants(
    spec: Spec, points: Sequence[Sequence[float]], interpolated: Interpolant
) -> tuple[SensorConstants, Interpolant] | None:
    """Find what the block needs to know of the sensor, and the model's rows for it.

    Parameters
    ----------
    spec : Spec
    points : sequence of points
        Of the live ranges, each from −1 to 1, where all is judged.
    interpolated : Interpolant
        Of the same live parameters, whose degree and bends are taken.

    Returns
    -------
    tuple or None
        None where there is no sensor.

    Raises
    ------
    SpecError
        The block cannot be served by this sensor.
    """
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    if sensor is None or disturbance is None:
        return None
    _refuse_machine(spec)
    directions = sensed_directions(spec)
    sensed = [sensed_modes(spec, point, one) for point in points for one in directions.values()]
    for one in sensed:
        _refuse(spec, sensor, one)
    least, modes = int(interpolated.exponents.max(initial=0)), len(sensed[0].frequencies)
    true = np.array([_rows(spec, directions, point) for point in points])
    for degree in [least, *(degree for degree in DEGREES if degree > least and spec.planner.live)]:
        rows = interpolate(lambda at: _rows(spec, directions, at), interpolated.curvatures, degree)
        found = np.array([rows(point) for point in points])
        error = _error(found, true, modes)
        if error <= ACCURATE and rows.exponents.shape[1] <= MOST_TERMS:
            break
    else:
        raise SpecError(
            f"planner.live: over these ranges what the sensor shows would be known to {error:.1g} only; "
            "narrow the ranges."
        )
    raised, last = rows.coefficients.copy(), slice(model_rows(modes) - 1, None, model_rows(modes))
    below = (true - found)[:, last].max(axis=0).clip(0.0)  # none is less than what is true
    raised[last, ~rows.exponents.any(axis=0)] += below[:, None]
    return _constants(spec, sensor, disturbance, sensed), attrs.evolve(rows, coefficients=raised)


def _constants(
    spec: Spec, sensor: SensorSpec, disturbance: DisturbanceSpec, sensed: Sequence[SensedModes]
) -> SensorConstants:
    rate, directions = sensor.quantity == "rate", sensed_directions(spec)
    acceleration = max(spec.limits.of(number).acceleration or 0.0 for number in planned_axes(spec))
    allowed = min(spec.check.residual_sway.values())
    disturbed = max(_disturbed(sensor, disturbance, one) for one in sensed)

    def own(order: int) -> float:
        """Tell what the axes' own accelerations make the sensor show, or its slope, at most."""
        powers = (one.frequencies ** (int(rate) + order - 2.0) for one in sensed)
        shown = (np.abs(one.shown * one.push) @ power for one, power in zip(sensed, powers, strict=True))
        return max(2.0 * acceleration * float(each) for each in shown)

    slope = own(1) + disturbed * max(float(one.frequencies[0]) for one in sensed)
    noise, swing = sensor.noise, max(one.swing for one in sensed)
    floor = max(float(_floor(sensor, one)[0]) for one in sensed)
    unit = next((one.unit for one in spec.machine().unactuated if one.name in sensor.names), "m")
    words = {"angle": "{}", "rate": "the rate of {}", "sway": "the sway of the {}"}[sensor.quantity]
    return SensorConstants(
        words={
            place: words.format(directions[number].of)
            for place, number in enumerate(planned_axes(spec))
            if number in directions
        },
        unit=f"{unit}/s" if rate else unit,
        load=spec.machine().end_load_name,
        rate=rate,
        age=sensor.usual_age,
        oldest=sensor.delay[1] + sensor.drop_out,
        drop_out=sensor.drop_out,
        most=2.0 * (disturbed + own(0)) + 2.0 * sensor.offset + NOISES * noise,
        step=UPDATE * slope + NOISES * noise,
        gate=_gate(sensor, disturbed),
        frozen=STUCK * noise,
        noisy=(NOISES * noise) ** 2 + slope**2 * UPDATE * spec.export.cycle_time,
        swing=swing,
        hides=swing if disturbance.gust else 0.0,
        floor=floor,
        again=AGAIN * allowed,
        roused=ROUSED * allowed,
        end=END * allowed,
        misread=MISREAD,
        room=damping_room(spec),
        estimation_error=estimation_error(spec),
    )


def modal_model(spec: Spec, known: Interpolant) -> Interpolant:
    """Find how the modes of a measured machine swing whose loads do not hang on ropes.

    The squares of their frequencies, as they swing while they decay, as `sway_model` gives them; then the
    diagonal matrix of these, decays, and what an acceleration does to the load that each makes sway most.
    `known` are the same frequencies, whose degree and bends are taken.
    """
    direction = next(iter(sensed_directions(spec).values()))

    def rows(point: Sequence[float]) -> Array:
        one = sensed_modes(spec, point, direction)
        squares = one.frequencies**2 - one.decays**2
        invariants = [squares.sum(), squares.prod()] if len(squares) == SYMMETRIC else squares
        return np.array([*invariants, *np.diag(squares).ravel(), *one.decays, *one.push])

    return interpolate(rows, known.curvatures, int(known.exponents.max(initial=0)))


def estimation_error(spec: Spec) -> float:
    """Find by how much, in m, an estimate of the end load's sway is off in gusts and by all stated errors.

    No acceleration within bounds moves it by more than the integral of the size of what an impulse leaves
    (Desoer and Vidyasagar 1975); wrong frequencies act as an acceleration on the stated swing and on what
    the axes' own accelerations make of it, and an unknown delay as an error of what is measured. What is
    unknown at first, as the offset, counts where it dies away later than `fSwayUncertainty`. As in the
    filter's design, modes have `LIGHT` damping at least: gusts in time with a faster one do more in minutes.
    """
    points, directions = between(len(spec.planner.live)), sensed_directions(spec).values()
    own = 2.0 * max(spec.limits.of(number).acceleration or 0.0 for number in planned_axes(spec))
    return max(
        _estimation_error_at(spec, sensed_modes(spec, point, one), own)
        for point in points
        for one in directions
    )


def _estimation_error_at(spec: Spec, one: SensedModes, own: float) -> float:
    sensor = spec.planner.sensor
    assert sensor is not None
    state, measured, gain = _filter(sensor, one)
    slowest, estimated, kicks = float(one.frequencies[0]), np.zeros(len(state)), np.zeros((len(state), 5))
    estimated[:-1:2], kicks[1:-1:2, 0], kicks[:, 1] = one.end_load, one.push, gain
    kicks[0, 2], kicks[1, 3], kicks[-1, 4] = one.swing, slowest * one.swing, sensor.offset
    step = IMPULSE_STEP / float(one.frequencies[-1])
    steps = range(round(IMPULSE_PHASE / (step * slowest)))
    transition = expm((state - np.outer(gain, measured[0])) * step)
    left = np.array([*accumulate(steps, lambda row, _: row @ transition, initial=estimated)]) @ kicks
    pushed, misread = np.abs(left[:, :2]).sum(axis=0) * step
    fading = one.swing * np.exp(-FADES * slowest * step * np.arange(len(left)))
    late = np.hypot(left[:, 2], left[:, 3]) + np.abs(left[:, 4]) - fading
    changes = abs(float(one.shown[0])) * slowest ** (1 + int(sensor.quantity == "rate"))  # in a second
    changes *= one.swing + abs(float(one.push[0])) * own / slowest**2
    known = pushed * (_unknown_acceleration(spec, one) + _stiffness_error(spec) * own)
    return float(known + misread * changes * sensor.unknown_delay + max(0.0, late.max()))


def _unknown_acceleration(spec: Spec, one: SensedModes) -> float:
    """Find what acts as an acceleration in m/s² and is not known: gusts, and wrong frequencies."""
    gust = spec.planner.disturbance.gust if spec.planner.disturbance else None
    restoring = float(one.frequencies[0]) ** 2 * one.swing / abs(float(one.push[0]))
    return (gust.acceleration if gust else 0.0) + _stiffness_error(spec) * restoring


def _stiffness_error(spec: Spec) -> float:
    """By which share the slowest mode's stiffness may be wrong."""
    return 2.0 * float(frequency_errors(spec)[0])


def _gate(sensor: SensorSpec, disturbed: float) -> float:
    return 1.5 * disturbed + 2.0 * sensor.offset + NOISES * sensor.noise


def _disturbed(sensor: SensorSpec, disturbance: DisturbanceSpec, one: SensedModes) -> float:
    """Find what the sensor shows of the stated swing and gusts at most."""
    slowest, gust = float(one.frequencies[0]), disturbance.gust.acceleration if disturbance.gust else 0.0
    swing = one.swing + 2.0 * abs(float(one.push[0])) * gust / slowest**2
    return abs(float(one.shown[0])) * slowest ** int(sensor.quantity == "rate") * swing


def sensed_modes(spec: Spec, point: Sequence[float], direction: SensedDirection) -> SensedModes:
    """Find the modes along a direction at a point of the live ranges, each from −1 to 1.

    Raises
    ------
    SpecError
        No load that is stated to swing shows there.
    """
    at, sensor, disturbance = linearized(spec, point), spec.planner.sensor, spec.planner.disturbance
    assert sensor is not None and disturbance is not None
    slowest, errors = float(at.distinct_frequencies[0]), float(frequency_errors(spec)[0])
    unknown = slowest * sensor.unknown_delay + errors
    sways = at.sway_gain @ driven_modes(at, direction.axis)
    push = np.abs(sways[direction.largest, range(sways.shape[1])])
    by_load = dict(zip(spec.machine().loads, np.abs(sways[:, 0] / push[0]).tolist(), strict=True))
    swings = [
        swing / by_load[load] for load, swing in disturbance.swing.items() if by_load[load] > LEAST_SHOWN
    ]
    if not swings:
        raise SpecError(
            f"planner.disturbance.swing: must name a load that {direction.of} shows; state it for "
            f"{list(by_load)[direction.end_load]}."
        )
    return SensedModes(
        frequencies=at.distinct_frequencies,
        decays=at.distinct_damping_ratios * at.distinct_frequencies,
        push=push,
        shown=shown_of_modes(spec, at, direction) / push,
        end_load=sways[direction.end_load] / push,
        swing=min(swings),
        bandwidth=slowest * min(QUICK, max(USUAL, KNOWN / max(unknown, 1e-9))),
    )


def _filter(sensor: SensorSpec, one: SensedModes) -> tuple[Array, Array, Array]:
    """State matrix and row of what is measured, each of z, z' by mode and the offset, and the gains."""
    modes, slowest = len(one.frequencies), float(one.frequencies[0])
    state, measured = np.zeros((2 * modes + 1,) * 2), np.zeros((1, 2 * modes + 1))
    spread, rate = np.zeros(2 * modes + 1), int(sensor.quantity == "rate")
    push = (one.swing * slowest) ** 2 * slowest / (2.0 * np.pi)
    for mode, (frequency, decay) in enumerate(zip(one.frequencies, one.decays, strict=True)):
        state[2 * mode, 2 * mode + 1] = 1.0
        state[2 * mode + 1, 2 * mode : 2 * mode + 2] = (-(frequency**2), -2.0 * max(decay, LIGHT * frequency))
        measured[0, 2 * mode + rate] = one.shown[mode]
        like = abs(one.shown[0]) / max(abs(one.shown[mode]), 0.05 * abs(one.shown[0]))
        spread[2 * mode + 1] = push * (FAST * like**2 if mode else 1.0)
    measured[0, -1] = 1.0
    shows = abs(one.shown[0]) * slowest**rate
    noise = max(sensor.noise**2 * NOISE_TIME, push * shows**2 / one.bandwidth**4)
    spread[-1] = noise / (OFFSET_TIME * 2.0 * np.pi / slowest) ** 2
    covariance = solve_continuous_are(state.T, measured.T, np.diag(spread), np.array([[noise]]))
    return state, measured, np.asarray(covariance @ measured.T / noise)[:, 0]


def _floor(sensor: SensorSpec, one: SensedModes) -> Array:
    """Find the standard deviations in m that noise gives the modes' estimates, shape (modes,)."""
    state, measured, gain = _filter(sensor, one)
    kicks = np.outer(gain, gain) * sensor.noise**2 * NOISE_TIME
    spread = np.diag(solve_continuous_lyapunov(state - np.outer(gain, measured[0]), -kicks))
    return np.asarray(np.sqrt(spread[:-1:2] + spread[1:-1:2] / one.frequencies**2))


def _known_sway(spec: Spec, one: SensedModes) -> Array:
    """Find to how many m each mode's sway is known at least, shape (modes,).

    To four standard deviations of noise. Of faster modes, which are not damped, what gusts made of them and
    the observer has not corrected within two slow periods counts, too: of one that does not show, all.
    """
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    assert sensor is not None and disturbance is not None
    state, measured, gain = _filter(sensor, one)
    rates = range(1, len(state) - 1, 2)
    state[rates, rates] = -2.0 * one.decays
    period = 2.0 * np.pi / float(one.frequencies[0])
    later = expm((state - np.outer(gain, measured[0])) * 2.0 * period)
    gust = disturbance.gust.acceleration if disturbance.gust else 0.0
    known = SURE * _floor(sensor, one)
    for mode, frequency in enumerate(one.frequencies[1:].tolist(), start=1):
        scale, own = np.array([1.0, frequency]), slice(2 * mode, 2 * mode + 2)
        kept = np.linalg.norm(later[own, own] * scale / scale[:, None], 2)
        known[mode] += kept * 2.0 * abs(float(one.push[mode])) * gust / frequency**2
    return known


def _others(spec: Spec, sensor: SensorSpec, one: SensedModes) -> float:
    """Find how much of what differs is not the sensor's fault at most.

    It comes from gusts, what is unknown at first, wrong frequencies and noise: the root of its square's
    integral over the phase in the memory, which by Cauchy and Schwarz bounds how much of it looks like
    what the axis's own motions show.
    """
    state, measured, gain = _filter(sensor, one)
    slowest, corrected = float(one.frequencies[0]), state - np.outer(gain, measured[0])
    pushed, freed = np.zeros(len(state)), np.zeros((len(state), 3))
    pushed[1:-1:2] = one.push
    freed[0, 0], freed[1, 1], freed[-1, 2] = one.swing, slowest * one.swing, sensor.offset
    peak = max(
        abs(measured[0] @ np.linalg.solve(1j * frequency * np.eye(len(state)) - corrected, pushed))
        for frequency in slowest * np.geomspace(0.1, 10.0, 100)
    )
    period = 2.0 * np.pi / slowest
    later = expm(corrected * period) @ freed
    energy = later.T @ solve_continuous_lyapunov(corrected.T, -measured.T @ measured) @ later
    noise = SURE_OTHERS * sensor.noise * np.sqrt(max(NOISE_TIME, spec.export.cycle_time))
    seen = (
        peak * _unknown_acceleration(spec, one) * np.sqrt(0.5 * MEMORY * period)
        + np.sqrt(np.linalg.norm(energy, 2))
        + noise
    )
    return float(seen * np.sqrt(slowest))


def _rows(spec: Spec, directions: Mapping[int, SensedDirection], point: Sequence[float]) -> Array:
    """Values of the model's rows, axis by axis: push, shown, end load's sway, gains of z and z'; then two.

    These are the offset's gain, and `_others`. The gains are those for a cycle, of what differed as long ago
    as a value usually is old. Of an axis without a sensor all are 0.
    """
    sensor = spec.planner.sensor
    assert sensor is not None
    modes, rows = len(linearized(spec, point).distinct_frequencies), list[Array]()
    for number in planned_axes(spec):
        rows.append(np.zeros(model_rows(modes)))
        if number in directions:
            one = sensed_modes(spec, point, directions[number])
            state, _, gain = _filter(sensor, one)
            now = spec.export.cycle_time * expm(state * sensor.usual_age) @ gain
            others = _others(spec, sensor, one)
            rows[-1][:] = *one.push, *one.shown, *one.end_load, *now[:-1:2], *now[1:-1:2], now[-1], others
    return np.concatenate(rows)


def _refuse_machine(spec: Spec) -> None:
    """Refuse what no sensor serves so far."""
    sensor = spec.planner.sensor
    assert sensor is not None
    axes, middle = planned_axes(spec), linearized(spec, [0.0] * len(spec.planner.live))
    alike = len(middle.frequencies) == len(axes) * len(middle.distinct_frequencies)
    if not alike or (len(axes) > 1 and any(axis.unit != "m" for axis in axes.values())):
        raise SpecError(
            "planner.sensor: the block damps by axes that lead straight, along each of which loads swing "
            "alike and alone; this machine's do not, so leave the sensor out."
        )
    for number in axes:
        travel, room = spec.limits.of(number).travel, damping_room(spec)
        if travel and travel[1] - travel[0] <= 2.0 * room:
            raise SpecError(
                f"{spec.limits.place(number, 'travel')}: must be longer than {2.0 * room:.3g}, as damping "
                "takes half of that at each end; lengthen it, or state a smaller planner.disturbance.swing."
            )
    if sensor.delay[1] + sensor.drop_out > MOST_EXPECTED * spec.export.cycle_time:
        raise SpecError(
            f"planner.sensor: delay and drop_out together may be {MOST_EXPECTED} cycles of "
            "export.cycle_time at most; state a shorter drop_out."
        )


def _refuse(spec: Spec, sensor: SensorSpec, one: SensedModes) -> None:
    """Refuse a sensor that does not show the slowest mode, or too late, and pulses that do not act on it."""
    slowest, named = float(one.frequencies[0]), " or ".join(sensor.names)
    shown = np.abs(one.shown * one.frequencies ** (sensor.quantity == "rate"))
    if not shown[0] > LEAST_SHOWN * shown.max():
        raise SpecError(
            f"planner.sensor.of: {named} does not show the slowest swing; measure another coordinate."
        )
    needed = (AGAIN - BEGIN) * min(spec.check.residual_sway.values())
    known, *others = _known_sway(spec, one)
    if known > needed:
        raise SpecError(
            f"planner.sensor.noise: the load's sway would be known to {known:.2g} m only, and {needed:.2g} m "
            "are needed to damp to check.residual_sway; take a better sensor, or allow more."
        )
    if max(others, default=0.0) > needed:
        raise SpecError(
            f"planner.sensor.of: {named} does not show the faster swings well enough: {max(others):.2g} "
            f"m that gusts make of them would not be seen, and {needed:.2g} m may be; measure another "
            'coordinate, or the sway of a load (quantity = "sway").'
        )
    late, unknown = slowest * sensor.delay[1], slowest * sensor.unknown_delay
    if late > LARGEST_DELAY or unknown > UNKNOWN_DELAY:
        most, width = LARGEST_DELAY / slowest, 2.0 * UNKNOWN_DELAY / slowest
        raise SpecError(
            f"planner.sensor.delay: at most {most:.2g} s, known to {width:.2g} s, for a load that swings "
            "this fast; take a faster sensor, or give the block fSensorAge and state its error alone."
        )


def _error(found: Array, true: Array, modes: int) -> float:
    """Tell by which share the model's rows, (points, rows), are off in what the sensor shows."""
    rows = np.arange(true.shape[1]).reshape(-1, model_rows(modes))[:, : 3 * modes].ravel()
    largest = np.abs(true[:, rows]).max(axis=0)
    apart = np.abs(found - true)[:, rows] / np.maximum(largest, LEAST_SHOWN * largest.max())
    return float(apart.max())


def between(live: int) -> list[tuple[float, ...]]:
    """Points of the live ranges between those of interpolation, each from −1 to 1."""
    return list(product(np.linspace(-1.0, 1.0, 6).tolist(), repeat=live))
