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

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.profile import Array

# Below these an axis counts as standing still: relative to the greatest of all axes, and at all.
SMALLEST_SHARE, SMALLEST_VELOCITY = 1e-12, 1e-30


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
