"""Axes of TwinCAT, CODESYS and TIA as their manuals describe them, for wrappers that run in the interpreter.

The library blocks are Structured Text: a rising edge takes the axis, an axis that is not fit is an error, and
another command takes it away (``bAway``). Members of an axis are inputs, so that tests can write them. A
drive does at once what its axis is told.
"""

import attrs
from st_interpreter import FunctionBlock

from gen_profile_exporters.playback.axis_wrapper import CODESYS, SIEMENS, TWINCAT, axis_wrapper

STRUCTURE = "FUNCTION_BLOCK {}\nVAR_INPUT\n{}\nEND_VAR\nEND_FUNCTION_BLOCK"


def structure(name, **members):
    return STRUCTURE.format(name, "\n".join(f"{member} : {type_};" for member, type_ in members.items()))


TWINCAT_BLOCKS = (
    structure("NCTOPLC_AXIS_REF", StateDWord="DWORD", ActPos="LREAL", SetPos="LREAL"),
    structure("AXIS_REF", NcToPlc="NCTOPLC_AXIS_REF", bAway="BOOL", bGenerator="BOOL"),
    """FUNCTION_BLOCK MC_ExtSetPointGenEnable
    VAR_IN_OUT Axis : AXIS_REF; END_VAR
    VAR_INPUT Execute : BOOL; Position : LREAL; PositionType : INT; END_VAR
    VAR_OUTPUT Busy : BOOL; Error : BOOL; Enabled : BOOL; END_VAR
    VAR Before : BOOL; Wait : DINT; END_VAR
    IF NOT Execute THEN Error := FALSE; END_IF;
    IF Execute AND NOT Before THEN
        Error := (Axis.NcToPlc.StateDWord <> 16#00000001) OR Axis.bAway;
        Busy := NOT Error;
        Wait := 3;
    END_IF;
    Before := Execute;
    Wait := Wait - 1;
    IF Busy AND (Wait = 0) THEN
        Axis(bGenerator := TRUE);
        Busy := FALSE;
    END_IF;
    IF Axis.bAway OR (Axis.NcToPlc.StateDWord <> 16#00000001) THEN Axis(bGenerator := FALSE); END_IF;
    Enabled := Axis.bGenerator;
    END_FUNCTION_BLOCK""",
    """FUNCTION_BLOCK MC_ExtSetPointGenDisable
    VAR_IN_OUT Axis : AXIS_REF; END_VAR
    VAR_INPUT Execute : BOOL; END_VAR
    VAR_OUTPUT Busy : BOOL; END_VAR
    VAR Before : BOOL; Wait : DINT; END_VAR
    IF Execute AND NOT Before THEN
        Busy := TRUE;
        Wait := 3;
    END_IF;
    Before := Execute;
    Wait := Wait - 1;
    IF Busy AND (Wait = 0) THEN
        Axis(bGenerator := FALSE);
        Busy := FALSE;
    END_IF;
    END_FUNCTION_BLOCK""",
    """FUNCTION_BLOCK MC_ExtSetPointGenFeed
    VAR_IN_OUT Axis : AXIS_REF; END_VAR
    VAR_INPUT Position : LREAL; Velocity : LREAL; Acceleration : LREAL; Direction : DINT; END_VAR
    IF Axis.bGenerator THEN Axis.NcToPlc(SetPos := Position); END_IF;
    END_FUNCTION_BLOCK""",
)
CODESYS_BLOCKS = (
    structure("AXIS_REF_SM3", nAxisState="INT", fActPosition="LREAL", fSetPosition="LREAL", bAway="BOOL"),
    """FUNCTION_BLOCK SMC_FollowSetValues
    VAR_IN_OUT Axis : AXIS_REF_SM3; END_VAR
    VAR_INPUT
        bExecute : BOOL; bAbort : BOOL; dwValueMask : DWORD;
        fSetPosition : LREAL; fSetVelocity : LREAL; fSetAcceleration : LREAL;
    END_VAR
    VAR_OUTPUT bBusy : BOOL; bCommandAborted : BOOL; bError : BOOL; END_VAR
    VAR bBefore : BOOL; END_VAR
    IF bExecute AND NOT bBefore THEN
        bBusy := TRUE;
        bCommandAborted := FALSE;
        bError := FALSE;
    END_IF;
    bBefore := bExecute;
    IF bAbort THEN bBusy := FALSE; END_IF;
    IF bBusy AND (Axis.nAxisState < 3) THEN
        bBusy := FALSE;
        bError := TRUE;
    END_IF;
    IF bBusy AND Axis.bAway THEN
        bBusy := FALSE;
        bCommandAborted := TRUE;
    END_IF;
    IF bBusy THEN Axis(fSetPosition := fSetPosition); END_IF;
    IF NOT bExecute AND NOT bBusy THEN
        bCommandAborted := FALSE;
        bError := FALSE;
    END_IF;
    END_FUNCTION_BLOCK""",
)
SIEMENS_BLOCKS = (
    structure(
        "TO_PositioningAxis", StatusWord="DWORD", ActualPosition="LREAL", Position="LREAL", bAway="BOOL"
    ),
    """FUNCTION_BLOCK MC_MOTIONINPOSITION
    VAR_IN_OUT Axis : TO_PositioningAxis; END_VAR
    VAR_INPUT Enable : BOOL; Position : LREAL; Velocity : LREAL; Acceleration : LREAL; END_VAR
    VAR_OUTPUT Busy : BOOL; CommandAborted : BOOL; Error : BOOL; END_VAR
    VAR Before : BOOL; END_VAR
    IF Enable AND NOT Before THEN Busy := TRUE; END_IF;
    IF NOT Enable THEN
        Busy := FALSE;
        CommandAborted := FALSE;
        Error := FALSE;
    END_IF;
    Before := Enable;
    IF Busy AND (Axis.StatusWord <> 16#00000001) THEN
        Busy := FALSE;
        Error := TRUE;
    END_IF;
    IF Busy AND Axis.bAway THEN
        Busy := FALSE;
        CommandAborted := TRUE;
    END_IF;
    IF Busy THEN Axis(Position := Position); END_IF;
    END_FUNCTION_BLOCK""",
)


