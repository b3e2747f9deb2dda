"""From a tape, a stopwatch and a logged swing to a spec: what is known of a crane, and how well.

Here the measurements come from a simulated crane with noise; on site they come from the crane.

    python examples/06_identify.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import gen_profile as gp

spec = gp.preset_spec("single-pendulum-crane")  # where the search starts: L0 = 3 m, c = 200 N m s/rad
stood = (0.0, 4.0)  # the hoist had paid out 4 m while periods and swings were measured
true = {**spec.plant.parameters, "L0": 3.25, "c": 350.0}

swinging = gp.evolve_spec(spec, move={"start": stood, "initial": {"phi": 0.12}})
still = gp.SampledProfile(cycle_time=0.05, position=np.tile(stood, (800, 1)))
swing = gp.cosimulate(swinging, still, true)
noisy = swing.angle[:, 0] + np.random.default_rng(1).normal(0.0, 2e-3, len(swing.times))

with TemporaryDirectory() as folder:
    log = Path(folder) / "swing.csv"
    np.savetxt(
        log, np.stack([swing.times, noisy], axis=1), delimiter=",", header="time_s,angle_rad", comments=""
    )
    logged = gp.read_swing(log, spec, columns=("time_s", "angle_rad"))

CAMPAIGNS = {
    "tape": ([gp.parse_reading("L0=3.2±0.05")], []),
    "tape and stopwatch": ([gp.parse_reading("L0=3.2±0.05"), gp.parse_period("54.0±0.3/10")], []),
    "logged swing": ([logged], ["L0", "c"]),
}
for name, (measurements, free) in CAMPAIGNS.items():
    found = gp.identify(spec, measurements, free, stood)
    print(name)
    for parameter, value in found.estimate.values.items():
        half_range = found.estimate.half_range[parameter]
        print(f"  {parameter:2} = {value:8.4g} ± {half_range:.2g}, in truth {true[parameter]:g}")
    worst = gp.plan(found.spec).figures["sway_residual_worst_m"]
    print(f"  residual sway of a motion that is robust to that: {1e3 * worst:.2f} mm at worst")
