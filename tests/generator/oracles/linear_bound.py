"""What the linear model allows at best: a linear program, written apart from the package."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from fmu import absolute_angle_crane as oracle
from scipy.linalg import expm
from scipy.optimize import linprog


def least_peak_angle(
    p: Mapping[str, float], distance: float, duration: float, pieces: int = 160
) -> float | None:
    """Least peak rope angle in rad of linear pendulums' moves insensitive to L1; None if there is none.

    The cart's jerk is constant on each of the pieces; angles are looked at where they join.
    """
    h = duration / pieces
    A, B = _augmented(dict(p))
    step = expm(h * np.block([[A, B], [np.zeros((1, len(A) + 1))]]))
    whole, push = step[:-1, :-1], step[:-1, -1]
    responses = [push]
    for _ in range(pieces - 1):
        responses.append(whole @ responses[-1])
    arrive = np.array(responses[::-1]).T  # states at the end, per piece
    target = np.zeros(len(A))
    target[-3] = distance
    sizes = np.abs(arrive).max(axis=1)
    angles = np.zeros((2 * pieces, pieces))
    for k in range(pieces):
        angles[2 * k : 2 * k + 2, : k + 1] = np.array(responses[k::-1]).T[:2]
    bound = np.full((len(angles), 1), -1.0)
    unit = np.abs(angles).max()
    found = linprog(
        np.r_[np.zeros(pieces), 1.0],
        A_ub=np.block([[angles / unit, bound], [-angles / unit, bound]]),
        b_ub=np.zeros(2 * len(angles)),
        A_eq=np.hstack([arrive / sizes[:, None], np.zeros((len(A), 1))]),
        b_eq=target / sizes,
        bounds=[(None, None)] * pieces + [(0.0, None)],
        method="highs",
    )
    return float(found.x[-1] * unit) if found.status == 0 else None


def _augmented(p: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Absolute angles and rates, their sensitivities to L1, then y, ẏ, ÿ; the input is the jerk."""

    def pendulum(L1: float) -> tuple[np.ndarray, np.ndarray]:
        q = p | {"L1": L1}
        mass = oracle.mass_matrix(np.zeros(2), q)
        weight = q["g"] * np.array([(q["m1"] + q["m2"]) * L1, q["m2"] * q["L2"]])
        A = np.zeros((4, 4))
        A[:2, 2:], A[2:, :2] = np.eye(2), -np.linalg.solve(mass, np.diag(weight))
        return A, np.r_[0.0, 0.0, np.linalg.solve(mass, oracle.lever(np.zeros(2), q))]

    A, B = pendulum(p["L1"])
    up, down = (pendulum(p["L1"] * (1.0 + s)) for s in (1e-5, -1e-5))
    whole = np.zeros((11, 11))
    whole[:4, :4] = whole[4:8, 4:8] = A
    whole[4:8, :4] = (up[0] - down[0]) / 2e-5
    whole[:4, 10], whole[4:8, 10] = B, (up[1] - down[1]) / 2e-5
    whole[8, 9] = whole[9, 10] = 1.0
    return whole, np.eye(11)[:, 10:]
