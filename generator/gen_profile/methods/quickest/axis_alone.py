"""How soon an axis alone, without any load, comes to a velocity or to a place within its limits.

Velocities change by jerk, acceleration and jerk; places are reached over one velocity, as far as the way lets
it rise (the double-S profile). No load makes any motion quicker.
"""

from __future__ import annotations

import math

import attrs
from scipy.optimize import brentq

EXACT = 1e-12  # of the greatest velocity, to which the one on the way is found


@attrs.frozen(kw_only=True)
class AxisLimits:
    """Greatest velocity, acceleration and jerk of an axis, in m (or rad) and s."""

    velocity: float
    acceleration: float
    jerk: float


def to_velocity(velocity: float, acceleration: float, wanted: float, limits: AxisLimits) -> float:
    """Tell the time in s from a velocity and an acceleration to another velocity, held."""
    return _ramp(velocity, acceleration, wanted, limits)[0]


def braked(velocity: float, acceleration: float, limits: AxisLimits) -> tuple[float, float]:
    """Tell the time in s and the way in m (or rad) from a velocity and an acceleration to rest, anywhere."""
    return _ramp(velocity, acceleration, 0.0, limits)


def to_place(way: float, velocity: float, acceleration: float, limits: AxisLimits) -> float:
    """Tell the time in s from a velocity and an acceleration to rest, so far away in m (or rad)."""
    most = limits.velocity

    def beyond(cruise: float) -> float:
        return _over(cruise, velocity, acceleration, limits)[1] - way

    cruise = most if beyond(most) <= 0.0 else -most
    if beyond(-most) < 0.0 < beyond(most):
        cruise = brentq(beyond, -most, most, xtol=EXACT * most)
    time, led = _over(cruise, velocity, acceleration, limits)
    return time + (max((way - led) / cruise, 0.0) if abs(cruise) == most else 0.0)


def _over(cruise: float, velocity: float, acceleration: float, limits: AxisLimits) -> tuple[float, float]:
    """Time and way over a velocity to rest."""
    (first, led), (last, ends) = (
        _ramp(velocity, acceleration, cruise, limits),
        _ramp(cruise, 0.0, 0.0, limits),
    )
    return first + last, led + ends


def _ramp(velocity: float, acceleration: float, wanted: float, limits: AxisLimits) -> tuple[float, float]:
    """Time and way to a velocity that is held from then on."""
    jerk, most = limits.jerk, limits.acceleration
    rests_at = velocity + 0.5 * acceleration * abs(acceleration) / jerk  # where the acceleration is taken off
    sign = 1.0 if wanted >= rests_at else -1.0
    v, a, to = sign * velocity, sign * acceleration, sign * wanted
    top = math.sqrt(max(jerk * (to - v) + 0.5 * a * a, 0.0))
    held = 0.0
    if top > most:
        top = max(most, a)
        held = (to - v - (2.0 * top * top - a * a) / (2.0 * jerk)) / top
    way, time = 0.0, 0.0
    for lasts, u in (((top - a) / jerk, jerk), (max(held, 0.0), 0.0), (top / jerk, -jerk)):
        way += lasts * (v + lasts * (a / 2.0 + lasts * u / 6.0))
        v, a, time = v + lasts * (a + 0.5 * lasts * u), a + lasts * u, time + lasts
    return time, sign * way
