"""Function blocks around the playback block, for axes of a vendor's motion library or frequency converters.

The vendor's block first takes the axes where they stand, so that no setpoint is a step; then the motion
begins, under watch: an axis in error, without power or no longer this block's is let go at once, the others
stop on the path, and nothing goes on before another rising edge and the check of the start.
The calls follow the vendors' public manuals; they were not tried on a controller.
"""

import re

import attrs

from gen_profile_exporters.block_source import BlockSource, BlockVariable
from gen_profile_exporters.motion_libraries import MotionLibrary, around, each
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE
from gen_profile_exporters.templates import text_parts

TEXTS = text_parts("playback/text/axis_wrapper.st")
STAGES = ("cIdle", "cTaking", "cPlaying", "cStopping")
TRIGGERS = ("bExecute", "bContinue")  # inputs whose rising edge starts
ACTUAL = "fActPosition"  # the only input of the playback block that comes from the axes
SETPOINTS = {"fPosition", "fVelocity", "fAcceleration", "nPosition"}  # what goes to them
MEASURED = {
    ACTUAL: "measured",
    "fFollowingLimit": "greatest distance from its setpoint",
}  # of a converter's axis
MAILBOX = {REQUEST, REPLY, STATE}  # reached from outside in the playback block itself
STATES = {"bBusy", "bDone", "bAborted", "bError", "nErrorId"}  # outputs that depend on the axes, too


def axis_wrappers(block: BlockSource, axes: int, library: MotionLibrary) -> tuple[BlockSource, ...]:
    """Write the wrapper of a playback block; others have none."""
    plays = any(v.section == "VAR_INPUT" and v.name == "bAbort" for v in block.variables)
    return (axis_wrapper(block, axes, library),) if plays else ()


def axis_wrapper(block: BlockSource, axes: int, library: MotionLibrary) -> BlockSource:
    """Write the block around a playback block, with the same inputs and outputs but the axes' own."""
    several = axes > 1
    places = [{"n": f"{n}" * several, "i": f"[{n}]" * several} for n in range(1, axes + 1)]
    inputs = [v for v in block.variables if v.section == "VAR_INPUT" and v.name not in {ACTUAL, *MAILBOX}]
    outputs = [v for v in block.variables if v.section == "VAR_OUTPUT" and v.name not in SETPOINTS | MAILBOX]
    by_velocity = not library.axis_type
    name, kind = (f"{block.name}_Velocity", "velocity") if by_velocity else (f"{block.name}_Axis", "axis")
    body = _body([v.name for v in inputs], [v.name for v in outputs], places, library)
    axis = [BlockVariable("VAR_IN_OUT", "Axis{n}", library.axis_type)]
    if by_velocity:  # the converter is powered, and its axis homed, by others
        axis = [
            BlockVariable("VAR_INPUT", f"{key}{{n}}", "LREAL", comment=of) for key, of in MEASURED.items()
        ]
        axis += [v for v in library.variables if v.name.removesuffix("{n}") in re.findall(r"[a-zA-Z]+", body)]
    return BlockSource(
        header=TEXTS["header"].format(
            name=name,
            block=block.name,
            guide=library.guide,
            **{k: TEXTS[f"{kind}_{k}"] for k in ("on", "more")},
        )
        + "\n",
        name=name,
        variables=(
            *(attrs.evolve(v, name=v.name.format(**place)) for place in places for v in axis),
            *inputs,
            *outputs,
            *_own(block.name, [v.name for v in inputs], places, library),
        ),
        body=body,
    )


def _own(
    block: str, inputs: list[str], places: list[dict[str, str]], library: MotionLibrary
) -> list[BlockVariable]:
    """Declare what is the wrapper's own."""
    own = {"fbMotion": block, "nStage": "DINT", "nTrigger": "DINT", "nDue": "DINT"}
    own |= {f"{trigger}{end}": "BOOL" for trigger in _triggers(inputs) for end in ("Before", "Now")}
    own |= {"nFault": "INT", "nCause": "INT", "bReady": "BOOL", "bGuided": "BOOL", "bFeed": "BOOL"}
    own |= {"fPosition": "LREAL", "fVelocity": "LREAL", "fAcceleration": "LREAL"}
    if len(places) > 1:
        own["fStand"] = f"ARRAY [1..{len(places)}] OF LREAL"
    own |= {
        f"{key}{place['n']}": type_
        for place in places
        for key, type_ in {"bTaken": "BOOL", **library.instances}.items()
    }
    return [
        *(BlockVariable("VAR", key, type_) for key, type_ in own.items()),
        *(
            BlockVariable("VAR CONSTANT", stage, "DINT", initial=str(number))
            for number, stage in enumerate(STAGES)
        ),
    ]


def _body(inputs: list[str], outputs: list[str], places: list[dict[str, str]], library: MotionLibrary) -> str:
    triggers = _triggers(inputs)
    several = len(places) > 1
    stand = each("fStand{i} := " + library.setpoint + ";", places) if several else ""
    following = "" if library.axis_type else f"{TEXTS['following']}\n"
    texts = {**TEXTS, "feed": TEXTS["feed"].replace("{following}", following)}
    prepare, feed = (each(around(texts, part, library), places) for part in ("prepare", "feed"))
    given = {key: f"{key}Now" if key in triggers else key for key in inputs}
    given |= {
        "bAbort": "bAbort OR (nStage = cStopping)",
        ACTUAL: "fStand" if several else library.setpoint.format(n=""),
    }
    text = TEXTS["body"].format(
        edges="\n".join(
            TEXTS["edge"].format(input=key, number=number) for number, key in enumerate(triggers, 1)
        ),
        held=" OR ".join(triggers),
        take=each("    bTaken{n} := TRUE;", places),
        prepare=f"{prepare}\n{stand}".rstrip(),
        levels="\n".join(f"{key}Now := (nStage = cPlaying) AND {key};" for key in triggers),
        starts="\n".join(f"    {key}Now := nTrigger = {number};" for number, key in enumerate(triggers, 1)),
        arguments=",\n    ".join(f"{key} := {value}" for key, value in given.items()),
        feed=feed,
        results="\n".join(f"{key} := fbMotion.{key};" for key in outputs if key not in STATES),
    )
    return f"{text}\n"


def _triggers(inputs: list[str]) -> list[str]:
    return [key for key in TRIGGERS if key in inputs]
