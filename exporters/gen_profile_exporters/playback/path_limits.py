"""How a playback block may speed up and slow down along its path, so that no peak of the motion is exceeded.

The block plays the path p(s) at the rate r = ds/dt, from 0 to 1, and changes r by its slope q = dr/dt:

    velocity p′ r, acceleration p″ r² + p′ q

With V, A, J the peaks of |p′|, |p″|, |p‴| of an axis and σ the sign of p′, it keeps

    −(A + min(0, σ p″ r²)) / V  ≤  q  ≤  (A − |p″| r²) / V

for every axis. Zero always lies between, as r ≤ 1; the velocity then stays within V, and the acceleration
within A: for q < 0, σ times it is at least −A and at most σ p″ r²; for q > 0, |p″| r² + V q is at most A.
Both bounds change steadily (where p′ changes its sign, the first only widens), by no more than

    W = max over axes of (J + 2 A Q) / V  per s,  Q = min over axes of A / V ≥ |q|

while q itself is otherwise changed by at most U = min over axes of J / V per s. From cycle to cycle an axis's
acceleration hence changes by no more than its *stop jerk* per s,

    J + 3 A Q + V W          (U ≤ W)
"""

from itertools import count

import attrs
import numpy as np

from gen_profile.motion.profile import Array

# Below these an axis counts as standing still: relative to the greatest of all axes, and at all.
SMALLEST_SHARE, SMALLEST_VELOCITY = 1e-12, 1e-30
# Stops that are tried, steps of the longest one, and steps that one has to be sooner than the motion.
STOPS, STEPS, MARGIN = 64, 512, 3


@attrs.frozen(kw_only=True, eq=False)
class PathLimits:
    """Constants of the rule above.

    Attributes
    ----------
    room : (axes,) array
        A / V in 1/s; Q for an axis that stands still.
    inverse_velocity : (axes,) array
        1 / V in s/m; 0 for an axis that stands still.
    slope : float
        Q in 1/s.
    slope_rate : float
        U in 1/s².
    jerk : (axes,) array
        Stop jerk in m/s³.
    """

    room: Array
    inverse_velocity: Array
    slope: float
    slope_rate: float
    jerk: Array


def path_limits(peaks: Array) -> PathLimits:
    """Work the constants out from the peaks of velocity, acceleration and jerk, shape (3, axes)."""
    velocity, acceleration, jerk = peaks
    moves = velocity > max(SMALLEST_SHARE * velocity.max(), SMALLEST_VELOCITY)
    if not moves.any():
        return PathLimits(
            room=np.ones_like(velocity),
            inverse_velocity=np.zeros_like(velocity),
            slope=1.0,
            slope_rate=1.0,
            jerk=np.zeros_like(velocity),
        )
    inverse = np.where(moves, 1.0 / np.where(moves, velocity, 1.0), 0.0)
    slope = float((acceleration * inverse)[moves].min())
    slope_rate = float((jerk * inverse)[moves].min())
    widest = float(((jerk + 2.0 * acceleration * slope) * inverse).max())
    return PathLimits(
        room=np.where(moves, acceleration * inverse, slope),
        inverse_velocity=inverse,
        slope=slope,
        slope_rate=slope_rate,
        jerk=jerk + 3.0 * acceleration * slope + velocity * widest,
    )


def latest_stop(limits: PathLimits, velocity: Array, acceleration: Array, cycle_time: float) -> int:
    """Find the cycle from which a stop would end no sooner than the motion, by trying stops all along it.

    Parameters
    ----------
    limits : PathLimits
    velocity, acceleration : (cycles + 1, axes) array
        Along the path.
    cycle_time : float
        s.
    """
    cycles = len(velocity) - 1
    begin = np.unique(np.linspace(0, cycles, STOPS + 1).astype(int))[:-1]
    path, step = begin.astype(np.float64), max(1.0, cycles / STEPS)  # in cycles
    rate, slope = np.ones(len(path)), np.zeros(len(path))
    worth = np.zeros(len(path), dtype=bool)
    push = np.abs(acceleration * limits.inverse_velocity).T
    pushes = np.stack([np.where((acceleration * velocity).T > 0.0, 0.0, push), push])  # slower, faster
    for passed in count(step, step):
        going = ~worth & (passed + MARGIN * step < cycles - begin)
        if not going.any():
            break
        slope = _slope(limits, rate, slope, step * cycle_time)
        used = pushes.take(path.astype(int), axis=2, mode="clip") * (rate * rate)
        slower, faster = np.maximum(limits.room[:, None] - used, 0.0).min(axis=1)
        slope = np.minimum(np.maximum(slope, -slower), faster)
        before, rate = rate, np.maximum(rate + slope * step * cycle_time, 0.0)
        path = path + 0.5 * step * (before + rate)
        worth |= going & (rate <= 0.0)
    failing = np.flatnonzero(~worth)
    return int(begin[max(failing[0] - 1, 0)]) if len(failing) else cycles


def _slope(limits: PathLimits, rate: Array, slope: Array, time: float) -> Array:
    """Choose the slopes that bring rates to zero, as the block does."""
    step = limits.slope_rate * time
    steps = rate / (step * time)
    pieces = np.maximum(np.rint(0.5 * np.sqrt(1.0 + 8.0 * steps)), 1.0)
    wanted = np.minimum(step * (steps / pieces + 0.5 * (pieces - 1.0)), limits.slope)
    return np.minimum(np.maximum(-wanted, slope - step), slope + step)
