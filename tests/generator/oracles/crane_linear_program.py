"""Cranes for small angles, as linear programs over a piecewise linear acceleration.

Modes from the absolute-angle equations; the quadratures of a mode after the move are ∫ cos(ω(T−t)) a dt and
∫ sin(ω(T−t)) a dt, and zero sensitivity to a frequency means that their derivatives by ω vanish, too. Nothing
is taken from the package.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import linprog

INTERVALS = 150
SIDES = 32  # of the polygon that stands for a circle


def modes(p: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and the payload's sway per unit acceleration impulse in each mode, with its sign."""
    m1, m2, L1, L2, g = (p[name] for name in ("m1", "m2", "L1", "L2", "g"))
    mass = np.array([[(m1 + m2) * L1**2, m2 * L1 * L2], [m2 * L1 * L2, m2 * L2**2]])
    stiffness = np.diag([(m1 + m2) * g * L1, m2 * g * L2])
    squares, shapes = eigh(stiffness, mass)
    drive = shapes.T @ np.array([(m1 + m2) * L1, m2 * L2])
    seen = np.array([L1, L2]) @ shapes
    frequencies = np.sqrt(squares)
    return frequencies, seen * drive / frequencies


class LinearCrane:
    """Integrals of a piecewise linear acceleration as rows that multiply its values at the nodes."""

    def __init__(self, duration: float, intervals: int = INTERVALS) -> None:
        self.duration, self.intervals, self.h = duration, intervals, duration / intervals
        nodes, weights = np.polynomial.legendre.leggauss(8)
        local = (nodes + 1.0) / 2.0
        self._times = (np.arange(intervals)[:, None] + local) * self.h
        self._weights = np.broadcast_to(weights * self.h / 2.0, (intervals, 8))
        self._local = local

    def row(self, kernel) -> np.ndarray:
        """∫ kernel(T − t) a(t) dt."""
        values = kernel(self.duration - self._times) * self._weights
        row = np.zeros(self.intervals + 1)
        row[:-1] += values @ (1.0 - self._local)
        row[1:] += values @ self._local
        return row

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows for no acceleration at the ends, no speed at the end, and the distance gone."""
        unit = np.eye(self.intervals + 1)
        rows = [unit[0], unit[-1], self.row(np.ones_like), self.row(lambda s: s)]
        return np.array(rows), np.array([0.0, 0.0, 0.0, 1.0])

    def quadratures(self, frequency: float) -> np.ndarray:
        return np.array(
            [self.row(lambda s: np.cos(frequency * s)), self.row(lambda s: np.sin(frequency * s))]
        )

    def slopes(self, frequency: float) -> np.ndarray:
        """Derivatives of the quadratures by the frequency."""
        return np.array(
            [self.row(lambda s: -s * np.sin(frequency * s)), self.row(lambda s: s * np.cos(frequency * s))]
        )

    def sway(self, p: Mapping[str, float], limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows that bound the payload's sway on the way, at every other node, in units of the limit."""
        shown = list(zip(*modes(p), strict=True))
        rows = []
        for late in self.h * np.arange(self.intervals - 1, 0, -2):

            def kernel(s: np.ndarray, late: float = late) -> np.ndarray:
                past = np.maximum(s - late, 0.0)
                return sum(gain * np.sin(frequency * past) for frequency, gain in shown)

            rows.append(self.row(kernel) / limit)
        return np.vstack([rows, np.negative(rows)]), np.ones(2 * len(rows))

    def limits(self, velocity: float, jerk: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows that bound the speed at the nodes, and the slope of the acceleration."""
        step = np.diff(np.eye(self.intervals + 1), axis=0) / self.h
        half = self.h / 2.0 * (np.eye(self.intervals + 1)[:-1] + np.eye(self.intervals + 1)[1:])
        speed = np.cumsum(half, axis=0)
        rows = np.vstack([step, -step, speed, -speed])
        return rows, np.repeat([jerk, velocity], 2 * self.intervals)


def feasible(
    frequencies: Sequence[float],
    distance: float,
    duration: float,
    *,
    desensitized: Sequence[float],
    sway: tuple[Mapping[str, float], float] | None = None,
    **limits: float,
) -> bool:
    """Whether a rest-to-rest move within limits leaves modes at rest, some even if they are a little off."""
    crane = LinearCrane(duration)
    rows, values = crane.ends()
    for frequency in frequencies:
        rows = np.vstack([rows, crane.quadratures(frequency)])
    for frequency in desensitized:
        rows = np.vstack([rows, crane.slopes(frequency)])
    values = np.concatenate([distance * values, np.zeros(len(rows) - len(values))])
    upper, sides = crane.limits(limits.get("velocity", 1e3), limits.get("jerk", 1e6))
    if sway is not None:
        swung, ones = crane.sway(*sway)
        upper, sides = np.vstack([upper, swung]), np.concatenate([sides, ones])
    bound = limits.get("acceleration", 1e3)
    size = np.abs(rows).max(axis=1)
    found = linprog(
        np.zeros(crane.intervals + 1),
        A_ub=upper,
        b_ub=sides,
        A_eq=rows / size[:, None],
        b_eq=values / size,
        bounds=(-bound, bound),
        method="highs",
    )
    return found.status == 0


def least_worst_sway(
    machines: Sequence[Mapping[str, float]],
    distance: float,
    duration: float,
    acceleration: float,
    nominal: Mapping[str, float] | None,
) -> float:
    """Least greatest sum of the modes' payload sways over machines, from below by polygons around circles.

    ``nominal`` is a machine that shall be left at rest exactly, if any.
    """
    crane = LinearCrane(duration)
    count, radii = crane.intervals + 1, 2 * len(machines)
    rows, values = crane.ends()
    if nominal is not None:
        rows = np.vstack([rows, *(crane.quadratures(w) for w in modes(nominal)[0])])
    values = np.concatenate([distance * values, np.zeros(len(rows) - len(values))])
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    upper = []
    for i, machine in enumerate(machines):
        total = np.zeros(count + radii + 1)
        for k, (frequency, seen) in enumerate(zip(*modes(machine), strict=True)):
            block = np.zeros((SIDES, count + radii + 1))
            block[:, :count] = 1e3 * abs(seen) * directions @ crane.quadratures(frequency)
            block[:, count + 2 * i + k] = -1.0
            upper.append(block)
            total[count + 2 * i + k] = 1.0
        total[-1] = -1.0
        upper.append(total[None])
    matrix = np.vstack(upper)
    cost = np.zeros(count + radii + 1)
    cost[-1] = 1.0
    found = linprog(
        cost,
        A_ub=matrix,
        b_ub=np.zeros(len(matrix)),
        A_eq=np.hstack([rows, np.zeros((len(rows), radii + 1))]),
        b_eq=values,
        bounds=[(-acceleration, acceleration)] * count + [(0.0, None)] * (radii + 1),
        method="highs",
    )
    assert found.status == 0
    return 1e-3 * float(found.fun)
