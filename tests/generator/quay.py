"""A ship-to-shore crane with stacks in its way, and a pendulum with a hoist written down independently."""

import numpy as np
from scipy.integrate import solve_ivp

import gen_profile as gp

STACKS = [
    [20.0, 22.5, 10.4],
    [22.5, 25.0, 13.0],
    [25.0, 27.5, 18.2],
    [27.5, 30.0, 15.6],
    [34.75, 37.25, 13.0],
]
RAIL, ROPE, WIDTH, HEIGHT, SIDEWAYS, ABOVE = 36.0, 3.0, 2.5, 2.6, 0.5, 1.0
LIMITS = {
    "sway": 1.5,
    "axis": {
        "cart": {"velocity": 4.0, "acceleration": 0.6, "jerk": 0.8, "travel": [-3.0, 60.0]},
        "hoist": {"velocity": 1.5, "acceleration": 0.75, "jerk": 1.5, "travel": [0.0, 40.0]},
    },
}


def quay(stacks=STACKS, **tables):
    """State the crane of docs/over-stacks.md, with changes."""
    document = {
        "name": "quay",
        "plant": {"type": "single-pendulum-crane", "m": 40000.0, "L0": ROPE},
        "move": {"start": [0.0, 30.1], "target": [36.0, 18.7], "duration": "minimum"},
        "path": {
            "rail": RAIL,
            "stacks": stacks,
            "load": [WIDTH, HEIGHT],
            "clearance": [SIDEWAYS, ABOVE],
        },
        "limits": LIMITS,
        "robustness": {"uncertain": {"L0": 0.1}},
        "check": {"residual_sway": 0.1},
        "export": {"cycle_time": 0.004},
    }
    return gp.evolve_spec(document, **tables)


def followed(motion, rope, times):
    """Places of the load (x, z from the rail) on a rope of a length with the hoist at 0, and its sway."""

    def rates(t, state):
        swing, rate = state
        (_, hoist), (_, paid), (push, _) = (motion.derivative([t], order)[0] for order in range(3))
        length = rope + hoist
        return rate, (-9.81 * np.sin(swing) - 2.0 * paid * rate + push * np.cos(swing)) / length

    found = solve_ivp(rates, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-8, atol=1e-10, max_step=0.05)
    cart, hoist = motion.derivative(times, 0).T
    sway = (rope + hoist) * np.sin(found.y[0])
    return cart - sway, -(rope + hoist) * np.cos(found.y[0]), sway


def shortage(x, z, path, start, target):
    """By how much at most a load is nearer to any stack than it may be, each instant by itself, in m."""
    sideways, above = path.clearances
    (width, height), worst = path.load, -np.inf
    for left, right, top in path.stacks:
        gap = np.maximum(left - (x + width / 2.0), (x - width / 2.0) - right) - sideways
        for end in (start, target):
            if left - width / 2.0 - sideways < end < right + width / 2.0 + sideways:
                gap = np.maximum(gap, sideways - np.abs(x - end))
        over = (path.rail + z - height / 2.0) - top - above
        worst = max(worst, float(-np.maximum(gap, over).min()))
    for left, right, underside in path.overhead:
        gap = np.maximum(left - (x + width / 2.0), (x - width / 2.0) - right) - sideways
        below = underside - above - (path.rail + z + height / 2.0)
        worst = max(worst, float(-np.maximum(gap, below).min()))
    return worst
