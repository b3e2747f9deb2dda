"""Whether replayed setpoints are the move that a spec asks for, before anything swings from them."""

from collections.abc import Iterator
from math import inf

import numpy as np

from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.phrase import Phrase
from gen_profile.support.units import RATES

TARGET_TOLERANCE = 1e-6  # of the axis' move, beside the artefact's own resolution
STANDING_TOLERANCE = 1e-7  # of the longest move, beside half the artefact's resolution
DURATION_TOLERANCE = 1e-9  # of the duration
VELOCITY_TOLERANCE = 0.01  # of the greatest velocity, between a velocity column and the positions beside it
# Beyond the command's limits: where an acceleration leaps from -a to a, a cam's cubic spline reaches 1.37 a.
OVERSHOOT = {"velocity": 0.02, "acceleration": 0.4}
# Second differences of a designed motion grow and fade over many cycles; one setpoint off its place makes
# three that do not, in the ratio 1 : -2 : 1.
STANDS_OUT = 5.0  # times the greatest one elsewhere, from which on a second difference is a fault
NEIGHBOURS = 2  # on either side, which the same fault may have made
FEWEST_SETPOINTS = 20  # fewer say too little about what is usual among them


def implausibilities(spec: Spec, setpoints: SampledProfile) -> tuple[str, ...]:
    """Say where setpoints are not what the spec asks for, or no designed motion.

    Each bound leaves room for what the artefact's format can represent and for the rounding of its numbers.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile

    Returns
    -------
    tuple of str
        A sentence each.
    """
    return (
        *another_move(spec, setpoints),
        *_contradiction(spec, setpoints),
        *_off_their_places(spec, setpoints),
        *_exceeded_limits(spec, setpoints),
    )


