"""A planner block: written and proved, drawn, and called as a controller would, cycle by cycle.

python examples/11_planner.py [FOLDER]

The same as `gen-profile planner --plot` and `gen-profile planner play`; see docs/planner.md.
"""

import sys
from pathlib import Path

import numpy as np

import gen_profile as gp

HISTORIES = 12  # the command line tries 200, and before a crane moves there should be thousands


def main(folder: Path) -> None:
    crane = gp.preset_spec(
        "paper",
        limits={"velocity": 0.5, "acceleration": 1.0, "jerk": 20.0, "travel": (-1.0, 1.0)},
        planner={"live": {"L1": (0.4, 0.5)}},  # the rope, which the hoist tells the controller
        check={"uncertain": {"L1": 0.02}, "residual_sway": 0.02},  # and how far that may be wrong
        export={"cycle_time": 0.01},
    )
    deployed = gp.deploy_planner(crane, ["plc"], folder, histories=HISTORIES)
    worst = deployed.proof.worst
    print(f"{len(deployed.proof.judged)} histories, {'passed' if deployed.proof.passed else 'failed'};")
    print(f"the worst, {worst.number}, leaves {1e3 * worst.residual['payload']:.1f} mm")
    gp.plot(deployed, folder / "proof.png")

    planner = gp.Planner(folder / deployed.files[0].path)  # the file that was proved
    planner.hold(1.0, live={"L1": 0.42})  # it prepares itself while the axis stands
    away = planner.hold(1.5, target=0.8)
    back = planner.hold(2.0, target=0.2)  # another target on the way
    stick = 0.3 * np.sin(np.linspace(0.0, np.pi, 300))
    steered = planner.hold(3.0, velocity=stick)
    stopped = planner.hold(4.0, stop=True)
    print(f"turned back at {max(away.position.max(), back.position.max()):.3f} m,")
    print(f"steered to {steered.position[-1]:.3f} m, stopped at {stopped.position[-1]:.3f} m")
    print(f"no sway remains: {bool(stopped.promise[-1])}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "planner-block"))
