"""What the commands that stream say of a plan and of what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gen_profile.delivery.streaming.outcome import Source, StreamOutcome
    from gen_profile_exporters.can.host.lateness import Lateness


def plan_words(plan: dict[str, Any], units: Sequence[str]) -> str:
    """Say what would be streamed, and what each drive would be set to."""
    axes = [
        f"  {axis['name']}: node {axis['node']}, {_way(axis, unit)}"
        for axis, unit in zip(plan["axes"], units, strict=True)
    ]
    objects = [
        f"  node {entry['node']}  {entry['object']} = {_value(entry)}  {entry['meaning']}"
        for entry in plan["startup"]
    ]
    many = "" if plan["cycles_planned"] is None else f"{plan['cycles_planned']} "
    head = f"{many}cycles of {1e3 * plan['period_s']:g} ms, bus load at most {plan['bus_load']:.0%}"
    return "\n".join([head, *axes, "Before anything moves, each drive is set to, and must hold:", *objects])


def _way(axis: dict[str, Any], unit: str) -> str:
    if axis["start_m"] is None:
        return "from where it stands"
    return f"from {axis['start_m']:g} to {axis['target_m']:g} {unit}"


def _value(entry: dict[str, Any]) -> str:
    """Write what is put together from bits in hexadecimal: COB-IDs, mappings and the like."""
    composed = entry["object"] < "6" and entry["value"] > 0xFFFF
    return f"{entry['value']:08X}h" if composed else str(entry["value"])


def lateness_words(late: Lateness) -> str:
    """Say how late cycles were."""
    half, most, all_ = (f"{late.percentile(percent):.0f} µs" for percent in (50, 99, 100))
    return f"half below {half}, 99 % below {most}, all below {all_}"


def outcome_words(outcome: StreamOutcome) -> str:
    """Say what became of a stream."""
    from gen_profile.dynamics.evaluation.phrases import mm, number

    document, late = outcome.to_dict(), outcome.record.lateness
    of_all = "" if document["cycles_planned"] is None else f" of {document['cycles_planned']}"
    lines = [f"{document['state']}: {document['cycles_sent']}{of_all} setpoints sent"]
    if document["cycles_sent"]:
        lines.append(f"lateness: {lateness_words(late)}; drift {number(1e6 * late.drift)} µs")
    lines += document["notes"]
    drive = document["drive"]
    if drive is not None:
        unit = " or ".join(f"m{unit}" for unit in dict.fromkeys(axis.unit for axis in outcome.source.axes))
        lines.append(
            f"axis: {number(1e3 * drive['position_error_m'])} {unit} off the target, at most "
            f"{number(1e3 * drive['following_error_max_m'])} {unit} off the plan on the way"
        )
        if drive["sway_residual_peak_m"] is not None:
            lines.append(f"residual sway of the simulated load: {mm(drive['sway_residual_peak_m'])}")
    return "\n".join(lines)


def at_start(source: Source) -> tuple[dict[str, Any], str]:
    """Say that nothing had to be moved."""
    tolerance = source.spec.can.start_tolerance
    words = (
        f"The axes stand at the start already, within can.start_tolerance ({tolerance:g}); nothing was moved."
    )
    return {"state": "at start", "reason": ""}, words
