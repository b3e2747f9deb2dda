"""The command that shows what can be reached by CAN."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import attrs

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import option
from gen_profile.cli.outcome import print_outcome
from gen_profile.support.errors import SpecError

if TYPE_CHECKING:
    from gen_profile_exporters.can.host.detection import Channel
    from gen_profile_exporters.can.host.port import Port
    from gen_profile_exporters.can.streaming.discovery import IdentifiedNode


@cli.group(epilog="Example: gen-profile can list")
def can() -> None:
    """Look at CAN buses."""


@can.command("list", epilog="Example: gen-profile can list --interface socketcan --channel can0")
@option("--interface NAME", "List only this interface, such as socketcan; all by default.")
@option("--channel NAME", "Ask which nodes are on this channel of the interface.")
@options.bitrate("channel")
@options.output
def list_(interface: str | None, channel: str | None, bitrate: int) -> None:
    """List CAN interfaces, their channels, and the nodes that answer.

    No bus is touched unless a channel is named. There, every node id is asked what it is, if no controller is
    heard; nothing is written to anyone.
    """
    from gen_profile_exporters.can.host import detection
    from gen_profile_exporters.can.host.port import Port

    if channel is not None and interface is None:
        raise SpecError(f"--channel {channel}: name its interface, too, as --interface socketcan.")
    if interface is not None:
        detection.require_known(interface)
    names = detection.hardware() if interface is None else [interface]
    nodes = None
    if interface is not None and channel is not None:
        nodes = _nodes(Port(interface=interface, channel=channel), bitrate)
    by_interface = {name: detection.channels(name) for name in names}
    interfaces = [
        {"name": name, "channels": list(map(attrs.asdict, channels)), "needs": detection.needs(name)}
        for name, channels in by_interface.items()
    ]
    document = {"interfaces": interfaces, "nodes": None if nodes is None else list(map(_told, nodes))}
    lines = list(_interface_words(by_interface))
    if nodes is not None:
        lines += _node_words(nodes, f"{interface} {channel}")
    print_outcome(document, "\n".join(lines))


def _nodes(port: Port, bitrate: int) -> tuple[IdentifiedNode, ...]:
    from gen_profile.support.plugins import require_installed

    require_installed("Streaming needs canopen", "can", "canopen")

    from gen_profile_exporters.can.host.clock import SystemClock
    from gen_profile_exporters.can.host.link import Link
    from gen_profile_exporters.can.streaming.discovery import discover

    with port.open(bitrate) as bus:
        return discover(Link(bus, SystemClock()))


def _told(node: IdentifiedNode) -> dict[str, Any]:
    return {
        "node": node.number,
        "name": node.name,
        "drive": node.is_drive,
        "device_type": node.device,
        "vendor": node.vendor,
        "product": node.product,
        "serial": node.serial,
        "modes": list(node.mode_names),
    }


def _interface_words(by_interface: dict[str, tuple[Channel, ...]]) -> Iterator[str]:
    from gen_profile_exporters.can.host import detection

    for name, channels in by_interface.items():
        for channel in channels:
            rate = "" if channel.bitrate is None else f"{channel.bitrate / 1000:g} kbit/s"
            yield ", ".join(filter(None, [f"{name} {channel.name}", rate, channel.state]))
    without = [name for name, channels in by_interface.items() if not channels]
    if without:
        yield "Without a channel:"
    for name in without:
        yield f"  {name}: {detection.needs(name)}"


def _node_words(nodes: tuple[IdentifiedNode, ...], where: str) -> Iterator[str]:
    if not nodes:
        yield f"No node answers on {where}: check power, cabling, termination, bit rate and node ids."
        return
    yield f"Nodes on {where}:"
    for node in nodes:
        numbers = {"vendor": node.vendor, "product": node.product, "serial": node.serial}
        stated = [f"{what} 0x{number:08X}" for what, number in numbers.items() if number is not None]
        modes = ", ".join(node.mode_names) or "no mode to stream in"
        kind = f"drive ({modes})" if node.is_drive else "no drive"
        yield f"  {node.number}: " + ", ".join([*filter(None, [node.name]), kind, *stated])
