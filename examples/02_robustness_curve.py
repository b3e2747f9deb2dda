"""Residual sway when the rope is longer or shorter than the model says: optimal motions against shapers.

python examples/02_robustness_curve.py [PICTURE.png]
"""

import sys

import attrs

import gen_profile as gp

spec = gp.preset_spec("paper")
variants = {
    "β = 0, robust": gp.evolve_spec(spec, cost={"sway_weight": 0.0}),
    "β = 50, robust": gp.evolve_spec(spec, cost={"sway_weight": 50.0}),
    "β = 0, not robust": gp.evolve_spec(spec, cost={"sway_weight": 0.0}, robustness={"method": "none"}),
}
own = [attrs.evolve(gp.plan(variant).motion, method=name) for name, variant in variants.items()]

curves = gp.robustness(spec, ["L1"], methods=["nzv", "zvd", "umzvd"], own=own)
for method in curves.residual:
    print(f"{method:20} {1e3 * curves.end_load(method).max():7.3f} mm at worst over L1 ±30 %")
gp.plot(curves, sys.argv[1] if len(sys.argv) > 1 else "robustness.png")
