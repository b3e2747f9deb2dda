"""How evenly 4 ms frames leave, by ours and by others' means, all on one vcan0 and measured by its kernel.

Run as a program in a kernel with vcan; prints one line of JSON: lateness in µs against the absolute schedule,
and how much the last frame was off the first one's schedule.
"""

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import numpy as np

from gen_profile_exporters.can.export.candump import Frame, write
from gen_profile_exporters.can.host.clock import SystemClock
from gen_profile_exporters.can.host.launch import LaunchingBus
from gen_profile_exporters.can.host.realtime import real_time

PERIOD = 0.004
SYNC = can.Message(arbitration_id=0x080, is_extended_id=False)


def ours(bus, count):
    clock, period = SystemClock(), round(PERIOD * 1e9)
    with real_time():
        start = clock.now() + period
        for cycle in range(count):
            clock.sleep_until(start + cycle * period)
            bus.send(SYNC)


def ours_launched(bus, count):
    """Hand each frame to the kernel a quarter of a period ahead, as the streamer does where that helps."""
    tc = shutil.which("tc", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    subprocess.run([tc, "qdisc", "replace", "dev", "vcan0", "root", "fq"], check=True)
    clock, period = SystemClock(), round(PERIOD * 1e9)
    with real_time(), LaunchingBus("vcan0") as bus:
        start = clock.now() + period
        for cycle in range(count):
            clock.sleep_until(start + cycle * period - period // 4)
            bus.send_at(SYNC, start + cycle * period)
        clock.sleep_until(start + count * period)


def send_periodic(bus, count):
    task = bus.send_periodic(SYNC, PERIOD)
    time.sleep(PERIOD * 1.2 * count)
    task.stop()


def players_log(count):
    path = Path("/dev/shm/pacing.log")
    path.write_bytes(write(Frame(round(cycle * PERIOD * 1e6), 0x080, b"") for cycle in range(count)))
    return path


def python_can_player(bus, count):
    with can.LogReader(players_log(count)) as log:
        for message in can.MessageSync(log):
            bus.send(message)


def canplayer(_, count):
    subprocess.run(["canplayer", "-I", players_log(count), "vcan0=can0"], check=True)


def measured(send, count):
    """Lateness of every frame, in s.

    It is judged by when a listener gets it: the kernel's stamp of a frame with a launch time is that time.
    """
    with (
        can.Bus(channel="vcan0", interface="socketcan") as bus,
        can.Bus(channel="vcan0", interface="socketcan") as witness,
    ):
        sender = threading.Thread(target=send, args=(bus, count))
        sender.start()
        stamps = []
        while len(stamps) < count and (message := witness.recv(1.0)) is not None:
            if message.arbitration_id == SYNC.arbitration_id:
                stamps.append(time.monotonic())
        sender.join()
    return np.array(stamps) - stamps[0] - PERIOD * np.arange(len(stamps))


def main(count):
    subprocess.run(["ip", "link", "add", "vcan0", "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    figures = {}
    for send in (ours, send_periodic, python_can_player, canplayer, ours_launched):
        late = measured(send, count)
        assert len(late) == count, f"{send.__name__} sent {len(late)} of {count} frames"
        p50, p99, most = np.percentile(np.abs(late - np.median(late)), [50, 99, 100]) * 1e6
        drift = float(np.polyfit(np.arange(len(late)), late, 1)[0] * len(late))
        figures[send.__name__] = {"p50": p50, "p99": p99, "max": most, "drift_s": drift}
    print(json.dumps(figures))


if __name__ == "__main__":
    main(int(sys.argv[1]))
