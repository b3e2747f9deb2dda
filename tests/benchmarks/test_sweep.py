"""What a sweep costs per case, and how much faster two processes are than one. Printed, not judged."""

import os
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil

from gen_profile.spec.reading import preset_text
from gen_profile.sweep.grid import parse_grid
from gen_profile.sweep.plan import prepare
from gen_profile.sweep.run import sweep

AXES = ("move.distance=0.1:0.3:20", "plant.L1=0.4:0.5:20")
FORMATS = ("csv", "plc")


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
