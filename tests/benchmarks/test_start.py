"""How long commands take from a cold start, in units of what Python needs for the same libraries.

Best of several runs, in turns, so that a busy machine slows both alike. Printed, not judged.
"""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import PROGRAM

RUNS = 7
LIBRARIES = "import casadi, numpy, scipy.integrate, fmpy"
CASES = {
    "--export plc": (("--export", "plc"), LIBRARIES),
    "--help": (("--help",), "import click"),
    "formats": (("formats",), "import click"),
}


def seconds(command: list[str | Path], folder: Path) -> float:
    began = time.perf_counter()
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return time.perf_counter() - began


@pytest.mark.parametrize(("words", "imports"), CASES.values(), ids=CASES.keys())
def test_time_from_a_cold_start(tmp_path: Path, words: tuple[str, ...], imports: str) -> None:
    ours: list[str | Path] = [PROGRAM, *words]
    theirs: list[str | Path] = [sys.executable, "-c", imports]
    seconds(ours, tmp_path)  # compiles the FMU
    seconds(theirs, tmp_path)
    times = [(seconds(ours, tmp_path), seconds(theirs, tmp_path)) for _ in range(RUNS)]
    best, reference = map(min, zip(*times, strict=True))
    print(
        f"\ngen-profile {' '.join(words)}: {best:.3f} s, {best / reference:.2f} times "
        f"`{imports}` ({reference:.3f} s); the goal is 3"
    )
