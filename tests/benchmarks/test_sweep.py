"""What a sweep costs per case, and how much faster two processes are than one. Printed, not judged."""

import os
import resource
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil

from gen_profile.spec.reading import preset_text
from gen_profile.studies.sweep.case import run_case
from gen_profile.studies.sweep.grid import parse_grid
from gen_profile.studies.sweep.run import prepare, sweep
from gen_profile.studies.sweep.store import opened

AXES = ("move.distance=0.1:0.3:20", "plant.L1=0.4:0.5:20")
FORMATS = ("csv", "plc")
LIBRARIES = "import casadi, numpy, scipy.integrate, fmpy"
CASES = 25  # of which each is timed beside those after it


class Memory(threading.Thread):
    """Watches how large the greatest child of this process becomes."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.greatest, self.over = 0, threading.Event()

    def run(self) -> None:
        while not self.over.wait(0.5):
            for child in psutil.Process().children(recursive=True):
                with suppress(psutil.NoSuchProcess):
                    self.greatest = max(self.greatest, child.memory_info().rss)


def swept(folder: Path, workers: int, *axes: str) -> dict[str, float]:
    grid = parse_grid(axes or AXES)
    text = (preset_text("paper"), "paper", folder)
    store = prepare(text, (), grid, FORMATS, folder)
    memory = Memory()
    memory.start()
    own, began = time.process_time(), time.perf_counter()
    done = sweep(store, workers=workers)
    wall, own = time.perf_counter() - began, time.process_time() - own
    memory.over.set()
    assert done.statuses["passed"] == len(grid), done.statuses
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {
        "cases": len(grid),
        "wall": wall,
        "own": own,
        "memory": memory.greatest,
        "files": len(files),
        "bytes": sum(path.stat().st_size for path in files),
        "table": done.table.stat().st_size,
    }


def cold_imports() -> float:
    """Processor time in s of a process that only loads the libraries."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", LIBRARIES], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_cases_beside_cold_imports_and_one_file_beside_a_folder(tmp_path: Path) -> None:
    """Cases of one process, early and late, and what it takes to keep them."""
    grid = parse_grid([f"plant.L1=0.4:0.5:{2 * CASES + 1}"])
    text = (preset_text("paper"), "paper", tmp_path)
    folder, file = (prepare(text, (), grid, ("plc",), tmp_path / name) for name in ("folder", "file.sqlite"))
    cold_imports()
    imports = min(cold_imports() for _ in range(3))
    outcomes = [run_case(folder.recipe, 0, grid[0])]  # by FMPy, too, and compiles the FMU
    marks = [time.process_time()]
    for case in range(1, len(grid)):
        outcomes.append(run_case(folder.recipe, case, grid[case]))
        marks.append(time.process_time())
    early, late = (marks[CASES] - marks[0]) / CASES, (marks[-1] - marks[CASES]) / CASES
    seconds = {}
    for store in (folder, file):
        began = time.process_time()
        with opened(store) as kept:
            for case, outcome in enumerate(outcomes):
                kept.keep(case, outcome)
            kept.gather()
        seconds[store] = (time.process_time() - began) / len(grid)
    print(
        f"\na case takes {1e3 * early:.0f} ms of processor, later {1e3 * late:.0f} ms: {late / imports:.3f} "
        f"times `{LIBRARIES}`; to keep it takes {1e3 * seconds[file]:.2f} ms in one file and "
        f"{1e3 * seconds[folder]:.2f} ms in a folder"
    )


def test_two_processes_beside_one(tmp_path: Path) -> None:
    swept(tmp_path / "warm", 1, "plant.L1=0.45,0.46")  # compiles the FMU
    one, two = (swept(tmp_path / str(workers), workers) for workers in (1, 2))
    load = os.getloadavg()[0]
    print(
        f"\n{one['cases']} cases: {one['wall']:.1f} s by one process, {two['wall']:.1f} s by two, "
        f"{one['wall'] / two['wall']:.2f} times faster; the goal is 1.8 (load of the machine {load:.1f})"
    )
    print(
        f"per case: {1e3 * one['wall'] / one['cases']:.0f} ms of a process, "
        f"{1e3 * two['own'] / two['cases']:.1f} ms of the one that writes, "
        f"{two['bytes'] / two['cases'] / 1e3:.0f} kB in {two['files'] / two['cases']:.1f} files, "
        f"{two['table'] / two['cases']:.0f} bytes of the table; "
        f"a process takes up to {max(one['memory'], two['memory']) / 1e6:.0f} MB"
    )
