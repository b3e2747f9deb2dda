"""Axes of TwinCAT, CODESYS and TIA as their manuals describe them, for wrappers that run in the interpreter.

The library blocks are Structured Text: a rising edge takes the axis, an axis that is not fit is an error, and
another command takes it away (``bAway``). Members of an axis are inputs, so that tests can write them. A
drive does at once what its axis is commanded; it takes some cycles to be powered or reset.
"""

import attrs
from st_interpreter import FunctionBlock

from gen_profile_exporters.motion_libraries import CODESYS, SIEMENS, TWINCAT
from gen_profile_exporters.playback.axis_wrapper import axis_wrapper

STRUCTURE = "FUNCTION_BLOCK {}\nVAR_INPUT\n{}\nEND_VAR\nEND_FUNCTION_BLOCK"


def structure(name, **members):
    return STRUCTURE.format(name, "\n".join(f"{member} : {type_};" for member, type_ in members.items()))


def powering(name, axis, inputs, *, on, error, powered, up, down):
    """Build MC_Power: up after some cycles, as long as the axis is in no error."""
    return f"""FUNCTION_BLOCK {name}
    VAR_IN_OUT Axis : {axis}; END_VAR
    VAR_INPUT {inputs} END_VAR
    VAR Wait : DINT; END_VAR
    IF ({on}) AND NOT ({error}) THEN
        Wait := Wait + 1;
        IF {powered} THEN Wait := 0; END_IF;
        IF Wait > 4 THEN {up} END_IF;
    ELSE
        Wait := 0;
        {down}
    END_IF;
    END_FUNCTION_BLOCK"""


def lasting(name, axis, effect):
    """Build a block whose effect comes some cycles after its edge."""
    return f"""FUNCTION_BLOCK {name}
    VAR_IN_OUT Axis : {axis}; END_VAR
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
        {effect}
        Busy := FALSE;
    END_IF;
    END_FUNCTION_BLOCK"""


TWINCAT_BLOCKS = (
    structure("NCTOPLC_AXIS_REF", StateDWord="DWORD", ActPos="LREAL", SetPos="LREAL", SetVelo="LREAL"),
    structure("AXIS_REF", NcToPlc="NCTOPLC_AXIS_REF", bAway="BOOL", bGenerator="BOOL"),
    """FUNCTION_BLOCK MC_ExtSetPointGenEnable
    VAR_IN_OUT Axis : AXIS_REF; END_VAR
    VAR_INPUT Execute : BOOL; Position : LREAL; PositionType : INT; END_VAR
    VAR_OUTPUT Busy : BOOL; Error : BOOL; Enabled : BOOL; END_VAR
    VAR Before : BOOL; Wait : DINT; END_VAR
    IF NOT Execute THEN Error := FALSE; END_IF;
    IF Execute AND NOT Before THEN
        Error := ((Axis.NcToPlc.StateDWord AND 16#80000001) <> 16#00000001) OR Axis.bAway;
        Busy := NOT Error;
        Wait := 3;
    END_IF;
    Before := Execute;
    Wait := Wait - 1;
    IF Busy AND (Wait = 0) THEN
        Axis(bGenerator := TRUE);
        Busy := FALSE;
    END_IF;
    IF Axis.bAway OR ((Axis.NcToPlc.StateDWord AND 16#80000001) <> 16#00000001) THEN
        Axis(bGenerator := FALSE);
    END_IF;
    Enabled := Axis.bGenerator;
    END_FUNCTION_BLOCK""",
    lasting("MC_ExtSetPointGenDisable", "AXIS_REF", "Axis(bGenerator := FALSE);"),
    """FUNCTION_BLOCK MC_ExtSetPointGenFeed
    VAR_IN_OUT Axis : AXIS_REF; END_VAR
    VAR_INPUT Position : LREAL; Velocity : LREAL; Acceleration : LREAL; Direction : DINT; END_VAR
    IF Axis.bGenerator THEN Axis.NcToPlc(SetPos := Position, SetVelo := Velocity); END_IF;
    END_FUNCTION_BLOCK""",
    powering(
        "MC_Power",
        "AXIS_REF",
        "Enable : BOOL; Enable_Positive : BOOL; Enable_Negative : BOOL;",
        on="Enable AND Enable_Positive AND Enable_Negative",
        error="(Axis.NcToPlc.StateDWord AND 16#80000000) <> 16#00000000",
        powered="(Axis.NcToPlc.StateDWord AND 16#00000001) <> 16#00000000",
        up="Axis.NcToPlc(StateDWord := Axis.NcToPlc.StateDWord OR 16#00000001);",
        down="Axis.NcToPlc(StateDWord := Axis.NcToPlc.StateDWord AND 16#80000002);",
    ),
    lasting("MC_Reset", "AXIS_REF", "Axis.NcToPlc(StateDWord := Axis.NcToPlc.StateDWord AND 16#00000003);"),
)
CODESYS_BLOCKS = (
    structure(
        "AXIS_REF_SM3",
        nAxisState="INT",
        fActPosition="LREAL",
        fSetPosition="LREAL",
        fSetVelocity="LREAL",
        bAway="BOOL",
    ),
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
    IF bBusy THEN Axis(fSetPosition := fSetPosition, fSetVelocity := fSetVelocity); END_IF;
    IF NOT bExecute AND NOT bBusy THEN
        bCommandAborted := FALSE;
        bError := FALSE;
    END_IF;
    END_FUNCTION_BLOCK""",
    powering(
        "MC_Power",
        "AXIS_REF_SM3",
        "Enable : BOOL; bRegulatorOn : BOOL; bDriveStart : BOOL;",
        on="Enable AND bRegulatorOn AND bDriveStart",
        error="Axis.nAxisState = 1",
        powered="Axis.nAxisState > 1",
        up="Axis(nAxisState := 3);",
        down="IF Axis.nAxisState > 1 THEN Axis(nAxisState := 0); END_IF;",
    ),
    lasting("MC_Reset", "AXIS_REF_SM3", "IF Axis.nAxisState = 1 THEN Axis(nAxisState := 0); END_IF;"),
)
SIEMENS_BLOCKS = (
    structure(
        "TO_PositioningAxis",
        StatusWord="DWORD",
        ActualPosition="LREAL",
        Position="LREAL",
        Velocity="LREAL",
        bAway="BOOL",
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
    IF Busy AND ((Axis.StatusWord AND 16#00000003) <> 16#00000001) THEN
        Busy := FALSE;
        Error := TRUE;
    END_IF;
    IF Busy AND Axis.bAway THEN
        Busy := FALSE;
        CommandAborted := TRUE;
    END_IF;
    IF Busy THEN Axis(Position := Position, Velocity := Velocity); END_IF;
    END_FUNCTION_BLOCK""",
    powering(
        "MC_POWER",
        "TO_PositioningAxis",
        "Enable : BOOL; StartMode : INT; StopMode : INT;",
        on="Enable AND (StartMode = 1) AND (StopMode = 0)",
        error="Axis.StatusWord.%X1",
        powered="Axis.StatusWord.%X0",
        up="Axis(StatusWord := Axis.StatusWord OR 16#00000001);",
        down="Axis(StatusWord := Axis.StatusWord AND 16#00000022);",
    ),
    lasting("MC_RESET", "TO_PositioningAxis", "Axis(StatusWord := Axis.StatusWord AND 16#00000021);"),
)


