"""Whether the axes of a planner block reach the velocity that their limits allow."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.design import PlannerBlock
from gen_profile.planner.directions import planned_axes
from gen_profile.planner.planner import Planner
from gen_profile.spec.model import AxisLimitsSpec, Spec

RUN_UP = 1.5  # slow periods in which an axis at its limits is at a speed that it can be left from
ROOM = 1e5  # m: travel that no axis comes to the end of
SETTLING = 10.0  # periods after which a held stick's velocity no longer changes
REACHED = 0.99


def slow_axes(spec: Spec, block: PlannerBlock) -> tuple[str, ...]:
    """Say which axes stay below the velocity of their limits, however far they go.

    A block goes no faster than it can stop within the time that it plans ahead. That is tried, where an axis
    is slow beside the swing: a stick is held at full speed, at every corner of the live ranges.

    Parameters
    ----------
    spec : Spec
    block : PlannerBlock
        Of that spec.

    Raises
    ------
    CosimulationError
        There is no C compiler.
    """
    period = block.period
    limits = {number: spec.limits.of(number) for number in planned_axes(spec)}
    quick = [
        (own.velocity or 0.0)
        <= RUN_UP * period * min(own.acceleration or 0.0, 0.5 * period * (own.jerk or 0.0))
        for own in limits.values()
    ]
    return () if all(quick) else tuple(_sentences(spec, period))


def _sentences(spec: Spec, period: float) -> Iterator[str]:
    axes, limits, live = planned_axes(spec), spec.limits, spec.planner.live
    travel = {limits.place(number, "travel"): (-ROOM, ROOM) for number in axes}
    planner = Planner(spec.changed(travel))
    corners = [dict(zip(live, ends, strict=True)) for ends in product(*live.values())]
    own_limits = [limits.of(number) for number in axes]
    reached = [_reached(planner, own_limits, corner, period) for corner in corners]
    for (number, axis), speeds in zip(axes.items(), np.transpose(reached), strict=True):
        own, at = limits.of(number), int(np.argmin(speeds))
        assert own.velocity and own.acceleration and own.jerk
        if speeds[at] < REACHED * own.velocity:
            scarce = "acceleration" if 3.0 * own.acceleration < period * own.jerk else "jerk"
            where = ", ".join(f"{name} = {value:g}" for name, value in corners[at].items())
            yield (
                f"{limits.place(number, 'velocity')}: of {own.velocity:g} {axis.unit}/s the block reaches "
                f"{speeds[at]:.2g} {axis.unit}/s{' with ' if where else ''}{where}: a stop from more would "
                f"take longer than it plans ahead; raise {limits.place(number, scarce)}."
            )


def _reached(
    planner: Planner, limits: Sequence[AxisLimitsSpec], live: Mapping[str, float], period: float
) -> Array:
    """Hold a stick at full speed, and find the greatest velocity of each axis, shape (axes,)."""
    full = [own.velocity or 0.0 for own in limits]
    rise = max((own.velocity or 0.0) / (own.acceleration or 1.0) for own in limits)
    planner.restart(np.zeros(len(full)) if len(full) > 1 else 0.0)
    issued = planner.hold(rise + SETTLING * period, velocity=full if len(full) > 1 else full[0], live=live)
    return np.asarray(np.abs(issued.velocity).reshape(-1, len(full)).max(axis=0))
