"""The table `[can]` of a spec: what it states by axis, and what belongs together."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gen_profile.plants.plant import Plant
from gen_profile.spec.structure import Faults, Table, found, place
from gen_profile.suggestion import suggestion

# tables of [can] by axis, with an example of each
BY_AXIS = {
    "travel": "cart = [0.0, 0.5]",
    "nodes": "bridge = 5, trolley = 9",
    "channels": 'bridge = "can0", trolley = "can1"',
    "cob_ids": "cart = { setpoint = 0x321 }",
    "serial": "cart = 0x12345678",
}
CHANNEL = re.compile(r"[!-~]{1,60}")
CHANNEL = re.compile(r"[!-~]{1,60}")  # candump separates its name from the rest by a space


def can_table(table: Table, plant: Plant | None, faults: Faults) -> Table:
    """Hold `[can]` to the machine's axes, and what it states to what that needs."""
    names = [axis.name for axis in plant.actuated] if plant else None
    if names and len(names) == 1 and isinstance(table.get("serial"), int):
        table = {**table, "serial": {names[0]: table["serial"]}}
    for key, example in BY_AXIS.items():
        table = _by_axis(table, key, example, names, faults)
    _nodes(table["nodes"], names, faults)
    _channels(table["channels"], names, faults)
    ahead = table.get("feed_forward", "none")
    if ahead in ("torque", "both") and "torque_per_acceleration" not in table:
        faults.add(
            "can.torque_per_acceleration",
            f'required with feed_forward = "{ahead}" (‰ of the rated torque per m/s²)',
        )
    if table.get("mode") in ("ip", "csv") and ahead != "none":
        faults.add("can.feed_forward", 'only with mode = "csp"; remove it or set the mode')
    if table.get("mode") == "csv" and "following_error" not in table:
        faults.add(
            "can.following_error", 'required with mode = "csv": how far the axis may be off the motion, in m'
        )
    return table


def _by_axis(table: Table, key: str, example: str, names: Sequence[str] | None, faults: Faults) -> Table:
    """Hold a table of `[can]` to the machine's axes; without a fault of its own where it is none."""
    by_axis = table.get(key, {})
    if not isinstance(by_axis, Mapping):
        faults.add(f"can.{key}", f"must be a table such as {{ {example} }}, found {found(by_axis)}")
        by_axis = {}
    for axis in by_axis:
        if names and axis not in names:
            faults.add(place(f"can.{key}", axis), f"unknown axis{suggestion(axis, names)}")
    return {**table, key: by_axis}


def _channels(channels: Mapping[str, Any], names: Sequence[str] | None, faults: Faults) -> None:
    """Have every axis's channel stated, or none."""
    for axis, channel in channels.items():
        if isinstance(channel, str) and not CHANNEL.fullmatch(channel):
            faults.add(
                place("can.channels", axis),
                f"must be the name of a channel, such as 'can0', found {found(channel)}",
            )
    _require_all("can.channels", channels, names, "channels", faults)


def _require_all(
    where: str, stated: Mapping[str, Any], names: Sequence[str] | None, what: str, faults: Faults
) -> None:
    """Have a table state something of every axis, or of none."""
    known = set(names or ()) >= stated.keys()
    for axis in names or ():
        if stated and known and axis not in stated:
            faults.add(place(where, axis), f"required beside the other axes' {what}")


def _nodes(nodes: Mapping[str, Any], names: Sequence[str] | None, faults: Faults) -> None:
    """Have every axis a node of its own, or none of them."""
    taken: dict[Any, str] = {}
    for axis, node in nodes.items():
        if isinstance(node, int) and taken.setdefault(node, axis) != axis:
            faults.add(place("can.nodes", axis), f"{node} is the node of the axis {taken[node]} already")
    _require_all("can.nodes", nodes, names, "nodes", faults)
