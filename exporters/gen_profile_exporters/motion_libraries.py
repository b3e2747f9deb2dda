"""How vendors' axes are powered, taken and guided: their libraries' calls, for wrappers around our blocks.

The calls follow the vendors' public manuals; they were not tried on a controller.
"""

from collections.abc import Mapping, Sequence

import attrs

from gen_profile_exporters.block_source import BlockVariable
from gen_profile_exporters.text_parts import text_parts

# What follows a vendor's statements: an axis that failed is commanded no more.
LET_GO = """\
IF bTaken{n} AND (nCause <> 0) THEN
    bTaken{n} := FALSE;
    IF nFault = 0 THEN nFault := nCause; END_IF;
END_IF;"""


@attrs.frozen(kw_only=True)
class MotionLibrary:
    """How a vendor's axis takes setpoints.

    In names and statements, ``{n}`` ends what is an axis's, and ``{i}`` is its index in the playback block's
    arrays; both are empty where there is one axis.

    Attributes
    ----------
    axis_type : str
        Empty where the axis is inputs and outputs.
    guide : str
        Name of the block that guides the axis.
    instances : dict of str to str
        Library blocks, and other variables of each axis, by the beginning of their names.
    power_instances : dict of str to str
        Likewise, of what powers it.
    setpoint, speed, actual : str
        Where the axis is commanded to be, at which velocity, and where it is.
    power : str
        Powers the axis while ``bOn`` is set and resets it with ``bAcknowledge``; sets ``bResets`` as long as
        that takes.
    homed : str
        Whether its position is known.
    prepare : str
        Before the block is called: tells by ``nCause`` what is wrong with the axis, and clears ``bReady`` as
        long as it is not guided.
    feed : str
        After it was called: gives ``fPosition``, ``fVelocity`` and ``fAcceleration`` to the axis if
        ``bFeed``, and tells by ``nCause`` what went wrong.
    variables : tuple of BlockVariable
        Inputs and outputs of the wrapper for each axis, beside those of the block.
    """

    axis_type: str
    guide: str
    instances: dict[str, str]
    power_instances: dict[str, str]
    setpoint: str
    speed: str
    actual: str
    power: str
    homed: str
    prepare: str
    feed: str
    variables: tuple[BlockVariable, ...] = ()


def each(template: str, places: Sequence[Mapping[str, str]]) -> str:
    """Repeat statements for every axis, with its places put in."""
    return "\n".join(template.format(**place) for place in places)


def around(texts: Mapping[str, str], part: str, library: MotionLibrary) -> str:
    """Put a library's statements into a wrapper's, where ``{vendor}`` is; the axis's places stay open."""
    values = attrs.asdict(library, recurse=False)
    return texts[part].format(n="{n}", i="{i}", vendor=values[part], let_go=LET_GO, **values)


HOMED = BlockVariable("VAR_INPUT", "bHomed{n}", "BOOL", comment="the axis's position is known")
TWINCAT = MotionLibrary(
    axis_type="AXIS_REF",
    guide="MC_ExtSetPointGenEnable",
    instances={
        "fbEnable": "MC_ExtSetPointGenEnable",
        "fbDisable": "MC_ExtSetPointGenDisable",
        "bExternal": "BOOL",
        "nDirection": "DINT",
    },
    power_instances={"fbPower": "MC_Power", "fbReset": "MC_Reset"},
    setpoint="Axis{n}.NcToPlc.SetPos",
    speed="Axis{n}.NcToPlc.SetVelo",
    actual="Axis{n}.NcToPlc.ActPos",
    homed="(Axis{n}.NcToPlc.StateDWord AND 16#00000002) <> 16#00000000",
    **text_parts("libraries/twincat.st"),
)
CODESYS = MotionLibrary(
    axis_type="AXIS_REF_SM3",
    guide="SMC_FollowSetValues",
    instances={"fbFollow": "SMC_FollowSetValues"},
    power_instances={"fbPower": "MC_Power", "fbReset": "MC_Reset"},
    setpoint="Axis{n}.fSetPosition",
    speed="Axis{n}.fSetVelocity",
    actual="Axis{n}.fActPosition",
    homed="bHomed{n}",
    variables=(HOMED,),
    **text_parts("libraries/codesys.st"),
)
SIEMENS = MotionLibrary(
    axis_type="TO_PositioningAxis",
    guide="MC_MOTIONINPOSITION",
    instances={"fbInPosition": "MC_MOTIONINPOSITION"},
    power_instances={"fbPower": "MC_POWER", "fbReset": "MC_RESET"},
    setpoint="Axis{n}.Position",
    speed="Axis{n}.Velocity",
    actual="Axis{n}.ActualPosition",
    homed="Axis{n}.StatusWord.%X5",
    **text_parts("libraries/siemens.st"),
)
# Velocity setpoints with a position control of our own; no library: the converter is inputs and outputs.
VELOCITY = MotionLibrary(
    axis_type="",
    guide="the position control (fGain, fCorrection, fFollowingLimit > 0.0)",
    instances={},
    power_instances={},
    setpoint="fActPosition{n}",
    speed="fActVelocity{n}",
    actual="fActPosition{n}",
    homed="bHomed{n}",
    variables=(
        HOMED,
        BlockVariable("VAR_INPUT", "bRunning{n}", "BOOL", comment="the converter is on and follows fSpeed"),
        BlockVariable("VAR_INPUT", "bDriveError{n}", "BOOL", comment="it is in error"),
        BlockVariable(
            "VAR_INPUT", "fGain{n}", "LREAL", comment="1/s: velocity for each distance from the setpoint"
        ),
        BlockVariable("VAR_INPUT", "fCorrection{n}", "LREAL", comment="greatest velocity for it"),
        BlockVariable("VAR_OUTPUT", "bRun{n}", "BOOL", comment="switches the converter on"),
        BlockVariable("VAR_OUTPUT", "bResetDrive{n}", "BOOL", comment="acknowledges its error"),
        BlockVariable("VAR_OUTPUT", "fSpeed{n}", "LREAL", comment="velocity setpoint"),
    ),
    **text_parts("libraries/velocity.st"),
)
