"""CAN interfaces by name."""

from __future__ import annotations

import sys
from contextlib import suppress

import attrs
import can

from gen_profile.errors import SpecError
from gen_profile.suggestion import suggestion

SERIAL = "install pyserial: pip install 'python-can[serial]'"
NEEDS = {  # what python-can's interfaces take, beside their hardware
    "socketcan": "bring it up as Linux knows it: ip link set {channel} up type can bitrate 500000 "
    "(to try things out: ip link add dev vcan0 type vcan, ip link set vcan0 up)",
    "pcan": "install PEAK's PCAN-Basic library (channels are called PCAN_USBBUS1, …)",
    "kvaser": "install Kvaser's CANlib (channels are 0, 1, …)",
    "vector": "install Vector's XL Driver Library, on Windows (channels are 0, 1, …)",
    "ixxat": "install HMS Ixxat's VCI driver, on Windows (channels are 0, 1, …)",
    "slcan": SERIAL,
    "serial": SERIAL,
    "seeedstudio": SERIAL,
    "robotell": SERIAL,
    "gs_usb": "install its library: pip install 'python-can[gs-usb]'",
}


@attrs.frozen(kw_only=True)
class Port:
    """A CAN interface as python-can names it, and its channel."""

    interface: str
    channel: str

    def open(self, bitrate: int) -> can.BusABC:
        """Open it; what may send at given instants (Linux) can be asked to do so.

        Raises
        ------
        SpecError
            There is none of that name, or it cannot be opened.
        """
        try:
            if self.interface == "udp_multicast":
                from gen_profile_exporters.can.host.multicast import MulticastBus  # noqa: PLC0415

                return MulticastBus(self.channel)
            if sys.platform == "linux" and self.interface == "socketcan":
                from gen_profile_exporters.can.host.launch import LaunchingBus  # noqa: PLC0415

                return LaunchingBus(self.channel)
            return can.Bus(channel=self.channel, interface=self.interface, bitrate=bitrate)
        # python-can's kvaser raises a NameError where its library is missing
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError, NameError) as error:
            raise SpecError(
                f"--interface {self.interface} --channel {self.channel}: cannot be opened "
                f"({str(error).rstrip('.')}); {self._cure()}."
            ) from error

    def _cure(self) -> str:
        """Say what to install or set up, and which channels are there."""
        if self.interface not in can.VALID_INTERFACES:
            return f"unknown to python-can{suggestion(self.interface, sorted(can.VALID_INTERFACES))}".rstrip(
                "."
            )
        channels = self._channels()
        there = f"channels found: {', '.join(channels)}" if channels else "no channel was found"
        needs = NEEDS.get(self.interface, "see python-can's documentation for what it needs")
        return f"{needs.format(channel=self.channel)}; {there}"

    def _channels(self) -> list[str]:
        """Ask python-can which channels of the interface there are; its drivers fail in ways of their own."""
        with suppress(Exception):
            return [str(found["channel"]) for found in can.detect_available_configs(self.interface)]
        return []

    def remarks(self, launched: bool) -> tuple[str, ...]:
        """Say what there is to say about who sends each cycle at its instant."""
        if launched:
            return ("The kernel sent every cycle at its instant (launch times).",)
        if self.interface != "socketcan":
            return ()
        return (
            f"Frames left when this program woke up; `tc qdisc replace dev {self.channel} root fq` would "
            "have the kernel send each at its instant.",
        )
