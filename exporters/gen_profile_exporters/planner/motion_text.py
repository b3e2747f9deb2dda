"""Statements of the planner block that run in every cycle: inputs, slots of the committed future, outputs."""

INPUTS = """\

(* Inputs. Not-a-number fails every comparison, so these ask for what must hold. *)
@take_live
@take_axes
bLiveGood := TRUE;
FOR nIndex := 0 TO cLives - 1 DO
    IF NOT (aLiveNow[nIndex] >= cLiveLow[nIndex]) OR NOT (aLiveNow[nIndex] <= cLiveHigh[nIndex]) THEN
        bLiveGood := FALSE;
    END_IF;
END_FOR;
nWork := cCycleWork;

IF nState = 0 THEN
    bFault := FALSE;
    nErrorId := 0;
    nCommand := 0;
    bCommandAborted := FALSE;
    IF bEnable THEN
        IF NOT (ABS(fCycleTime - cCycle) <= 1.0E-6 * cCycle) THEN nErrorId := 1; END_IF;
        FOR nAxis := 0 TO cAxes - 1 DO
            IF NOT (aActual[nAxis] >= cTravelLow[nAxis]) OR NOT (aActual[nAxis] <= cTravelHigh[nAxis]) THEN
                nErrorId := 4;
            END_IF;
        END_FOR;
        bFault := nErrorId <> 0;
        IF NOT bFault THEN
            nState := 1;
            FOR nAxis := 0 TO cAxes - 1 DO
                aFinal[nAxis] := aActual[nAxis];
                aPosition[nAxis] := aActual[nAxis];
                aTop[nAxis] := cVelocity[nAxis];
            END_FOR;
            nFuture := 0;
            FOR nIndex := 0 TO cAxes * cFuture - 1 DO
                aFuture[nIndex] := 0.0;
            END_FOR;
            nWeighed := 0;
            bReady := FALSE;
            bSettled := TRUE;
            bCalming := FALSE;
@forget
            bPulses := TRUE;
            nTick := 0;
            nJob := 0;
        END_IF;
    END_IF;
END_IF;

IF (nState = 1) OR (nState = 2) THEN
    IF NOT bEnable OR bStop THEN
        IF (nCommand <> 0) AND NOT (bDone AND (nCommand = 1)) THEN bCommandAborted := TRUE; END_IF;
        nCommand := 0;
    ELSIF bVelocity THEN
        IF (nErrorId <> 6) OR NOT bVelocityBefore THEN nErrorId := 0; END_IF;
        FOR nAxis := 0 TO cAxes - 1 DO
            IF NOT (ABS(aCommand[nAxis]) <= 1.0E+9) THEN nErrorId := 3; END_IF;
        END_FOR;
        IF bExecute AND NOT bExecuteBefore THEN nErrorId := 6; END_IF;
        IF (nCommand = 1) AND NOT bDone THEN bCommandAborted := TRUE; END_IF;
        nCommand := 2;
        bFault := nErrorId <> 0;
    ELSIF bExecute AND NOT bExecuteBefore THEN
        bCommandAborted := (nCommand = 1) AND NOT bDone;
        nErrorId := 0;
        FOR nAxis := 0 TO cAxes - 1 DO
            IF NOT (aTarget[nAxis] >= cTargetLow[nAxis]) OR NOT (aTarget[nAxis] <= cTargetHigh[nAxis]) THEN
                nErrorId := 3;
            END_IF;
            aGoal[nAxis] := aTarget[nAxis];
        END_FOR;
        bFault := nErrorId <> 0;
        nCommand := 1;
        bSurrender := FALSE;
        bBraked := FALSE;
        nLeast := 0;
        IF nJob > 1 THEN nJob := 0; END_IF;
    ELSIF nCommand = 2 THEN
        nCommand := 0;
    END_IF;
    bLimitsGood := (rOverride > 0.0) AND (rOverride <= 1.0);
    FOR nAxis := 0 TO cAxes - 1 DO
        IF NOT (aLimit[nAxis] >= 0.0) THEN bLimitsGood := FALSE; END_IF;
    END_FOR;
    IF NOT bLimitsGood THEN
        nErrorId := 5;
        bFault := TRUE;
    ELSE
        FOR nAxis := 0 TO cAxes - 1 DO
            aTop[nAxis] := cVelocity[nAxis] * rOverride;
            IF (aLimit[nAxis] > 0.0) AND (aLimit[nAxis] < aTop[nAxis]) THEN
                aTop[nAxis] := aLimit[nAxis];
            END_IF;
        END_FOR;
        IF nErrorId = 5 THEN
            nErrorId := 0;
            bFault := FALSE;
        END_IF;
    END_IF;
    IF NOT bLiveGood THEN
        nErrorId := 2;
        bFault := TRUE;
    ELSIF nErrorId = 2 THEN
        nErrorId := 0;
        bFault := FALSE;
    END_IF;
    IF NOT (ABS(fCycleTime - cCycle) <= 1.0E-6 * cCycle) THEN
        nErrorId := 1;
        bFault := TRUE;
    END_IF;
    IF bFault THEN nCommand := 0; END_IF;
    IF (nCommand <> 1) AND (nJob = 2) THEN nJob := 0; END_IF;
END_IF;
bExecuteBefore := bExecute;
bVelocityBefore := bVelocity;
bNew := FALSE;

(* Brake at once: velocity and acceleration to zero by steps of the jerk, in the shortest time. *)
IF bQuickStop AND (nState = 2) THEN
    nState := 3;
    nJob := 0;
    bPlanned := FALSE;
    IF nCommand <> 0 THEN bCommandAborted := TRUE; END_IF;
    nCommand := 0;
    bSettled := FALSE;
    bCalming := FALSE;
    nWeighed := 0;
    fQuickTime := 0.0;
    FOR nAxis := 0 TO cAxes - 1 DO
        aQuickX[nAxis] := aPosition[nAxis];
        fJerk := cQuickJerk[nAxis];
        fValue := aVelocity[nAxis];
        fDelta := aAcceleration[nAxis];
        aQuickSign[nAxis] := -1.0;
        IF fValue + 0.5 * fDelta * ABS(fDelta) / fJerk < 0.0 THEN aQuickSign[nAxis] := 1.0; END_IF;
        fValue := aQuickSign[nAxis] * fValue;
        fDelta := aQuickSign[nAxis] * fDelta;
        fPeak := 0.5 * fDelta * fDelta - fJerk * fValue;
        IF fPeak > 0.0 THEN fPeak := SQRT(fPeak); ELSE fPeak := 0.0; END_IF;
        IF fPeak < fDelta THEN fPeak := fDelta; END_IF;
        aHold[nAxis] := 0.0;
        IF fPeak > cQuickDeceleration[nAxis] THEN
            fPeak := cQuickDeceleration[nAxis];
            aHold[nAxis] := (0.5 * fDelta * fDelta / fJerk - fValue) / fPeak - fPeak / fJerk;
        END_IF;
        aQuickV[nAxis] := fValue;
        aQuickA[nAxis] := fDelta;
        aPeak[nAxis] := fPeak;
        aRise[nAxis] := (fPeak - fDelta) / fJerk;
        aFall[nAxis] := fPeak / fJerk;
        fValue := aRise[nAxis] + aHold[nAxis] + aFall[nAxis];
        IF (nAxis = 0) OR (fValue > fQuickEnd) THEN fQuickEnd := fValue; END_IF;
    END_FOR;
END_IF;
"""

