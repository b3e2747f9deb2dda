"""Header, inputs and outputs of a planner block, and what they state of it."""

import re
from pathlib import Path

from gen_profile_exporters.planner.axis_declarations import ZONES, axis_interface, axis_words
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.planner.sensor_constants import values as of_sensor
from gen_profile_exporters.playback.structured_text import block_name, literal

HOLD = 0.2  # s, in which an input that is out of range is held
SLOTS_PER_PERIOD = 20.0  # of the slowest mode
REACTION = 4.0  # slots, in which a new command is obeyed, also from rest
GIVES_UP = 4.0  # slow periods in which no motion is found for a command
WHERE = re.compile(r"(?ms)^ *@where_(\w+)\n(.*?)^ *@end\n")
TEXT = Path(__file__).parent / "blocks/interface.st"


def interface(constants: PlannerConstants) -> str:
    """Write a block's header, and declare its inputs and outputs."""
    parts = {
        "followed": bool(constants.rates),
        "zones": constants.zones,
        "events": constants.events,
        "stays": not constants.rates,
        "measured": constants.sensor is not None,
        "prompt": may_stop_promptly(constants),
    }
    text = WHERE.sub(lambda some: some[2] if parts[some[1]] else "", TEXT.read_text("ascii"))
    values = _values(constants)
    return re.sub(r"@([a-z_]+)", lambda hole: values[hole[1]], text)


def may_stop_promptly(constants: PlannerConstants) -> bool:
    """Whether stops may be prompt: not where a machine is followed, whose promise would not hold."""
    return not (constants.rates or constants.sensor)


def reaction(constants: PlannerConstants) -> float:
    """Bound the time in s until a new command changes the motion."""
    return REACTION * max(constants.periods) / SLOTS_PER_PERIOD + 2.0 * constants.cycle


def gives_up(constants: PlannerConstants) -> float:
    """Give the time in s in which a command is given up that no motion obeys."""
    return GIVES_UP * max(constants.periods)


def _values(c: PlannerConstants) -> dict[str, str]:
    known = list(zip(c.live.items(), c.units, c.nominal, strict=True))
    ranges = [
        f"f{name}: live parameter {name}, {low:g} to {high:g} {unit}".rstrip()
        + (f", on the way at most {c.rates[name]:g} {unit}/s" if name in c.rates else "")
        for (name, (low, high)), unit, _ in known
    ]
    inputs = [
        f"    f{name} : LREAL := {literal(value)}; (* {unit or 1}, {low:g} to {high:g} *)"
        for (name, (low, high)), unit, value in known
    ]
    return {
        "name": c.name,
        "block": f"{block_name(c.name)}_planner",
        "machine": c.machine,
        "cycle_time": literal(c.cycle),
        "cycle": f"{c.cycle:g}",
        "live_rates": " faster than stated" if c.rates else "",
        "hold": f"{HOLD:g}",
        "prompt_default": " := TRUE" if c.prompt else "",
        "reaction": f"{reaction(c):.3g}",
        "gives_up": f"{gives_up(c):.3g}",
        "live_lines": "\n    ".join(ranges) or "No live parameters.",
        "live_inputs": "\n".join(inputs),
        "last_zone": str(ZONES - 1),
        **axis_words(c.axes),
        **axis_interface(c.axes),
        **of_sensor(c.sensor, [axis.suffix for axis in c.axes]),
    }
