"""Channels of this computer, and the nodes on a bus."""

import json

import can
import pytest
from command_line import error_of, run_here
from exporters.can.bench import MS, Bench, FakeClock
from exporters.motions import quintic

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can.host import clock, detection
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.can.streaming.discovery import discover

LINKS = [
    {"ifname": "lo", "link_type": "loopback", "flags": ["UP"]},
    {
        "ifname": "can0",
        "link_type": "can",
        "flags": ["NOARP", "UP", "LOWER_UP"],
        "linkinfo": {
            "info_kind": "can",
            "info_data": {"state": "ERROR-ACTIVE", "bittiming": {"bitrate": 250000}},
        },
    },
    {"ifname": "can1", "link_type": "can", "flags": ["NOARP"], "linkinfo": {"info_kind": "can"}},
    {
        "ifname": "vcan0",
        "link_type": "can",
        "flags": ["NOARP", "UP"],
        "linkinfo": {"info_kind": "vcan"},
    },
]


@pytest.fixture
def linux(tmp_path, monkeypatch):
    """A computer whose `ip` tells of some CAN interfaces."""
    program = tmp_path / "ip"
    program.write_text(f"#!/bin/sh\ncat <<'END'\n{json.dumps(LINKS)}\nEND\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    return program


def test_channels_with_their_bit_rates_and_states(linux):
    document = run_here("can", "list", "--interface", "socketcan", "--json").document
    (interface,) = document["interfaces"]
    assert document["nodes"] is None
    assert interface["channels"] == [
        {"name": "can0", "bitrate": 250000, "state": "ERROR-ACTIVE"},
        {"name": "can1", "bitrate": None, "state": "DOWN"},
        {"name": "vcan0", "bitrate": None, "state": "UP"},
    ]
    words = run_here("can", "list", "--interface", "socketcan").out.splitlines()
    assert words == [
        "socketcan can0, 250 kbit/s, ERROR-ACTIVE",
        "socketcan can1, DOWN",
        "socketcan vcan0, UP",
    ]


@pytest.mark.parametrize("says", ["not json", ""])
def test_an_ip_that_tells_nothing(linux, says):
    linux.write_text(f"#!/bin/sh\necho '{says}'\n")
    assert detection.channels("socketcan") == ()


def test_everything_that_python_can_knows_and_what_it_needs(linux):
    """No network is asked: socketcand's detection takes what it hears there."""
    listed = {one["name"]: one for one in run_here("can", "list", "--json").document["interfaces"]}
    assert listed.keys() == can.VALID_INTERFACES - {"virtual", "udp_multicast", "socketcand"}
    assert "PCAN-Basic" in listed["pcan"]["needs"]
    words = run_here("can", "list")
    assert "  kvaser: install Kvaser's CANlib" in words.out
    assert words.err == ""


def discovered(bench):
    return discover(Link(bench.streamer_end, bench.clock))


def questions(bench):
    bench.wait(2)
    return [frame for frame in bench.heard if 0x600 < frame.cob_id < 0x680]


def test_nodes_tell_what_they_are():
    with Bench("bridge", "trolley", profile=quintic((0.1, 0.4), (1.2, -0.7)), node=11) as bench:
        nodes = discovered(bench)
        asked = questions(bench)
    assert [node.number for node in nodes] == [11, 12]
    assert {(node.is_drive, node.vendor, node.product, node.serial) for node in nodes} == {
        (True, 0x2E5, 0x4750_0001, 1)
    }
    assert nodes[0].mode_names == ("ip", "csp", "csv")
    assert {frame.data[0] for frame in asked} == {0x40}  # nothing but uploads


def test_a_device_that_is_no_drive_and_tells_little():
    with Bench() as bench:
        bench.drive.store(0x1000, 0, 0x0002_0191)
        del bench.drive.local.object_dictionary[0x1018]
        (node,) = discovered(bench)
    assert (node.number, node.is_drive, node.device, node.vendor, node.modes) == (
        1,
        False,
        0x0002_0191,
        None,
        None,
    )


@pytest.mark.parametrize("cob_id", [0x000, 0x080, 0x77F, 0x601])
def test_a_bus_with_a_controller_is_left_alone(cob_id):
    with Bench() as bench:
        bench.say(cob_id, bytes(2 if cob_id == 0 else 8))
        with pytest.raises(StreamAborted, match=f"{cob_id:03X}h: a controller is at work"):
            discovered(bench)
        assert questions(bench) == []


@pytest.mark.parametrize("early", [True, False])
def test_a_disturbed_bus_is_left_alone(early):
    """A wrong bit rate shows as error frames, at the latest when something is sent."""
    with Bench() as bench:
        error = can.Message(is_error_frame=True, arbitration_id=0x8)
        if early:
            bench.streamer_end.inbox.append(error)
        else:
            bench.streamer_end.sending = lambda message: bench.streamer_end.inbox.append(error) or True
        with pytest.raises(StreamAborted, match="error frames"):
            discovered(bench)
        assert len(questions(bench)) == (not early)


class TestOnAChannel:
    def listed(self, monkeypatch, *options):
        with Bench("cart", port=Port) as bench:
            monkeypatch.setattr(clock, "SystemClock", lambda: bench.clock)
            channel = bench.witness.channel_info.rpartition(" ")[2]
            return run_here("can", "list", "--interface", "virtual", "--channel", channel, *options)

    def test_in_json(self, monkeypatch):
        (node,) = self.listed(monkeypatch, "--json").document["nodes"]
        assert node == {
            "node": 1,
            "name": None,
            "drive": True,
            "device_type": 0x0002_0192,
            "vendor": 0x2E5,
            "product": 0x4750_0001,
            "serial": 1,
            "modes": ["ip", "csp", "csv"],
        }

    def test_in_words(self, monkeypatch):
        words = self.listed(monkeypatch).out.splitlines()
        assert words[-1] == (
            "  1: drive (ip, csp, csv), vendor 0x000002E5, product 0x47500001, serial 0x00000001"
        )

    def test_nobody(self, monkeypatch):
        monkeypatch.setattr(clock, "SystemClock", lambda: FakeClock(MS))
        outcome = run_here("can", "list", "--interface", "virtual", "--channel", "an empty one")
        assert outcome.code == 0
        assert outcome.out.splitlines()[-1].startswith("No node answers on virtual an empty one: check")
        asked = run_here("can", "list", "--interface", "virtual", "--channel", "an empty one", "--json")
        assert (asked.code, asked.document["nodes"]) == (0, [])
        assert run_here("can", "list", "--interface", "virtual", "--json").document["nodes"] is None

    def test_a_channel_without_its_interface(self):
        assert "name its interface" in error_of("can", "list", "--channel", "can0")

    def test_an_interface_that_python_can_does_not_know(self):
        assert "'socket-can'; did you mean 'socketcan'" in error_of(
            "can", "list", "--interface", "socket-can"
        )
