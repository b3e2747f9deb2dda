"""The planner's program for a Linux machine: built, run, commanded by OPC UA, read cycle by cycle."""

import asyncio
import math
import os
import runpy
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from asyncua import Client, ua
from end_to_end.simulated_controllers import free_port
from system_parts import program
from test_planner_forms import BAY

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files
from gen_profile.spec.reading import parse_spec

CYCLES = 4_500
LOOKS = 0.1  # s between calls for rows; without a pause each would be for one, and take a processor
SPEC = parse_spec(BAY.replace("bay 3", "host 3").replace("0.004", "0.001"))
COMMANDS = (  # cycle, inputs from there on
    (50, {"fL1": 5.5, "bEnable": True}),
    (200, {"fTarget": 3.0, "bExecute": True}),
    (2000, {"bExecute": False}),
    (2200, {"fTarget": 6.0, "bExecute": True}),
)


@pytest.fixture(scope="module")
def block():
    return planner_block(SPEC)


@pytest.fixture(scope="module")
def host(block, tmp_path_factory):
    folder = tmp_path_factory.mktemp("host")
    for file in block_files(block, SPEC, ["c", "linux"]):
        (folder / file.filename).write_bytes(file.content)
    strict = ["-std=c11", "-Og", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    command = [program("cc", "gcc"), *strict, "-o", "host_3", "host 3_linux.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return folder


@contextmanager
def running(*words):
    """Start a program, and end it where the test fails, too."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def until(look):
    """Look again and again, until there is something to see."""
    while True:
        with suppress(OSError, ValueError):
            if found := look():
                return found
        time.sleep(0.01)


async def commanded(process, url):
    """Command by the numbers of the rows, from the first one that is read, and end the host by a signal.

    Returns
    -------
    names, first, rows
        `first` is the number of the first row, before any command.
    """
    first, rows, commands = -1, [], [*COMMANDS]
    async with Client(url) as client:
        space = await client.get_namespace_index("urn:host_3")
        block = await client.nodes.objects.get_child(f"{space}:host_3")
        names = await (await block.get_child(f"{space}:Names")).read_value()
        while True:
            await asyncio.sleep(LOOKS)
            wanted = ua.Variant(first + len(rows), ua.VariantType.Int64)
            begun, *more = await block.call_method(f"{space}:Rows", wanted)
            assert begun == first + len(rows) or not rows, "rows were missed"
            first = first if rows else int(begun)
            rows += np.reshape(more, (-1, len(names))).tolist()
            while commands and commands[0][0] <= len(rows):
                for name, value in commands.pop(0)[1].items():
                    await (await block.get_child(f"{space}:{name}")).write_value(value)
            if len(rows) >= CYCLES and not commands:
                process.send_signal(signal.SIGTERM)
                commands.append((math.inf, {}))  # once
            elif not more and process.poll() is not None:
                return names, first, np.array(rows)


@pytest.mark.slow
def test_every_setpoint_read_from_outside_is_the_block_s_own(block, host):
    port = free_port()
    url = f"opc.tcp://127.0.0.1:{port}"
    server_script = [sys.executable, host / "host 3_opcua.py", "--port", str(port)]
    with running(host / "host_3", "0") as process, running(*server_script) as server:
        assert server.stdout.readline() == f"host_3 at {url}\n", server.stderr.read()
        names, first, rows = asyncio.run(commanded(process, url))
        said = process.communicate()[0]
        assert server.communicate()[1] == "host_3 has ended.\n"
    assert len(rows) >= CYCLES
    assert said.startswith(f"{first + len(rows)} cycles of 1 ms: late by ")
    column = {name: rows[:, place] for place, name in enumerate(names)}
    oracle = BlockInstance(block.text)
    column["fCycleTime"] = np.full(len(rows), oracle.inputs["fCycleTime"])
    given = np.stack([column[name] for name in oracle.inputs], axis=1)
    issued = oracle.call(np.concatenate([np.tile(given[0], (first, 1)), given]))[first:]
    assert np.stack([column[name] for name in oracle.outputs], axis=1).tobytes() == issued.tobytes()
    assert np.ptp(column["fPosition"]) > 1.0
    assert abs(column["fVelocity"][CYCLES - 1]) > 0.1
    final = {name: column[name][-1] for name in ("bStop", "fVelocity", "bBusy", "bError", "bPromise")}
    assert final == {"bStop": 1.0, "fVelocity": 0.0, "bBusy": 0.0, "bError": 0.0, "bPromise": 1.0}


@pytest.mark.slow
def test_it_stops_where_nobody_changes_b_alive_and_at_a_second_signal_at_once(host):
    """Commanded as by a fieldbus's program, in shared memory."""
    script = runpy.run_path(str(host / "host 3_opcua.py"))
    with running(host / "host_3", "2") as process:
        image = until(script["Image"])
        place = {name: number for number, name in enumerate(image.names)}

        def put(**values):
            for name, value in values.items():
                image.given[place[name]] = value

        def shows(name, value, **changed):
            put(bAlive=1.0 - image.given[0], **changed)
            return image.rows(-1)[1 + place[name]] == value

        first_row = until(lambda: image.rows(-1)[1:])
        assert first_row[place["bStop"]] == 1.0
        assert until(lambda: shows("bEnabled", 1.0, bEnable=1.0))
        assert until(lambda: shows("bInVelocity", 1.0, bVelocity=1.0))
        assert until(lambda: shows("bInVelocity", 0.0, fVelocityCommand=0.5))
        assert until(lambda: shows("bInVelocity", 1.0))
        assert until(lambda: image.rows(-1)[1 + place["bStop"]] == 1.0)
        other = subprocess.run([host / "host_3"], capture_output=True, text=True, check=False)
        assert (other.returncode, other.stderr.split(";")[0]) == (1, "host_3 runs already")
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        assert "cycles of 1 ms" in process.communicate()[0]
    last = image.rows(-1)[1:]
    assert (last[place["bQuickStop"]], last[place["fVelocity"]], last[place["bPromise"]]) == (1.0, 0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("words", [["x"], ["-1"], ["nan"], ["1", "2"]])
def test_a_wrong_word_is_refused(host, words):
    done = subprocess.run([host / "host_3", *words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.partition(":")[0]) == (2, "usage")


@pytest.mark.slow
@pytest.mark.parametrize("trap", ["open to all", "a second name", *["another user's"][: os.geteuid() == 0]])
def test_shared_memory_that_another_user_may_write_is_not_taken(host, trap):
    """A user who can write it commands the axes."""
    shared = Path("/dev/shm/host_3")
    shared.touch(mode=0o600)
    second = shared.with_name("host_3.second")
    try:
        if trap == "another user's":
            os.chown(shared, 65534, 65534)
        elif trap == "open to all":
            shared.chmod(0o666)
        else:
            os.link(shared, second)
        with running(host / "host_3") as process:
            until(lambda: process.poll() is not None or shared.stat().st_size)
            assert shared.stat().st_size == 0
            assert "or others may write it: remove it, and start again" in process.stderr.read()
        assert process.returncode == 1
        if trap != "a second name":
            script = runpy.run_path(str(host / "host 3_opcua.py"))
            with pytest.raises(OSError, match="is another user's, or others may write it"):
                script["Image"]()
    finally:
        for path in (shared, second):
            path.unlink(missing_ok=True)
