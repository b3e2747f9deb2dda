"""A machine that gen-profile does not know: `inclined_crane.py`, named in the spec.

    python examples/05_own_machine.py [FOLDER]

On the command line: gen-profile inclined.toml, with ``file = "inclined_crane.py"`` in its [plant].
"""

import sys
from pathlib import Path

import gen_profile as gp

SPEC = """
name = "inclined"

[plant]
file = "inclined_crane.py"   # beside the spec
s = 0.3

[move]
distance = 6.0
duration = 10.0

[robustness]
uncertain = { L = 0.1 }

[cost]
sway_weight = 10.0

[check]
residual_sway = 0.03
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "gen-profile-out")
outcome = gp.design(gp.parse_spec(SPEC, folder=Path(__file__).parent), ["csv"], folder)
if not outcome.passed:
    sys.exit("\n".join(outcome.check.reasons()))

# the machine's file lies beside the artefact now: both can go to another computer, and be checked there
print("\n".join(sorted(path.name for path in folder.iterdir())))
for finding in gp.check_artefact(folder / "inclined.csv").check.findings:
    print(f"{finding.scenario.name:8} {1e3 * finding.residual['load']:6.2f} mm")
