"""The farthest motion in a given time, by a linear program of SciPy's: an oracle for planners."""

import numpy as np
from scipy.optimize import linprog


def farthest(duration, rates, limits, pieces=120):
    """Linear program: piecewise constant jerk, each mode and its derivative by frequency at rest."""
    step = duration / pieces
    middle = step * (np.arange(pieces) + 0.5) - duration / 2
    below = np.tri(pieces)
    accelerations = step * below
    velocities = step * (below @ accelerations) - 0.5 * step**2 * below
    ends = [np.ones(pieces), duration / 2 - middle]
    for rate in rates:
        for factor in (1.0, middle / duration):
            ends += [factor * np.cos(rate * middle), factor * np.sin(rate * middle)]
    velocity, acceleration, jerk = limits
    found = linprog(
        -(((duration / 2 - middle) ** 2) / 2 * step + step**3 / 24),
        A_ub=np.vstack([velocities, -velocities, accelerations, -accelerations]),
        b_ub=np.repeat([velocity, acceleration], 2 * pieces),
        A_eq=np.array(ends),
        b_eq=np.zeros(len(ends)),
        bounds=(-jerk, jerk),
    )
    return -found.fun if found.status == 0 else 0.0
