"""Function blocks around the planner block that power real axes, take them over and guide them.

One for the axes of a vendor's motion library, and one whose output is a velocity, for frequency converters.
An axis that fails is let go at once, the others brake, and nothing is guided again before a reset and another
rising edge: the block then takes the axes over where they stand.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import attrs

from gen_profile.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable
from gen_profile_exporters.motion_libraries import (
    CODESYS,
    SIEMENS,
    TWINCAT,
    VELOCITY,
    MotionLibrary,
    around,
    each,
)
from gen_profile_exporters.playback.structured_text import literal

HEADER = """\
(*
    {name}: {block} on {axes}. Call it in their task, every fCycleTime.
    Not tried on a controller: watch the first motion with the hand at the emergency stop.

    bPower powers the axes, to be homed and moved otherwise, too. A rising edge of bEnable takes them over
    at their setpoints, as fast as they go, and guides them: bEnabled is set, and commands are obeyed.
    Dropping bEnable or bPower stops without sway first (with bQuickStop: at once) and then lets them go.

    An axis that fails is let go and left to its own reaction, the others brake at once. Then it takes bReset,
    which resets the axes, too, and another rising edge of bEnable: they are taken over where they stand.

    nErrorId: as of {block} (7 lets the axes go, once they stand), and
              20 an axis is in error
              21 an axis has no power, or had none for {patience:g} s
              22 {guide} reports an error, or does not work
              23 something else took an axis
              24 an axis is not homed
*)
"""
BODY = """\
bWanted := bEnable AND bPower;
IF nStage = cOff THEN
    IF bReset THEN nFault := 0; END_IF;
    IF bWanted AND NOT bWantedBefore THEN
        nStage := cPowering;
        nWaited := 0;
    END_IF;
ELSIF NOT bWanted THEN
    IF nStage = cGuiding THEN nStage := cStopping; END_IF;
    IF nStage < cGuiding THEN nStage := cOff; END_IF;
ELSIF NOT bWantedBefore AND (nStage = cStopping) THEN
    nStage := cGuiding;
END_IF;
bWantedBefore := bWanted;

bOn := bPower OR (nStage <> cOff);
bAcknowledge := bReset AND (nStage = cOff);
bPowered := TRUE;
bReady := TRUE;
bGuided := FALSE;
{prepare}
IF nFault <> 0 THEN
    IF nStage < cGuiding THEN nStage := cOff; ELSE nStage := cStopping; END_IF;
ELSIF (nStage = cPowering) AND bPowered THEN
    nStage := cTaking;
    nWaited := 0;
{take}
ELSIF (nStage = cTaking) AND bReady THEN
    nStage := cGuiding;
ELSIF (nStage = cPowering) OR (nStage = cTaking) THEN
    nWaited := nWaited + 1;
    IF nWaited > cPatience THEN
        nFault := 21;
        IF nStage = cTaking THEN nFault := 22; END_IF;
    END_IF;
END_IF;

{lists}fbPlanner(
    {arguments});
IF nStage >= cGuiding THEN
    IF (nFault = 0) AND ((fbPlanner.nErrorId = 7) OR NOT fbPlanner.bEnabled) THEN
        nFault := fbPlanner.nErrorId;
        nStage := cStopping;
    END_IF;
END_IF;

{feed}
IF (nStage = cStopping) AND NOT fbPlanner.bBusy THEN nStage := cOff; END_IF;

{results}bBusy := fbPlanner.bBusy OR ((nStage <> cOff) AND (nStage <> cGuiding));
IF nFault <> 0 THEN nErrorId := nFault; END_IF;
bError := nErrorId <> 0;
"""
PREPARE = """\
IF nStage = cOff THEN bTaken{n} := FALSE; END_IF;
bResets := FALSE;
{power}
nCause := 0;
{vendor}
IF (nStage = cPowering) AND (nFault = 0) THEN
    IF bResets OR (nCause = 21) THEN
        bPowered := FALSE;
    ELSIF nCause = 20 THEN
        nFault := 20;
    ELSIF NOT ({homed}) THEN
        nFault := 24;
    END_IF;
