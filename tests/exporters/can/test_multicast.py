"""The bus over UDP multicast, with the network replaced by a list: nothing may leave this machine."""

import can
import pytest
from can.interfaces.udp_multicast import UdpMulticastBus

from gen_profile_exporters.can.host.multicast import MulticastBus


@pytest.fixture
def bus(monkeypatch):
    heard = []
    monkeypatch.setattr(UdpMulticastBus, "__init__", lambda self, channel, fd: None)
    monkeypatch.setattr(UdpMulticastBus, "send", lambda self, message, timeout=None: heard.append(message))
    monkeypatch.setattr(
        UdpMulticastBus, "_recv_internal", lambda self, timeout: (heard.pop(0) if heard else None, False)
    )
    monkeypatch.setattr(UdpMulticastBus, "shutdown", lambda self: None)
    found = MulticastBus("239.74.163.2")
    found.heard = heard
    return found


def frame(cob_id, data=b""):
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def receive(bus):
    message, _ = bus._recv_internal(0.0)
    return message and (message.arbitration_id, bytes(message.data))


def test_it_does_not_hear_itself(bus):
    bus.send(frame(0x301, b"\x01"))
    bus.send(frame(0x080))
    bus.heard.append(frame(0x181, b"\x37"))
    assert receive(bus) == (0x181, b"\x37")
    assert receive(bus) is None


def test_somebody_elses_same_frame_is_heard(bus):
    bus.send(frame(0x080))
    bus.heard.append(frame(0x080))
    assert receive(bus) == (0x080, b"")
    assert receive(bus) is None
