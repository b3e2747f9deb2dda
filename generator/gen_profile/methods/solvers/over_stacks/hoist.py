"""The hoist's motion: up as fast as it can, through the height that is needed, and down as late as it can.

Upwards is positive here. Speed, acceleration and jerk have one limit each, the same both ways. A change of
speed takes the jerk-limited ramps of any drive (L. Biagiotti and C. Melchiorri, Trajectory planning for
automatic machines and robots, 2008, section 3.4); what is looked for is how fast to go up and down.
"""

import math
from collections.abc import Callable

import attrs
import numpy as np

from gen_profile.motion.profile import Array

BISECTIONS = 44
NOTHING = 1e-9  # s, pieces of which are left out
MISSED = 1e-6  # m, by which a motion may end elsewhere


@attrs.frozen(kw_only=True)
class Rates:
    """Greatest speed, acceleration and jerk of an axis, in m/s, m/s² and m/s³."""

    speed: float
    acceleration: float
    jerk: float

    def ramp_time(self, change: float) -> float:
        """Time in s that a change of speed takes."""
        change = abs(change)
        if change < self.acceleration**2 / self.jerk:
            return 2.0 * math.sqrt(change / self.jerk)
        return change / self.acceleration + self.acceleration / self.jerk

    def ramp(self, change: float) -> list[tuple[float, float]]:
        """Pieces (time, jerk) of a change of speed."""
        jerk, time = float(np.copysign(self.jerk, change)), self.ramp_time(change)
        edge = min(self.acceleration / self.jerk, time / 2.0)
        return [(edge, jerk), (time - 2.0 * edge, 0.0), (edge, -jerk)]