@attrs.frozen(kw_only=True)
class Vendor:
    """How a test sees a vendor's axis.

    Attributes
    ----------
    library : str
    blocks : tuple of str
    axis : int
        Which of them is the axis.
    part : str or None
        Structure within the axis that has its state and its positions.
    state, setpoint, speed, actual : str
        Members of it.
    fit, error, off, astray : int
        Values of its state; astray is not homed.
    """

    library: str
    blocks: tuple[str, ...]
    axis: int = 0
    part: str | None = None
    state: str
    setpoint: str
    speed: str
    actual: str
    fit: int
    error: int
    off: int
    astray: int


VENDORS = {
    "twincat": Vendor(
        library=TWINCAT,
        blocks=TWINCAT_BLOCKS,
        axis=1,
        part="NcToPlc",
        state="StateDWord",
        setpoint="SetPos",
        speed="SetVelo",
        actual="ActPos",
        fit=3,
        error=0x80000002,
        off=2,
        astray=1,
    ),
    "codesys": Vendor(
        library=CODESYS,
        blocks=CODESYS_BLOCKS,
        state="nAxisState",
        setpoint="fSetPosition",
        speed="fSetVelocity",
        actual="fActPosition",
        fit=3,
        error=1,
        off=0,
        astray=3,
    ),
    "siemens": Vendor(
        library=SIEMENS,
        blocks=SIEMENS_BLOCKS,
        state="StatusWord",
        setpoint="Position",
        speed="Velocity",
        actual="ActualPosition",
        fit=0x21,
        error=0x22,
        off=0x20,
        astray=0x01,
    ),
}


class Bench:
    """A wrapper on its axes, which keep to their commands, cycle after cycle."""

    def __init__(self, vendor, source, block, names, starts):
        """Make axes, by the names that the wrapper has for them; ``block`` is the inner one."""
        self.vendor = vendor
        self.source = source
        # The only name of an enumeration; the interpreter has none.
        wrapper = self.source.text().replace("POSITIONTYPE_ABSOLUTE", "1")
        blocks = (block.text(), *vendor.blocks)
        self.wrapper = FunctionBlock(wrapper, blocks)
        self.axes = [FunctionBlock(vendor.blocks[vendor.axis], blocks) for _ in starts]
        self.given = dict(zip(names, self.axes, strict=True))
        self.commanded = []
        for axis in self.axes:
            self.put(axis, vendor.fit)

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
        outputs = self.wrapper.call(**self.given, **inputs)
        for axis in self.axes:
            part = self.part(axis)
            fit = part[self.vendor.state] in (self.vendor.fit, self.vendor.astray)
            come, gone = (
                (self.vendor.actual, self.vendor.setpoint)
                if fit
                else (self.vendor.setpoint, self.vendor.actual)
            )
            part.call(**{come: part[gone]})
        commanded = [self.part(axis)[self.vendor.setpoint] for axis in self.axes]
        for axis, at, before in zip(
            self.axes, commanded, self.commanded[-1] if self.commanded else commanded, strict=True
        ):
            if at == before:
                self.part(axis).call(**{self.vendor.speed: 0.0})
        self.commanded.append(commanded)
        return outputs

    def until(self, condition, most=500, **inputs):
        """Run until the outputs fulfil a condition; the last ones."""
        for _ in range(most):
            outputs = self.cycle(**inputs)
            if condition(outputs):
                return outputs
        raise AssertionError(f"still {outputs}")


class PlaybackBench(Bench):
    """A wrapper of a playback block."""

    def __init__(self, vendor, block, starts):
        names = ["Axis"] if len(starts) == 1 else [f"Axis{n}" for n in range(1, len(starts) + 1)]
        super().__init__(vendor, axis_wrapper(block, len(starts), vendor.library), block, names, starts)
        self.given["fCycleTime"] = self.wrapper["fbMotion"]["cCycleTime"]
        self.bring(starts)
        while not self.wrapper["fbMotion"]["bChecked"]:
            self.cycle(bExecute=False)
        self.commanded = self.commanded[-1:]
