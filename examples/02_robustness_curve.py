"""Residual sway when the rope is longer or shorter than the model says: optimal motions against shapers.

python examples/02_robustness_curve.py [PICTURE.png]
"""

import sys

import attrs
import matplotlib
import numpy as np

from gen_profile.evaluation.simulation import Swing
from gen_profile.motion.metrics import peak
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import problem_of
from gen_profile.shapers.shaped_move import shaped_move
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.solvers.motion import optimal_profile
from gen_profile.spec.reading import preset_spec

matplotlib.use("Agg")
from matplotlib import pyplot

pyplot.style.use("tableau-colorblind10")

spec = preset_spec("paper")
plant, nominal, move = spec.machine(), spec.plant.parameters, spec.move
problem = problem_of(spec)

frequencies = linearize(plant, nominal).frequencies
motions = {
    name: shaped_move(name, start=move.start, target=move.target, frequencies=frequencies).profile(
        move.duration
    )
    for name in ("nzv", "zvd", "umzvd")
}
motions |= {
    f"β = {weight:g}, robust": optimal_profile(indirect.solve(attrs.evolve(problem, sway_weight=weight)))
    for weight in (0.0, 50.0)
}
motions["β = 0, not robust"] = optimal_profile(
    indirect.solve(attrs.evolve(problem, sway_weight=0.0, desensitized=()))
)

errors = np.linspace(-0.3, 0.3, 31)
machines = [{**nominal, "L1": nominal["L1"] * (1.0 + error)} for error in errors]
watch = np.linspace(move.duration, move.duration + 4.0, 2001)

figure, axis = pyplot.subplots(figsize=(8, 5), layout="constrained")
for name, motion in motions.items():
    responses = Swing(plant, motion, machines, until=watch[-1]).at(watch)
    residual = [1e3 * peak(response.sway)[-1] for response in responses]
    axis.plot(100.0 * errors, residual, "-" if name.startswith("β") else "--", label=name)
    print(f"{name:20} {max(residual):7.3f} mm at worst over L1 ±30 %")
axis.axhline(1e3 * spec.check.residual_sway["payload"], color="k", linewidth=1.0, label="limit")
axis.set(xlabel="rope length L1 off by (%)", ylabel="residual sway of the payload (mm)", ylim=(0.0, 15.0))
axis.grid(alpha=0.3)
axis.legend()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "robustness.png", dpi=120)
