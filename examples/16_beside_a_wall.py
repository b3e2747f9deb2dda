"""A load that was picked up askew is put down beside a wall, which stands 10 cm behind its target.

Without a limit the load swings through the wall; `limits.overshoot` keeps every machine of the range from it.

    python examples/16_beside_a_wall.py
"""

import numpy as np

import gen_profile as gp

WALL = 0.1

crane = {
    "plant": {"L0": 6.5, "m": 1000.0, "g": 9.81, "c": 0.0},
    "move": {"start": [0.0, 1.0], "target": [1.5, 1.0], "duration": 10.0, "initial": {"phi": 0.12}},
    "robustness": {"uncertain": {"L0": 0.03}},
    "check": {"residual_sway": 0.02},
    "export": {"cycle_time": 0.01},
}

for limits in ({}, {"overshoot": WALL}):
    spec = gp.preset_spec("single-pendulum-crane", **crane, limits=limits)
    plan = gp.plan(spec)
    passed = []
    for rope in (6.5 * 0.97, 6.5, 6.5 * 1.03):
        response = gp.cosimulate(spec, gp.sample(plan.motion, cycle_time=0.01), {"L0": rope})
        place = response.position[:, 0] - response.sway[:, 0]
        passed.append(float(np.max(place) - 1.5))
    print(
        f"{'limited' if limits else 'free':8} passes its target by {1e3 * passed[1]:7.1f} mm, at most "
        f"{1e3 * max(passed):7.1f} mm; accelerates by {plan.figures['acceleration_max_m_per_s2']:.2f} m/s²"
    )