END_IF;
{let_go}
bGuided := bGuided OR bTaken{n};
(* Taken over where it is commanded to be, then supervised where it is. *)
fPlace{n} := {setpoint} / cUnits{n};
IF fbPlanner.bEnabled THEN fPlace{n} := {actual} / cUnits{n}; END_IF;"""
# Until it is enabled, the block follows the axis, which goes on as fast as it does.
FEED = """\
bFeed := bTaken{n};
fPosition := cUnits{n} * fbPlanner.fPosition{n};
fVelocity := cUnits{n} * fbPlanner.fVelocity{n};
fAcceleration := cUnits{n} * fbPlanner.fAcceleration{n};
IF nStage = cTaking THEN fPosition := fPosition + fCycleTime * fVelocity; END_IF;
nCause := 0;
{vendor}
{let_go}"""
# Element by element, as matiec takes no whole array for a parameter.
LIST = """\
nIndex := {first};
WHILE nIndex <= {last} DO
    {to}[nIndex] := {of}[nIndex];
    nIndex := nIndex + 1;
END_WHILE;
"""
INTERFACE = ("VAR_INPUT", "VAR_OUTPUT")
STAGES = ("cOff", "cPowering", "cTaking", "cGuiding", "cStopping")
STAGE = BlockVariable(
    section="VAR_OUTPUT",
    name="nStage",
    type="DINT",
    comment="0 off, 1 waits for power, 2 takes over, 3 guides, 4 stops",
)
POWER = BlockVariable(section="VAR_INPUT", name="bPower", type="BOOL", comment="power the axes")
COMMENTS = {
    "bEnable": "rising edge: take the axes over; low: stop without sway, then let them go",
    "bReset": "acknowledge errors, of the axes, too",
    "bEnabled": "the axes are guided",
}
OWN = {
    "BOOL": (
        *("bWanted", "bWantedBefore", "bOn", "bAcknowledge", "bResets", "bPowered", "bReady"),
        *("bGuided", "bFeed"),
    ),
    "DINT": ("nWaited", "nFault", "nCause"),
    "LREAL": ("fPosition", "fVelocity", "fAcceleration"),
}
SETPOINTS = OWN["LREAL"]  # outputs of the block that go to the axes
PLACES = {"fActPosition": "fPlace{n}", "fActVelocity": "{speed} / cUnits{n}"}  # inputs that come from them
PATIENCE = 10.0  # s, for power, and for the vendor's block
LIBRARIES = {"twincat": TWINCAT, "codesys": CODESYS, "siemens-scl": SIEMENS}


def planner_wrappers(block: BlockSource, units: Mapping[str, float], format_: str) -> dict[str, BlockSource]:
    """Write the wrappers of a planner block that a format carries, by what their files' names end with.

    Parameters
    ----------
    block : BlockSource
    units : mapping of str to float
        By the end of the names of each axis's variables: the axis's own units in one of the block's.
    format_ : str
    """
    converters = dict.fromkeys(units, 1.0)
    wrappers = {"_velocity": planner_wrapper(block, converters, VELOCITY)}
    if format_ in LIBRARIES:
        wrappers["_axis"] = planner_wrapper(block, units, LIBRARIES[format_])
    return wrappers


def planner_wrapper(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> BlockSource:
    """Write the block around a planner block, with the same inputs and outputs but the axes' own.

    Raises
    ------
    ExportError
        A live parameter's input has the name of a variable of the wrapper.
    """
    name = f"{block.name}_{'Axis' if library.axis_type else 'Velocity'}"
    outer = [v for v in block.variables if v.section in INTERFACE]
    hidden = {f"{key}{n}" for n in units for key in (*SETPOINTS, *(PLACES if library.axis_type else ()))}
    declared = [
        attrs.evolve(v, comment=COMMENTS.get(v.name, v.comment)) for v in outer if v.name not in hidden
    ]
    variables = (
        *(
            BlockVariable(section="VAR_IN_OUT", name=f"Axis{n}", type=library.axis_type)
            for n in units
            if library.axis_type
        ),
        POWER,
        *declared,
        *(attrs.evolve(v, name=v.name.format(n=n)) for n in units for v in library.variables),
        STAGE,
        *_own(block, units, library),
    )
    counted = Counter(v.name.lower() for v in variables)  # the language has one case only
    if twice := [v.name for v in variables if counted[v.name.lower()] > 1]:
        raise ExportError(f"{name} has a variable {twice[0]} of its own; name the live parameter otherwise.")
    return BlockSource(
        header=HEADER.format(
            name=name,
            block=block.name,
            axes="axes of the motion library" if library.axis_type else "frequency converters",
            guide=library.guide,
            patience=PATIENCE,
        ),
        name=name,
        variables=variables,
        body=_body(block, units, library),
    )


def _own(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> list[BlockVariable]:
    """Declare what is the wrapper's own."""
    own = {"fbPlanner": block.name} | {name: type_ for type_, names in OWN.items() for name in names}
    if any(v.array for v in block.variables if v.section in INTERFACE):
        own["nIndex"] = "DINT"
    instances = library.power_instances | library.instances
    for n in units:
        own |= {f"bTaken{n}": "BOOL", f"fPlace{n}": "LREAL"}
        own |= {f"{key}{n}": type_ for key, type_ in instances.items()}
    (cycle,) = (float(v.initial) for v in block.variables if v.name == "fCycleTime")
    whole = {stage: number for number, stage in enumerate(STAGES)} | {"cPatience": round(PATIENCE / cycle)}
    constants = {name: ("DINT", str(number)) for name, number in whole.items()}
    constants |= {f"cUnits{n}": ("LREAL", literal(factor)) for n, factor in units.items()}
    return [
        *(BlockVariable(section="VAR", name=name, type=type_) for name, type_ in own.items()),
        *(
            BlockVariable(section="VAR CONSTANT", name=name, type=type_, initial=initial)
            for name, (type_, initial) in constants.items()
        ),
    ]


