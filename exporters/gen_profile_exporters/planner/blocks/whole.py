"""The whole planner block: the shell, and before it the blocks that it has within it."""

import re
from collections.abc import Mapping

from gen_profile_exporters.planner.axis_declarations import ZONES, AxisConstants
from gen_profile_exporters.planner.blocks import followed
from gen_profile_exporters.planner.blocks.measured import observer
from gen_profile_exporters.planner.blocks.sizes import Sizes, operations, shell_work
from gen_profile_exporters.planner.blocks.texts import (
    FOLDER,
    constant_lines,
    filled,
    known_for,
    planner,
)
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.planner.interface import (
    HOLD,
    WHERE,
    gives_up,
    interface,
    may_stop_promptly,
    reaction,
)
from gen_profile_exporters.planner.layout import narrow, with_while_loops
from gen_profile_exporters.playback.structured_text import block_name

STILL = 1e-3  # of full speed: a velocity that counts as standing, and a way as none
ROUNDING = 1e-3  # of a live parameter's greatest rate
BRAKE_WORK = 350  # operations of a cycle in which an axis has to brake in time
EACH = re.compile(r"(?ms)^ *@each_axis\n(.*?)^ *@end_axis\n")


def whole_block(constants: PlannerConstants) -> str:
    """Write the planner block with all blocks that it has within it; the last one is its own."""
    follows = constants.rates or constants.sensor
    within = followed.motion(constants) if follows else planner(constants, Sizes())
    if constants.sensor:
        within += "\n" + observer(constants, constants.sensor)
    motion = _renamed(within, constants.name, block_name(constants.name))
    return around(motion, constants)


def around(motion: str, constants: PlannerConstants) -> str:
    """Write the shell around a motion, `FB_NAME_motion` with the inputs and outputs of `planner.st`."""
    own = block_name(constants.name)
    names = {part: f"{own}_{part}" for part in ("motion", "observer", "quick_stop", "zones", "event_log")}
    parts = [motion]
    lasts = {"zone": ZONES, "live": max(1, len(constants.live)), "mode": constants.modes}
    lasts["axis"] = len(constants.axes)
    values = names | {f"last_{array}": str(length - 1) for array, length in lasts.items()}
    taken = {"quick_stop": True, "zones": constants.zones, "event_log": constants.events}
    parts += [filled(part, **values) for part, is_taken in taken.items() if is_taken]
    return narrow(with_while_loops("\n".join([*parts, _shell(constants, values)])))


def _renamed(text: str, name: str, own: str) -> str:
    """Begin the names of the blocks of a motion as the own block's name, as vendors' formats ask."""
    before = name.replace("-", "_")
    text = re.sub(rf"\b{before}_planner\b", f"{own}_motion", text)
    return re.sub(rf"\b{before}_(?=[a-z])", f"{own}_", text)


def _shell(c: PlannerConstants, values: Mapping[str, str]) -> str:
    stated = {"zones": c.zones, "events": c.events, "followed": bool(c.rates), "stays": not c.rates}
    stated |= {"measured": c.sensor is not None, "several": len(c.axes) > 1}
    stated["prompt"] = may_stop_promptly(c)
    body = (FOLDER / "shell.st").read_text("ascii")
    words = c.sensor.words if c.sensor else {}

    def of_axes(part: re.Match[str]) -> str:
        kinds = [("sensed" if n in words else "unsensed") if words else "" for n in range(len(c.axes))]
        return "".join(_of_axis(part[1], n, a, kinds[n]) for n, a in enumerate(c.axes))

    body = WHERE.sub(lambda part: part[2] if stated[part[1]] else "", EACH.sub(of_axes, body))
    given = {
        **values,
        # where a sensor is, it stands to damp
        "goes_on": "(nState = cMoving) OR (nState = cStanding)" if c.sensor else "nState = cMoving",
        "prompt": "bPrompt := bPromptStop," if may_stop_promptly(c) else "",
        "operations": "nShare" if len(c.axes) > 1 else "nWork",
        "together": "nTogether := nTogether, bHeld := bHeld, " if len(c.axes) > 1 else "",
        "first_suffix": c.axes[0].suffix,
        "take_live": "\n".join(f"aLiveGiven[{k}] := f{name};" for k, name in enumerate(c.live)),
        "shell_constants": constant_lines(_constants(c)),
    }
    return interface(c) + re.sub(r"@([a-z_]+)", lambda hole: given[hole[1]], body)


def _of_axis(text: str, number: int, axis: AxisConstants, sensed: str) -> str:
    def taken(part: re.Match[str]) -> str:
        return part[2] if part[1] == sensed else "" if part[1] in ("sensed", "unsensed") else part[0]

    text = WHERE.sub(taken, text)
    return text.replace("@axis_number", str(number)).replace("#", axis.suffix)


def _constants(c: PlannerConstants) -> dict[str, object]:
    lives = c.live or {"": (0.0, 1.0)}
    common: dict[str, object] = {
        "cAxes": len(c.axes),
        "cLives": len(c.live),
        "cCycle": c.cycle,
        "cOperations": operations(c),
        "cShellWork": shell_work(c),
        "cBrakeWork": BRAKE_WORK,
        "cHoldCycles": round(HOLD / c.cycle),
        "cReaction": reaction(c),
        "cGivesUp": gives_up(c),
        "cSwayLimit": c.sway_limit,
        "cMargin": c.axes[0].targets[0] - c.axes[0].travel[0],
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveDrift": list(c.drift) or [0.0],
    }
    if c.sensor:
        common |= {
            "cStatedError": c.stated_error,
            "cSettled": c.sensor.again,
            "cRoused": c.sensor.roused,
            "cKnown": c.sensor.end,
        }
    if not c.rates:
        common["cKnownFor"] = known_for(c)
    if c.rates:
        common["cLiveStep"] = [(1.0 + ROUNDING) * c.rates.get(name, 0.0) * c.cycle for name in c.live]
    for axis in c.axes:
        own = {
            "cVelocity": axis.velocity,
            "cAcceleration": axis.acceleration,
            "cJerk": axis.jerk,
            "cQuickDeceleration": axis.quick_deceleration,
            "cQuickJerk": axis.quick_jerk,
            "cStill": STILL * axis.velocity,
            "cTravelLow": axis.travel[0],
            "cTravelHigh": axis.travel[1],
            "cTargetLow": axis.targets[0],
            "cTargetHigh": axis.targets[1],
            # in which an axis comes to rest from a limit: a period, and by its acceleration
            "cApproach": max(c.periods) + axis.velocity / axis.acceleration,
        }
        common |= {f"{name}{axis.suffix}": value for name, value in own.items()}
    return common
