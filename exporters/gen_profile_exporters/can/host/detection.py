"""Which CAN channels this computer has, and what each interface needs; no bus is touched for it."""

import json
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Any

import attrs
import can

from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import suggestion

# what is no hardware of this computer: who looks for its channels has to ask the network, or finds any number
NOT_HARDWARE = {"virtual", "udp_multicast", "socketcand"}

_LINES = Path(__file__).with_name("interfaces.txt").read_text("utf-8").splitlines()
# what python-can's interfaces take, beside their hardware
NEEDS = {name: words for name, _, words in (line.partition(": ") for line in _LINES)}
UNKNOWN_NEEDS = "see python-can's documentation for what it needs"


@attrs.frozen(kw_only=True)
class Channel:
    """One channel of an interface.

    Attributes
    ----------
    name : str
        As python-can takes it.
    bitrate : int or None
        bit/s, where the system knows it.
    state : str
        In the system's words, such as ``"DOWN"`` or ``"ERROR-ACTIVE"``; empty where it has none.
    """

    name: str
    bitrate: int | None = None
    state: str = ""


def hardware() -> list[str]:
    """List the interfaces that python-can knows for hardware of this computer."""
    return sorted(can.VALID_INTERFACES - NOT_HARDWARE)


def require_known(interface: str) -> None:
    """Refuse, by a `SpecError`, an interface that python-can does not know."""
    if interface not in can.VALID_INTERFACES:
        known = sorted(can.VALID_INTERFACES)
        raise SpecError(f"interface: unknown interface {interface!r}{suggestion(interface, known)}")


def needs(interface: str, channel: str = "can0") -> str:
    """Say what to install or set up for an interface."""
    return NEEDS.get(interface, UNKNOWN_NEEDS).format(channel=channel)


def channels(interface: str) -> tuple[Channel, ...]:
    """List the channels that there are; on Linux also those that are down."""
    if interface == "socketcan":
        return _of_linux()
    with suppress(Exception):  # drivers fail in ways of their own
        return tuple(
            Channel(name=str(configuration["channel"]))
            for configuration in can.detect_available_configs(interface)
        )
    return ()


def _of_linux() -> tuple[Channel, ...]:
    program = shutil.which("ip") or shutil.which("ip", path="/usr/sbin:/sbin")
    if program is None:
        return ()
    listing = subprocess.run([program, "-details", "-json", "link", "show"], capture_output=True, check=False)
    try:
        links = json.loads(listing.stdout)
    except ValueError:  # an ip that knows no JSON
        return ()
    return tuple(_channel(link) for link in links if link.get("link_type") == "can")


def _channel(link: dict[str, Any]) -> Channel:
    about = link.get("linkinfo", {}).get("info_data", {})
    up = "UP" in link.get("flags", ())
    return Channel(
        name=link["ifname"],
        bitrate=about.get("bittiming", {}).get("bitrate"),
        state=about.get("state", "UP") if up else "DOWN",
    )