SLOTS = """\

IF nState = 3 THEN
    fQuickTime := fQuickTime + cCycle;
    FOR nAxis := 0 TO cAxes - 1 DO
        fJerk := cQuickJerk[nAxis];
        fPeak := aPeak[nAxis];
        fTime := fQuickTime;
        IF fTime > aRise[nAxis] THEN fTime := aRise[nAxis]; END_IF;
        fValue := aQuickV[nAxis] + fTime * (aQuickA[nAxis] + 0.5 * fTime * fJerk);
        fPath := fTime * (aQuickV[nAxis] + fTime * (0.5 * aQuickA[nAxis] + fTime * fJerk / 6.0));
        fDelta := aQuickA[nAxis] + fTime * fJerk;
        fTime := fQuickTime - aRise[nAxis];
        IF fTime > 0.0 THEN
            IF fTime > aHold[nAxis] THEN fTime := aHold[nAxis]; END_IF;
            fPath := fPath + fTime * (fValue + 0.5 * fTime * fPeak);
            fValue := fValue + fTime * fPeak;
            fDelta := fPeak;
            fTime := fQuickTime - aRise[nAxis] - aHold[nAxis];
        END_IF;
        IF fTime > 0.0 THEN
            IF fTime > aFall[nAxis] THEN fTime := aFall[nAxis]; END_IF;
            fPath := fPath + fTime * (fValue + fTime * (0.5 * fPeak - fTime * fJerk / 6.0));
            fValue := fValue + fTime * (fPeak - 0.5 * fTime * fJerk);
            fDelta := fPeak - fTime * fJerk;
        END_IF;
        aPosition[nAxis] := aQuickX[nAxis] + aQuickSign[nAxis] * fPath;
        aVelocity[nAxis] := aQuickSign[nAxis] * fValue;
        aAcceleration[nAxis] := aQuickSign[nAxis] * fDelta;
        nWork := nWork + 60;
    END_FOR;
    IF fQuickTime >= fQuickEnd THEN
        nState := 1;
        nFuture := 0;
        nTick := 0;
        bPulses := TRUE;
        FOR nAxis := 0 TO cAxes - 1 DO
            aFinal[nAxis] := aPosition[nAxis];
        END_FOR;
        FOR nIndex := 0 TO cAxes * cFuture - 1 DO
            aFuture[nIndex] := 0.0;
        END_FOR;
    END_IF;
ELSIF nState = 2 THEN
    nTick := nTick + 1;
    IF nTick >= nSlot THEN
        nTick := 0;
        bNew := TRUE;
        FOR nIndex := 1 TO cAxes * cFuture - 1 DO
            aFuture[nIndex - 1] := aFuture[nIndex];
        END_FOR;
        FOR nAxis := 1 TO cAxes DO
            aFuture[nAxis * cFuture - 1] := 0.0;
        END_FOR;
        IF nFuture > 0 THEN nFuture := nFuture - 1; END_IF;
        IF nJob = 5 THEN nJob := 0; END_IF;
        IF (nJob > 1) AND (nAhead > 0) THEN
            nAhead := nAhead - 1;
            IF (nAhead = 0) AND NOT bPlanned THEN
                nLeast := 0;
                IF nJob = 2 THEN nLeast := nSlots; END_IF;
                nJob := 0;
            END_IF;
        END_IF;
    END_IF;
END_IF;

(* A plan takes over where its slot begins. *)
IF (nJob > 1) AND bPlanned AND (nAhead = 0) AND (bNew OR (nState = 1)) AND (nState < 3) THEN
    nLast := nOld + 2;
    IF nSlots > nOld THEN nLast := nSlots + 2; END_IF;
    nFuture := 2;
    FOR nAxis := 0 TO cAxes - 1 DO
        nBase := nAxis * cFuture;
        FOR nIndex := 2 TO cFuture - 1 DO
            aFuture[nBase + nIndex] := 0.0;
            IF nIndex < nLast THEN aFuture[nBase + nIndex] := aPlan[nBase + nIndex - 2]; END_IF;
            IF (aFuture[nBase + nIndex] <> 0.0) AND (nIndex >= nFuture) THEN nFuture := nIndex + 1; END_IF;
        END_FOR; (* a stop ends before the old future *)
        aFinal[nAxis] := aPlanEnd[nAxis];
    END_FOR;
    nWeighed := 0;
    bStopPlanned := nJob = 3;
    bPulses := FALSE;
    bOutdated := FALSE;
    nJob := 0;
    bPlanned := FALSE;
    IF nState = 1 THEN
        nState := 2;
        bNew := TRUE;
        nTick := 0;
    END_IF;
END_IF;
IF (nState = 2) AND bNew AND (nFuture <= 0) THEN
    nState := 1;
    IF nJob > 1 THEN nJob := 0; END_IF;
END_IF;

(* Standing: disabled, or machine of the live parameters that are now. *)
IF nState = 1 THEN
    bStopPlanned := FALSE;
    bPulses := TRUE;
    FOR nAxis := 0 TO cAxes - 1 DO
        aVelocity[nAxis] := 0.0;
        aAcceleration[nAxis] := 0.0;
        aPosition[nAxis] := aFinal[nAxis];
    END_FOR;
    bNew := TRUE;
    nTick := 0;
    IF NOT bEnable THEN
        nState := 0;
        nJob := 0;
    END_IF;
END_IF;
"""

