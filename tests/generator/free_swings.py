"""Free swings and periods of machines whose parameters are known, without the package's equations."""

import numpy as np
from generator.lagrangian_machines import Lagrange
from scipy.integrate import solve_ivp


def periods(m1, m2, L1, L2, g=9.81, **_):
    """A textbook's two periods of a double pendulum."""
    half = (m1 + m2) * g * (L1 + L2) / (2.0 * m1 * L1 * L2)
    root = np.sqrt(half**2 - (m1 + m2) * g**2 / (m1 * L1 * L2))
    return 2.0 * np.pi / np.sqrt([half - root, half + root])


def states(parameters, times, start, axes, type_):
    """Unactuated coordinates and rates of a machine, (states, times), by other equations and integrator."""
    lagrange, n = Lagrange(type_), len(start) // 2
    still = np.zeros(len(axes))

    def rates(_, x):
        q, dq = np.concatenate([x[:n], axes]), np.concatenate([x[n:], still])
        return np.concatenate([x[n:], lagrange.accelerations(q, dq, still, parameters)])

    return solve_ivp(rates, (0.0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-11).y


def swing(parameters, times, start, axes=(0.0, 4.0), type_="single-pendulum-crane"):
    """Angle of its first unactuated coordinate."""
    return states(parameters, times, start, axes, type_)[0]


def inside(found, true):
    return all(abs(found.values[name] - true[name]) <= found.half_range[name] for name in found.values)
