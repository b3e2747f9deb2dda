"""Axes on several buses: one SYNC on each, and a fault on one stops all."""

import can
import can.interfaces.virtual
import numpy as np
import pytest
from exporters.can.bench import MS, QUICK_STOP, Bench, Tampered
from exporters.motions import quintic, target
from numpy.testing import assert_array_equal

from gen_profile.support.errors import ExportError
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.cia402 import MOVING, State
from gen_profile_exporters.can.export.exporter import encode, replay
from gen_profile_exporters.can.streaming.joint_bus import JointBus
from gen_profile_exporters.can.streaming.record import Phase

PROFILE = quintic((0.1, 0.2), (1.2, 1.0), (0.0, 0.1), duration=0.4)
AXES = ("bridge", "trolley", "hoist")
CHANNELS = {"bridge": "can0", "trolley": "can1", "hoist": "can1"}
PERIOD = 4  # ms


@pytest.fixture
def bench():
    with Bench(*AXES, profile=PROFILE, channels=CHANNELS, step=MS // 4) as found:
        yield found


def quick_stopped(bench, *nodes):
    """When drives were first commanded to stop, in ms."""
    stops = (0x200 + node for node in nodes or (1, 2, 3))
    return [next(frame.at for frame in bench.of(cob_id) if frame.data == QUICK_STOP) for cob_id in stops]


def fail(bench, channel, *ways):
    """Have one of the streamer's buses fail."""

    def down(*_):
        raise can.CanOperationError("Network is down")

    joint = bench.streamer_end._bus
    joint.buses[channel] = Tampered(joint.buses[channel])
    for way in ways:
        setattr(joint.buses[channel], way, down)


def test_every_frame_on_its_own_bus_and_one_sync_on_each(bench):
    record = bench.run()
    assert (record.reason, record.aftermath, record.final) == ("", "", (200_000, 1_000_000, 100_000))
    ways = {(frame.cob_id, frame.channel) for frame in bench.heard}
    own = {node: "can0" if node == 1 else "can1" for node in (1, 2, 3)}
    bases = (0x180, 0x200, 0x300, 0x580, 0x600, 0x700)
    assert ways == {
        *((base + node, own[node]) for base in bases for node in own),
        *((cob_id, channel) for cob_id in (0x000, 0x080, 0x77F) for channel in ("can0", "can1")),
    }
    syncs = {channel: [f.at for f in bench.of(0x080) if f.channel == channel] for channel in ("can0", "can1")}
    assert_array_equal(syncs["can0"], syncs["can1"])
    assert np.diff(syncs["can0"])[:-1] == pytest.approx(PERIOD)
    nmt = {(frame.data[1], frame.channel) for frame in bench.of(0x000)}
    assert nmt == set(own.items())


@pytest.mark.parametrize("node", [1, 3])
def test_a_fault_on_one_bus_stops_all(bench, node):
    bench.at_cycle(50, lambda: bench.say(0x080 + node, bytes.fromhex("2031010000000000")))
    record = bench.run()
    assert record.reason.endswith("reports emergency 3120h; see its manual. The axes were stopped.")
    assert max(quick_stopped(bench)) - bench.fault_at <= PERIOD
    assert {drive.state for drive in bench.drives.drives} == {State.SWITCH_ON_DISABLED}
    setpoints = [frame.at for node in (1, 2, 3) for frame in bench.of(0x300 + node)]
    assert max(setpoints) <= min(quick_stopped(bench))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "lost", "ways"),
    [
        ("can0", "bridge", ("send", "recv")),
        ("can1", "trolley, hoist", ("send", "recv")),
        ("can1", "trolley, hoist", ("send",)),
        ("can1", "trolley, hoist", ("recv",)),
    ],
)
def test_a_bus_that_goes_down_stops_the_axes_on_the_other(bench, channel, lost, ways):
    bench.at_cycle(50, lambda: fail(bench, channel, *ways))
    record = bench.run()
    assert f"{channel}: Network is down" in record.reason
    known = "; ".join(f"{axis}: no answer" for axis in lost.split(", "))
    assert f"Not every axis is known to stand ({known})" in record.reason
    well = [node for node in (1, 2, 3) if ("can0" if node == 1 else "can1") != channel]
    assert max(quick_stopped(bench, *well)) - bench.fault_at <= 2 * PERIOD
    assert {bench.drives.drives[node - 1].state for node in well} == {State.SWITCH_ON_DISABLED}
    assert not {drive.state for drive in bench.drives.drives} & MOVING


