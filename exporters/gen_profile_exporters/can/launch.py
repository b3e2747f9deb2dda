"""Launch times: the kernel sends each frame at its instant, however late this program wakes up (Linux).

It takes a queue that keeps instants (``tc qdisc replace dev can0 root fq``) and a kernel whose CAN sockets
pass them on (SO_TXTIME, see tc-fq(8)). Whether both are there is found by trying.
"""

from __future__ import annotations

import socket
import struct
import sys
import time

import can
from can.interfaces.socketcan import SocketcanBus

from gen_profile_exporters.can import frames
from gen_profile_exporters.can.clock import NANOSECONDS

assert sys.platform == "linux"  # for the type checker, too
SO_TXTIME = SCM_TXTIME = 61  # asm-generic/socket.h
TRIAL = NANOSECONDS // 50  # how far ahead the frame of the trial is sent
_HEARTBEAT = can.Message(arbitration_id=frames.HEARTBEAT + frames.MASTER, data=b"\x05", is_extended_id=False)
_FRAME = struct.Struct("=IB3x8s")  # struct can_frame of linux/can.h


class LaunchingBus(SocketcanBus):
    """A SocketCAN interface that is also told when to send.

    Parameters
    ----------
    channel : str
        Name of the interface.
    """

    def __init__(self, channel: str) -> None:
        super().__init__(channel)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TXTIME, struct.pack("=iI", time.CLOCK_MONOTONIC, 0))

    def send_at(self, message: can.Message, instant: int) -> None:
        """Hand a frame to the kernel, to be sent at an instant of the monotonic clock, in ns.

        Raises
        ------
        OSError
            The queue is full or the interface down.
        """
        data = _FRAME.pack(message.arbitration_id, message.dlc, bytes(message.data))
        launch = (socket.SOL_SOCKET, SCM_TXTIME, struct.pack("=Q", instant))
        self.socket.sendmsg([data], [launch], socket.MSG_DONTWAIT)


def launching_bus(channel: str) -> LaunchingBus | None:
    """Open an interface for launch times; None where one early heartbeat shows that it keeps none."""
    try:
        bus = LaunchingBus(channel)
    except OSError:  # no such option, or no such interface: for the usual way to find out
        return None
    only_ours = [can.typechecking.CanFilter(can_id=_HEARTBEAT.arbitration_id, can_mask=0x7FF)]
    with SocketcanBus(channel, can_filters=only_ours) as witness:
        if _keeps_instants(bus, witness):
            return bus
    bus.shutdown()
    return None


def _keeps_instants(bus: LaunchingBus, witness: can.BusABC) -> bool:
    """Have a heartbeat of ours sent later, and listen on the same interface when that is."""
    instant = time.monotonic_ns() + TRIAL
    try:
        bus.send_at(_HEARTBEAT, instant)
    except OSError:
        return False
    heard = witness.recv(3 * TRIAL / NANOSECONDS)
    return heard is not None and time.monotonic_ns() >= instant
