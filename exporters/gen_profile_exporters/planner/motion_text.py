"""Statements of the planner block that run in every cycle: inputs, slots of the committed future, outputs."""

INPUTS = """\

(* Inputs. Not-a-number fails every comparison, so these ask for what must hold. *)
@take_live
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
        IF NOT (fActPosition >= cTravelLow) OR NOT (fActPosition <= cTravelHigh) THEN
            bFault := TRUE;
            nErrorId := 4;
        ELSIF NOT (ABS(fCycleTime - cCycle) <= 1.0E-6 * cCycle) THEN
            bFault := TRUE;
            nErrorId := 1;
        ELSE
            nState := 1;
            fFinal := fActPosition;
            fPosition := fActPosition;
            nFuture := 0;
            FOR nIndex := 0 TO cFuture - 1 DO
                aFuture[nIndex] := 0.0;
            END_FOR;
            fTop := cVelocity;
            bReady := FALSE;
            bSettled := TRUE;
            bCalming := FALSE;
            bSways := FALSE;
            nFresh := cFresh;
            fAccelerationBefore := 0.0;
            FOR nIndex := 0 TO cModes - 1 DO
                aSway[nIndex] := 0.0;
                aSwayRate[nIndex] := 0.0;
            END_FOR;
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
        IF NOT (ABS(fVelocityCommand) <= 1.0E+9) THEN nErrorId := 3; END_IF;
        IF bExecute AND NOT bExecuteBefore THEN nErrorId := 6; END_IF;
        IF (nCommand = 1) AND NOT bDone THEN bCommandAborted := TRUE; END_IF;
        nCommand := 2;
        bFault := nErrorId <> 0;
    ELSIF bExecute AND NOT bExecuteBefore THEN
        bCommandAborted := (nCommand = 1) AND NOT bDone;
        nErrorId := 0;
        IF NOT (fTarget >= cTargetLow) OR NOT (fTarget <= cTargetHigh) THEN nErrorId := 3; END_IF;
        bFault := nErrorId <> 0;
        nCommand := 1;
        fGoal := fTarget;
        bSurrender := FALSE;
        IF nJob > 1 THEN nJob := 0; END_IF;
    ELSIF nCommand = 2 THEN
        nCommand := 0;
    END_IF;
    IF NOT (rOverride > 0.0) OR NOT (rOverride <= 1.0) OR NOT (fVelocityLimit >= 0.0) THEN
        nErrorId := 5;
        bFault := TRUE;
    ELSE
        fTop := cVelocity * rOverride;
        IF (fVelocityLimit > 0.0) AND (fVelocityLimit < fTop) THEN fTop := fVelocityLimit; END_IF;
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
    IF (nCommand = 1) AND (nJob = 3) THEN nJob := 0; END_IF;
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
    fQuickTime := 0.0;
    fQuickX := fPosition;
    fQuickV := fVelocity;
    fQuickA := fAcceleration;
    fQuickSign := -1.0;
    IF fQuickV + 0.5 * fQuickA * ABS(fQuickA) / cQuickJerk < 0.0 THEN fQuickSign := 1.0; END_IF;
    fQuickV := fQuickSign * fQuickV;
    fQuickA := fQuickSign * fQuickA;
    fPeak := 0.5 * fQuickA * fQuickA - cQuickJerk * fQuickV;
    IF fPeak > 0.0 THEN fPeak := SQRT(fPeak); ELSE fPeak := 0.0; END_IF;
    IF fPeak < fQuickA THEN fPeak := fQuickA; END_IF;
    fHold := 0.0;
    IF fPeak > cQuickDeceleration THEN
        fPeak := cQuickDeceleration;
        fHold := (0.5 * fQuickA * fQuickA / cQuickJerk - fQuickV) / fPeak - fPeak / cQuickJerk;
    END_IF;
    fRise := (fPeak - fQuickA) / cQuickJerk;
    fFall := fPeak / cQuickJerk;
END_IF;
"""

