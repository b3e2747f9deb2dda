"""Slow motions from where the axes stand: to the start of a motion, and jogging.

They are designed and checked as every motion is, so the load hangs still afterwards, and streamed as every
motion is, with all that stops it.
"""

import math
from collections.abc import Mapping, Sequence

import attrs

from gen_profile.delivery.streaming.outcome import Source
from gen_profile.delivery.streaming.stream import actual_positions, designed
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.spec.model import Spec
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress
from gen_profile.support.suggestion import finite_number, number_meant, suggestion
from gen_profile_exporters.can.following_window import LEAST_USEFUL
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.can.streaming.approach import CREEP, FRACTION

# room for the shape of a motion: its peaks over those at even speed, or with even acceleration
PEAK_VELOCITY, PEAK_ACCELERATION = 4.0, 16.0
SETTLE = 1.5  # of the time in which residual sway is watched; shorter motions ask for greater accelerations


def to_start(source: Source, port: Port, *, simulate_drive: bool, tell: Progress) -> Source | None:
    """Design a slow motion from where the axes stand to the first setpoint; None where they stand there.

    Raises
    ------
    StreamAborted
        The drives do not tell where their axes stand, or another master is in command.
    CheckFailed, InfeasibleProblem, SolverDiverged
        There is no such motion.
    """
    spec = source.spec
    at = spec.move.start if simulate_drive else actual_positions(source, port, tell)
    apart = [abs(there - here) for here, there in zip(at, spec.move.start, strict=True)]
    if max(apart) <= spec.can.start_tolerance:
        return None
    return designed(slow(source, at, spec.move.start), tell)


def jog(
    source: Source, port: Port, distances: Sequence[str], *, simulate_drive: bool, tell: Progress
) -> Source:
    """Design a slow motion by distances from where the axes stand, each as ``AXIS=DISTANCE`` in m (or rad).

    Raises
    ------
    SpecError
        There is no such axis, or that is no distance, or one that leaves the travel.
    StreamAborted, CheckFailed, InfeasibleProblem, SolverDiverged
        As `to_start`.
    """
    by_axis = _distances(distances, list(source.spec.axis))
    at = source.spec.move.start if simulate_drive else actual_positions(source, port, tell)
    target = [here + by_axis.get(name, 0.0) for name, here in zip(source.spec.axis, at, strict=True)]
    for column, name in enumerate(source.spec.axis):
        low, high = source.spec.limits.of(column).travel or (-math.inf, math.inf)
        if name in by_axis and not low <= target[column] <= high:
            raise SpecError(
                f"jog {name}={by_axis[name]:g}: leads to {target[column]:g}, beyond limits.travel ({low:g} "
                f"to {high:g}); distances are in m (or rad)."
            )
    return designed(slow(source, at, target), tell)


def slow(source: Source, start: Sequence[float], target: Sequence[float]) -> Spec:
    """Ask for a motion with a tenth of the source's greatest velocity and acceleration at most.

    Parameters
    ----------
    source : Source
    start, target : sequence of float
        In m (or rad), one per axis.

    Returns
    -------
    Spec
        With limits on every axis, and a duration that leaves room below them.
    """
    spec, demand = source.spec, source.plan.demand
    durations, limits = [SETTLE * observation_time(spec)], {}
    for column, (name, axis) in enumerate(spec.axis.items()):
        scale = abs(axis.counts_per_metre)
        velocity = FRACTION * demand.velocity[column] / scale or CREEP
        acceleration = FRACTION * demand.acceleration[column] / scale or CREEP
        distance = abs(target[column] - start[column])
        durations.append(PEAK_VELOCITY * distance / velocity)
        durations.append((PEAK_ACCELERATION * distance / acceleration) ** 0.5)
        own = spec.limits.of(column)
        limits[name] = attrs.evolve(
            own, velocity=_lower(own.velocity, velocity), acceleration=_lower(own.acceleration, acceleration)
        )
    move = attrs.evolve(
        spec.move,
        start=tuple(start),
        target=tuple(target),
        duration=float(round(max(durations), 3)),
        shortest=False,
        final_velocity=(0.0,) * len(target),
    )
    window = spec.can.following_error  # stated for the whole motion, and maybe too wide for a slow one
    can = spec.can if window is None else attrs.evolve(spec.can, following_error=min(window, LEAST_USEFUL))
    return attrs.evolve(
        spec,
        name=f"{spec.name[:59]}-slow",
        move=move,
        can=can,
        limits=attrs.evolve(spec.limits, velocity=None, acceleration=None, axis=limits),
    )


def _lower(stated: float | None, peak: float) -> float:
    """Lower a limit to the peak of a slow motion, unless it is lower already."""
    return peak if stated is None else min(stated, peak)


def _distances(stated: Sequence[str], axes: Sequence[str]) -> Mapping[str, float]:
    distances = {}
    for text in stated:
        name, _, number = text.partition("=")
        if name not in axes:
            raise SpecError(f"jog {text}: unknown axis{suggestion(name, axes)}")
        distances[name] = finite_number(number)
        if math.isnan(distances[name]):
            hint = number_meant(number)
            wanted = "state the distance as a number of metres (or rad)"
            raise SpecError(f"jog {text}: {wanted}, as {name}=0.05{hint}.")
    return distances