@attrs.frozen(kw_only=True)
class Vendor:
    """How a test sees a vendor's axis.

    Attributes
    ----------
    library : MotionLibrary
    blocks : tuple of str
    part : str or None
        Structure within the axis that has its state and its positions.
    state, setpoint, actual : str
        Members of it.
    fit, error, off : int
        Values of its state.
    """

    library: object
    blocks: tuple[str, ...]
    part: str | None = None
    state: str
    setpoint: str
    actual: str
    fit: int
    error: int
    off: int


VENDORS = {
    "twincat": Vendor(
        library=TWINCAT,
        blocks=TWINCAT_BLOCKS,
        part="NcToPlc",
        state="StateDWord",
        setpoint="SetPos",
        actual="ActPos",
        fit=1,
        error=0x80000001,
        off=0,
    ),
    "codesys": Vendor(
        library=CODESYS,
        blocks=CODESYS_BLOCKS,
        state="nAxisState",
        setpoint="fSetPosition",
        actual="fActPosition",
        fit=3,
        error=1,
        off=0,
    ),
    "siemens": Vendor(
        library=SIEMENS,
        blocks=SIEMENS_BLOCKS,
        state="StatusWord",
        setpoint="Position",
        actual="ActualPosition",
        fit=1,
        error=3,
        off=0,
    ),
}


class Bench:
    """A wrapper on its axes, which keep to what they are told, cycle after cycle."""

    def __init__(self, vendor, block, starts):
        self.vendor = vendor
        self.source = axis_wrapper(block, len(starts), vendor.library)
        # The only name of an enumeration; the interpreter has none.
        wrapper = self.source.text().replace("POSITIONTYPE_ABSOLUTE", "1")
        blocks = (block.text(), *vendor.blocks)
        self.wrapper = FunctionBlock(wrapper, blocks)
        self.axes = [
            FunctionBlock(vendor.blocks[-2 if len(vendor.blocks) == 2 else 1], blocks) for _ in starts
        ]
        names = ["Axis"] if len(starts) == 1 else [f"Axis{n}" for n in range(1, len(starts) + 1)]
        self.given = dict(zip(names, self.axes, strict=True))
        self.told = []
        for axis in self.axes:
            self.put(axis, vendor.fit)
        self.bring(starts)
        while not self.wrapper["fbMotion"]["bChecked"]:
            self.cycle(bExecute=False)
        self.told = self.told[-1:]

    def bring(self, positions):
        """Let something else bring the axes to where they are to stand, and take its time."""
        for axis, at in zip(self.axes, positions, strict=False):
            self.part(axis).call(**{self.vendor.setpoint: at, self.vendor.actual: at})
        for _ in range(5):
            self.cycle(bExecute=False)

    def part(self, axis):
        return axis[self.vendor.part] if self.vendor.part else axis

    def put(self, axis, state):
        self.part(axis).call(**{self.vendor.state: state})

    def cycle(self, **inputs):
        """Run once; an axis that is not fit stays where it is, whatever its setpoint."""
        outputs = self.wrapper.call(**self.given, fCycleTime=self.wrapper["fbMotion"]["cCycleTime"], **inputs)
        for axis in self.axes:
            part = self.part(axis)
            fit = part[self.vendor.state] == self.vendor.fit
            come, gone = (
                (self.vendor.actual, self.vendor.setpoint)
                if fit
                else (self.vendor.setpoint, self.vendor.actual)
            )
            part.call(**{come: part[gone]})
        self.told.append([self.part(axis)[self.vendor.setpoint] for axis in self.axes])
        return outputs

    def until(self, condition, most=500, **inputs):
        """Run until the outputs fulfil a condition; the last ones."""
        for _ in range(most):
            outputs = self.cycle(**inputs)
            if condition(outputs):
                return outputs
        raise AssertionError(f"still {outputs}")