SLOTS = """\

IF nState = 3 THEN
    fQuickTime := fQuickTime + cCycle;
    fTime := fQuickTime;
    IF fTime > fRise THEN fTime := fRise; END_IF;
    fVelocity := fQuickV + fTime * (fQuickA + 0.5 * fTime * cQuickJerk);
    fPosition := fTime * (fQuickV + fTime * (0.5 * fQuickA + fTime * cQuickJerk / 6.0));
    fAcceleration := fQuickA + fTime * cQuickJerk;
    fTime := fQuickTime - fRise;
    IF fTime > 0.0 THEN
        IF fTime > fHold THEN fTime := fHold; END_IF;
        fPosition := fPosition + fTime * (fVelocity + 0.5 * fTime * fPeak);
        fVelocity := fVelocity + fTime * fPeak;
        fAcceleration := fPeak;
        fTime := fQuickTime - fRise - fHold;
    END_IF;
    IF fTime > 0.0 THEN
        IF fTime > fFall THEN fTime := fFall; END_IF;
        fPosition := fPosition + fTime * (fVelocity + fTime * (0.5 * fPeak - fTime * cQuickJerk / 6.0));
        fVelocity := fVelocity + fTime * (fPeak - 0.5 * fTime * cQuickJerk);
        fAcceleration := fPeak - fTime * cQuickJerk;
    END_IF;
    fPosition := fQuickX + fQuickSign * fPosition;
    fVelocity := fQuickSign * fVelocity;
    fAcceleration := fQuickSign * fAcceleration;
    nWork := nWork + 60;
    IF fQuickTime >= fRise + fHold + fFall THEN
        nState := 1;
        fFinal := fPosition;
        nFuture := 0;
        nTick := 0;
        bPulses := TRUE;
        FOR nIndex := 0 TO cFuture - 1 DO
            aFuture[nIndex] := 0.0;
        END_FOR;
    END_IF;
ELSIF nState = 2 THEN
    nTick := nTick + 1;
    IF nTick >= nSlot THEN
        nTick := 0;
        bNew := TRUE;
        FOR nIndex := 1 TO cFuture - 1 DO
            aFuture[nIndex - 1] := aFuture[nIndex];
        END_FOR;
        aFuture[cFuture - 1] := 0.0;
        IF nFuture > 0 THEN nFuture := nFuture - 1; END_IF;
        IF nJob = 5 THEN nJob := 0; END_IF;
        IF (nJob > 1) AND (nAhead > 0) THEN
            nAhead := nAhead - 1;
            IF (nAhead = 0) AND NOT bPlanned THEN nJob := 0; END_IF;
        END_IF;
    END_IF;
END_IF;

(* A plan takes over where its slot begins. *)
IF (nJob > 1) AND bPlanned AND (nAhead = 0) AND (bNew OR (nState = 1)) AND (nState < 3) THEN
    nOther := 2;
    nFuture := nOld + 2;
    IF nSlots > nOld THEN nFuture := nSlots + 2; END_IF;
    FOR nIndex := 2 TO cFuture - 1 DO
        aFuture[nIndex] := 0.0;
        IF nIndex < nFuture THEN aFuture[nIndex] := aPlan[nIndex - 2]; END_IF;
        IF aFuture[nIndex] <> 0.0 THEN nOther := nIndex + 1; END_IF;
    END_FOR;
    nFuture := nOther; (* a stop ends before the old future *)
    fFinal := fPlanEnd;
    bStopPlanned := nJob = 3;
    bPulses := FALSE;
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
    fVelocity := 0.0;
    fAcceleration := 0.0;
    fPosition := fFinal;
    bNew := TRUE;
    nTick := 0;
    IF NOT bEnable THEN
        nState := 0;
        nJob := 0;
    END_IF;
END_IF;

(* At the beginning of a slot: what is added to the future. *)
IF bNew THEN
    fRest := 0.0;
    FOR nIndex := 2 TO nFuture - 1 DO
        fRest := fRest + aFuture[nIndex];
    END_FOR;
    nWork := nWork + nFuture + 20;
END_IF;
IF bNew AND bReady AND ((nState = 1) OR (nState = 2)) THEN
    fWanted := 0.0;
    bDue := (nCommand = 1) AND (ABS(fGoal - fFinal) > 1.0E-9) AND NOT bSurrender
        AND (bMeasured OR (ABS(fGoal - fFinal) <= fReached * fTop * fSlot));
    bPulse := bCalming AND ((nJob = 0) OR (nJob = 4)) AND NOT bDue;
    bCalming := bPulse;
    fShare := 1.0;
    IF bCalming THEN
        fWanted := 1.0;
    ELSIF nCommand = 1 THEN
        IF ABS(fGoal - fFinal) > 1.0E-9 THEN
            IF bSurrender THEN
                bPulse := TRUE;
                fWanted := (fGoal - fFinal) / fSlot;
            ELSIF bDue AND ((nJob = 0) OR (nJob = 4)) THEN
                nJob := 2;
                nPhase := 2;
                bPlanned := FALSE;
            END_IF;
        END_IF;
    ELSIF NOT bPulses AND NOT bStopPlanned AND (nState = 2) THEN
        IF (nJob = 0) AND (nFuture > nKernel + 4) THEN
            nJob := 3;
            nPhase := 2;
            bPlanned := FALSE;
        ELSIF nJob = 0 THEN
            bStopPlanned := TRUE;
        END_IF;
    ELSIF nCommand = 2 THEN
        bPulse := TRUE;
        fWanted := fVelocityCommand;
    END_IF;
    IF bPulse AND ((nJob = 0) OR (nJob = 4)) THEN
        nJob := 0;
        IF NOT bCalming THEN
            fShare := 1.0 - cReserve;
            IF fWanted > fTop * fShare THEN fWanted := fTop * fShare; END_IF;
            IF fWanted < -fTop * fShare THEN fWanted := -fTop * fShare; END_IF;
        END_IF;
        (* The greatest share of the pulse that keeps every limit over the whole committed time. *)
        fLow := -1.0E+9;
        fHigh := 1.0E+9;
        fSum := 0.0;
        fPath := fFinal - fSlot * fRest;
        fHalf := 0.5 * (cTravelHigh + cTravelLow);
        aBound[0] := fShare * cVelocity;
        aBound[1] := fShare * cAcceleration * fSlot;
        aBound[2] := fShare * cJerk * fSlot * fSlot;
        aBound[3] := 0.5 * (cTargetHigh - cTargetLow);
        IF bCalming THEN aBound[3] := 0.5 * (cTravelHigh - cTravelLow); END_IF;
        FOR nIndex := 0 TO nKernel + 1 DO
            aKernelWide[nIndex + 2] := 0.0;
            IF nIndex < nKernel THEN
                aKernelWide[nIndex + 2] := aKernel[nIndex];
                IF bCalming THEN aKernelWide[nIndex + 2] := aCalming[nIndex]; END_IF;
            END_IF;
        END_FOR;
        FOR nIndex := 2 TO nKernel + 3 DO
            fSum := fSum + fSlot * aKernelWide[nIndex];
            fPath := fPath + fSlot * aFuture[nIndex];
            FOR nRow := 0 TO 3 DO
                fBound := aBound[nRow];
                CASE nRow OF
                    0:
                        fDelta := aKernelWide[nIndex];
                        fValue := aFuture[nIndex];
                    1:
                        fDelta := aKernelWide[nIndex] - aKernelWide[nIndex - 1];
                        fValue := aFuture[nIndex] - aFuture[nIndex - 1];
                    2:
                        fDelta := aKernelWide[nIndex] - 2.0 * aKernelWide[nIndex - 1]
                            + aKernelWide[nIndex - 2];
                        fValue := aFuture[nIndex] - 2.0 * aFuture[nIndex - 1] + aFuture[nIndex - 2];
                    3:
                        fDelta := fSum;
                        fValue := fPath - fHalf;
                END_CASE;
                IF fDelta < 0.0 THEN
                    fDelta := -fDelta;
                    fValue := -fValue;
                END_IF;
                IF fDelta > 0.0 THEN
                    IF (fBound - fValue) < fHigh * fDelta THEN fHigh := (fBound - fValue) / fDelta; END_IF;
                    IF (fBound + fValue) < -fLow * fDelta THEN fLow := -(fBound + fValue) / fDelta; END_IF;
                END_IF;
            END_FOR;
        END_FOR;
        IF fLow > 0.0 THEN fLow := 0.0; END_IF;
        IF fHigh < 0.0 THEN fHigh := 0.0; END_IF;
        IF fWanted > fHigh THEN fWanted := fHigh; END_IF;
        IF fWanted < fLow THEN fWanted := fLow; END_IF;
        nWork := nWork + 60 + 60 * nKernel;
        IF fWanted <> 0.0 THEN
            FOR nIndex := 0 TO nKernel - 1 DO
                aFuture[nIndex + 2] := aFuture[nIndex + 2] + fWanted * aKernelWide[nIndex + 2];
            END_FOR;
            IF NOT bCalming THEN
                fFinal := fFinal + fSlot * fWanted;
                fRest := fRest + fWanted;
            END_IF;
            IF ABS(fGoal - fFinal) <= 1.0E-9 THEN
                IF nCommand = 1 THEN fFinal := fGoal; END_IF;
            END_IF;
            IF nFuture < nKernel + 2 THEN nFuture := nKernel + 2; END_IF;
            nState := 2;
        END_IF;
        bCalming := FALSE;
    END_IF;
END_IF;

(* Where nothing is to be planned: the machine of the live parameters of now, and what its plans reach. *)
bStale := FALSE;
FOR nIndex := 0 TO cLives - 1 DO
    fDelta := ABS(aLiveNow[nIndex] - aLive[nIndex]);
    IF fDelta > 0.5 * cLiveDrift[nIndex] THEN bStale := TRUE; END_IF;
    IF bLiveGood THEN
        fDelta := aLiveNow[nIndex] - aLiveFollowed[nIndex];
        IF fDelta > cLiveStep[nIndex] THEN fDelta := cLiveStep[nIndex]; END_IF;
        IF fDelta < -cLiveStep[nIndex] THEN fDelta := -cLiveStep[nIndex]; END_IF;
        aLiveFollowed[nIndex] := aLiveFollowed[nIndex] + fDelta;
    END_IF;
    IF (nState = 2) AND NOT (ABS(aLiveNow[nIndex] - aLiveFollowed[nIndex]) <= cLiveDrift[nIndex]) THEN
        bDrifted := TRUE;
    END_IF;
END_FOR;
IF bNew AND ((nState = 1) OR (nState = 2)) AND ((nJob = 0) OR (bMeasured AND (nJob = 4))) THEN
    bLook := cFollows AND bReady AND bSettled AND NOT bCalming AND ((nState = 2) OR bSways);
    IF bLiveGood AND (bStale OR NOT bReady) AND (bMeasured OR (nUnmeasured = 0) OR bLook)
        AND (bLooked OR NOT bLook) THEN
        nJob := 1;
        nPhase := 1;
        bLooked := FALSE;
        bPlanned := FALSE;
    ELSIF bLook THEN
        nJob := 5;
        nPhase := 40;
        nAhead := 0;
        bLooked := TRUE;
        bPlanned := FALSE;
        FOR nIndex := 0 TO cModes - 1 DO
            aSwayAt[nIndex] := aSway[nIndex];
            aSwayRateAt[nIndex] := aSwayRate[nIndex];
        END_FOR;
    ELSIF (nState = 1) AND (nJob = 0) AND (nUnmeasured > 0) THEN
        nJob := 4;
        nPhase := 2;
        bPlanned := FALSE;
    END_IF;
END_IF;
(* The matrix of the machine followed is renewed every few cycles, where there is room. *)
nFresh := nFresh + 1;
nCost := (cLives + 2 * cMatrices * cModes) * cTerms + (4 * cDegrees + 10) * cLives;
IF cFollows AND bReady AND bLiveGood AND (nState > 0) AND (nFresh >= cFresh) AND (nWork + nCost <= cWork) THEN
    nFresh := 0;
    nWork := nWork + nCost;
    FOR nIndex := 0 TO cLives - 1 DO
@powers
    END_FOR;
    FOR nRow := 0 TO cMatrices * cModes - 1 DO
        aMatrixNow[nRow] := 0.0;
    END_FOR;
    FOR nTerm := 0 TO cTerms - 1 DO
        fValue := 1.0;
        FOR nIndex := 0 TO cLives - 1 DO
            fValue := fValue * aPower[nIndex * cDegrees + cExponent[nIndex * cTerms + nTerm]];
        END_FOR;
        FOR nRow := 0 TO cMatrices * cModes - 1 DO
            aMatrixNow[nRow] := aMatrixNow[nRow] + cMatrix[nRow * cTerms + nTerm] * fValue;
        END_FOR;
    END_FOR;
END_IF;
IF (nState = 2) AND bNew THEN
    fFrom := fFinal - fSlot * (aFuture[0] / 6.0 + 5.0 * aFuture[1] / 6.0 + fRest);
END_IF;
"""

