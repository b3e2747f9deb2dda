"""The motion of the planner block, within one that is called as the whole one is."""

from gen_profile.planner.design import planner_constants
from gen_profile_exporters.planner.blocks.followed import motion
from gen_profile_exporters.planner.blocks.sizes import Sizes, operations
from gen_profile_exporters.planner.blocks.texts import planner

ISSUED = {
    "fPosition": "LREAL", "fVelocity": "LREAL", "fAcceleration": "LREAL", "bMoving": "BOOL", "bLeads": "BOOL",
    "bReady": "BOOL", "bSteady": "BOOL", "fTimeToGo": "LREAL", "fSwayLeft": "LREAL", "bPromise": "BOOL",
    "fStopLow": "LREAL",
    "fStopHigh": "LREAL", "bVoid": "BOOL", "nAhead": "DINT", "fEnd": "LREAL",
    "nProgrammes": "DINT", "nFailed": "DINT", "nUnfinished": "DINT",
    "nIterations": "DINT", "nSpent": "DINT",
}  # fmt: skip


def played_text(spec, sizes=None):
    """The planner's blocks, and one that takes commands by the names that the whole block has."""
    _, constants = planner_constants(spec)
    sizes = sizes or Sizes()
    (axis,) = constants.axes
    low, high = axis.travel
    lives = "".join(
        f"f{name} : LREAL := {value!r}; "
        for name, value in zip(constants.live, constants.nominal, strict=True)
    )
    taken = "\n".join(f"aLive[{k}] := f{name};" for k, name in enumerate(constants.live))
    outputs = "\n".join(f"{name} : {type_};" for name, type_ in ISSUED.items())
    given = "\n".join(f"{name} := planner.{name};" for name in ISSUED)
    name = f"{constants.name.replace('-', '_')}_planner"
    text = motion(constants) if constants.rates else planner(constants, sizes)
    return f"""{text}
FUNCTION_BLOCK Played
VAR_INPUT
    bEnable : BOOL; bExecute : BOOL; fTarget : LREAL; bStop : BOOL;
    bVelocity : BOOL; fVelocityCommand : LREAL;
    bPrompt : BOOL; rOverride : LREAL := 1.0; fLowest : LREAL := {low!r}; fHighest : LREAL := {high!r};
    fActPosition : LREAL; {lives}
END_VAR
VAR_OUTPUT
{outputs}
END_VAR
VAR
    planner : {name}; aLive : ARRAY [0..{max(1, len(constants.live)) - 1}] OF LREAL;
    bOn : BOOL; bBegin : BOOL; bWas : BOOL; bNew : BOOL; nCommand : DINT; nBefore : DINT; fGoal : LREAL;
END_VAR
bBegin := bEnable AND NOT bOn;
bOn := bEnable;
IF bBegin OR {str(bool(constants.rates)).upper()} THEN
    {taken}
END_IF;
IF bBegin THEN nCommand := 0; END_IF;
nBefore := nCommand;
bNew := FALSE;
IF bStop THEN
    nCommand := 1;
    IF bPrompt THEN nCommand := 4; END_IF;
ELSIF bVelocity THEN
    nCommand := 3;
    fGoal := fVelocityCommand;
ELSIF bExecute AND NOT bWas THEN
    nCommand := 2;
    fGoal := fTarget;
    bNew := TRUE;
END_IF;
bWas := bExecute;
bNew := bNew OR (nCommand <> nBefore);
planner(bBegin := bBegin, bForget := TRUE, fBeginAt := fActPosition, nOperations := {operations(constants)},
    nCommand := nCommand, fGoal := fGoal, bNew := bNew, fLimit := rOverride * {axis.velocity!r},
    fLowest := fLowest, fHighest := fHighest, aLive := aLive);
{given}
END_FUNCTION_BLOCK
"""
