"""When launch times are used, on interfaces that keep them or do not; on a real queue: `test_vcan`."""

import struct
from types import SimpleNamespace

import can
import pytest

from gen_profile_exporters.can.host import launch
from gen_profile_exporters.can.host.port import Port


class Interface:
    """One interface, as its senders and listeners see it.

    Parameters
    ----------
    late : float or None
        How long after its launch time a frame is heard, in s; None: never.
    """

    channel = "can7"

    def __init__(self, late):
        self._late, self.now, self.instant, self.sent = late, 0, 0, []

    def monotonic_ns(self):
        return self.now

    def send_at(self, message, instant):
        self.sent.append(message.arbitration_id)
        self.instant = instant

    def recv(self, timeout):
        if self._late is None:
            return None
        self.now = max(self.now, self.instant + round(self._late * 1e9))
        return can.Message()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def refuse(*_):
    raise OSError("No buffer space available")


@pytest.mark.parametrize(
    ("late", "keeps"), [(0.0005, True), (-0.02, False), (None, False)], ids=["in time", "at once", "never"]
)
def test_whether_an_interface_keeps_them_is_tried(monkeypatch, late, keeps):
    interface = Interface(late)
    monkeypatch.setattr(launch, "SocketcanBus", lambda channel, can_filters: interface)
    monkeypatch.setattr(launch, "time", interface)
    assert launch.LaunchingBus.keeps_instants(interface) is keeps
    assert interface.sent == [0x780]  # which arms no drive's heartbeat watch, and stops no other stream


def test_an_interface_whose_queue_is_full(monkeypatch):
    interface = Interface(late=0.0)
    interface.send_at = refuse
    monkeypatch.setattr(launch, "SocketcanBus", lambda channel, can_filters: interface)
    assert not launch.LaunchingBus.keeps_instants(interface)


def test_what_is_said_of_them():
    port = Port(interface="socketcan", channel="can7")
    assert "launch times" in port.remarks(True)[0]
    assert "tc qdisc replace dev can7 root fq" in port.remarks(False)[0]
    assert Port(interface="pcan", channel="x").remarks(False) == ()


def test_a_frame_as_linux_takes_it():
    sent = []
    bus = SimpleNamespace(socket=SimpleNamespace(sendmsg=lambda *arguments: sent.append(arguments)))
    message = can.Message(arbitration_id=0x301, data=b"\x01\x02\x03\x04", is_extended_id=False)
    launch.LaunchingBus.send_at(bus, message, 123_456_789_012)
    ((data,), ((_, kind, instant),), _) = sent[0]
    assert struct.unpack("=IBBBB8s", data) == (0x301, 4, 0, 0, 0, b"\x01\x02\x03\x04\x00\x00\x00\x00")
    assert (kind, struct.unpack("=Q", instant)) == (61, (123_456_789_012,))
