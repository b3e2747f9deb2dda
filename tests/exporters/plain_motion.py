"""A motion that plans nothing, in the place of the planner's: what the shell around it does is seen alone."""

TEXT = """
FUNCTION_BLOCK @name
VAR_INPUT
    bBegin : BOOL; bForget : BOOL; fBeginAt : LREAL; nAxis : DINT; nOperations : DINT; nCommand : DINT;
    fGoal : LREAL; bNew : BOOL; bPrompt : BOOL; fLimit : LREAL; fLowest : LREAL; fHighest : LREAL;
END_VAR
VAR_IN_OUT aLive : ARRAY [0..@last_live] OF LREAL; END_VAR
VAR_OUTPUT
    fPosition : LREAL; fVelocity : LREAL; fAcceleration : LREAL; bReady : BOOL; bMoving : BOOL; bLeads : BOOL;
    bSteady : BOOL; fTimeToGo : LREAL; fSwayLeft : LREAL; bPromise : BOOL; fStopLow : LREAL;
    fStopHigh : LREAL; bVoid : BOOL; fFastest : LREAL; nSpent : DINT; fSpanLow : LREAL; fSpanHigh : LREAL;
END_VAR
VAR nWait : DINT; fMost : LREAL; fWay : LREAL; fSpeed : LREAL; fStop : LREAL; END_VAR
VAR CONSTANT cCycle : LREAL := @cycle; cSlowing : LREAL := @slowing; cFull : LREAL := @full; END_VAR
IF bBegin THEN fPosition := fBeginAt; fVelocity := 0.0; nWait := 20; END_IF;
IF bNew AND (nWait < 5) THEN nWait := 5; END_IF;
IF nWait > 0 THEN nWait := nWait - 1; END_IF;
bReady := nWait < 10;
fSpeed := fVelocity;
IF nWait = 0 THEN
    fSpeed := 0.0;
    fWay := fGoal - fPosition;
    IF nCommand = 3 THEN
        fSpeed := fGoal;
        fWay := fHighest - fPosition;
        IF fGoal < 0.0 THEN fWay := fLowest - fPosition; END_IF;
    END_IF;
    IF nCommand = 2 THEN fSpeed := cFull; IF fWay < 0.0 THEN fSpeed := -cFull; END_IF; END_IF;
    IF fSpeed > fLimit THEN fSpeed := fLimit; END_IF;
    IF fSpeed < -fLimit THEN fSpeed := -fLimit; END_IF;
    IF fSpeed * fSpeed > 2.0 * cSlowing * ABS(fWay) THEN (* in time to stop there *)
        fStop := SQRT(2.0 * cSlowing * ABS(fWay));
        IF fSpeed < 0.0 THEN fStop := -fStop; END_IF;
        fSpeed := fStop;
    END_IF;
    fMost := 2.0 * cSlowing * cCycle; (* in a cycle *)
    IF fSpeed > fVelocity + fMost THEN fSpeed := fVelocity + fMost; END_IF;
    IF fSpeed < fVelocity - fMost THEN fSpeed := fVelocity - fMost; END_IF;
    IF (nCommand >= 2) AND (ABS(fSpeed) * cCycle >= ABS(fWay)) THEN
        fPosition := fPosition + fWay * ABS(fSpeed) / (ABS(fSpeed) + 1.0E-12);
        IF nCommand = 2 THEN fPosition := fGoal; END_IF;
        fSpeed := 0.0;
    END_IF;
END_IF;
fVelocity := fSpeed;
fPosition := fPosition + cCycle * fSpeed;
bMoving := fVelocity <> 0.0;
bLeads := nWait = 0;
bPromise := TRUE;
fSwayLeft := 0.001;
fFastest := ABS(fVelocity) / cFull;
fStop := 0.25 * fVelocity * fVelocity / cSlowing;
fTimeToGo := 0.5 * ABS(fVelocity) / cSlowing;
fStopLow := fPosition;
fStopHigh := fPosition;
IF fVelocity > 0.0 THEN fStopHigh := fPosition + fStop; ELSE fStopLow := fPosition - fStop; END_IF;
fSpanLow := fStopLow;
fSpanHigh := fStopHigh;
bVoid := (fStopHigh > fHighest + 0.01) AND (fVelocity > 0.0)
    OR (fStopLow < fLowest - 0.01) AND (fVelocity < 0.0);
nSpent := 10;
END_FUNCTION_BLOCK
"""


def plain_motion(constants):
    """Its text, for a machine of one axis."""
    (axis,) = constants.axes
    values = {
        "name": f"FB_{constants.name.replace('-', '_').replace(' ', '_')}_motion",
        "last_live": max(1, len(constants.live)) - 1,
        "cycle": constants.cycle,
        "slowing": 0.5 * axis.acceleration,
        "full": axis.velocity,
    }
    text = TEXT
    for name, value in values.items():
        text = text.replace(f"@{name}", str(value))
    return text
