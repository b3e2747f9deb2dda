"""Design the paper's move, export it twice, and read the verdict: the command line's main job from Python.

python examples/01_design_and_check.py [FOLDER]
"""

import sys
from pathlib import Path

import gen_profile as gp

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "gen-profile-out")

spec = gp.preset_spec("paper", move={"duration": 3.5}, axis={"unit": "mm"})
outcome = gp.design(spec, ["csv", "plc"], folder)
if not outcome.passed:
    sys.exit("\n".join(outcome.check.reasons()))

for artefact in outcome.artefacts:
    judgement = gp.check_artefact(folder / artefact.path)
    load, finding = judgement.check.worst
    print(
        f"{artefact.path}: {load} sways by {1e3 * finding.residual[load]:.3f} mm at worst "
        f"({finding.scenario.name}), error below {1e6 * judgement.check.error_bound:.2f} µm"
    )
