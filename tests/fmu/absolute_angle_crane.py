"""The double-pendulum crane written a second time, by other means, as an oracle for the plant FMU.

Both angles are counted from the vertical. Lagrange's equations of the two masses at

    x1 = y − L1 sin φ1,   z1 = −L1 cos φ1,   x2 = x1 − L2 sin φ2,   z2 = z1 − L2 cos φ2

with Rayleigh's dissipation ½ c1 φ̇1² + ½ c2 (φ̇2 − φ̇1)² are, in symmetric form M φ̈ = f,

    M = [ (m1+m2) L1²           m2 L1 L2 cos(φ1−φ2) ]
        [ m2 L1 L2 cos(φ1−φ2)   m2 L2²              ]

    f = [ (m1+m2) L1 (ÿ cos φ1 − g sin φ1) − m2 L1 L2 φ̇2² sin(φ1−φ2) − c1 φ̇1 + c2 (φ̇2−φ̇1) ]
        [ m2 L2 (ÿ cos φ2 − g sin φ2) + m2 L1 L2 φ̇1² sin(φ1−φ2) − c2 (φ̇2−φ̇1)               ]

A step of the cart's velocity is an infinitely short push: only the terms in ÿ count, M Δφ̇ = (…) Δv.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Parameters = Mapping[str, float]


def mass_matrix(phi: Array, p: Parameters) -> Array:
    coupling = p["m2"] * p["L1"] * p["L2"] * np.cos(phi[0] - phi[1])
    return np.array([[(p["m1"] + p["m2"]) * p["L1"] ** 2, coupling], [coupling, p["m2"] * p["L2"] ** 2]])


def lever(phi: Array, p: Parameters) -> Array:
    """Generalised forces per unit of cart acceleration."""
    return np.array([(p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]]) * np.cos(phi)


def accelerations(phi: Array, rate: Array, push: float, p: Parameters) -> Array:
    """Solve M φ̈ = f by Cramer's rule, in plain numbers: integrators ask for it a hundred thousand times."""
    (phi1, phi2), (rate1, rate2) = phi.tolist(), rate.tolist()
    upper, lower = (p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]
    coupling, centrifugal = lower * p["L1"] * cos(phi1 - phi2), lower * p["L1"] * sin(phi1 - phi2)
    joint = p["c2"] * (rate2 - rate1)
    f1 = upper * (push * cos(phi1) - p["g"] * sin(phi1)) - centrifugal * rate2**2 - p["c1"] * rate1 + joint
    f2 = lower * (push * cos(phi2) - p["g"] * sin(phi2)) + centrifugal * rate1**2 - joint
    m1, m2 = upper * p["L1"], lower * p["L2"]
    return np.array([f1 * m2 - f2 * coupling, f2 * m1 - f1 * coupling]) / (m1 * m2 - coupling**2)


def energy(phi: Array, rate: Array, p: Parameters) -> float:
    """Of the loads, as a crane at rest sees it."""
    heights = -p["g"] * np.array([(p["m1"] + p["m2"]) * p["L1"], p["m2"] * p["L2"]]) * np.cos(phi)
    return float(0.5 * rate @ mass_matrix(phi, p) @ rate + heights.sum())


def swing(push: Callable[[float], float], times: Array, p: Parameters) -> Array:
    """Angles from rest under a smooth cart acceleration, shape (times, 2)."""
    return _integrate(np.zeros(4), push, times, p)[:, :2]


def swing_from(phi: Array, rate: Array, push: Callable[[float], float], times: Array, p: Parameters) -> Array:
    """Angles and their rates from any state under a smooth cart acceleration, shape (times, 4)."""
    return _integrate(np.concatenate((phi, rate)), push, times, p, rtol=1e-9)


def swing_freely(phi: Array, rate: Array, times: Array, p: Parameters) -> Array:
    """Angles from any state under a cart at rest, shape (times, 2)."""
    return _integrate(np.concatenate((phi, rate)), lambda _: 0.0, times, p)[:, :2]


def swing_in_steps(positions: Array, cycle: float, tau: float, p: Parameters) -> tuple[Array, Array]:
    """Angles and their rates, and cart positions, at the times of linearly interpolated setpoints.

    With tau = 0 the cart takes up every new velocity by a push, else the lagging cart is integrated along.
    """
    states, carts = [np.zeros(4)], [positions[0]]
    state, cart = np.zeros(4), np.array([positions[0], 0.0])
    for velocity in np.diff(positions) / cycle:
        if tau == 0.0:
            state[2:] += np.linalg.solve(mass_matrix(state[:2], p), lever(state[:2], p)) * (
                velocity - cart[1]
            )
            state = _integrate(state, lambda _: 0.0, np.array([0.0, cycle]), p)[-1]
            cart = np.array([cart[0] + velocity * cycle, velocity])
        else:
            state, cart = _lagging(state, cart, velocity, cycle, tau, p)
        states.append(state.copy())
        carts.append(cart[0])
    return np.array(states), np.array(carts)


def sway(phi: Array, p: Parameters) -> Array:
    """Of hook and payload, shape (times, 2)."""
    hook = p["L1"] * np.sin(phi[:, 0])
    return np.column_stack((hook, hook + p["L2"] * np.sin(phi[:, 1])))


def _integrate(
    state: Array, push: Callable[[float], float], times: Array, p: Parameters, rtol: float = 1e-11
) -> Array:
    def rates(time: float, x: Array) -> Array:
        return np.concatenate((x[2:], accelerations(x[:2], x[2:], push(time), p)))

    span = (times[0], times[-1])
    solution = solve_ivp(rates, span, state, method="DOP853", rtol=rtol, atol=0.01 * rtol, t_eval=times)
    return solution.y.T


def _lagging(
    state: Array, cart: Array, reference: float, cycle: float, tau: float, p: Parameters
) -> tuple[Array, Array]:
    def rates(_: float, x: Array) -> Array:
        push = (reference - x[5]) / tau
        return np.concatenate((x[2:4], accelerations(x[:2], x[2:4], push, p), [x[5], push]))

    start = np.concatenate((state, cart))
    end = solve_ivp(rates, (0.0, cycle), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return end[:4], end[4:]
