"""What a planner block declares of its axes, and tells of them in its header."""

from collections.abc import Sequence

import attrs

from gen_profile_exporters.playback.structured_text import literal

ZONES = 8  # intervals of each kind that an axis may have
PLACE = "fActPosition"
# inputs and outputs of each axis
TAKEN = ("fTarget", "fVelocityCommand", "fVelocityLimit", PLACE, "fActVelocity", "fFollowingLimit")
GIVEN = ("fPosition", "fVelocity", "fAcceleration", "fDistanceToGo", "fStopDistance", "fStopLow", "fStopHigh")
ZONE_INPUTS = {  # of each axis, and what is declared of them
    "aBlockedLow": ", where blocked intervals begin",
    "aBlockedHigh": ", where they end",
    "aSlowLow": ", where slow intervals begin",
    "aSlowHigh": ", where they end",
    "aSlowLimit": "/s, greatest velocity there",
}


@attrs.frozen(kw_only=True)
class AxisConstants:
    """What the block needs to know of an axis, in its unit and s.

    Attributes
    ----------
    name : str
    unit : str
        m or rad.
    suffix : str
        Of the names of its inputs and outputs; none where it is the only axis.
    start : float
        Where it stands in the block's example.
    velocity, acceleration, jerk : float
    quick_deceleration, quick_jerk : float
    travel, targets : (float, float)
        `targets` lie within the travel.
    """

    name: str
    unit: str
    suffix: str
    start: float
    velocity: float
    acceleration: float
    jerk: float
    quick_deceleration: float
    quick_jerk: float
    travel: tuple[float, float]
    targets: tuple[float, float]


def axis_words(axes: Sequence[AxisConstants]) -> dict[str, str]:
    """Tell of the axes in the block's header."""
    several = len(axes) > 1
    units = " and ".join(dict.fromkeys(axis.unit for axis in axes))
    names = " and ".join(axis.name for axis in axes)
    limits = [
        f"Limits{f' of {a.name}' if several else ''}: velocity {a.velocity:g} {a.unit}/s, acceleration "
        f"{a.acceleration:g} {a.unit}/s2, jerk {a.jerk:g} {a.unit}/s3, travel {a.travel[0]:g} to "
        f"{a.travel[1]:g} {a.unit}."
        for a in axes
    ]
    if several:
        limits.append(
            f"Each axis has inputs and outputs of its own, such as fTarget{axes[0].suffix}; a command is for "
            "all of them,\n    and at their targets they come to rest together."
        )
    quick = [
        f"{a.quick_deceleration:g} {a.unit}/s2 and {a.quick_jerk:g} {a.unit}/s3"
        + (f" ({a.name})" if several else "")
        for a in axes
    ]
    targets = [
        f"{a.targets[0]:g} to {a.targets[1]:g} {a.unit}" + (f" ({a.name})" if several else "") for a in axes
    ]
    return {
        "axes": f"{'Axes' if several else 'Axis'} {names}, in {units} and s.",
        "limits": "\n    ".join(limits),
        "quick": ", ".join(quick),
        "targets": ", ".join(targets),
    }


def axis_interface(axes: Sequence[AxisConstants]) -> dict[str, str]:
    """Declare what each axis takes and gives."""

    def declared(name: str, comment: str) -> str:
        return "\n".join(
            f"    {name}{a.suffix} : LREAL{f' := {literal(a.start)}' if name == PLACE else ''}; "
            f"(* {a.unit}{comment} *)"
            for a in axes
        )

    zones = [
        f"    {name}{a.suffix} : ARRAY [0..{ZONES - 1}] OF LREAL; (* {a.unit}{comment} *)"
        for a in axes
        for name, comment in ZONE_INPUTS.items()
    ]
    return {
        "target_inputs": declared("fTarget", ""),
        "command_inputs": declared("fVelocityCommand", "/s"),
        "limit_inputs": declared("fVelocityLimit", "/s; 0.0: none but the machine's"),
        "place_inputs": declared(PLACE, ", where the axis is")
        + "\n"
        + declared("fActVelocity", "/s, of the axis"),
        "following_inputs": declared("fFollowingLimit", ", from the setpoint; 0.0: none"),
        "setpoint_outputs": "\n".join(
            [declared("fPosition", ""), declared("fVelocity", "/s"), declared("fAcceleration", "/s2")]
        ),
        "distance_outputs": "\n".join(
            [
                declared("fDistanceToGo", ", to the target"),
                declared("fStopLow", ", the least place that a stop without sway passes"),
                declared("fStopHigh", ", the greatest"),
                declared("fStopDistance", ", the farther of them from here"),
            ]
        ),
        "zone_inputs": "\n".join(zones),
    }
