"""Ten thousand cranes, each a little off: the compiled loop over an FMU's own functions.

python examples/10_many_cranes.py
"""

import numpy as np

import gen_profile as gp
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.running.many_runs import ManyRuns

RUNS = 10_000
CYCLE, SETTLE = 0.01, 4.0  # s

spec = gp.preset_spec("paper")
setpoints = gp.sample(gp.plan(spec).command, cycle_time=CYCLE).position[:, 0]
held = np.append(setpoints[1:], np.full(round(SETTLE / CYCLE), setpoints[-1]))
times = CYCLE * np.arange(len(held) + 1)

random = np.random.default_rng(1)
cranes = {
    name: spec.plant.parameters[name] * random.uniform(0.8, 1.2, RUNS) for name in ("L1", "L2", "m1", "m2")
}
steps = {"max_step": np.full(RUNS, CYCLE)}  # of integration: a seventieth of the shortest period

with ManyRuns(plant_fmu(spec.machine()), Version.FMI2) as runs:
    sway = runs.peaks(
        times, {"cart.setpoint": held}, cranes | steps, ["sway.payload"], since=spec.move.duration
    )[:, 0]

for share in (50, 90, 99, 100):
    print(f"{share:3} % of {RUNS} cranes are left with less than {1e3 * np.percentile(sway, share):.2f} mm")
