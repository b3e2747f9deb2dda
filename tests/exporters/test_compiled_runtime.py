"""The planner's project in OpenPLC Runtime itself, commanded and read by S7.

Collected only where IEC2C and MATIEC_LIB name OpenPLC's matiec. Run only where OPENPLC_RUNTIME names the
folder of an installed OpenPLC Runtime v4, and XML2ST the program of that name that its editor brings.
"""

import json
import os
import shutil
import signal
import struct
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import snap7
from test_planner_forms import SPEC

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files

RUNTIME, XML2ST = (os.environ.get(name) for name in ("OPENPLC_RUNTIME", "XML2ST"))
PORT = 10407
READ = 10_000  # cycles
SETPOINTS = ("fPosition", "fVelocity", "fAcceleration")
SWITCHES = ("bEnable", "bExecute", "bVelocity", "bStop")  # from %QX0.0 on
NUMBERS = ("fTarget", "fVelocityCommand")  # from %ML0 on
COMMANDS = (  # of the cycles that were read
    (100, {"bEnable": 1}),
    (200, {"fTarget": 4.0}),
    (300, {"bExecute": 1}),
    (2000, {"bExecute": 0}),
    (2100, {"fTarget": 1.0}),
    (2200, {"bExecute": 1}),
    (5000, {"bExecute": 0}),
    (5100, {"bVelocity": 1}),
    (5300, {"fVelocityCommand": 0.4}),
    (8000, {"bStop": 1}),
)
BLOCKS = (("bool_output", 0, 16), ("lint_memory", 0, 128), ("lint_memory", 64, 32))


def installed(file, folder):
    """Compile the project as OpenPLC's editor and runtime do, in a copy of the runtime."""
    runtime = Path(
        shutil.copytree(RUNTIME, folder / "runtime", ignore=shutil.ignore_patterns("venvs", ".git"))
    )
    generated = runtime / "core" / "generated"
    shutil.rmtree(generated, ignore_errors=True)
    library = Path(os.environ["MATIEC_LIB"])
    shutil.copytree(library / "C", generated / "lib")
    (generated / "plc.st").write_bytes(file.content)
    (generated / "c_blocks_code.cpp").touch()
    for words in (
        [os.environ["IEC2C"], "-f", "-p", "-i", "-l", "-I", library, "-T", ".", "plc.st"],
        [XML2ST, "--generate-debug", "plc.st", "VARIABLES.csv"],
        [XML2ST, "--generate-gluevars", "LOCATED_VARIABLES.h"],
    ):
        subprocess.run(words, cwd=generated, check=True, capture_output=True)
    for old in (runtime / "build").glob("libplc_*.so"):
        old.unlink()
    subprocess.run(["bash", "scripts/compile.sh"], cwd=runtime, check=True, capture_output=True)
    (runtime / "build" / "new_libplc.so").rename(runtime / "build" / "libplc_1.so")
    mapped = [
        {"db_number": number, "size_bytes": size, "mapping": {"type": area, "start_buffer": start}}
        for number, (area, start, size) in enumerate(BLOCKS, start=1)
    ]
    server = {"enabled": True, "bind_address": "127.0.0.1", "port": PORT}
    (runtime / "s7.json").write_text(json.dumps({"server": server, "data_blocks": mapped}))
    (runtime / "plugins.conf").write_text("s7comm,./build/plugins/libs7comm_plugin.so,1,1,./s7.json,\n")
    Path("/run/runtime").mkdir(exist_ok=True)
    return runtime


def connected():
    while True:
        client = snap7.client.Client()
        try:
            client.connect("127.0.0.1", 0, 1, PORT)
        except snap7.error.S7ConnectionError:
            time.sleep(0.2)
        else:
            return client


def commanded(client):
    """Give setpoints by cycle, and each command with the cycles between which it was taken over."""
    seen, given, switches, due = {}, [], dict.fromkeys(SWITCHES, 0), [*COMMANDS]

    def look():
        number, *setpoints = struct.unpack(">q3d", bytes(client.db_read(3, 0, 32)))
        seen[number] = setpoints
        return number

    while len(seen) < READ:
        before = look()
        if due and due[0][0] <= len(seen):
            ((name, value),) = due.pop(0)[1].items()
            if name in switches:
                switches[name] = value
                bits = sum(on << place for place, on in enumerate(switches.values()))
                client.db_write(1, 0, bytearray([bits]))
            else:
                client.db_write(2, 8 * NUMBERS.index(name), bytearray(struct.pack(">d", value)))
            given.append((name, value, range(before + 1, look() + 2)))
    return seen, given


@pytest.mark.skipif(
    not (RUNTIME and XML2ST), reason="NOT run in OpenPLC: OPENPLC_RUNTIME or XML2ST is not set"
)
def test_every_setpoint_that_openplc_shows_is_the_block_s_own(tmp_path):
    block = planner_block(SPEC)
    (file,) = block_files(block, SPEC, ["openplc"])
    runtime = installed(file, tmp_path)
    with (
        (tmp_path / "log").open("w") as log,
        subprocess.Popen(["build/plc_main"], cwd=runtime, stdout=log) as plc,
    ):
        try:
            seen, given = commanded(connected())
        finally:
            plc.send_signal(signal.SIGINT)
    names = [*BlockInstance(block.text).inputs]
    columns = [BlockInstance(block.text).outputs.index(name) for name in SETPOINTS]
    rows = np.tile([*BlockInstance(block.text).inputs.values()], (max(seen), 1))

    def differing(until):
        issued = BlockInstance(block.text).call(rows[:until])[:, columns]
        return [n for n in seen if n <= until and issued[n - 1].tobytes() != np.array(seen[n]).tobytes()]

    for (name, value, taken), following in zip(given, [*given[1:], None], strict=True):
        until, place = max(seen) if following is None else following[2].start, names.index(name)
        kept = rows[:, place].copy()
        for cycle in taken:  # the one in which it was taken over is not shown
            rows[:, place] = np.where(np.arange(len(rows)) < cycle - 1, kept, value)
            if not differing(until):
                break
    assert differing(max(seen)) == []
    assert np.ptp([setpoints[0] for setpoints in seen.values()]) > 1.0
