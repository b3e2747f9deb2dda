"""Values that are well formed and cannot be meant, or hardly, such as millimetres typed for metres.

What is judged here takes no solution of the move: its mean speed, the quasi-static sway under the least
acceleration that makes it, the ropes' lengths.
"""

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import RESIDUAL_SHARE, Spec
from gen_profile.support.errors import SpecError
from gen_profile.support.phrase import Phrase, placed
from gen_profile.support.units import RATES

STEP = 1e-6  # m (or rad), for differences of forces and outputs about rest
# (unit of the axis, what) → beyond which it is implausible, and impossible
FAST = {
    ("m", "velocity"): (15.0, 100.0),
    ("m", "acceleration"): (200.0, 1e4),
    ("rad", "velocity"): (100.0, 1e4),
    ("rad", "acceleration"): (1e4, 1e6),
}
LONG_WAY = 1000.0  # m, longer than the runways of cranes
MANY_TURNS = 4.0 * math.pi  # rad, of an axis that is not stated to wrap (axis.modulo)
MOST_TURNS = 10.0 * math.pi  # rad, of any: 31.4 is less than most angles in degrees
SHORT_IN_SMALL_UNITS = {"m": 100.0, "rad": 10.0}  # moves that may be in mm, or in degrees
HASTE = 0.1  # s, within which no crane moves: a duration that lost a factor of 1000
LONG_TIME, SLOW = 1000.0, 5e-3  # s, and m/s (or rad/s): a duration in ms rather than so slow a move
LARGE_SWING = 0.8  # rad: sin and tan are 10 % and 29 % off the angle
RESIDUAL_OF_ROPE = 0.5  # a load that hangs by 30° after the move
RESIDUAL_OF_MOVE = 0.05
WORST_TIMING = 4.0  # times its quasi-static sway, a mode sways after steps of acceleration to +a, -a and 0
FAR = 10.0  # times the load's whole way
HEAVY = 50.0  # times its payload, that a hook block may weigh
LOOSE = 0.5  # of the longest move, that an axis may be away from its setpoint


Implausibility = tuple[Phrase, bool]  # what is wrong with a value, and whether that is refused


@attrs.frozen(kw_only=True, eq=False)
class Scale:
    """What a machine's loads can do in a move, by load in the plant's order.

    Attributes
    ----------
    depth : (loads,) array
        How far they hang below the suspension, in m; 0 where nothing hangs.
    way : (loads,) array
        How far the axes' move takes them, in m.
    sway : (loads,) array
        Greatest sway in m that is to be expected of any motion of this length and duration.
    angle : (loads,) array
        Of the ropes in rad, under the least acceleration that makes the move.
    """

    depth: Array
    way: Array
    sway: Array
    angle: Array


def refuse_implausible(spec: Spec) -> None:
    """Refuse values that cannot be meant.

    Raises
    ------
    SpecError
        With a sentence for each.
    """
    if sentences := [sentence for sentence, refused in _implausibilities(spec) if refused]:
        raise SpecError(*sentences)


def plausibility_warnings(spec: Spec) -> tuple[str, ...]:
    """Say which values are implausible, a sentence each."""
    return tuple(sentence for sentence, refused in _implausibilities(spec) if not refused)


def _implausibilities(spec: Spec) -> Iterator[Implausibility]:
    scale = _scale(spec)
    yield from _masses(spec)
    yield from _move(spec)
    yield from _limits(spec, scale)
    yield from _residual(spec, scale)
    yield from _swing(spec, scale)
    yield from _drive(spec)


def _odd(place: str, problem: str, /, *, refused: bool = False, **values: Any) -> Implausibility:
    """Question the value at a place; the problem is a template of `gen_profile.support.phrase.Phrase`."""
    return placed(place, Phrase(problem, **values)), refused


