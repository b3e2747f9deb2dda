"""The way from where the axes stand to the first setpoint: slow, and without a step.

An axis may stand off the start by `can.start_tolerance`. A drive would go there within one cycle, faster than
the motion ever does. So the setpoints lead it there by the polynomial of least jerk that rests at both ends,
with a tenth of the motion's greatest velocity and acceleration at most. The load then swings by no more than
the axis stood off.
"""

from collections.abc import Sequence
from math import ceil

import numpy as np

from gen_profile_exporters.can import pdos
from gen_profile_exporters.can.drive_units import VELOCITY_UNIT, per_count
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.scaling import Demand, Setpoints, magnitude_counts
from gen_profile_exporters.exporter import Target

FRACTION = 0.1  # of the motion's greatest velocity and acceleration
CREEP = 0.001  # m/s and m/s² (or rad) of an axis that the motion leaves at rest
PEAK_VELOCITY, PEAK_ACCELERATION = 15 / 8, 10 / 3**0.5  # of the polynomial, for unit distance and time


def approach(rest_counts: Sequence[int], demand: Demand, target: Target) -> Setpoints:
    """Lead all axes to the first setpoint, to arrive there together.

    Parameters
    ----------
    rest_counts : sequence of int
        Where the axes stand, in counts.
    demand : Demand
        Of the motion.
    target : Target

    Returns
    -------
    Setpoints
        Of no cycle, where the axes stand at the first setpoint already, or the motion begins anywhere.
    """
    period = target.can.sync_period
    distance = np.array(rest_counts if demand.start is None else demand.start) - np.array(rest_counts)
    cycles = ceil(max(_durations(distance, demand, target)) / period)
    fraction = np.arange(cycles + 1)[:, None] / max(1, cycles)
    position = np.rint(rest_counts + distance * fraction**3 * (10 - 15 * fraction + 6 * fraction**2)).astype(
        np.int64
    )
    offsets = len(pdos.setpoint_fields(target.can)) - 1
    rest = np.zeros((cycles, len(rest_counts), offsets), dtype=np.int64)
    if target.can.mode != "csv":
        return Setpoints(period=period, position=position[1:], offsets=rest)
    rates = [float(per_count(VELOCITY_UNIT, target.can, axis)) / period for axis in target.axes]
    velocity = np.diff(np.rint(position * rates), axis=0).astype(np.int64)  # rounding adds nothing up
    return Setpoints(period=period, position=position[:-1], offsets=rest, velocity=velocity)


def _durations(distance: Integers, demand: Demand, target: Target) -> list[float]:
    """Shortest time in s in which each axis goes a distance in counts within its limits."""
    durations = []
    for column, axis in enumerate(target.axes):
        far, creep = abs(int(distance[column])), magnitude_counts(CREEP, axis)
        velocity = FRACTION * demand.velocity[column] or creep
        acceleration = FRACTION * demand.acceleration[column] or creep
        by_velocity = PEAK_VELOCITY * far / velocity
        durations.append(max(by_velocity, (PEAK_ACCELERATION * far / acceleration) ** 0.5))
    return durations
