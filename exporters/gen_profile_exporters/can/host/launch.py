"""Launch times: the kernel sends each frame at its instant, however late this program wakes up (Linux).

It takes a queue that keeps instants (``tc qdisc replace dev can0 root fq``) and a kernel whose CAN sockets
pass them on (SO_TXTIME, see tc-fq(8)). Whether both are there is found by trying.
"""

import socket
import struct
import sys
import time
from contextlib import suppress

import can
from can.interfaces.socketcan import SocketcanBus

from gen_profile_exporters.can.frames import message
from gen_profile_exporters.can.host.clock import NANOSECONDS

assert sys.platform == "linux"  # for the type checker, too
SO_TXTIME = SCM_TXTIME = 61  # asm-generic/socket.h
TRIAL = NANOSECONDS // 50  # how far ahead the frame of the trial is sent
_TRIAL = message(0x780)  # reserved by CiA 301: no device takes it, it commands nothing and arms no time-out
_FRAME = struct.Struct("=IB3x8s")  # struct can_frame of linux/can.h


class LaunchingBus(SocketcanBus):
    """A SocketCAN interface that is also given the instant at which to send.

    Parameters
    ----------
    channel : str
        Name of the interface.
    """

    def __init__(self, channel: str) -> None:
        super().__init__(channel)
        with suppress(OSError):  # a kernel without them shows when they are tried
            self.socket.setsockopt(socket.SOL_SOCKET, SO_TXTIME, struct.pack("=iI", time.CLOCK_MONOTONIC, 0))

    def keeps_instants(self) -> bool:
        """Have a frame sent later, and listen on the same interface when that is."""
        only_ours = [can.typechecking.CanFilter(can_id=_TRIAL.arbitration_id, can_mask=0x7FF)]
        with SocketcanBus(self.channel, can_filters=only_ours) as witness:
            instant = time.monotonic_ns() + TRIAL
            try:
                self.send_at(_TRIAL, instant)
            except OSError:
                return False
            heard = witness.recv(3 * TRIAL / NANOSECONDS)
            return heard is not None and time.monotonic_ns() >= instant

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
