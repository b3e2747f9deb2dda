"""Streamer, simulated drive and candump as processes on vcan, judged by what candump saw.

The kernel is this machine's or, where that has no vcan, user-mode-linux, booted once for all tests.
"""

import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import PROGRAM
from exporters.can import vcan_kernel
from system_parts import missing

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
TIMEOUT = 0.1  # s
PERIOD = 0.03  # s; a kernel in a process, on a busy machine, wakes late by milliseconds
CYCLES = round(3.0 / PERIOD) + 1
PATIENCE = 30.0  # s, for a simulated drive on a busy machine to answer
YEAR = 365 * 86400.0  # s
QUICK_STOP = b"\x02\x00"
SLACK = 0.05  # s, for a simulated drive on a busy machine to speak up


@pytest.fixture(scope="session")
def scenarios(tmp_path_factory, cache):
    """Run all scenarios, once for all of pytest-xdist's processes."""
    if lacking := vcan_kernel.missing():
        missing(lacking)
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "vcan"
    with (folder.parent / "vcan.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            folder.mkdir()
            environment = {"GEN_PROFILE_CACHE": str(cache)}
            keys = (f"timeout={TIMEOUT}", f"sync_period={PERIOD}", f"sdo_timeout={PATIENCE}")
            spec = [word for key in keys for word in ("--set", f"can.{key}")]
            subprocess.run(
                [PROGRAM, "--preset", "paper", *spec, "--export", "can", "--out", folder],
                check=True,
                capture_output=True,
                env={**os.environ, **environment},
            )
            command = [sys.executable, HERE / "vcan_scenarios.py", folder]
            code, output = vcan_kernel.run(command, folder, environment)
            (folder / "said").write_text(output)
            assert code == 0, output
    return folder


@pytest.fixture
def scenario(scenarios, request):
    """What one scenario left: frames as (s, COB-ID, data), JSON documents, exit codes."""
    place = scenarios / request.param
    ended = json.loads((place / "codes.json").read_text())
    frames = []
    for line in (place / "bus.log").read_text().splitlines():
        stamp, _, frame = line.split()
        cob_id, _, data = frame.partition("#")
        at = float(stamp.strip("()"))  # launch times are those of another clock
        at += ended["epoch"] if at < YEAR else 0.0
        frames.append((at, int(cob_id, 16), bytes.fromhex(data)))
    report, drive = (place / "stream.json").read_text(), (place / "drive.json").read_text()
    return SimpleNamespace(
        frames=frames,
        stream=json.loads(report) if report else None,
        drive=json.loads(drive) if drive else None,
        log=(scenarios / "paper.log").read_text(),
        codes=(ended["stream"], ended["drive"]),
        launches=ended["launches"],
    )


def instants(scenario, cob_id, data=None):
    return [at for at, found, content in scenario.frames if found == cob_id and data in {None, content}]


def on(name):
    return pytest.mark.parametrize("scenario", [name], indirect=True)


@pytest.mark.parametrize("scenario", ["whole", "launched"], indirect=True)
class TestWhole:
    def test_every_setpoint_once_in_order_byte_for_byte(self, scenario):
        exported = [line.split()[2] for line in scenario.log.splitlines()]
        frames_seen = [
            f"{cob_id:03X}#{data.hex().upper()}"
            for _, cob_id, data in scenario.frames
            if cob_id in {0x301, 0x080}
        ]
        starts = [k for k in range(len(frames_seen)) if frames_seen[k : k + len(exported)] == exported]
        assert starts
        around = {*frames_seen[: starts[0]], *frames_seen[starts[0] + len(exported) :]}
        assert around == {exported[0], exported[-2], "080#"}
        assert frames_seen[::2] == [frame for frame in frames_seen if frame != "080#"]
        assert len(exported) == 2 * CYCLES

    def test_it_ends_well(self, scenario):
        assert scenario.codes == (0, 0)
        assert (scenario.stream["state"], scenario.stream["cycles_sent"]) == ("done", CYCLES)
        assert abs(scenario.stream["drift_s"]) < PERIOD
        assert scenario.stream["drive"]["position_error_m"] == 0.0

    def test_the_load_does_not_sway(self, scenario):
        assert (
            0.0 < scenario.drive["sway_residual_peak_m"] < 0.003
        )  # the check's limit: a late SYNC on a busy machine shows
        assert scenario.drive["position_m"] == pytest.approx([0.3], abs=1e-12)

    def test_the_kernel_keeps_the_instants_where_it_can(self, scenario):
        said = any("launch times" in note for note in scenario.stream["notes"])
        assert said == scenario.launches
        assert abs(np.median(np.diff(instants(scenario, 0x080))) - PERIOD) < 0.1 * PERIOD
        assert min(waits(scenario)) > 0.0  # handed over before its instant, and yet not answered before it


def waits(scenario):
    """How long after each SYNC's instant its answer came, in s."""
    synced = None
    for at, cob_id, _ in scenario.frames:
        if cob_id == 0x080:
            synced = at
        elif cob_id == 0x181 and synced is not None:
            yield at - synced


@on("frozen")
def test_a_frozen_streamers_drive_stops_by_itself(scenario):
    assert scenario.codes[0] == 6
    emergency = instants(scenario, 0x081)[0]
    setpoints = instants(scenario, 0x301)
    assert max(setpoints) < emergency < max(setpoints) + TIMEOUT + SLACK
    assert scenario.drive["states"] in (["switch on disabled"], ["fault"])
    assert 0.0 < scenario.drive["position_m"][0] < 0.25


@on("second-controller")
def test_a_second_controller_stops_the_axis(scenario):
    assert scenario.codes[0] == 6
    assert "a second controller is on the bus" in scenario.stream["reason"]
    said = next(at for at, *frame in scenario.frames if frame == [0x301, bytes(4)] and at > moved(scenario))
    stop = assert_quick_stop(scenario)
    assert stop - said < 2 * PERIOD + SLACK


def moved(scenario):
    """When the first setpoint was sent that is not the start."""
    return next(at for at, cob_id, data in scenario.frames if cob_id == 0x301 and data != bytes(4))


def assert_quick_stop(scenario):
    """Find the quick stop on the bus, no setpoint after it, and the axis at rest; return its instant."""
    stop = instants(scenario, 0x201, QUICK_STOP)[0]
    assert max(instants(scenario, 0x301)) < stop
    positions = [data[2:] for at, cob_id, data in scenario.frames if cob_id == 0x181]
    assert positions[-1] == positions[-2]
    assert scenario.drive["states"] == ["switch on disabled"]
    return stop


@on("bus-down")
def test_a_bus_that_goes_down_ends_the_stream(scenario):
    assert scenario.codes[0] == 6
    assert "to stop by itself" in scenario.stream["reason"]
    assert scenario.codes == (6, 6)


def test_an_encoder_that_swings_is_logged(scenarios):
    place = scenarios / "encoder"
    assert json.loads((place / "codes.json").read_text()) == {"log": 0}, (place / "log.err").read_text()
    times, angles = np.loadtxt(place / "swing.csv", delimiter=",", skiprows=1).T
    assert times[-1] >= 2.0 and np.diff(times).min() > 0.0
    waves = np.stack([np.sin(5.0 * times), np.cos(5.0 * times), np.ones_like(times)], axis=1)
    found, *_ = np.linalg.lstsq(waves, angles)
    assert np.hypot(*found[:2]) == pytest.approx(300 * 2 * np.pi / 4096, rel=0.01)
