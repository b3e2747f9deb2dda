"""A drive that lags by 0.1 s, with setpoints that lead it and without.

A linear lag alone only delays the arrival: the sway stays cancelled either way. Leading it arrives in
time, and asks the drive for much more acceleration.

    python examples/03_lagging_drive.py
"""

import numpy as np

import gen_profile as gp
from gen_profile.motion.metrics import greatest, peak
from gen_profile_fmu.running.cosimulation import PlantCosimulation

TAU = 0.1

spec = gp.preset_spec("paper", actuator={"type": "first-order", "tau": TAU}, cost={"effort": "snap"})
plan = gp.plan(spec)

with PlantCosimulation(spec.machine()) as crane:
    for name, setpoints in (("leading", plan.command), ("not leading", plan.motion)):
        response = crane.run(
            gp.sample(setpoints, cycle_time=0.004),
            spec.plant.parameters,
            tau=TAU,
            max_step=1e-3,
            settle=10 * TAU + 4.0,
        )
        at_end = np.searchsorted(response.times, setpoints.duration)
        standing = response.times >= setpoints.duration + 10 * TAU
        missing = spec.move.target[0] - response.position[at_end, 0]
        print(
            f"{name:12} commanded acceleration {greatest(setpoints, 2):.2f} m/s², "
            f"{1e3 * missing:6.3f} mm short of the target at {setpoints.duration:g} s, "
            f"sway afterwards {1e3 * peak(response.sway[standing])[-1]:.4f} mm"
        )