OUTPUTS = """\

IF nState = 2 THEN
    fPart := DINT_TO_LREAL(nTick) / DINT_TO_LREAL(nSlot);
    fValue := 1.0 - fPart;
    fVelocity := 0.5 * fValue * fValue * aFuture[0] + (0.5 + fPart * fValue) * aFuture[1]
        + 0.5 * fPart * fPart * aFuture[2];
    fAcceleration := (fValue * (aFuture[1] - aFuture[0]) + fPart * (aFuture[2] - aFuture[1])) / fSlot;
    fPosition := fFrom + fSlot * ((1.0 - fValue * fValue * fValue) * aFuture[0] / 6.0
        + fPart * (0.5 + fPart * (0.5 - fPart / 3.0)) * aFuture[1]
        + fPart * fPart * fPart * aFuture[2] / 6.0);
END_IF;

(* What the loads do: a Taylor step of the machine of now. *)
IF cFollows AND (nState > 0) THEN
    bSways := FALSE;
    fDelta := (fAcceleration - fAccelerationBefore) / cCycle;
    FOR nRow := 0 TO cModes - 1 DO
        aSwayD2[nRow] := fAccelerationBefore;
        aSwayD3[nRow] := fDelta;
        FOR nIndex := 0 TO cModes - 1 DO
            aSwayD2[nRow] := aSwayD2[nRow] - aMatrixNow[nRow * cModes + nIndex] * aSway[nIndex];
            aSwayD3[nRow] := aSwayD3[nRow] - aMatrixNow[nRow * cModes + nIndex] * aSwayRate[nIndex];
        END_FOR;
    END_FOR;
    FOR nRow := 0 TO cModes - 1 DO
        aSwayD4[nRow] := 0.0;
        aSwayD5[nRow] := 0.0;
        FOR nIndex := 0 TO cModes - 1 DO
            aSwayD4[nRow] := aSwayD4[nRow] - aMatrixNow[nRow * cModes + nIndex] * aSwayD2[nIndex];
            aSwayD5[nRow] := aSwayD5[nRow] - aMatrixNow[nRow * cModes + nIndex] * aSwayD3[nIndex];
        END_FOR;
    END_FOR;
    FOR nRow := 0 TO cModes - 1 DO
        aSway[nRow] := aSway[nRow] + cCycle * (aSwayRate[nRow] + cCycle / 2.0 * (aSwayD2[nRow]
            + cCycle / 3.0 * (aSwayD3[nRow] + cCycle / 4.0 * (aSwayD4[nRow]
            + cCycle / 5.0 * aSwayD5[nRow]))));
        aSwayRate[nRow] := aSwayRate[nRow] + cCycle * (aSwayD2[nRow] + cCycle / 2.0 * (aSwayD3[nRow]
            + cCycle / 3.0 * (aSwayD4[nRow] + cCycle / 4.0 * aSwayD5[nRow])));
        IF ABS(aSway[nRow]) + ABS(aSwayRate[nRow]) / aFrequency[0] > cCalm THEN
            bSways := bReady AND bSettled;
        END_IF;
    END_FOR;
    fAccelerationBefore := fAcceleration;
END_IF;

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
bDone := (nState = 1) AND (nCommand = 1) AND NOT bSways AND (ABS(fGoal - fFinal) <= 1.0E-9);
bBusy := (nState > 1) OR bSways OR ((nState = 1) AND (nCommand = 1) AND NOT bDone);
bInVelocity := (nCommand = 2) AND (ABS(fVelocity - fVelocityCommand) <= 1.0E-6 * cVelocity);
fTimeToGo := 0.0;
fStopDistance := 0.0;
IF nState = 2 THEN
    fTimeToGo := (DINT_TO_LREAL(nFuture) - fPart) * fSlot;
    fStopDistance := ABS(fFinal - fPosition);
ELSIF nState = 3 THEN
    fTimeToGo := fRise + fHold + fFall - fQuickTime;
END_IF;
fDistanceToGo := 0.0;
IF nCommand = 1 THEN fDistanceToGo := fGoal - fPosition; END_IF;
END_FUNCTION_BLOCK
"""
