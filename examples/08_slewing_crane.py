"""A tower crane slews by 100° and ends at the radius where it began: what does its trolley do meanwhile?

While the jib turns, the load flies outward, and nothing that the slew does afterwards brings it back to rest.
The move does not ask the trolley to move, so it is held. Where `move.free` lets it help, it follows the load
a little in the optimal motion, and both come to rest together.

    python examples/08_slewing_crane.py
"""

import numpy as np

import gen_profile as gp

move = {"start": [0.0, 25.0], "target": [1.745, 25.0], "duration": 25.0}
optimal = {"cost": {"sway_weight": 0.0}}
tried = {
    "zvd": {"move": move, "solver": {"method": "zvd"}},
    "optimal": {"move": move, **optimal},
    "free": {"move": {**move, "free": ["trolley"]}, **optimal},
}
for method, changes in tried.items():
    trial = gp.plan(gp.preset_spec("tower-crane", **changes)).evaluation
    times = np.linspace(0.0, trial.motion.duration, 501)
    trolley = trial.motion(times).position[:, 1] - 25.0
    nominal = trial.swing.at(trial.motion.duration + np.linspace(0.0, trial.watch, 1001))[0]
    along, across = 1e3 * np.abs(nominal.sway).max(axis=0)
    print(
        f"{method:8} the trolley goes {1e3 * np.ptp(trolley):5.1f} mm; afterwards the load sways "
        f"{along:5.2f} mm along the jib, {across:5.2f} mm across it"
    )
