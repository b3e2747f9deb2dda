"""Trolley and hoist together over stacks, with a hook block: `hook_crane.py`, named in the spec.

python examples/13_over_stacks.py [FOLDER]
"""

import sys
from pathlib import Path

import gen_profile as gp

SPEC = """
name = "hook"

[plant]
file = "hook_crane.py"       # beside the spec

[move]
start = [0.0, 26.0]          # m: trolley, and rope paid out
target = [30.0, 16.0]
duration = "minimum"

[path]
rail = 36.0                  # m, height of the trolley's sheaves
stacks = [[12.0, 15.0, 15.0], [18.0, 21.0, 19.0]]
load = [2.5, 2.6]            # m, width and height
hook = [1.0, 1.5]
clearance = [0.5, 1.0]       # m, to the sides and upwards

[limits]
sway = 1.5
axis.trolley = { velocity = 4.0, acceleration = 0.6, jerk = 0.8, travel = [-3.0, 60.0] }
axis.hoist = { velocity = 1.5, acceleration = 0.75, jerk = 1.5, travel = [0.0, 40.0] }

[robustness]
uncertain = { L0 = 0.1 }

[check]
residual_sway = 0.1

[export]
cycle_time = 0.004
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "gen-profile-out")
outcome = gp.design(gp.parse_spec(SPEC, folder=Path(__file__).parent), ["csv"], folder)
if not outcome.passed:
    sys.exit("\n".join(outcome.check.reasons()))

duration, near = outcome.plan.motion.duration, outcome.check.nearest
print(f"{duration:.2f} s; {outcome.plan.passage.one_by_one:.2f} s one axis after the other")
print(
    f"least room beyond the clearance: {1e3 * near.room:.1f} mm ({near.nearest.body}, {near.scenario.name})"
)
