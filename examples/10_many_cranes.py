"""Two thousand cranes, each a little off: the compiled loop over an FMU's own functions.

python examples/10_many_cranes.py
"""

import numpy as np

import gen_profile as gp

RUNS = 2_000

spec = gp.preset_spec("paper")
setpoints = gp.sample(gp.plan(spec).command, cycle_time=0.01)

random = np.random.default_rng(1)
cranes = {
    name: spec.plant.parameters[name] * random.uniform(0.8, 1.2, RUNS) for name in ("L1", "L2", "m1", "m2")
}
sway = gp.residual_sways(spec, setpoints, cranes)[:, -1]

for percent in (50, 90, 99, 100):
    print(
        f"{percent:3} % of {RUNS} cranes are left with less than {1e3 * np.percentile(sway, percent):.2f} mm"
    )