def _thousandth(value: float, what: str) -> Phrase:
    """End a sentence by what a value means if it is in thousandths, as one below 1 hardly is."""
    template = "{what}; did you mean {meant:.4g}?" if value >= 1.0 else "{what}; state less."
    return Phrase(template, what=what, meant=value / 1e3)


def _fast(value: float, unit: str, place: str, problem: str, cure: str) -> Iterator[Implausibility]:
    """Question a speed or acceleration."""
    kind = "acceleration" if place.endswith("acceleration") else "velocity"
    hardly, never = FAST[unit, kind]
    if value > hardly:
        verdict = "which no such machine reaches" if value > never else "which few machines reach"
        template = "{problem}, {verdict}; {cure}"
        yield _odd(place, template, problem=problem, verdict=verdict, cure=cure, refused=value > never)


def _masses(spec: Spec) -> Iterator[Implausibility]:
    """Question a hook block that no such load needs; an empty hook, of a payload of 0, is left alone."""
    if spec.plant.type != "double-pendulum-crane":
        return
    hook, load = spec.plant.parameters["m1"], spec.plant.parameters["m2"]
    if hook > HEAVY * load > 0.0:
        cure = _thousandth(hook, "masses are in kg")
        template = "a hook block of {hook:g} kg is {times:.3g} times as heavy as its payload; {cure}"
        yield _odd("plant.m1", template, hook=hook, times=hook / load, cure=cure)


def _move(spec: Spec) -> Iterator[Implausibility]:
    """Question distances, the duration, and speeds that follow from them."""
    move, axes = spec.move, spec.machine().actuated
    ways, speeds = map(abs, move.distance), map(abs, move.final_velocity)
    scales = spec.axis_scales()
    for axis, scale, distance, speed in zip(axes, scales, ways, speeds, strict=True):
        unit = axis.unit
        cure = _move_meant(distance, move.duration, unit)
        said = Phrase("{name} moves {distance:g} {unit}", name=axis.name, distance=distance, unit=unit)
        if not move.shortest:
            mean = distance / move.duration
            template = "{said} in {duration:g} s, at {mean:.3g} {unit}/s on average"
            statement = Phrase(template, said=said, duration=move.duration, mean=mean, unit=unit)
            hurried = list(_fast(mean, unit, "move.duration", statement, cure))
            yield from hurried
            if hurried:
                continue
        if unit == "m" and distance > LONG_WAY:
            template = "{said}, farther than any crane's runway; {cure}"
            yield _odd("move.distance", template, said=said, cure=cure)
        elif unit == "rad" and distance > (MOST_TURNS if scale.modulo else MANY_TURNS):
            turns = distance / (2.0 * math.pi)
            template = "{said}, which are {turns:.3g} turns; {cure}"
            yield _odd("move.distance", template, said=said, turns=turns, cure=cure)
        statement = Phrase("{name} ends at {speed:g} {unit}/s", name=axis.name, speed=speed, unit=unit)
        cure = _thousandth(speed, Phrase("speeds are in {unit}/s", unit=unit))
        yield from _fast(speed, unit, "move.final_velocity", statement, cure)
    longest = max(map(abs, move.distance))
    if not move.shortest and move.duration >= LONG_TIME and 0.0 < longest < SLOW * move.duration:
        cure = _thousandth(move.duration, "durations are in s")
        template = "{duration:g} s for {longest:g} m (or rad) is slow; {cure}"
        yield _odd("move.duration", template, duration=move.duration, longest=longest, cure=cure)


def _move_meant(distance: float, duration: float, unit: str) -> Phrase:
    """End a sentence on a move that is too fast by the slip that explains it: mm, degrees, or a lost 1000."""
    slow_enough = FAST[unit, "velocity"][0] * duration
    meant = distance / 1e3 if unit == "m" else math.radians(distance)
    if distance >= SHORT_IN_SMALL_UNITS[unit] and meant <= slow_enough:
        template = "distances are in {unit} and durations in s; did you mean {meant:.4g} {unit}?"
        return Phrase(template, unit=unit, meant=meant)
    if duration < HASTE and distance <= 1e3 * slow_enough:
        template = "distances are in {unit} and durations in s; did you mean {meant:.4g} s?"
        return Phrase(template, unit=unit, meant=1e3 * duration)
    return Phrase("distances are in {unit} and durations in s; allow more time, or move less.", unit=unit)


