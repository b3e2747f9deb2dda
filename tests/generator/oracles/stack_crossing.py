"""The quickest way over stacks as one nonlinear program, with a free hoist and the full angle, from a guess.

Multiple shooting with jerks held over even intervals. A load is outside a stack exactly if some weights of
"left of it", "right of it" and "above it" give a sum that is not negative (X. Zhang, A. Liniger, F. Borrelli,
Optimization-based collision avoidance, IEEE Trans. Control Syst. Technol. 29, 2021).
"""

import casadi as ca
import numpy as np

GRAVITY = 9.81
SUBSTEPS = 2  # in each interval, at whose ends the load is outside all stacks


def step_function():
    """One step of a pendulum below a trolley with a hoist, by the classical method of Runge and Kutta."""
    state, jerk, span = ca.SX.sym("state", 8), ca.SX.sym("jerk", 2), ca.SX.sym("span")

    def rates(z):
        _, v, a, rope, paid, push, swing, rate = ca.vertsplit(z)
        turn = (-GRAVITY * ca.sin(swing) - 2.0 * paid * rate + a * ca.cos(swing)) / rope
        return ca.vertcat(v, a, jerk[0], paid, push, jerk[1], rate, turn)

    k1 = rates(state)
    k2 = rates(state + span / 2.0 * k1)
    k3 = rates(state + span / 2.0 * k2)
    k4 = rates(state + span * k3)
    return ca.Function("step", [state, jerk, span], [state + span / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])


def quickest(bay, guess, intervals=30):
    """Find a local optimum near a guess.

    Parameters
    ----------
    bay : dict
        ``start`` and ``target`` (trolley, rope), ``zones`` (low, high, greatest rope that clears
        them), ``limits`` (velocity, acceleration, jerk) of trolley and hoist, ``rope`` (the least).
    guess : (states (8, nodes), duration)

    Returns
    -------
    float or None
        The duration in s.
    """
    opti, step = ca.Opti(), step_function()
    z, u, duration = opti.variable(8, intervals + 1), opti.variable(2, intervals), opti.variable()
    span = duration / intervals / SUBSTEPS
    points = []
    for k in range(intervals):
        at = z[:, k]
        for _ in range(SUBSTEPS):
            at = step(at, u[:, k], span)
            points.append(at)
        opti.subject_to(z[:, k + 1] == at)
    for axis, (velocity, acceleration, jerk) in enumerate(bay["limits"]):
        for row, limit in (
            (z[3 * axis + 1, :], velocity),
            (z[3 * axis + 2, :], acceleration),
            (u[axis, :], jerk),
        ):
            opti.subject_to(opti.bounded(-limit, row, limit))
    opti.subject_to(z[3, :] >= bay["rope"])
    for column, (place, rope) in ((0, bay["start"]), (intervals, bay["target"])):
        opti.subject_to(z[:, column] == ca.DM([place, 0, 0, rope, 0, 0, 0, 0]))
    opti.subject_to(opti.bounded(-1.0, z[6, :], 1.0))
    for low, high, rope in bay["zones"]:
        weights = opti.variable(3, len(points))
        opti.subject_to(ca.vec(weights) >= 0.0)
        opti.subject_to(ca.sum1(weights) == 1.0)
        for k, at in enumerate(points[:-1]):
            x = at[0] - at[3] * ca.sin(at[6])
            above = rope - at[3] * ca.cos(at[6])
            opti.subject_to(
                weights[0, k] * (low - x) + weights[1, k] * (x - high) + weights[2, k] * above >= 0.0
            )
        opti.set_initial(weights, _weights(low, high, rope, guess[0], len(points)))
    opti.subject_to(duration >= 1.0)
    opti.minimize(duration + 1e-4 * ca.sumsqr(u) / intervals)
    opti.set_initial(z, guess[0])
    opti.set_initial(duration, guess[1])
    opti.solver(
        "ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 600, "max_cpu_time": 30.0}
    )
    try:
        return float(opti.solve().value(duration))
    except RuntimeError:
        return None


def _weights(low, high, rope, states, count):
    """Give all weight to what a guess keeps best."""
    nodes = np.linspace(0.0, 1.0, states.shape[1])
    at = np.linspace(0.0, 1.0, count + 1)[1:]
    x = np.interp(at, nodes, states[0] - states[3] * np.sin(states[6]))
    above = rope - np.interp(at, nodes, states[3] * np.cos(states[6]))
    best = np.argmax([low - x, x - high, above], axis=0)
    return np.eye(3)[:, best] * 0.9 + 0.1 / 3.0


def one_by_one(bay, duration, nodes=31):
    """Guess: lift, travel above everything, lower, each in a third of the time."""
    (x0, r0), (x1, r1) = bay["start"], bay["target"]
    s = np.linspace(0.0, 3.0, nodes)

    def smooth(share):
        share = np.clip(share, 0.0, 1.0)
        return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

    states = np.zeros((8, nodes))
    states[0] = x0 + (x1 - x0) * smooth(s - 1.0)
    states[3] = r0 + (bay["rope"] - r0) * smooth(s) + (r1 - bay["rope"]) * smooth(s - 2.0)
    return states, duration
