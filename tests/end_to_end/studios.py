"""The studio as a user starts it: a process of its own, and its address."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from command_line import PROGRAM


@contextmanager
def studio(
    *words: str | Path, folder: Path | None = None, told: IO[str] | None = None
) -> Iterator[tuple[str, int]]:
    """Start the studio, give its address and process, and end it as Ctrl-C does; `told` takes its stderr."""
    command = [PROGRAM, "studio", "--no-browser", "--json", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=told, text=True, cwd=folder) as process:
        try:
            assert process.stdout is not None
            document = "".join(iter(process.stdout.readline, "}\n")) + "}"
            yield json.loads(document)["address"], process.pid
        finally:
            process.terminate()
    assert process.returncode == 0


def workers_of(server: int) -> list[int]:
    """List the processes that a studio started, those that have ended left out."""
    found: list[int] = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if int(parent) == server and state != "Z" and b"spawn_main" in command:
            found.append(int(entry.name))
    return found
