"""A library of profiles for a whole range of ropes and distances, and the one that fits the crane of today.

python examples/09_profile_library.py [FOLDER]

The same as `gen-profile sweep`, `gen-profile lookup` and `gen-profile library`; see docs/sweeps.md.
"""

import sys
from pathlib import Path

import gen_profile as gp


def main(folder: Path) -> None:
    spec = gp.preset_spec("paper", export={"cycle_time": 0.01})
    done = gp.run_sweep(spec, {"move.distance": [0.2, 0.3], "plant.L1": [0.45, 0.475, 0.5]}, ["plc"], folder)
    print(f"{sum(done.statuses.values())} cases: {done.statuses}; {done.table.name} has a row for each")

    found = gp.lookup(folder, {"move.distance": 0.28, "plant.L1": 0.46})
    expected, designed = found.sway
    print(f"0.28 m on a rope of 0.46 m: case {found.row['case']}, designed for {found.used},")
    print(f"leaves {1e3 * expected:.2f} mm at worst, {1e3 * designed:.2f} mm on its own crane")

    library = gp.write_library(folder, folder / "profiles.st")
    print(f"{library.path.name}: {library.block} plays any of {len(library.profiles)}, by nProfile")


main(Path(sys.argv[1] if len(sys.argv) > 1 else "profile-library"))
