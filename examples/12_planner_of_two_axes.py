"""Bridge and trolley of a gantry, planned by one block: to a place, to another on the way, by two sticks.

python examples/12_planner_of_two_axes.py

Before a crane moves, prove the block: `gen-profile planner`, as in example 11; see docs/planner.md.
"""

import numpy as np

import gen_profile as gp


def main() -> None:
    gantry = gp.preset_spec(
        "gantry-crane",
        limits={
            "axis": {
                "x": {"velocity": 1.0, "acceleration": 0.3, "jerk": 1.0, "travel": (0.0, 40.0)},
                "y": {"velocity": 0.5, "acceleration": 0.4, "jerk": 1.0, "travel": (0.0, 12.0)},
            }
        },
        planner={"live": {"L": (3.0, 9.0)}},  # the rope
        export={"cycle_time": 0.004},
    )
    planner = gp.Planner(gantry, position=(0.0, 0.0))
    planner.hold(20.0, live={"L": 5.5})  # it prepares itself while the axes stand
    away = planner.hold(8.0, target=(20.0, 2.0))
    back = planner.hold(40.0, target=(4.0, 9.0))  # the bridge turns back
    arrived = [back.velocity[:, axis].nonzero()[0][-1] * planner.cycle_time for axis in range(2)]
    print(f"the bridge turned back at {max(away.position[-1, 0], back.position[:, 0].max()):.2f} m")
    print(f"bridge and trolley arrive {arrived[0]:.2f} s and {arrived[1]:.2f} s after the new target")

    sticks = np.outer(np.sin(np.linspace(0.0, np.pi, 2000)), (0.5, -0.3))
    planner.hold(8.0, velocity=sticks)
    stopped = planner.hold(20.0, stop=True)
    print(f"stopped at {stopped.position[-1, 0]:.2f} m and {stopped.position[-1, 1]:.2f} m")
    print(f"no sway remains: {bool(stopped.promise[-1])}")


if __name__ == "__main__":
    main()
