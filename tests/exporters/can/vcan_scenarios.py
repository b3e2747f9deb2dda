"""What happens on vcan0, with `gen-profile stream`, `gen-profile drive-sim` and candump as processes.

Run as a program, in a kernel with vcan: FOLDER holds the exported logs, and gets one folder per scenario with
what candump saw (``bus.log``), what the programs said (``stream.json``, ``drive.json``) and how they ended
(``codes.json``). The processes are forked from this one, which has loaded the program once: user-mode-linux
takes five seconds for that. None is killed: to a drive, a frozen streamer is a dead one.
"""

import fcntl
import gc
import json
import math
import multiprocessing
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import can
from can.interfaces.socketcan import SocketcanBus

from gen_profile.cli import main as gen_profile_command

DRIVE = ("drive-sim", "--preset", "paper")
LOGGED = ("log-swing", "can:socketcan:vcan0", "--node", "5", "--for", "2", "--out")
PATIENCE = 60.0  # s, for what takes a second or two; a machine may be busy
SIOCSIFFLAGS = 0x8914  # linux/sockios.h
ATTEMPTS = 8  # for a fair trial
UNDER_WAY = 0.6  # s after the beginning of the stream
FROZEN = 0.5  # s
NAP = 0.005  # s
STALL = 0.04  # s, less than the tests allow a drive to speak up


class _StalledError(Exception):
    """The machine did nothing for a while."""


def run(place, log, queue, disturb):
    """Let a stream run, disturb it once it moves, and keep what everybody saw; tell whether it was fair.

    A busy machine stalls, which ends a stream before, or instead of, what was to end it, or lets the
    simulated drive miss a setpoint.
    """
    place.mkdir()
    running = True
    tc = shutil.which("tc", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    queued = subprocess.run([tc, "qdisc", "replace", "dev", "vcan0", "root", queue], check=False)
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    with (place / "bus.log").open("w") as bus:
        witness = subprocess.Popen(["candump", "-L", "vcan0"], stdout=bus)
        drive = _begun(DRIVE, place / "drive.json", place / "drive.err")
        _wait_for("waiting for a stream", place / "drive.err", drive)
        streamer = _begun(("stream", str(log)), place / "stream.json", place / "stream.err")
        if disturb is not None:
            _wait_for("stream …", place / "stream.err", streamer)
            time.sleep(UNDER_WAY)
            running = "aborted" not in (place / "stream.err").read_text()
            try:
                disturb(streamer, drive)
            except (ProcessLookupError, _StalledError):  # it has ended by itself, or none could act
                running = False
        codes = {"stream": _ended(streamer), "drive": _ended(drive, patience=10.0)}
        time.sleep(0.1)
        witness.terminate()
        witness.wait()
    echo = Path("/sys/module/vcan/parameters/echo").read_text().strip()
    launches = queue == AT_LAUNCH_TIME and queued.returncode == 0 and echo == "Y"
    (place / "codes.json").write_text(
        json.dumps({**codes, "launches": launches, "epoch": time.time() - time.monotonic()})
    )
    report = (place / "stream.json").read_text()
    if disturb is None:
        reported = json.loads(report or "{}")
        whole = reported.get("cycles_sent") == reported.get("cycles_planned")  # none was skipped
        running = whole and reported.get("state") == "done" and reported["drive"]["cycles_unanswered"] == 0
    late = [float(ms) / 1e3 for ms in re.findall(r"([\d.]+) ms late at cycle", report)]
    stalled = any(seconds < FROZEN - 0.1 for seconds in late) if disturb is _freeze else bool(late)
    return running and not stalled and "no heartbeat" not in report


def _begun(arguments, out, err):
    """Begin a command of gen-profile in a process of its own."""
    process = multiprocessing.get_context("fork").Process(target=_command, args=(arguments, out, err))
    process.start()
    return process


def _command(arguments, out, err):
    for path, number in ((out, 1), (err, 2)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
    _gen_profile(arguments, "vcan0")


def _gen_profile(arguments, channel):
    where = () if arguments[0] == "log-swing" else ("--interface", "socketcan", "--channel", channel)
    sys.argv = ["gen-profile", *arguments, "--json", *where]
    try:
        gen_profile_command()
    finally:
        sys.stdout.flush()


def _load(*commands):
    """Have in memory whatever commands need, by giving them for a bus that is not there."""
    for arguments in commands:
        with suppress(SystemExit):
            _gen_profile(arguments, "no-bus")


def _wait_for(words, file, process):
    """Wait until a program says something, or ends."""
    deadline = time.monotonic() + PATIENCE
    while process.is_alive() and time.monotonic() < deadline:
        with suppress(FileNotFoundError):
            if words in file.read_text():
                return
        time.sleep(0.05)


def _ended(process, patience=PATIENCE):
    process.join(patience)
    if process.is_alive():
        process.kill()
        process.join()
    return process.exitcode


# To start a process takes longer than a cycle here; whatever disturbs a stream is done by this one.


def _say(cob_id, data):
    frame = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)

    def act(*_):
        with SocketcanBus("vcan0") as bus:
            bus.send(frame)

    return act


def _freeze(streamer, _):
    """Stop the streamer for a while, in which the drive must be able to act."""
    os.kill(streamer.pid, signal.SIGSTOP)
    instants = [time.monotonic()]
    while instants[-1] < instants[0] + FROZEN:
        time.sleep(NAP)
        instants.append(time.monotonic())
    os.kill(streamer.pid, signal.SIGCONT)
    if max(after - before for before, after in pairwise(instants)) > NAP + STALL:
        raise _StalledError


def _bus_down(*_):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh", b"vcan0", 0))


AT_ONCE, AT_LAUNCH_TIME = "pfifo_fast", "fq"  # what a queue does

SCENARIOS = {
    "whole": (AT_ONCE, None),
    "launched": (AT_LAUNCH_TIME, None),
    "frozen": (AT_ONCE, _freeze),
    "second-controller": (AT_ONCE, _say(0x301, bytes(4))),
    "bus-down": (AT_ONCE, _bus_down),
}


def encoder(place):
    """Let an encoder swing, of 4096 counts a turn, about where it turns over, while it is logged."""
    place.mkdir()
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    logged = _begun((*LOGGED, str(place / "swing.csv")), place / "log.json", place / "log.err")
    turn = can.Message(arbitration_id=0x585, data=b"\x43\x01\x60\x00\x00\x10\x00\x00", is_extended_id=False)
    with SocketcanBus("vcan0") as bus:
        while logged.is_alive():
            if (asked := bus.recv(0.01)) is not None and asked.arbitration_id == 0x605:
                bus.send(turn)
            counts = round(300.0 * math.sin(5.0 * time.time())) % 4096
            data = counts.to_bytes(4, "little")
            bus.send(can.Message(arbitration_id=0x185, data=data, is_extended_id=False))
    (place / "codes.json").write_text(json.dumps({"log": _ended(logged)}))


def main(folder):
    subprocess.run(["ip", "link", "add", "vcan0", "type", "vcan"], check=True)
    _load(DRIVE, ("stream", str(folder / "paper.log")), (*LOGGED[:1], "can:socketcan:no-bus", *LOGGED[2:4]))
    gc.freeze()
    gc.disable()  # a collection in a forked process would copy every page, which takes a second here
    for name, (queue, disturb) in SCENARIOS.items():
        for attempt in range(ATTEMPTS):
            place = folder / f"{name}-{attempt}"
            if run(place, folder / "paper.log", queue, disturb):
                break
        place.rename(folder / name)
    encoder(folder / "encoder")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
