"""A sampled motion as quintic segments whose knots lie on the cycle grid.

A segment from cycle ``first[k]`` to ``first[k + 1]`` takes position, velocity and acceleration of the motion
over at both ends (quintic Hermite interpolation), so the whole is twice continuously differentiable. Segments
are as long as the error at the cycles between allows; a single cycle always fits.
"""

import math
from functools import lru_cache

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array, read_only

POSITION_ERROR = 1e-9  # m (or rad), of a segment at the cycles inside it
ACCELERATION_ERROR = 1e-6  # m/s²
LEAST_SHARE = 0.01  # of the length that would fit, below which it is not said how much longer it could be
POINTS = 16, 4096  # where peaks are looked for: per segment, and of all, at least


@attrs.frozen(kw_only=True, eq=False)
class QuinticSegments:
    """Piecewise quintic motion; after its last cycle it holds `target`.

    Attributes
    ----------
    cycle_time : float
        s.
    first : (segments + 1,) array of int
        Cycle at which each segment begins, and the cycle of the end.
    coefficients : (segments, 6, axes) array
        Lowest power first, of the time in s since the segment's begin.
    target : (axes,) array
    """

    cycle_time: float
    first: NDArray[np.int64]
    coefficients: Array = attrs.field(converter=read_only)
    target: Array = attrs.field(converter=read_only)

    def at_cycles(self) -> tuple[Array, Array, Array]:
        """Evaluate position, velocity and acceleration at every cycle, each of shape (samples, axes).

        The operations and their order are those of the playback block, so that both round alike.
        """
        cycles = np.arange(self.first[-1])
        segment = np.searchsorted(self.first, cycles, side="right") - 1
        time: Array = (cycles - self.first[segment]) * np.float64(self.cycle_time)
        position, velocity, acceleration = horner(self.coefficients[segment], time[:, None])
        still = np.zeros((1, len(self.target)))
        return (
            np.concatenate([position, self.target[None]]),
            np.concatenate([velocity, still]),
            np.concatenate([acceleration, still]),
        )

    def peaks(self) -> Array:
        """Bound the magnitudes of velocity, acceleration and jerk, between cycles too; shape (3, axes).

        Between points that are δ apart, a function exceeds the greater of its values there by at most δ²/8
        times the greatest magnitude of its second derivative.
        """
        length = np.diff(self.first) * self.cycle_time
        points = max(POINTS[0], POINTS[1] // len(length))
        time = length[:, None] * np.linspace(0.0, 1.0, points)
        powers = time[:, :, None] ** np.arange(5)
        size: dict[int, Array] = {}
        for order in (5, 4, 3, 2, 1):
            factors = np.array([math.perm(power, order) for power in range(order, 6)], dtype=np.float64)
            scaled = self.coefficients[:, order:, :] * factors[:, None]
            values = np.abs(powers[:, :, : 6 - order] @ scaled)
            spacing = (length / (points - 1))[:, None]
            size[order] = values.max(axis=1) + spacing**2 / 8.0 * size.get(order + 2, 0.0)
        return np.array([size[order].max(axis=0) for order in (1, 2, 3)])


def fit(samples: Array, cycle_time: float) -> QuinticSegments:
    """Cover a motion with as few segments as the allowed errors need.

    Parameters
    ----------
    samples : (3, cycles + 1, axes) array
        Position, velocity and acceleration in m, m/s, m/s² (or rad …).
    cycle_time : float
        s.
    """
    last = samples.shape[1] - 1
    allowed = samples[::2] / np.array([POSITION_ERROR, ACCELERATION_ERROR])[:, None, None]
    knots, length = [0], 1
    while knots[-1] < last:
        begin = knots[-1]
        length = _longest(samples, allowed, begin, length, cycle_time)
        knots.append(begin + length)
    first = np.array(knots)
    duration = (np.diff(first) * cycle_time)[:, None]
    pieces = hermite(samples[:, first[:-1]], samples[:, first[1:]], duration)
    return QuinticSegments(
        cycle_time=cycle_time, first=first, coefficients=np.moveaxis(pieces, 0, 1), target=samples[0, -1]
    )


def hermite(begin: Array, end: Array, duration: Array | float) -> Array:
    """Interpolate by a quintic; `begin` and `end` hold position, velocity, acceleration.

    Parameters
    ----------
    begin, end : (3, …, axes) array
    duration : float or (…, 1) array
        s.

    Returns
    -------
    (6, …, axes) array
        Coefficients, lowest power first.
    """
    (p0, v0, a0), (p1, v1, a1) = begin, end
    t = duration
    missing = p1 - p0 - t * (v0 + 0.5 * t * a0)
    speed = t * (v1 - v0 - t * a0)
    push = 0.5 * t * t * (a1 - a0)
    third = (10.0 * missing - 4.0 * speed + push) / t**3
    fourth = (-15.0 * missing + 7.0 * speed - 2.0 * push) / t**4
    fifth = (6.0 * missing - 3.0 * speed + push) / t**5
    return np.array([p0, v0, 0.5 * a0, third, fourth, fifth])


def horner(coefficients: Array, time: Array) -> tuple[Array, Array, Array]:
    """Evaluate position, velocity and acceleration as the playback block does, operation by operation."""
    c0, c1, c2, c3, c4, c5 = np.moveaxis(coefficients, -2, 0)
    return (
        c0 + time * (c1 + time * (c2 + time * (c3 + time * (c4 + time * c5)))),
        c1 + time * (2.0 * c2 + time * (3.0 * c3 + time * (4.0 * c4 + time * (5.0 * c5)))),
        2.0 * c2 + time * (6.0 * c3 + time * (12.0 * c4 + time * (20.0 * c5))),
    )


def _longest(samples: Array, allowed: Array, begin: int, guess: int, cycle_time: float) -> int:
    """Find the longest segment that fits: tried where its error says, and now and then in between.

    `allowed` has positions and accelerations in units of their allowed errors.
    """
    fits, fails, trial = 1, samples.shape[1] - begin, 0
    while fails - fits > 1:
        trial += 1
        length = min(max(guess, fits + 1), fails - 1)
        ends = np.concatenate([samples[:, begin], samples[:, begin + length]])
        reach = _reach(ends, allowed[:, begin + 1 : begin + length], cycle_time)
        if reach >= 1.0:
            fits = length
        else:
            fails = length
        guess = int(min(reach, 2.0) * length) if trial % 4 else min((fits + fails) // 2, 2 * fits)
    return fits


def _reach(ends: Array, inside: Array, cycle_time: float) -> float:
    """Predict how many times as long a segment would fit; at least 1 where this one does.

    Errors of a quintic's position and acceleration grow with the sixth and fourth power of its length.
    """
    error = _interpolation(inside.shape[1] + 1, cycle_time) @ ends - inside
    far, bent = np.maximum.reduce(np.abs(error, out=error), axis=(1, 2)).tolist()
    return float(1.0 / max(far ** (1 / 6), bent**0.25, LEAST_SHARE))


@lru_cache(maxsize=1024)
def _interpolation(length: int, cycle_time: float) -> Array:
    """Matrices from what holds at a segment's ends to what `_longest` allows inside it."""
    ends, times = np.eye(6), np.arange(1, length, dtype=np.float64) * cycle_time
    position, _, acceleration = horner(hermite(ends[:3], ends[3:], length * cycle_time), times[:, None])
    return np.array([position / POSITION_ERROR, acceleration / ACCELERATION_ERROR])
