"""A drive that lags by 0.1 s, with setpoints that lead it and without.

A linear lag alone only delays the arrival: the sway stays cancelled either way. Leading it arrives in
time, and asks the drive for much more acceleration.

    python examples/03_lagging_drive.py
"""

import gen_profile as gp

TAU = 0.1

spec = gp.preset_spec("paper", actuator={"type": "first-order", "tau": TAU}, cost={"effort": "snap"})
plan = gp.plan(spec)

for name, motion in (("leading", plan.command), ("not leading", plan.motion)):
    setpoints = gp.sample(motion, cycle_time=0.004)
    response = gp.cosimulate(spec, setpoints)
    missing = spec.move.target[0] - response.position[response.times.searchsorted(motion.duration), 0]
    after = response.times >= motion.duration + 10 * TAU
    print(
        f"{name:12} commanded acceleration {abs(setpoints.acceleration).max():.2f} m/s², "
        f"{1e3 * missing:6.3f} mm short of the target at {motion.duration:g} s, "
        f"sway afterwards {1e3 * abs(response.sway[after, -1]).max():.4f} mm"
    )