OUTPUTS = """\

IF nState = 2 THEN
    fPart := DINT_TO_LREAL(nTick) / DINT_TO_LREAL(nSlot);
    fValue := 1.0 - fPart;
    FOR nAxis := 0 TO cAxes - 1 DO
        nBase := nAxis * cFuture;
        aVelocity[nAxis] := 0.5 * fValue * fValue * aFuture[nBase]
            + (0.5 + fPart * fValue) * aFuture[nBase + 1] + 0.5 * fPart * fPart * aFuture[nBase + 2];
        aAcceleration[nAxis] := (fValue * (aFuture[nBase + 1] - aFuture[nBase])
            + fPart * (aFuture[nBase + 2] - aFuture[nBase + 1])) / fSlot;
        aPosition[nAxis] := aFrom[nAxis] + fSlot * ((1.0 - fValue * fValue * fValue) * aFuture[nBase] / 6.0
            + fPart * (0.5 + fPart * (0.5 - fPart / 3.0)) * aFuture[nBase + 1]
            + fPart * fPart * fPart * aFuture[nBase + 2] / 6.0);
    END_FOR;
END_IF;

@follow
bPromise := bReady AND bSettled AND (nState > 0);
nPromise := 0;
IF NOT bReady THEN nPromise := 3; END_IF;
IF nState = 0 THEN bDrifted := FALSE; END_IF;
IF bDrifted THEN
    nPromise := 1;
    bPromise := FALSE;
END_IF;
IF NOT bSettled THEN nPromise := 2; END_IF;

bEnabled := nState > 0;
bError := bFault;
bDone := (nState = 1) AND (nCommand = 1) AND NOT bSways;
bInVelocity := nCommand = 2;
FOR nAxis := 0 TO cAxes - 1 DO
    IF ABS(aGoal[nAxis] - aFinal[nAxis]) > 1.0E-9 THEN bDone := FALSE; END_IF;
    IF NOT (ABS(aVelocity[nAxis] - aCommand[nAxis]) <= 1.0E-6 * cVelocity[nAxis]) THEN
        bInVelocity := FALSE;
    END_IF;
    aDistanceToGo[nAxis] := 0.0;
    IF nCommand = 1 THEN aDistanceToGo[nAxis] := aGoal[nAxis] - aPosition[nAxis]; END_IF;
    aStopDistance[nAxis] := 0.0;
    IF nState = 2 THEN aStopDistance[nAxis] := ABS(aFinal[nAxis] - aPosition[nAxis]); END_IF;
END_FOR;
bBusy := (nState > 1) OR bSways OR ((nState = 1) AND (nCommand = 1) AND NOT bDone);
fTimeToGo := 0.0;
IF nState = 2 THEN
    fTimeToGo := (DINT_TO_LREAL(nFuture) - fPart) * fSlot;
    IF (nCommand = 1) AND bSurrender THEN fTimeToGo := fTimeToGo + (fStretch - 1.0) * fSlot; END_IF;
END_IF;
IF nState = 3 THEN fTimeToGo := fQuickEnd - fQuickTime; END_IF;
@give_axes
END_FUNCTION_BLOCK
"""
