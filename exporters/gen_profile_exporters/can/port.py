"""CAN interfaces by name."""

from __future__ import annotations

import sys

import attrs
import can

from gen_profile.errors import SpecError


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
                from gen_profile_exporters.can.multicast import MulticastBus  # noqa: PLC0415

                return MulticastBus(self.channel)
            if sys.platform == "linux" and self.interface == "socketcan":
                from gen_profile_exporters.can.launch import LaunchingBus  # noqa: PLC0415

                return LaunchingBus(self.channel)
            return can.Bus(channel=self.channel, interface=self.interface, bitrate=bitrate)
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise SpecError(
                f"--interface {self.interface} --channel {self.channel}: cannot be opened ({error}); see "
                "python-can's documentation for its interfaces."
            ) from error

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
