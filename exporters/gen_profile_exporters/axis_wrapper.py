"""A function block around the playback block that hands its outputs to the axes of a vendor's motion library.

The calls follow the vendors' public manuals; they were not tried on a controller.
"""

from __future__ import annotations

import attrs

from gen_profile_exporters.block_source import BlockSource, Variable

HEADER = """\
(*
    {name}: plays {block} on the axes given. Call it in the task of the motion, every fCycleTime.
    Not tried on a controller: watch the first motion with the hand at the emergency stop.
*)
"""
BODY = """\
{prepare}
fbMotion(
    {arguments});
bGuided := fbMotion.bBusy OR fbMotion.bDone OR fbMotion.bAborted;
{feed}
{results}
"""
ACTUAL = "fActPosition"  # the only input of the playback block that comes from the axes


@attrs.frozen(kw_only=True)
class MotionLibrary:
    """How a vendor's axis takes setpoints.

    In the statements, ``{n}`` is the axis's number and ``{i}`` its index in the playback block's arrays, both
    empty where there is one axis.

    Attributes
    ----------
    axis_type : str
    instances : dict of str to str
        Library blocks by the beginning of their instances' names.
    prepare : str
        Before the playback block is called; clears ``bReady`` as long as the axis is not ready.
    actual : str
        Where the axis stands.
    feed : str
        After it was called; ``bGuided`` tells that its outputs count.
    """

    axis_type: str
    instances: dict[str, str]
    prepare: str
    actual: str
    feed: str


TWINCAT = MotionLibrary(
    axis_type="AXIS_REF",
    instances={
        "fbEnable": "MC_ExtSetPointGenEnable",
        "fbDisable": "MC_ExtSetPointGenDisable",
        "nDirection": "DINT",
    },
    prepare="""\
fbEnable{n}(Axis := Axis{n}, Execute := bExecute, Position := Axis{n}.NcToPlc.ActPos,
    PositionType := POSITIONTYPE_ABSOLUTE);
IF NOT fbEnable{n}.Enabled THEN bReady := FALSE; END_IF;""",
    actual="Axis{n}.NcToPlc.ActPos",
    feed="""\
nDirection{n} := 0;
IF fbMotion.fVelocity{i} > 0.0 THEN nDirection{n} := 1; END_IF;
IF fbMotion.fVelocity{i} < 0.0 THEN nDirection{n} := -1; END_IF;
IF bGuided THEN
    MC_ExtSetPointGenFeed(Position := fbMotion.fPosition{i}, Velocity := fbMotion.fVelocity{i},
        Acceleration := fbMotion.fAcceleration{i}, Direction := nDirection{n}, Axis := Axis{n});
END_IF;
fbDisable{n}(Axis := Axis{n}, Execute := NOT bExecute AND NOT fbMotion.bBusy);""",
)
CODESYS = MotionLibrary(
    axis_type="AXIS_REF_SM3",
    instances={"fbFollow": "SMC_FollowSetValues"},
    prepare="",
    actual="Axis{n}.fActPosition",
    feed="""\
fbFollow{n}(Axis := Axis{n}, bExecute := bGuided, bAbort := NOT bGuided, dwValueMask := 16#00000007,
    fSetPosition := fbMotion.fPosition{i}, fSetVelocity := fbMotion.fVelocity{i},
    fSetAcceleration := fbMotion.fAcceleration{i});""",
)
SIEMENS = MotionLibrary(
    axis_type="TO_PositioningAxis",
    instances={"fbInPosition": "MC_MOTIONINPOSITION"},
    prepare="",
    actual="Axis{n}.ActualPosition",
    feed="""\
fbInPosition{n}(Axis := Axis{n}, Enable := bGuided, Position := fbMotion.fPosition{i},
    Velocity := fbMotion.fVelocity{i}, Acceleration := fbMotion.fAcceleration{i});""",
)


def axis_wrapper(block: BlockSource, axes: int, library: MotionLibrary) -> BlockSource:
    """Write the block around a playback block, with the same inputs and flags."""
    inputs = [v for v in block.variables if v.section == "VAR_INPUT" and v.name != ACTUAL]
    flags = [v for v in block.variables if v.section == "VAR_OUTPUT" and v.type in {"BOOL", "INT"}]
    numbers = [(str(n), f"[{n}]") for n in range(1, axes + 1)] if axes > 1 else [("", "")]
    own = {"bReady": "BOOL", "bGuided": "BOOL", "fbMotion": block.name}
    own |= {f"{name}{n}": type_ for n, _ in numbers for name, type_ in library.instances.items()}
    prepare, feed = (
        "\n".join(text.format(n=n, i=i) for n, i in numbers) for text in (library.prepare, library.feed)
    )
    if axes > 1:
        own["fActual"] = f"ARRAY [1..{axes}] OF LREAL"
        prepare += "".join(f"\nfActual{i} := {library.actual.format(n=n)};" for n, i in numbers)
    given = {v.name: v.name for v in inputs}
    given |= {
        "bExecute": "bExecute AND bReady",
        ACTUAL: library.actual.format(n="") if axes == 1 else "fActual",
    }
    name = f"{block.name}_Axis"
    return BlockSource(
        header=HEADER.format(name=name, block=block.name),
        name=name,
        variables=(
            *(Variable(section="VAR_IN_OUT", name=f"Axis{n}", type=library.axis_type) for n, _ in numbers),
            *inputs,
            *flags,
            *(Variable(section="VAR", name=key, type=type_) for key, type_ in own.items()),
        ),
        body=BODY.format(
            prepare=f"bReady := TRUE;\n{prepare.lstrip()}".rstrip(),
            arguments=",\n    ".join(f"{key} := {value}" for key, value in given.items()),
            feed=feed,
            results="\n".join(f"{v.name} := fbMotion.{v.name};" for v in flags),
        ),
    )
