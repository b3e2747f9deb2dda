"""When launch times are used, on interfaces that keep them or do not; on a real queue: `test_vcan`."""

import struct
import time
from types import SimpleNamespace

import can
import pytest

from gen_profile.workflows.stream import Port
from gen_profile_exporters.can import launch


class Interface:
    """One interface, as whoever sends on it and whoever listens see it.

    Parameters
    ----------
    late : float or None
        How long after its launch time a frame is heard, in s; None: never.
    """

    def __init__(self, late):
        self._late, self.instant, self.closed = late, 0, 0

    def send_at(self, message, instant):
        assert message.arbitration_id == 0x77F
        self.instant = instant

    def recv(self, timeout):
        if self._late is None:
            return None
        time.sleep(max(0.0, self.instant / 1e9 + self._late - time.monotonic()))
        return can.Message()

    def shutdown(self):
        self.closed += 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def refuse(*_):
    raise OSError("No buffer space available")


def opened(monkeypatch, interface):
    """Open a bus for streaming on an interface; return it, and what is said about it."""
    monkeypatch.setattr(launch, "LaunchingBus", lambda channel: interface)
    monkeypatch.setattr(launch, "SocketcanBus", lambda channel, can_filters: interface)
    monkeypatch.setattr(can, "Bus", lambda **_: "usual bus")
    return Port(interface="socketcan", channel="can7").open_for_streaming(500_000)


def test_an_interface_that_keeps_them(monkeypatch):
    interface = Interface(late=0.0005)
    bus, (said,) = opened(monkeypatch, interface)
    assert (bus, interface.closed) == (interface, 0)
    assert "launch times" in said


@pytest.mark.parametrize("late", [-0.02, None], ids=["at once", "never"])
def test_an_interface_that_keeps_none(monkeypatch, late):
    interface = Interface(late)
    bus, (said,) = opened(monkeypatch, interface)
    assert (bus, interface.closed) == ("usual bus", 1)
    assert "tc qdisc replace dev can7 root fq" in said


def test_an_interface_whose_queue_is_full(monkeypatch):
    interface = Interface(late=0.0)
    interface.send_at = refuse
    assert opened(monkeypatch, interface)[0] == "usual bus"


def test_there_is_none_of_that_name():
    assert launch.launching_bus("no-such-bus") is None


def test_a_frame_as_linux_takes_it():
    sent = []
    bus = SimpleNamespace(socket=SimpleNamespace(sendmsg=lambda *arguments: sent.append(arguments)))
    message = can.Message(arbitration_id=0x301, data=b"\x01\x02\x03\x04", is_extended_id=False)
    launch.LaunchingBus.send_at(bus, message, 123_456_789_012)
    ((data,), ((_, kind, instant),), _) = sent[0]
    assert struct.unpack("=IBBBB8s", data) == (0x301, 4, 0, 0, 0, b"\x01\x02\x03\x04\x00\x00\x00\x00")
    assert (kind, struct.unpack("=Q", instant)) == (61, (123_456_789_012,))
