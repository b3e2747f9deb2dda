"""A planner block in C in two programs: a controller as of ros2_control, and an EtherCAT master's task.

python examples/14_cyclic_programs.py [FOLDER]

Both are in examples/cyclic; ROS and a bus are left out, and neither was tried with them. Linux only.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

import gen_profile as gp

SOURCES = Path(__file__).parent / "cyclic"
CRANE = gp.preset_spec(
    "paper",
    limits={"velocity": 0.5, "acceleration": 1.0, "jerk": 20.0, "travel": (-1.0, 1.0)},
    check={"residual_sway": 0.02},
    export={"cycle_time": 0.01},
)


def output_of(folder: Path, source: str, *options: str) -> list[str]:
    """Build a program with the planner's files beside it, run it, and return the lines it prints."""
    compiler = [sys.executable, "-m", "ziglang", "cc", "-O1", "-Wall", "-Wextra", f"-I{folder}"]
    for words in (
        ["-c", "crane.c", "-o", "crane.o"],
        [*options, SOURCES / source, "crane.o", "-lm", "-o", "program"],
    ):
        subprocess.run([*compiler, *words], cwd=folder, check=True)
    done = subprocess.run([folder / "program"], capture_output=True, check=True, text=True)
    return done.stdout.splitlines()


def main(folder: Path) -> None:
    crane = gp.evolve_spec(CRANE, name="crane")
    gp.deploy_planner(crane, ["c"], folder, check=False)  # prove it before a crane moves, as 11 does
    rows = output_of(folder, "controller.cpp", "-std=c++17", "-fno-exceptions", "-fno-rtti")
    position, velocity = np.array([[float.fromhex(word) for word in row.split()] for row in rows]).T
    counts = np.array(output_of(folder, "cyclic_task.c", "-std=c11"), int)

    print(
        f"ros2_control's shape: from {position[0]:.3f} m over {position.max():.3f} m to {position[-1]:.3f} m,"
    )
    print(f"at {np.abs(velocity).max():.3f} m/s, within {np.abs(np.diff(position)).max() / 0.01:.3f} m/s")
    print(f"EtherCAT's shape: from {counts[0]} over {counts.max()} to {counts[-1]} counts")
    rounded = np.rint(1e6 * position)
    moves = np.flatnonzero(np.diff(counts))[0] - np.flatnonzero(np.diff(rounded))[0]
    same = rounded[: len(counts) - moves] == counts[moves:]
    if not same[:240].all() or abs(position[-1] - 0.4) > 1e-6 or counts[-1] != 400_000:
        sys.exit("The programs do not issue the same setpoints, or do not arrive.")
    print(f"up to the other target the same setpoints, {moves} cycles later")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "cyclic-programs").resolve())
