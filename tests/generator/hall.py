"""A hall crane with boxes in its way, and two masses on rods in space written down independently."""

import numpy as np
from scipy.integrate import solve_ivp

import gen_profile as gp

BOXES = [[8.0, 12.0, 2.0, 9.0, 4.0], [16.0, 19.0, 6.0, 14.0, 5.5], [16.0, 19.0, 0.0, 3.0, 9.0]]
MACHINE = {"m1": 350.0, "m2": 5000.0, "L0": 1.5, "L2": 2.0}
RAIL = 12.0
LIMITS = {
    "sway": 0.6,
    "axis": {
        "x": {"velocity": 1.3, "acceleration": 0.3, "jerk": 0.6, "travel": [0.0, 40.0]},
        "y": {"velocity": 0.7, "acceleration": 0.2, "jerk": 0.5, "travel": [0.0, 15.0]},
        "hoist": {"velocity": 0.4, "acceleration": 0.3, "jerk": 0.6, "travel": [0.0, 9.0]},
    },
}


def hall(**tables):
    """State the crane of docs/over-stacks.md, with changes."""
    document = {
        "name": "hall",
        "plant": {"type": "hall-crane", **MACHINE},
        "move": {"start": [2.0, 2.0, 6.0], "target": [26.0, 11.0, 5.0], "duration": "minimum"},
        "path": {
            "rail": RAIL,
            "stacks": BOXES,
            "load": [2.0, 1.5, 1.0],
            "hook": [0.6, 0.6, 0.8],
            "clearance": [0.3, 0.5],
        },
        "limits": LIMITS,
        "robustness": {"uncertain": {"L0": 0.1}},
        "check": {"residual_sway": 0.05},
        "export": {"cycle_time": 0.01},
    }
    return gp.evolve_spec(document, **tables)


def two_masses(motion, p, times):
    """Places of hook and load, (times, 3) each, by the forces in both rods as unknowns."""
    down = np.array([0.0, 0.0, -9.81])

    def rates(t, state):
        hook, load, fast, slow = state.reshape(4, 3)
        (x, y, h), (vx, vy, paid), (ax, ay, pull) = (motion.derivative([t], order)[0] for order in range(3))
        upper, lower = np.array([x, y, 0.0]) - hook, hook - load
        above, below = np.array([vx, vy, 0.0]) - fast, fast - slow
        rope = p["L0"] + h
        # |upper| = rope and |lower| = L2, twice derived, are linear in the forces per length
        matrix = [
            [upper @ upper / p["m1"], -(upper @ lower) / p["m1"]],
            [-(lower @ upper) / p["m1"], lower @ lower * (1.0 / p["m1"] + 1.0 / p["m2"])],
        ]
        side = [
            upper @ (np.array([ax, ay, 0.0]) - down) + above @ above - paid**2 - rope * pull,
            below @ below,
        ]
        first, second = np.linalg.solve(matrix, side)
        return np.concatenate(
            [fast, slow, (first * upper - second * lower) / p["m1"] + down, second * lower / p["m2"] + down]
        )

    x, y, h = motion.start
    low = -(p["L0"] + h)
    begin = [x, y, low, x, y, low - p["L2"], *np.zeros(6)]
    found = solve_ivp(
        rates, (0.0, times[-1]), begin, t_eval=times, rtol=1e-9, atol=1e-10, max_step=0.05, method="DOP853"
    )
    return found.y[:3].T, found.y[3:6].T


def shortage(places, size, path, ends):
    """By how much at most a box of a size is nearer to anything than it may be, in m.

    It may be beside it along x or along y, or above it, or within the clearance of where it stood at an end.
    """
    sideways, above = path.clearances
    (x, y, z), (wide, deep, high), worst = places.T, size, -np.inf
    for row in path.stacks:
        west, east, *rest, top = row
        gaps = [west - (x + wide / 2.0) - sideways, (x - wide / 2.0) - east - sideways]
        inside = [west - wide / 2.0 - sideways < end[0] < east + wide / 2.0 + sideways for end in ends]
        if rest:
            south, north = rest
            gaps += [south - (y + deep / 2.0) - sideways, (y - deep / 2.0) - north - sideways]
            near = [south - deep / 2.0 - sideways < end[1] < north + deep / 2.0 + sideways for end in ends]
            inside = [one and other for one, other in zip(inside, near, strict=True)]
        gaps += [
            sideways - np.maximum(np.abs(x - end[0]), np.abs(y - end[1]))
            for end, stands in zip(ends, inside, strict=True)
            if stands
        ]
        over = path.rail + z - high / 2.0 - top - above
        worst = max(worst, float(-np.maximum.reduce([*gaps, over]).min()))
    return worst
