"""A crane that hoists on the way: the rope, and with it the natural frequency, changes while the load moves.

An input shaper knows one frequency for each mode, here that of the rope at the target, where the load would
swing on. The optimal motion follows the equations, and uses the hoist as a second actuator; where
the move does not ask the hoist to move, it is held.

    python examples/04_hoisting_crane.py
"""

import numpy as np

import gen_profile as gp

spec = gp.preset_spec("single-pendulum-crane")
for word, q_a in (("start", spec.move.start), ("target", spec.move.target)):
    (frequency,) = gp.linearize(spec.machine(), spec.plant.parameters, q_a).frequencies
    rope = spec.plant.parameters["L0"] + q_a[1]
    print(f"{word:6}  rope {rope:4.1f} m, period {2.0 * np.pi / frequency:.2f} s")

for start in (spec.move.start, (0.0, 1.0)):
    task = gp.preset_spec("single-pendulum-crane", move={"start": start})
    print(f"\n{task.move.distance[0]:g} m in {task.move.duration:g} s, hoist from {start[1]:g} m to 1 m")
    for row in gp.compare(task).rows:
        if row.evaluation:
            nominal, worst = (
                1e3 * row.figures[key] for key in ("sway_residual_peak_m", "sway_residual_worst_m")
            )
            print(f"  {row.method:15} {nominal:7.2f} mm afterwards, {worst:7.2f} mm on the worst crane")