def _limits(spec: Spec, scale: Scale) -> Iterator[Implausibility]:
    """Question limits that hold nothing back."""
    units = {axis.name: axis.unit for axis in spec.machine().actuated}
    for place, value in spec.limits.stated().items():
        *table, kind = place.split(".")
        unit = units[table[-1]] if len(table) > 1 else max(units.values(), key="m".__eq__)
        if (unit, kind) in FAST:
            per = f"{unit}{RATES[kind]}"
            cure = _thousandth(value, Phrase("limits are in {per}", per=per))
            yield from _fast(value, unit, place, Phrase("allows {value:g} {per}", value=value, per=per), cure)
        if unit == "m" and kind == "travel" and (far := max(map(abs, value))) > LONG_WAY:
            cure = _thousandth(far, "lengths are in m")
            template = "reaches {far:g} m, farther than any crane's runway; {cure}"
            yield _odd(place, template, far=far, cure=cure)
    for name, rate in spec.planner.live_rate.items():
        statement = Phrase("hoists at {rate:g} m/s", rate=rate)
        cure = _thousandth(rate, "rates are in m/s")
        yield from _fast(rate, "m", f"planner.live_rate.{name}", statement, cure)
    sway, depth = spec.limits.sway, scale.depth[-1]
    if sway is not None and sway > (depth or FAR * max(scale.way[-1], *scale.depth)) > 0.0:
        template = "the ropes' {depth:.4g} m" if depth else "{times:g} times the move"
        what = Phrase(template, depth=depth, times=FAR)
        cure = _thousandth(sway, "lengths are in m")
        template = "{sway:g} m are more than {what}; {cure}"
        yield _odd("limits.sway", template, sway=sway, what=what, cure=cure, refused=True)


def _residual(spec: Spec, scale: Scale) -> Iterator[Implausibility]:
    """Question limits of the residual sway that every motion keeps."""
    limits = spec.check.residual_sway
    usual = RESIDUAL_SHARE * spec.move.longest(spec.machine())
    one_limit = len(set(limits.values())) == 1
    from_rest = not spec.move.initial and spec.move.stops
    end_load = spec.machine().end_load
    ends = spec.machine().loads[end_load]  # others, such as a hook, may be left to swing
    for load, limit in reversed(list(limits.items())):  # the end load, which hangs lowest, speaks for all
        if spec.check.default or math.isclose(limit, usual):
            continue  # what was not typed is no slip
        column = list(limits).index(load)
        place = "check.residual_sway" if one_limit else f"check.residual_sway.{load}"
        directions = end_load if load in ends else slice(column, column + 1)
        depth, way, sway = (float(of[directions].max()) for of in (scale.depth, scale.way, scale.sway))
        cure = _thousandth(limit, "lengths are in m")
        if depth and limit > RESIDUAL_OF_ROPE * depth:
            template = "{limit:g} m are more than half of the {depth:.4g} m by which the {load} hangs; {cure}"
            yield _odd(place, template, limit=limit, depth=depth, load=load, cure=cure, refused=True)
        elif from_rest and not depth and limit > FAR * way > 0.0:
            template = (
                "{limit:g} m are more than {times:g} times the {way:.4g} m that the move takes the "
                "{load}; {cure}"
            )
            yield _odd(place, template, limit=limit, times=FAR, way=way, load=load, cure=cure, refused=True)
        elif load in ends and from_rest and limit > max(sway, RESIDUAL_OF_MOVE * way) > 0.0:
            template = (
                "{limit:g} m are more than the {sway:.2g} m that almost any motion of this length "
                "and time leaves, so the check tells nothing; state less."
            )
            yield _odd(place, template, limit=limit, sway=sway)
        else:
            continue
        if one_limit:
            return