@attrs.frozen(kw_only=True, eq=False)
class Pieces:
    """A motion from rest by pieces of constant jerk.

    Attributes
    ----------
    lengths, jerks : (pieces,) arrays
    start : float
        m, where it begins.
    """

    lengths: Array
    jerks: Array
    start: float = 0.0

    @property
    def knots(self) -> Array:
        """Times of the ends of all pieces in s, from 0."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @property
    def duration(self) -> float:
        """In s."""
        return float(self.lengths.sum())

    def states(self) -> Array:
        """Position, velocity and acceleration at the knots, shape (pieces + 1, 3)."""
        t, j = self.lengths, self.jerks
        states = np.zeros((len(t) + 1, 3))
        states[0, 0] = self.start
        states[1:, 2] = np.cumsum(j * t)
        a = states[:-1, 2]
        states[1:, 1] = np.cumsum(a * t + j * t**2 / 2.0)
        v = states[:-1, 1]
        states[1:, 0] = self.start + np.cumsum(v * t + a * t**2 / 2.0 + j * t**3 / 6.0)
        return states

    def peak(self) -> float:
        """Highest position: at a knot, or where the speed is 0 within a piece."""
        (x, v, a), j = self.states()[:-1].T, self.jerks
        root = np.sqrt(np.maximum(a**2 - 2.0 * j * v, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.stack([np.where(j == 0.0, -v / a, (-a + sign * root) / j) for sign in (1.0, -1.0)])
        t = np.where((found > 0.0) & (found < self.lengths), found, 0.0)
        within = x + v * t + a * t**2 / 2.0 + j * t**3 / 6.0
        return float(max(within.max(initial=self.start), self.states()[-1, 0]))

    def at(self, times: Array) -> Array:
        """Position, velocity, acceleration and jerk at times in s, right-continuous, shape (times, 4)."""
        knots = self.knots
        piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(self.jerks) - 1)
        t = np.clip(times, 0.0, knots[-1]) - knots[piece]
        (x, v, a), j = self.states()[piece].T, self.jerks[piece]
        position = x + v * t + a * t**2 / 2.0 + j * t**3 / 6.0
        return np.stack([position, v + a * t + j * t**2 / 2.0, a + j * t, j], axis=1)

    def within(self, before: float, after: float) -> "Pieces":
        """Wait before and after it, for times in s."""
        lengths = np.concatenate([[before], self.lengths, [after]])
        jerks = np.concatenate([[0.0], self.jerks, [0.0]])
        return _kept(lengths, jerks, self.start)


def _kept(lengths: Array, jerks: Array, start: float) -> Pieces:
    kept = lengths > NOTHING
    return Pieces(lengths=lengths[kept], jerks=jerks[kept], start=start)


def _joined(pieces: list[tuple[float, float]], start: float) -> Pieces:
    lengths, jerks = np.array(pieces).reshape(-1, 2).T
    return _kept(lengths, jerks, start)


def rest_to_rest(way: float, rates: Rates) -> list[tuple[float, float]]:
    """Pieces (time, jerk) of the fastest way in m from rest to rest."""
    distance, sign = abs(way), float(np.copysign(1.0, way))
    speed = rates.speed
    if speed * rates.ramp_time(speed) > distance:
        speed = _greatest(lambda v: v * rates.ramp_time(v) <= distance, 0.0, speed)
    cruise = max(distance - speed * rates.ramp_time(speed), 0.0) / speed if distance else 0.0
    return [*rates.ramp(sign * speed), (cruise, 0.0), *rates.ramp(-sign * speed)]


def least_time(way: float, rates: Rates) -> float:
    """Least time in s of a way in m from rest to rest."""
    return sum(time for time, _ in rest_to_rest(way, rates))


def highest(duration: float, rise: float, top: float, rates: Rates, start: float = 0.0) -> Pieces | None:
    """Find the motion that is at every instant as high as it can be, from rest to rest.

    Parameters
    ----------
    duration : float
        s.
    rise : float
        m, from start to target.
    top : float
        m above the start, which it may not exceed.
    rates : Rates
    start : float
        m.

    Returns
    -------
    Pieces or None
        None where the time does not suffice for the rise.
    """
    up, down = rest_to_rest(top, rates), rest_to_rest(rise - top, rates)
    wait = duration - sum(time for time, _ in (*up, *down))
    if wait >= 0.0:
        return _joined([*up, (wait, 0.0), *down], start)
    through = _through(duration, rise, rates)
    if through is None or through.peak() <= top:
        return None if through is None else attrs.evolve(through, start=start)

    # it meets the top in passing: a slower hoist is nearly the highest then
    def low(speed: float) -> bool:
        slower = _through(duration, rise, attrs.evolve(rates, speed=speed))
        return slower is None or slower.peak() <= top

    speed = _greatest(low, 0.0, rates.speed)
    slower = _through(duration, rise, attrs.evolve(rates, speed=speed))
    return None if slower is None else attrs.evolve(slower, start=start)


def _through(duration: float, rise: float, rates: Rates) -> Pieces | None:
    """Go up and down again without a pause: 0 → v₁, cruise, → −v₂, cruise, → 0."""
    quick = rates.ramp_time(rates.speed)
    spare = duration - 2.0 * quick - rates.ramp_time(2.0 * rates.speed)
    first = (spare + rise / rates.speed) / 2.0
    if 0.0 <= first <= spare:
        return _joined(_turn(rates.speed, first, rates.speed, spare - first, rates), 0.0)

    # one number for each way: a speed up to the greatest, then seconds of cruising at it
    def split(effort: float) -> tuple[float, float]:
        return min(effort, rates.speed), max(effort - rates.speed, 0.0)

    def time(up: float, down: float) -> float:
        (v1, c1), (v2, c2) = split(up), split(down)
        return rates.ramp_time(v1) + c1 + rates.ramp_time(v1 + v2) + c2 + rates.ramp_time(v2)

    most = rates.speed + duration

    def down_of(up: float) -> float:
        return _greatest(lambda down: time(up, down) <= duration, 0.0, most)

    def gained(up: float) -> float:
        (v1, c1), (v2, c2) = split(up), split(down_of(up))
        turning = (v1 - v2) / 2.0 * rates.ramp_time(v1 + v2)
        return v1 * (rates.ramp_time(v1) / 2.0 + c1) + turning - v2 * (c2 + rates.ramp_time(v2) / 2.0)

    up = _greatest(lambda up: time(up, 0.0) <= duration and gained(up) <= rise, 0.0, most)
    if abs(gained(up) - rise) > MISSED * max(1.0, abs(rise)) or time(up, 0.0) > duration:
        return None
    (v1, c1), (v2, c2) = split(up), split(down_of(up))
    return _joined(_turn(v1, c1, v2, c2, rates), 0.0)


def _turn(v1: float, c1: float, v2: float, c2: float, rates: Rates) -> list[tuple[float, float]]:
    return [*rates.ramp(v1), (c1, 0.0), *rates.ramp(-v1 - v2), (c2, 0.0), *rates.ramp(v2)]


def _greatest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Find the greatest number for which something holds, as it does up to some number."""
    if holds(high):
        return high
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
