"""Bridge, trolley and hoist together over boxes in plan view: `hoisting_gantry.py`, named in the spec.

python examples/17_hall_path.py [FOLDER]
"""

import sys
from pathlib import Path

import gen_profile as gp

SPEC = """
name = "hall"

[plant]
file = "hoisting_gantry.py"  # beside the spec
m = 5000.0
L0 = 3.0

[move]
start = [2.0, 2.0, 6.0]      # m: bridge, trolley, and rope paid out
target = [26.0, 11.0, 5.0]
duration = "minimum"

[path]
rail = 12.0                  # m, height of the trolley's sheaves
# from and to along the bridge's way, from and to along the trolley's, and height; or a wall across the hall
stacks = [[8.0, 12.0, 2.0, 9.0, 4.0], [16.0, 19.0, 5.5], [20.0, 24.0, 0.0, 3.0, 9.0]]
load = [2.0, 1.5, 1.0]       # m, widths along both axes, and height
clearance = [0.3, 0.5]       # m, to the sides and upwards

[limits]
sway = 0.6
axis.bridge = { velocity = 1.3, acceleration = 0.3, jerk = 0.6, travel = [0.0, 40.0] }
axis.trolley = { velocity = 0.7, acceleration = 0.2, jerk = 0.5, travel = [0.0, 15.0] }
axis.hoist = { velocity = 0.4, acceleration = 0.3, jerk = 0.6, travel = [0.0, 9.0] }

[robustness]
uncertain = { L0 = 0.1 }

[check]
residual_sway = 0.05

[export]
cycle_time = 0.01
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "gen-profile-out")
outcome = gp.design(gp.parse_spec(SPEC, folder=Path(__file__).parent), ["csv"], folder)
if not outcome.passed:
    sys.exit("\n".join(outcome.check.reasons()))

duration, near = outcome.plan.motion.duration, outcome.check.nearest
print(f"{duration:.2f} s; {outcome.plan.passage.one_by_one:.2f} s one axis after the other")
print(f"least room beyond the clearance: {1e3 * near.room:.1f} mm ({near.scenario.name})")