def _swing(spec: Spec, scale: Scale) -> Iterator[Implausibility]:
    """Question moves that swing a load out of the range in which it behaves like a spring."""
    angle = float(np.max(scale.angle, initial=0.0))
    if not spec.move.shortest and angle > LARGE_SWING:
        template = (
            "the move swings the load by some {angle:.0f}°, far beyond small angles; distances "
            "are in m and durations in s, so allow more than {duration:g} s."
        )
        yield _odd("move.duration", template, angle=math.degrees(angle), duration=spec.move.duration)


def _drive(spec: Spec) -> Iterator[Implausibility]:
    """Question what is stated of the drives."""
    tau = spec.actuator.tau
    if tau is not None and not spec.move.shortest and tau > spec.move.duration:
        cure = _thousandth(tau, "time constants are in s")
        yield _odd("actuator.tau", "{tau:g} s are longer than the whole move; {cure}", tau=tau, cure=cure)
    longest = spec.move.longest(spec.machine()) or math.inf
    for name in ("start_tolerance", "following_error"):
        value, usual = getattr(spec.can, name), getattr(CanSpec(), name)
        if value is not None and value != usual and value > LOOSE * longest:
            cure = _thousandth(value, "tolerances are in m")
            template = "{value:g} m are more than half of the move; {cure}"
            yield _odd(f"can.{name}", template, value=value, cure=cure)


def _scale(spec: Spec) -> Scale:
    """Estimate what the loads can do; nothing is said of a machine whose equations fail at the target."""
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            return _scale_at_target(spec)
    except (ArithmeticError, np.linalg.LinAlgError):
        return Scale(**dict.fromkeys(("depth", "way", "sway", "angle"), np.zeros(len(spec.machine().loads))))


def _scale_at_target(spec: Spec) -> Scale:
    """Take the machine's equations about rest at the target.

    Of M_uu q̈_u = K_u − M_auᵀ q̈_a, q̈_u = 0 gives the quasi-static swing, and without K_u, when the axes jump
    faster than anything swings, q_u = −M_uu⁻¹ M_auᵀ Δq_a. A move of d in T takes 4 d/T² at least.
    """
    plant, target = spec.machine(), list(spec.move.target)
    named = SimpleNamespace(**spec.plant.parameters)
    still = [0.0] * len(plant.unactuated)
    at_rest = [0.0] * len(target)
    swung: list[list[float]] = (STEP * np.eye(len(still))).tolist()
    rest, *near = (plant.equations(q_u, still, target, at_rest, named) for q_u in (still, *swung))
    level, *views = (plant.outputs(q_u, target, named) for q_u in (still, *swung))
    stiffness = -np.array([one.K_u for one in near], dtype=float).T / STEP
    inputs = np.array(rest.M_au, dtype=float).T
    held = np.linalg.lstsq(stiffness, inputs, rcond=None)[0]
    free = np.linalg.lstsq(np.array(rest.M_uu, dtype=float), inputs, rcond=None)[0]
    sway = np.array([view.sway for view in views], dtype=float).T / STEP
    angle = np.array([view.angle for view in views], dtype=float).T / STEP
    distance = np.array(spec.move.distance)
    least = 4.0 * distance / spec.move.duration**2
    depth = np.maximum(0.0, -np.array(level.height, dtype=float))
    way = np.abs(sway @ free) @ np.abs(distance)
    worst = WORST_TIMING * np.abs(sway @ held) @ np.abs(least)
    angles = np.minimum(np.abs(angle @ held @ least), np.abs(angle @ free @ distance))
    return Scale(
        depth=depth,
        way=way,
        sway=way if spec.move.shortest else np.minimum(worst, way),
        angle=np.where(depth > 0.0, angles, 0.0),
    )
