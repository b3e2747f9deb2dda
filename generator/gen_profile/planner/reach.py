"""How far a motion from rest to rest leads in so many slots, by linear programming: first guesses."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from gen_profile.planner.chebyshev import Array


def reach(
    slots: int, slot: float, frequencies: Array, decays: Array, limits: tuple[float, float, float]
) -> float:
    """Find the longest motion that leaves each mode, and its derivative by frequency, at rest.

    Parameters
    ----------
    slots : int
        Coefficients of the velocity's quadratic B-spline that are not zero.
    slot : float
        Their distance in s.
    frequencies, decays : (modes,) arrays
        rad/s and 1/s.
    limits : (float, float, float)
        Velocity, acceleration and jerk.

    Returns
    -------
    float
        m; 0 where there is no such motion.
    """
    velocity, acceleration, jerk = limits
    number = np.arange(slots)
    rows = []
    for frequency, decay in zip(frequencies, decays, strict=True):
        turned = np.exp((decay + 1j * frequency) * slot * number)
        for factor in (np.ones(slots), number / slots - 0.5):
            rows += [(factor * turned).real, (factor * turned).imag]
    padded = np.vstack([np.zeros((2, slots)), np.eye(slots), np.zeros((2, slots))])
    changes, curves = np.diff(padded, axis=0)[1:-1], np.diff(padded, n=2, axis=0)
    bounds = [*[acceleration * slot] * len(changes), *[jerk * slot**2] * len(curves)]
    found = linprog(
        -np.ones(slots),
        A_ub=np.vstack([changes, curves, -changes, -curves]),
        b_ub=bounds * 2,
        A_eq=np.array(rows),
        b_eq=np.zeros(len(rows)),
        bounds=(0.0, velocity),
        method="highs",
    )
    return float(-found.fun * slot) if found.status == 0 else 0.0
