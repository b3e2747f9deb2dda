"""The paper's optimal control problem written a second time, with absolute angles inside.

State: θ1, θ2 (relative), their rates, y, ẏ, ÿ (and y⃛ for snap), then the four sensitivities to the relative
change of L1. The Hamiltonian is differentiated here, and nothing is taken from the package.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

SNAP_TIME = 0.02


class CraneOptimalControl:
    """Functions ``rates(x, u)``, ``running_cost(x, u)`` and what follows from H = g + λᵀ f."""

    def __init__(
        self, p: Mapping[str, float], effort: str, tau: float | None, beta: float, gamma: float
    ) -> None:
        angles, rates, L1 = ca.SX.sym("angles", 2), ca.SX.sym("rates", 2), ca.SX.sym("L1")
        self.orders = 4 if effort == "snap" else 3
        axis, u = ca.SX.sym("axis", self.orders), ca.SX.sym("u")
        S = ca.SX.sym("S", 4)
        swing = ca.vertcat(angles, rates)
        swing_rates = ca.vertcat(rates, _relative_accelerations(angles, rates, axis[2], L1, p))
        forcing = p["L1"] * ca.jacobian(swing_rates, L1)
        S_rates = ca.jtimes(swing_rates, swing, S) + forcing
        top = (u - axis[2]) / tau if effort == "reference" else u
        x = ca.vertcat(swing, axis, S)
        f = ca.substitute(ca.vertcat(swing_rates, axis[1:], top, S_rates), L1, p["L1"])
        sway = p["L1"] * ca.sin(angles[0]) + p["L2"] * ca.sin(angles[0] + angles[1])
        half_square = (axis[3] ** 2 + (SNAP_TIME * u) ** 2) / 2 if effort == "snap" else u**2 / 2
        # exp(…) − 1, a constant less than eq. (26): the optimum is the same
        g = half_square + beta * (ca.exp((gamma * sway) ** 2) - 1)
        costate = ca.SX.sym("costate", x.shape[0])
        H = g + ca.dot(costate, f)
        self.size = x.shape[0]
        self.rates = ca.Function("rates", [x, u], [f])
        self.running_cost = ca.Function("running_cost", [x, u], [g])
        self.hamiltonian = ca.Function("hamiltonian", [x, costate, u], [H])
        self.slope_in_u = ca.Function("slope_in_u", [x, costate, u], [ca.gradient(H, u)])
        self.canonical = ca.Function("canonical", [x, costate, u], [f, -ca.gradient(H, x)])

    def control(self, x: np.ndarray, costate: np.ndarray) -> float:
        """Where ∂H/∂u, which is linear in u, is zero."""
        at_0, at_1 = (float(self.slope_in_u(x, costate, u)) for u in (0.0, 1.0))
        return -at_0 / (at_1 - at_0)


def _relative_accelerations(angles, rates, push, L1, p):
    """Lagrange's equations of both angles from the vertical (see `fmu.absolute_angle_crane`), solved."""
    phi1, phi2 = angles[0], angles[0] + angles[1]
    rate1, rate2 = rates[0], rates[0] + rates[1]
    m1, m2, L2, g = p["m1"], p["m2"], p["L2"], p["g"]
    a, b = (m1 + m2) * L1**2, m2 * L1 * L2 * ca.cos(phi1 - phi2)
    c, turning = m2 * L2**2, m2 * L1 * L2 * ca.sin(phi1 - phi2)
    force1 = (m1 + m2) * L1 * (push * ca.cos(phi1) - g * ca.sin(phi1)) - turning * rate2**2
    force2 = m2 * L2 * (push * ca.cos(phi2) - g * ca.sin(phi2)) + turning * rate1**2
    determinant = a * c - b**2
    first, second = (c * force1 - b * force2) / determinant, (a * force2 - b * force1) / determinant
    return ca.vertcat(first, second - first)


