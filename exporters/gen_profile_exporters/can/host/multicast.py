"""A bus between processes without any CAN hardware: python-can's UDP multicast, made deaf to itself.

python-can's own hears everything it sends. On a CAN bus no node does, and a frame of ours that we hear is
another master's that commands our drives.
"""

from collections import Counter

import can
from can.interfaces.udp_multicast import UdpMulticastBus


class MulticastBus(UdpMulticastBus):
    """As python-can's, but each frame sent is passed over once when it is heard."""

    def __init__(self, channel: str) -> None:
        self._echoes: Counter[tuple[int, bytes]] = Counter()
        super().__init__(channel, fd=False)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame, and expect to hear it."""
        self._echoes[_content(msg)] += 1
        super().send(msg, timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        while True:
            message, filtered = super()._recv_internal(timeout)
            if message is None or not self._echoes[_content(message)]:
                return message, filtered
            self._echoes[_content(message)] -= 1


def _content(message: can.Message) -> tuple[int, bytes]:
    return message.arbitration_id, bytes(message.data)