def _body(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> str:
    places = [{"n": n} for n in units]
    prepare, feed = (
        each(around(template, statements, library), places)
        for template, statements in ((PREPARE, library.prepare), (FEED, library.feed))
    )
    inputs, outputs = ([v for v in block.variables if v.section == section] for section in INTERFACE)
    given = {v.name: v.name for v in inputs if not v.array} | {
        "bEnable": "bGuided AND (nStage >= cGuiding)",
        "bStop": "bStop OR (nStage = cStopping)",
        "bQuickStop": "bQuickStop OR (nFault <> 0)",
    }
    for n in units:
        for key, place in PLACES.items():
            given[f"{key}{n}"] = place.format(n=n, speed=library.speed.format(n=n))
    setpoints = {f"{key}{n}" for n in units for key in SETPOINTS}
    copied = [v for v in outputs if v.name not in setpoints]
    return BODY.format(
        prepare=prepare,
        take=each("    bTaken{n} := TRUE;", places),
        lists="".join(_list(v, f"fbPlanner.{v.name}", v.name) for v in inputs if v.array),
        arguments=",\n    ".join(f"{name} := {value}" for name, value in given.items()),
        feed=feed,
        results="".join(
            _list(v, v.name, f"fbPlanner.{v.name}") if v.array else f"{v.name} := fbPlanner.{v.name};\n"
            for v in copied
        ),
    )


def _list(variable: BlockVariable, to: str, of: str) -> str:
    """Hand an array over."""
    assert variable.array is not None
    first, last, _ = variable.array
    return LIST.format(first=first, last=last, to=to, of=of)