def another_move(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say where setpoints are not the move that a spec asks for: of its ends, its time and its travel."""
    yield from _missed_ends(spec, setpoints)
    yield from _missed_time(spec, setpoints)
    yield from _left_travel(spec, setpoints)


def _missed_ends(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say where the motion does not begin or end as the spec asks."""
    speed = np.array(spec.move.final_velocity)
    allowed = _nearby(spec, setpoints)
    beyond = spec.actuator.tau or 0.0
    if spec.move.shortest:  # the motion ends somewhere in the last cycle
        allowed += setpoints.cycle_time * np.abs(speed)
    else:
        beyond += setpoints.times[-1] - spec.move.duration
    for word, actual, asked in (
        ("starts", setpoints.position[0], spec.move.start),
        ("ends", setpoints.position[-1], np.array(spec.move.target) + beyond * speed),
    ):
        for axis, at, due, tolerance in zip(spec.machine().actuated, actual, asked, allowed, strict=True):
            if abs(at - due) > tolerance:
                template = (
                    "Axis {axis.name} {word} at {at:.9g} {axis.unit}, and the spec asks for {due:.9g} "
                    "{axis.unit}."
                )
                yield Phrase(template, axis=axis, word=word, at=at, due=due)


def _missed_time(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say when the motion arrives, where it is a cycle or more from when the spec asks.

    Setpoints that only hold what was reached are no part of the motion.
    """
    times, least, most = setpoints.times, spec.move.duration, spec.move.duration
    if spec.move.shortest:
        least, most = spec.move.bounds.least or 0.0, spec.move.bounds.most or inf
    onward = setpoints.position[-1] + np.outer(times - times[-1], spec.move.final_velocity)
    standstill = STANDING_TOLERANCE * _sizes(spec).max() + 0.5 * setpoints.resolution
    moving = np.flatnonzero((np.abs(setpoints.position - onward) > standstill).any(axis=1))
    last = int(moving[-1]) if len(moving) else 0
    late = times[last] >= most * (1.0 - DURATION_TOLERANCE)
    early = times[-1] + setpoints.cycle_time <= least * (1.0 + DURATION_TOLERANCE)
    if late or early:
        arrival = times[last + 1] if late else times[-1]
        asked = f"at {'most' if late else 'least'} " * (least < most) + f"{most if late else least:.6g} s"
        yield f"The motion arrives at {arrival:.6g} s, and the spec asks for {asked} (move.duration)."


def _left_travel(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say where an axis is beyond its travel."""
    for column, axis in enumerate(spec.machine().actuated):
        travel, position = spec.limits.of(column).travel, setpoints.position[:, column]
        if travel is None:
            continue
        beyond = np.maximum(travel[0] - position, position - travel[1])
        worst = int(beyond.argmax())
        if beyond[worst] > _nearby(spec, setpoints)[column]:
            template = (
                "Axis {axis.name} is at {at:.9g} {axis.unit} at {time:.6g} s, and {place} allows {low:.9g} "
                "to {high:.9g} {axis.unit}."
            )
            low, high = travel
            place, time = spec.limits.place(column, "travel"), setpoints.times[worst]
            yield Phrase(template, axis=axis, at=position[worst], time=time, place=place, low=low, high=high)


def _contradiction(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say where a velocity column does not belong to the positions beside it.

    A drive fed with both would follow one and not the other.
    """
    if setpoints.velocity is None or len(setpoints.position) < FEWEST_SETPOINTS:
        return
    central = _central(spec, setpoints)
    size = max(float(np.abs(central).max()), float(np.abs(setpoints.velocity).max()))
    noise = float(setpoints.resolution.max()) / setpoints.cycle_time
    apart: Array = np.abs(setpoints.velocity - central)[1:-1]
    worst, column = np.unravel_index(apart.argmax(), apart.shape)
    difference, axis = apart[worst, column], spec.machine().actuated[column]
    if difference > VELOCITY_TOLERANCE * size + noise + _missed_by_central(setpoints.velocity, central):
        template = (
            "The velocity at {time:.6g} s contradicts the positions around it by {found:.3g} "
            "{unit}/s: the artefact was altered; export it again."
        )
        yield Phrase(template, time=setpoints.times[worst + 1], found=difference, unit=axis.unit)


def _central(spec: Spec, setpoints: SampledProfile) -> Array:
    """Take central differences of positions, shape (samples, axes)."""
    steps = _differences(spec, setpoints, 1)
    before = np.concatenate([np.zeros_like(steps[:1]), steps[:-1]])
    return (before + steps) / (2.0 * setpoints.cycle_time)


def _missed_by_central(velocity: Array, central: Array) -> float:
    """Bound what central differences of positions miss of velocities that belong to them.

    Where the velocity bends one way, they differ by a quarter of the velocities' second differences at most,
    and by half of the central differences' own; twice that leaves room for bends both ways. Both bounds hold,
    and where one column was altered, one still does.
    """
    return min(
        float(np.abs(np.diff(velocity, 2, axis=0)).max()) / 2.0,
        float(np.abs(np.diff(central, 2, axis=0)).max()),
    )


def _off_their_places(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say which setpoint lies off the curve through the others."""
    if len(setpoints.position) < FEWEST_SETPOINTS:
        return
    curvatures = np.abs(_differences(spec, setpoints, 2))
    noise = 4.0 * setpoints.resolution + STANDING_TOLERANCE * _sizes(spec).max()
    for axis, bend, unsure in zip(spec.machine().actuated, curvatures.T, noise, strict=True):
        worst = int(bend.argmax())
        usual = max(
            bend[: max(worst - NEIGHBOURS, 0)].max(initial=0.0),
            bend[worst + NEIGHBOURS + 1 :].max(initial=0.0),
        )
        if bend[worst] > STANDS_OUT * usual + unsure:
            there, elsewhere = bend[worst] / setpoints.cycle_time, usual / setpoints.cycle_time
            template = (
                "The setpoint of {axis.name} at {time:.6g} s lies off the others: the velocity "
                "changes there by {there:.3g} {axis.unit}/s in a cycle, elsewhere by {elsewhere:.3g} "
                "{axis.unit}/s at most; the artefact was altered: export it again."
            )
            yield Phrase(template, axis=axis, time=setpoints.times[worst], there=there, elsewhere=elsewhere)


def _exceeded_limits(spec: Spec, setpoints: SampledProfile) -> Iterator[str]:
    """Say where the played setpoints ask the drives for more than the spec allows.

    Differences of positions are means of what a continuous motion has between them, so they do not exceed
    its peaks but by rounding: of the positions by half a spacing each.
    """
    cycle, times = setpoints.cycle_time, setpoints.times
    for order, (name, overshoot) in enumerate(OVERSHOOT.items(), start=1):
        played = np.abs(_differences(spec, setpoints, order)) / cycle**order
        rounding = 2 ** (order - 1) * setpoints.resolution / cycle**order
        for column, axis in enumerate(spec.machine().actuated):
            allowed = getattr(spec.limits.of(column), name)
            worst = int(played[:, column].argmax())
            demand = float(played[worst, column])
            if allowed is not None and demand > (1.0 + overshoot) * allowed + rounding[column]:
                unit = f"{axis.unit}{RATES[name]}"
                template = (
                    "The setpoints ask {name} for {found:.4g} {unit} at {time:.6g} s, and {place} "
                    "allows {allowed:.4g} {unit}."
                )
                place, values = spec.limits.place(column, name), {"found": demand, "allowed": allowed}
                yield Phrase(template, name=axis.name, unit=unit, time=times[worst], place=place, **values)


def _differences(spec: Spec, setpoints: SampledProfile, order: int) -> Array:
    """Take differences of positions, shape (samples, axes), the standstill before and the way on included."""
    position = setpoints.position
    onward = position[-1:] + setpoints.cycle_time * np.array(spec.move.final_velocity)
    return np.diff(np.concatenate([position[:1]] * (order - 1) + [position, onward]), order, axis=0)


def _nearby(spec: Spec, setpoints: SampledProfile) -> Array:
    """How far each axis may be off a place, in m (or rad)."""
    return np.asarray(TARGET_TOLERANCE * _sizes(spec) + setpoints.resolution)


def _sizes(spec: Spec) -> Array:
    """How far each axis moves, in m (or rad); the farthest axis stands in for one that does not."""
    distance = np.abs(spec.move.distance)
    return np.where(distance > 0.0, distance, distance.max() or 1.0)
