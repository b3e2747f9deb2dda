"""How soon an axis alone, without any load, comes to a velocity or to a place within its limits.

Velocities change by jerk, acceleration and jerk; places are reached over one velocity, as far as the way lets
it rise (the double-S profile). No load makes any motion quicker.
"""

from __future__ import annotations

import math

import attrs

BISECTIONS = 40  # of a velocity, to a millionth of a millionth


@attrs.frozen(kw_only=True)
class AxisLimits:
    """Greatest velocity, acceleration and jerk of an axis, in m (or rad) and s."""

    velocity: float
    acceleration: float
    jerk: float


def to_velocity(velocity: float, acceleration: float, wanted: float, limits: AxisLimits) -> float:
    """Tell the time in s from a velocity and an acceleration to another velocity, held."""
    return _ramp(velocity, acceleration, wanted, limits)[0]


def to_place(way: float, velocity: float, acceleration: float, limits: AxisLimits) -> float:
    """Tell the time in s from a velocity and an acceleration to rest, so far away in m (or rad)."""
    low, high = -limits.velocity, limits.velocity
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _over(middle, velocity, acceleration, limits)[1] < way:
            low = middle
        else:
            high = middle
    time, led = _over(high, velocity, acceleration, limits)
    cruise = (way - led) / high if abs(high) > 0.999 * limits.velocity else 0.0
    return time + max(cruise, 0.0)


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
