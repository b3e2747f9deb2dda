"""A function block around the playback block that hands its outputs to the axes of a vendor's motion library.

The vendor's block first takes the axes where they stand, so that no setpoint is a step; then the motion
begins, under watch: an axis in error, without power or no longer this block's is let go at once, the others
stop on the path, and nothing goes on before another rising edge and the check of the start.
The calls follow the vendors' public manuals; they were not tried on a controller.
"""

from __future__ import annotations

from gen_profile_exporters.block_source import BlockSource, BlockVariable
from gen_profile_exporters.motion_libraries import MotionLibrary, around, each
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE

HEADER = """\
(*
    {name}: plays {block} on the axes given. Call it in the task of the motion, every fCycleTime.
    Not tried on a controller: watch the first motion with the hand at the emergency stop.

    An axis that fails is let go and left to its own reaction, the others stop on the path: until then, bBusy
    is set beside bError. It takes another rising edge to start, from where the motion begins.

    nErrorId: as of {block}, and
              20 an axis is in error
              21 an axis has no power
              22 {guide} reports an error, or does not work
              23 something else took an axis
*)
"""
BODY = """\
{edges}
(* Idle lasts a cycle at least, so that the vendor's blocks see an edge at the next start. *)
IF (nStage = cIdle) AND (nDue > 0) THEN
    nStage := cTaking;
    nTrigger := nDue;
{take}
ELSIF (nStage = cStopping) AND NOT fbMotion.bBusy THEN
    nStage := cIdle;
ELSIF (nStage = cPlaying) AND NOT fbMotion.bBusy AND NOT ({held}) THEN
    nStage := cIdle;
END_IF;
IF (nStage = cTaking) OR (nStage = cPlaying) THEN nDue := 0; END_IF;

bReady := TRUE;
{prepare}
IF (nFault <> 0) AND (nStage <> cIdle) THEN nStage := cStopping; END_IF;

{levels}
IF (nStage = cTaking) AND (bReady OR bAbort) THEN
    nStage := cPlaying;
{starts}
END_IF;
fbMotion(
    {arguments});
bGuided := fbMotion.bBusy OR fbMotion.bDone OR fbMotion.bAborted;
IF (nStage = cPlaying) AND fbMotion.bError THEN
    nStage := cIdle;
    nFault := fbMotion.nErrorId;
END_IF;

{feed}
IF (nFault <> 0) AND (nStage <> cIdle) THEN nStage := cStopping; END_IF;

bBusy := (nStage = cTaking) OR (nStage = cStopping) OR fbMotion.bBusy;
bDone := (nStage = cPlaying) AND fbMotion.bDone;
bAborted := (nStage = cPlaying) AND fbMotion.bAborted;
bError := nFault <> 0;
nErrorId := nFault;
{results}
"""
# For each input whose rising edge starts: what asks for a motion, or takes note of an error.
EDGE = """\
IF {input} AND NOT {input}Before THEN
    nDue := {number};
    nFault := 0;
ELSIF {input}Before AND NOT {input} THEN
    IF nDue = {number} THEN nDue := 0; END_IF;
    nFault := 0;
END_IF;
{input}Before := {input};"""
PREPARE = """\
IF nStage = cIdle THEN bTaken{n} := FALSE; END_IF;
nCause := 0;
IF (nStage = cTaking) AND (ABS({setpoint} - {actual}) > fStartTolerance{i}) THEN nCause := 2; END_IF;
{vendor}
{let_go}"""
FEED = """\
bFeed := bTaken{n} AND ((nStage = cTaking) OR bGuided);
fPosition := fbMotion.fPosition{i};
fVelocity := fbMotion.fVelocity{i};
fAcceleration := fbMotion.fAcceleration{i};
IF nStage = cTaking THEN
    fPosition := {setpoint};
    fVelocity := 0.0;
    fAcceleration := 0.0;
END_IF;
nCause := 0;
{vendor}
{let_go}"""
STAGES = ("cIdle", "cTaking", "cPlaying", "cStopping")
TRIGGERS = ("bExecute", "bContinue")  # inputs whose rising edge starts
ACTUAL = "fActPosition"  # the only input of the playback block that comes from the axes
SETPOINTS = {"fPosition", "fVelocity", "fAcceleration", "nPosition"}  # what goes to them
MAILBOX = {REQUEST, REPLY, STATE}  # reached from outside in the playback block itself
STATES = {"bBusy", "bDone", "bAborted", "bError", "nErrorId"}  # outputs that depend on the axes, too


def axis_wrappers(block: BlockSource, axes: int, library: MotionLibrary) -> tuple[BlockSource, ...]:
    """Write the wrapper of a playback block; others have none."""
    plays = any(v.section == "VAR_INPUT" and v.name == "bAbort" for v in block.variables)
    return (axis_wrapper(block, axes, library),) if plays else ()


def axis_wrapper(block: BlockSource, axes: int, library: MotionLibrary) -> BlockSource:
    """Write the block around a playback block, with the same inputs and outputs but the axes' own."""
    inputs = [v for v in block.variables if v.section == "VAR_INPUT" and v.name not in {ACTUAL, *MAILBOX}]
    outputs = [v for v in block.variables if v.section == "VAR_OUTPUT" and v.name not in SETPOINTS | MAILBOX]
    several = axes > 1
    places = [{"n": f"{n}" * several, "i": f"[{n}]" * several} for n in range(1, axes + 1)]
    name = f"{block.name}_Axis"
    return BlockSource(
        header=HEADER.format(name=name, block=block.name, guide=library.guide),
        name=name,
        variables=(
            *(
                BlockVariable(section="VAR_IN_OUT", name=f"Axis{place['n']}", type=library.axis_type)
                for place in places
            ),
            *inputs,
            *outputs,
            *_own(block.name, [v.name for v in inputs], places, library),
        ),
        body=_body([v.name for v in inputs], [v.name for v in outputs], places, library),
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
        *(BlockVariable(section="VAR", name=key, type=type_) for key, type_ in own.items()),
        *(
            BlockVariable(section="VAR CONSTANT", name=stage, type="DINT", initial=str(number))
            for number, stage in enumerate(STAGES)
        ),
    ]


def _body(inputs: list[str], outputs: list[str], places: list[dict[str, str]], library: MotionLibrary) -> str:
    triggers = _triggers(inputs)
    several = len(places) > 1
    stand = each("fStand{i} := " + library.setpoint + ";", places) if several else ""
    prepare, feed = (
        each(around(template, statements, library), places)
        for template, statements in ((PREPARE, library.prepare), (FEED, library.feed))
    )
    given = {key: f"{key}Now" if key in triggers else key for key in inputs}
    given |= {
        "bAbort": "bAbort OR (nStage = cStopping)",
        ACTUAL: "fStand" if several else library.setpoint.format(n=""),
    }
    return BODY.format(
        edges="\n".join(EDGE.format(input=key, number=number) for number, key in enumerate(triggers, 1)),
        held=" OR ".join(triggers),
        take=each("    bTaken{n} := TRUE;", places),
        prepare=f"{prepare}\n{stand}".rstrip(),
        levels="\n".join(f"{key}Now := (nStage = cPlaying) AND {key};" for key in triggers),
        starts="\n".join(f"    {key}Now := nTrigger = {number};" for number, key in enumerate(triggers, 1)),
        arguments=",\n    ".join(f"{key} := {value}" for key, value in given.items()),
        feed=feed,
        results="\n".join(f"{key} := fbMotion.{key};" for key in outputs if key not in STATES),
    )


def _triggers(inputs: list[str]) -> list[str]:
    return [key for key in TRIGGERS if key in inputs]
