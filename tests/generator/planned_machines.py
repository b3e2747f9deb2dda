"""Machines that planner blocks are proved for, and the double pendulum by equations of its own."""

import numpy as np

G = 9.81
CYCLE = 0.004
BAY = f"""
name = "bay 3"
plant = {{ type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }}
move = {{ distance = 8.0, duration = 14.0 }}
limits = {{ velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }}
planner = {{ live = {{ L1 = [3.0, 9.0], m2 = [0.0, 2000.0] }} }}
robustness = {{ uncertain = {{ L1 = 0.05 }} }}
check = {{ residual_sway = 0.05 }}
export = {{ cycle_time = {CYCLE} }}
"""


PAPER = """
name = "paper"
plant = { type = "double-pendulum-crane", m1 = 0.192, m2 = 0.203, L1 = 0.47, L2 = 0.391 }
move = { distance = 0.3, duration = 3.0 }
limits = { velocity = 0.3, acceleration = 0.7, jerk = 20.0, travel = [0.0, 2.0] }
planner = { live = { L1 = [0.3, 0.6] } }
robustness = { uncertain = { L1 = 0.03 } }
check = { residual_sway = 0.003 }
export = { cycle_time = 0.001 }
"""
HOIST = """
name = "hoist"
plant = { type = "single-pendulum-crane" }
move = { distance = [1.0, 0.0], duration = 8.0 }
limits = { velocity = 0.5, acceleration = 0.3, jerk = 2.0, travel = [0.0, 6.0] }
planner = { live = { hoist = [0.0, 2.0] } }
robustness = { uncertain = {} }
check = { residual_sway = 0.01 }
export = { cycle_time = 0.004 }
"""
GANTRY = """
name = "gantry"
plant = { type = "gantry-crane", m = 1000.0, L = 5.0 }
move = { distance = [8.0, 3.0], duration = 14.0 }
planner = { live = { L = [3.0, 9.0] } }
robustness = { uncertain = { L = 0.02 } }
check = { residual_sway = 0.05 }
export = { cycle_time = 0.001 }
[limits.axis]
x = { velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }
y = { velocity = 0.5, acceleration = 0.4, jerk = 1.0, travel = [0.0, 12.0] }
"""


def swing(time, acceleration, m1, m2, L1, L2, **_):
    """Sway of two point masses below a cart, by absolute angles and their Lagrangian equations.

    By Runge-Kutta steps over two cycles each, and so known in every second one. L1 is a number, or the rope's
    length at these times.
    """
    rope = np.broadcast_to(L1, time.shape)
    rate = np.gradient(rope, time)
    driven = np.transpose([acceleration, rope, rate, np.gradient(rate, time)]).tolist()

    def slope(state, inputs):
        (a, b, da, db), (push, L, dL, ddL) = state, inputs
        heavy, coupling, coriolis = (m1 + m2) * L, np.cos(a - b), 2.0 * dL * da
        first = (m1 + m2) * (push * np.cos(a) - G * np.sin(a) - coriolis) - m2 * L2 * db**2 * np.sin(a - b)
        second = push * np.cos(b) - G * np.sin(b) + (L * da**2 - ddL) * np.sin(a - b) - coriolis * coupling
        ratio = m2 * coupling
        dda = (first - ratio * second) / (heavy - ratio * L * coupling)
        return np.array([da, db, dda, (second - L * coupling * dda) / L2])

    states, step = [np.zeros(4)], 2.0 * (time[1] - time[0])
    for begin, middle, end in zip(driven[:-2:2], driven[1:-1:2], driven[2::2], strict=True):
        state = states[-1]
        k1 = slope(state, begin)
        k2 = slope(state + 0.5 * step * k1, middle)
        k3 = slope(state + 0.5 * step * k2, middle)
        k4 = slope(state + step * k3, end)
        states.append(state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
    found = np.transpose(states)
    hook = rope[: 2 * len(states) : 2] * np.sin(found[0])
    return np.abs([hook, hook + L2 * np.sin(found[1])])