def test_a_bus_without_sync_is_a_silent_drive(bench):
    joint = bench.drive_end._bus
    joint.buses["can1"] = Tampered(joint.buses["can1"])
    deaf = lambda message: None if message is not None and message.arbitration_id == 0x080 else message  # noqa: E731
    bench.at_cycle(50, lambda: setattr(joint.buses["can1"], "receiving", deaf))
    record = bench.run()
    assert record.phase is Phase.ABORTED
    assert "trolley: no feedback" in record.reason or "reports emergency" in record.reason
    assert quick_stopped(bench)[0] - bench.fault_at < 40


@pytest.mark.parametrize("channel", ["can0", "can1"])
def test_a_second_controller_on_any_bus(bench, channel):
    bench.at_cycle(50, lambda: bench.witness.buses[channel].send(frames.message(frames.SYNC)))
    assert "Frame 080h came from another node" in bench.run().reason


def test_what_another_bus_has_under_a_drives_cob_id_is_not_its_own(bench):
    bench.at_cycle(50, lambda: bench.witness.buses["can1"].send(frames.message(0x181, b"\x08" + bytes(5))))
    assert bench.run().phase is Phase.DONE


class Timed(can.interfaces.virtual.VirtualBus):
    """A bus that says it sends at given instants."""

    def keeps_instants(self):
        return True

    def send_at(self, message, instant):
        self.taken = (message.arbitration_id, instant)


@pytest.mark.parametrize(("second", "keeps"), [(Timed, True), (can.interfaces.virtual.VirtualBus, False)])
def test_launch_times_need_every_bus(second, keeps):
    joint = JointBus({"can0": Timed("timed-0"), "can1": second("timed-1")}, target(*AXES, channels=CHANNELS))
    with joint:
        assert joint.keeps_instants() is keeps
        if keeps:
            joint.send_at(frames.message(frames.SYNC), 7)
            joint.send_at(frames.message(0x303), 8)
            assert [bus.taken for bus in joint.buses.values()] == [(0x080, 7), (0x303, 8)]


def test_files_tell_the_channels():
    own = target(*AXES, channels=CHANNELS)
    files = {file.filename.partition(".")[2]: file.content for file in encode(PROFILE, own)}
    lines = files["log"].decode().splitlines()
    assert [line.split()[1:] for line in lines[:5]] == [
        ["can0", "301#A0860100"],
        ["can1", "302#804F1200"],
        ["can1", "303#00000000"],
        ["can0", "080#"],
        ["can1", "080#"],
    ]
    assert_array_equal(replay(files["log"], own).position, replay(_on_one_bus(), target(*AXES)).position)
    assert [line.split()[1] for line in files["asc"].decode().splitlines()[5:10]] == ["1", "2", "2", "1", "2"]


def _on_one_bus():
    return encode(PROFILE, target(*AXES))[0].content


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        (b"can1 302#", b"can0 302#", "line 2: frame 302h is on the channel can0 instead of can1"),
        (b"can1 080#", b"can0 080#", "line 5: SYNC on can0 out of turn"),
    ],
)
def test_logs_with_frames_on_the_wrong_bus(before, after, reason):
    own = target(*AXES, channels=CHANNELS)
    log = encode(PROFILE, own)[0].content
    with pytest.raises(ExportError, match=reason):
        replay(log.replace(before, after, 1), own)


def test_each_bus_has_its_own_load():
    together, apart = target(*AXES, sync_period=0.001), target(*AXES, sync_period=0.001, channels=CHANNELS)
    assert frames.cycle_bits(apart) < 0.75 * frames.cycle_bits(together)
    with pytest.raises(ExportError, match=r"2 axes every 0\.001 s"):
        frames.require_load(apart)
