"""What a spec states of a planner block's motions, whichever block it is."""

from gen_profile.planner.directions import planned_axes
from gen_profile.spec.model import Spec
from gen_profile.support.phrase import Phrase, placed
from gen_profile.support.units import RATES

LEAST_RATE = 1e-3  # change of a live parameter on the way, relative to its range's end; less is none
MARGIN = 2.0  # between targets and the travel's ends, relative to the allowed sway, for calming
QUICK_STOP_FACTOR = 2.0  # default deceleration of a quick stop, relative to the limit of the acceleration
QUICK_JERK = 4.0
ROOM = 1.25  # of the stated swing: how far damping may lead


def quick_limits(spec: Spec, axis: int) -> tuple[float, float]:
    """Deceleration and jerk of an axis's quick stop, where its limits are stated, in m (or rad) and s."""
    own = spec.limits.of(axis)
    assert own.acceleration and own.jerk
    return (
        spec.planner.quick_stop or QUICK_STOP_FACTOR * own.acceleration,
        spec.planner.quick_stop_jerk or QUICK_JERK * own.jerk,
    )


def target_range(spec: Spec, axis: int) -> tuple[float, float]:
    """Least and greatest target of an axis, where its travel is stated: with room for calming and damping."""
    travel = spec.limits.of(axis).travel
    assert travel is not None
    calming = MARGIN * min(spec.check.residual_sway.values()) if spec.planner.live_rate else 0.0
    margin = max(calming, damping_room(spec))
    return travel[0] + margin, travel[1] - margin


def damping_room(spec: Spec) -> float:
    """By how much, in m (or rad), damping may lead an axis away; 0 without a sensor."""
    disturbance = spec.planner.disturbance
    if spec.planner.sensor is None or disturbance is None or not disturbance.swing:
        return 0.0
    return ROOM * max(disturbance.swing.values())


def unstated_limits(spec: Spec) -> list[str]:
    """Say which limits of the axes are not stated, or above those of their quick stops."""
    planned = planned_axes(spec).items()
    return [fault for number, axis in planned for fault in _faults(spec, number, axis.suffix)]


def _faults(spec: Spec, number: int, suffix: str) -> list[str]:
    """Say which limits of an axis are not stated, or above those of its quick stop."""
    own, quick, quick_jerk = spec.limits.of(number), spec.planner.quick_stop, spec.planner.quick_stop_jerk
    of = Phrase(" of {axis}", axis=spec.machine().actuated[number].name) if suffix else ""
    template = "required{of} for a planner block, which keeps it in every motion"
    faults: list[str] = [
        placed(f"limits.{name}", Phrase(template, of=of))
        for name in (*RATES, "travel")
        if getattr(own, name) is None
    ]
    if quick and own.acceleration and quick < own.acceleration:
        template = "must be at least limits.acceleration{of}, {least:g}, found {found:g}"
        problem = Phrase(template, of=of, least=own.acceleration, found=quick)
        faults.append(placed("planner.quick_stop", problem))
    if quick_jerk and own.jerk and quick_jerk < own.jerk:
        template = "must be at least limits.jerk{of}, {least:g}, found {found:g}"
        problem = Phrase(template, of=of, least=own.jerk, found=quick_jerk)
        faults.append(placed("planner.quick_stop_jerk", problem))
    return faults
