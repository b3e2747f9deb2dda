"""What happens on vcan0, with `gen-profile stream`, `gen-profile drive-sim` and candump as processes.

Run as a program, in a kernel with vcan: FOLDER holds the exported log, and gets one folder per scenario with
what candump saw (``bus.log``), what the programs said (``stream.json``, ``drive.json``) and how they ended
(``codes.json``).
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

PROGRAM = Path(sys.executable).parent / "gen-profile"
BUS = ("--interface", "socketcan", "--channel", "vcan0")
PATIENCE = 60.0  # s, for what takes a second or two; a machine may be busy
ATTEMPTS = 8  # for a fair trial
UNDER_WAY = 1.0  # s after the beginning of the stream


def run(place, log, disturb):
    """Let a stream run, disturb it once it moves, and keep what everybody saw; tell whether it was fair.

    A busy machine may be late, which ends a stream before, or instead of, what was to end it, or leaves out
    a setpoint.
    """
    place.mkdir()
    running = True
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    with (place / "bus.log").open("w") as bus, (place / "drive.json").open("w") as told:
        witness = subprocess.Popen(["candump", "-L", "vcan0"], stdout=bus)
        simulated = subprocess.Popen(
            [PROGRAM, "drive-sim", "--preset", "paper", "--json", *BUS], stdout=told, stderr=told
        )
        _wait_for("waiting for a stream", place / "drive.json", simulated)
        with (place / "stream.json").open("w") as said, (place / "stream.err").open("w") as complaints:
            streamer = subprocess.Popen(
                [PROGRAM, "stream", log, "--json", *BUS], stdout=said, stderr=complaints
            )
            if disturb is not None:
                _wait_for("stream …", place / "stream.err", streamer)
                time.sleep(UNDER_WAY)
                running = "aborted" not in (place / "stream.err").read_text()
                disturb(streamer, simulated)
            code = _ended(streamer)
        drive_code = _ended(simulated, patience=20.0)
        time.sleep(0.1)
        witness.terminate()
        witness.wait()
    (place / "codes.json").write_text(json.dumps({"stream": code, "drive": drive_code}))
    said = (place / "stream.json").read_text()
    if disturb is None:
        return code == 0 and json.loads(said)["cycles_sent"] == json.loads(said)["cycles_planned"]
    return running and (disturb is _freeze or "late at cycle" not in said)


def _wait_for(words, file, process):
    """Wait until a program says something, or ends."""
    deadline = time.monotonic() + PATIENCE
    while words not in file.read_text() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)


def _ended(process, patience=PATIENCE):
    try:
        return process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _cansend(frame):
    return lambda *_: subprocess.run(["cansend", "vcan0", frame], check=True)


def _signal_streamer(number):
    return lambda streamer, _: streamer.send_signal(number)


def _freeze(streamer, _):
    streamer.send_signal(signal.SIGSTOP)
    time.sleep(0.5)
    streamer.send_signal(signal.SIGCONT)


def _bus_down(*_):
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)


DISTURBANCES = {
    "whole": None,
    "killed": _signal_streamer(signal.SIGKILL),
    "frozen": _freeze,
    "interrupted": _signal_streamer(signal.SIGINT),
    "second-master": _cansend("301#00000000"),
    "bus-down": _bus_down,
}


def main(folder):
    subprocess.run(["ip", "link", "add", "vcan0", "type", "vcan"], check=True)
    log = folder / "deploy" / "paper.log"
    for name, disturb in DISTURBANCES.items():
        for attempt in range(ATTEMPTS):
            place = folder / f"{name}-{attempt}"
            if run(place, log, disturb):
                break
        place.rename(folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