def direct_cost(
    problem: CraneOptimalControl,
    distance: float,
    duration: float,
    intervals: int = 40,
    *,
    swung: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    final_velocity: float = 0.0,
    limit: tuple[Sequence[float], float] | None = None,
) -> float:
    """Minimum of ∫ g dt by direct collocation at five Gauss points, solved by IPOPT from a quintic move.

    ``swung`` holds the angles and their rates at the start, ``limit`` factors of all states and the control,
    whose sum is bounded at the collocation points, and the bound.
    """
    solver, guess, bounds = direct_program(
        problem, distance, duration, intervals, swung=swung, final_velocity=final_velocity, limit=limit
    )
    found = solver(x0=guess, lbg=-bounds, ubg=bounds)
    assert solver.stats()["success"], solver.stats()["return_status"]
    return float(found["f"])


def direct_program(
    problem: CraneOptimalControl,
    distance: float,
    duration: float,
    intervals: int,
    *,
    swung: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    final_velocity: float = 0.0,
    limit: tuple[Sequence[float], float] | None = None,
    degree: int = 5,
) -> tuple[ca.Function, np.ndarray, np.ndarray]:
    """IPOPT's program of `direct_cost`, its first guess, and bounds of its constraints: zero for equations.

    Expanded to scalar operations, with CasADi's exact Hessian, which is quickest.

    The first multipliers are the costates at the start.
    """
    points = np.array(ca.collocation_points(degree, "legendre"))
    C, D, B = _lagrange(points)
    h = duration / intervals
    variables, equations, limited, guess, cost = [], [], [], [], 0
    factors, bound = limit or (np.zeros(problem.size + 1), np.inf)

    def unknown(time: float, control: bool) -> tuple[ca.MX, ca.MX | None]:
        x = ca.MX.sym("x", problem.size)
        variables.append(x)
        s, value = time / duration, np.zeros(problem.size)
        value[4] = distance * (10 * s**3 - 15 * s**4 + 6 * s**5)
        guess.append(value)
        if not control:
            return x, None
        u = ca.MX.sym("u")
        variables.append(u)
        guess.append(np.zeros(1))
        return x, u

    node, _ = unknown(0.0, False)
    begin = np.zeros(problem.size)
    begin[:4] = swung
    equations.append(node - begin)
    for k in range(intervals):
        stages = [unknown((k + c) * h, True) for c in points]
        values = [node, *(x for x, _ in stages)]
        for j, (x, u) in enumerate(stages):
            slope = sum(C[i, j + 1] * values[i] for i in range(degree + 1))
            equations.append(slope - h * problem.rates(x, u))
            if limit is not None:
                limited.append(ca.dot(ca.DM(factors), ca.vertcat(x, u)))
            cost += h * B[j + 1] * problem.running_cost(x, u)
        node_end = sum(D[i] * values[i] for i in range(degree + 1))
        node, _ = unknown((k + 1) * h, False)
        equations.append(node - node_end)
    target = np.zeros(problem.size)
    target[4:6] = distance, final_velocity
    equations.append(node - target)
    solver = ca.nlpsol(
        "solver",
        "ipopt",
        {"x": ca.vertcat(*variables), "f": cost, "g": ca.vertcat(*equations, *limited)},
        {"expand": True, "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-9},
    )
    bounds = np.concatenate([np.zeros(sum(e.numel() for e in equations)), np.full(len(limited), bound)])
    return solver, np.concatenate(guess), bounds


def _lagrange(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes, values at 1 and integrals of the Lagrange polynomials through 0 and the points."""
    grid = np.concatenate([[0.0], points])
    basis = [np.polynomial.Polynomial.fromroots(np.delete(grid, i)) for i in range(len(grid))]
    basis = [b / b(x) for b, x in zip(basis, grid, strict=True)]
    slopes = np.array([b.deriv()(grid) for b in basis])
    integrals = np.array([b.integ()(1.0) for b in basis])
    return slopes, np.array([b(1.0) for b in basis]), integrals
