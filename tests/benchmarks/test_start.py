"""What commands take from a cold start, in units of what Python needs for the same libraries.

Time of the processor, the least of several runs in turns, so that a busy machine slows both alike. Printed,
not judged.
"""

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import PROGRAM

RUNS = 5
LIBRARIES = "import casadi, numpy, scipy.integrate, fmpy"
CASES = {
    "--export plc": (("--export", "plc"), LIBRARIES, "1.5 times"),
    "--help": (("--help",), "import click", "1.3 times"),
    "formats": (("formats",), "import click", "1.3 times"),
    "compare": (("compare", "--preset", "paper"), LIBRARIES, "2 s"),
    "robustness": (("robustness", "--preset", "paper"), LIBRARIES, "2 s"),
    "report": (("report", "--preset", "paper"), LIBRARIES, "2 s"),
}


def seconds(command: list[str | Path], folder: Path) -> float:
    """Time of the processor in s of a process and its own."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.parametrize(("words", "imports", "goal"), CASES.values(), ids=CASES.keys())
def test_time_from_a_cold_start(tmp_path: Path, words: tuple[str, ...], imports: str, goal: str) -> None:
    ours: list[str | Path] = [PROGRAM, *words]
    theirs: list[str | Path] = [sys.executable, "-c", imports]
    seconds(ours, tmp_path)  # compiles the FMU
    seconds(theirs, tmp_path)
    times = [(seconds(ours, tmp_path), seconds(theirs, tmp_path)) for _ in range(RUNS)]
    least, reference = map(min, zip(*times, strict=True))
    print(
        f"\ngen-profile {' '.join(words)}: {least:.3f} s, {least / reference:.2f} times "
        f"`{imports}` ({reference:.3f} s); the goal is {goal}"
    )
