"""CAN interfaces by name."""

import sys
from collections.abc import Sequence

import attrs
import can

from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import suggestion
from gen_profile_exporters.can.host import detection


@attrs.frozen(kw_only=True)
class Port:
    """A CAN interface as python-can names it, and its channel; none where a spec states every axis's."""

    interface: str
    channel: str = ""

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
                f"interface {self.interface}, channel {self.channel}: cannot be opened "
                f"({str(error).rstrip('.')}){self._cure()}"
            ) from error

    def _cure(self) -> str:
        """End a sentence by what to install or set up, and which channels are there."""
        if self.interface not in can.VALID_INTERFACES:
            return suggestion(self.interface, sorted(can.VALID_INTERFACES))
        channels = [channel.name for channel in detection.channels(self.interface)]
        there = f"channels found: {', '.join(channels)}" if channels else "no channel was found"
        return f"; {detection.needs(self.interface, self.channel)}; {there}."

    def remarks(self, launched: bool, channels: Sequence[str] = ()) -> tuple[str, ...]:
        """Say what there is to say about who sends each cycle at its instant."""
        if launched:
            return ("The kernel sent every cycle at its instant (launch times).",)
        if self.interface != "socketcan":
            return ()
        commands = [f"`tc qdisc replace dev {channel} root fq`" for channel in channels or (self.channel,)]
        return (
            f"Frames left when this program woke up; {' and '.join(commands)} would have the kernel send "
            "each at its instant.",
        )
