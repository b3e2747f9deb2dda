"""Statements of the planner block that add pulses to the committed future where a slot begins.

Of each pulse as much is admitted as keeps every limit over the whole committed time.
"""

PULSES = """\

(* Whether the live parameters differ from those that were taken over, or change too fast on the way. *)
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

(* Where a slot begins: what is added to the future. Pulses are weighed for one axis a cycle, that of the last
   one where the slot begins, and those of the others before. *)
IF bNew THEN
    FOR nAxis := 0 TO cAxes - 1 DO
        aRest[nAxis] := 0.0;
        FOR nIndex := nAxis * cFuture + 2 TO nAxis * cFuture + nFuture - 1 DO
            aRest[nAxis] := aRest[nAxis] + aFuture[nIndex];
        END_FOR;
    END_FOR;
    nWork := nWork + cAxes * nFuture + 20;
END_IF;
bSoon := (nState = 2) AND NOT bNew AND (nTick > nSlot - cAxes);
IF bSoon AND (nTick = nSlot - cAxes + 1) THEN nWeighed := 0; END_IF;
IF (bNew OR bSoon) AND bReady AND ((nState = 1) OR (nState = 2)) THEN
    bAway := FALSE;
    bWithin := TRUE;
    FOR nAxis := 0 TO cAxes - 1 DO
        fValue := ABS(aGoal[nAxis] - aFinal[nAxis]);
        IF fValue > 1.0E-9 THEN bAway := TRUE; END_IF;
        IF NOT (fValue <= aReached[nAxis] * aTop[nAxis] * fSlot) THEN bWithin := FALSE; END_IF;
    END_FOR;
    bDue := (nCommand = 1) AND bAway AND NOT bSurrender AND ((nState = 2) OR bMeasured OR bWithin);
    (* From rest, live parameters that changed are taken over first; once, as they may go on changing. *)
    bWanted := (nCommand = 1) AND bAway;
    fStretch := 1.0;
    FOR nAxis := 0 TO cAxes - 1 DO
        fValue := ABS(aGoal[nAxis] - aFinal[nAxis]) / ((1.0 - cReserve) * aTop[nAxis] * fSlot);
        IF fValue > fStretch THEN fStretch := fValue; END_IF;
        bWanted := bWanted OR ((nCommand = 2) AND (aCommand[nAxis] <> 0.0));
    END_FOR;
    IF (nState = 2) OR NOT bWanted THEN bTaken := FALSE; END_IF;
    bWaits := (nState = 1) AND bWanted AND bStale AND bLiveGood AND NOT bTaken;
    bPulse := bCalming AND ((nJob = 0) OR (nJob = 4)) AND NOT bDue;
    bCalming := bPulse;
    IF NOT bCalming THEN
        IF nCommand = 1 THEN
            bPulse := bAway AND bSurrender AND NOT bWaits;
            IF bDue AND bNew AND NOT bWaits AND ((nJob = 0) OR (nJob = 4)) THEN
                nJob := 2;
                nPlanAxis := 0;
                nSized := 0;
                nFitted := 0;
                nPhase := 2;
                bPlanned := FALSE;
            END_IF;
        ELSIF NOT bPulses AND NOT bStopPlanned AND (nState = 2) THEN
            IF bNew AND (nJob = 0) AND (nFuture > nKernel + 4) THEN
                nJob := 3;
                nPlanAxis := 0;
                nSized := 0;
                nFitted := 0;
                nPhase := 2;
                bPlanned := FALSE;
            ELSIF bNew AND (nJob = 0) THEN
                bStopPlanned := TRUE;
            END_IF;
        ELSIF nCommand = 2 THEN
            bPulse := NOT bWaits;
        END_IF;
    END_IF;
    IF bPulse AND ((nJob = 0) OR (nJob = 4)) THEN
        nJob := 0;
        IF nWeighed < cAxes THEN
            (* The greatest share of the pulse that keeps every limit over the whole committed time. *)
            nAxis := nWeighed;
            nBase := nAxis * cFuture;
            IF bSoon THEN nBase := nBase + 1; END_IF;
            fShare := 1.0 - cReserve;
            fHigh := aTop[nAxis] * fShare;
            IF bCalming THEN
                fShare := 1.0;
                fWanted := 0.0;
                IF nAxis = nCalmAxis THEN fWanted := 1.0; END_IF;
            ELSE
                fWanted := aCommand[nAxis];
                IF nCommand = 1 THEN fWanted := (aGoal[nAxis] - aFinal[nAxis]) / (fStretch * fSlot); END_IF;
                IF fWanted > fHigh THEN fWanted := fHigh; END_IF;
                IF fWanted < -fHigh THEN fWanted := -fHigh; END_IF;
            END_IF;
            fHigh := 1.0E+9;
            fSum := 0.0;
            fPath := 0.0;
            FOR nIndex := 2 TO nFuture - 1 DO
                fPath := fPath + aFuture[nBase + nIndex];
            END_FOR;
            fPath := aFinal[nAxis] - fSlot * fPath;
            fHalf := 0.5 * (cTravelHigh[nAxis] + cTravelLow[nAxis]);
            aBound[0] := fShare * cVelocity[nAxis];
            aBound[1] := fShare * cAcceleration[nAxis] * fSlot;
            aBound[2] := fShare * cJerk[nAxis] * fSlot * fSlot;
            aBound[3] := 0.5 * (cTargetHigh[nAxis] - cTargetLow[nAxis]);
            IF bCalming THEN aBound[3] := 0.5 * (cTravelHigh[nAxis] - cTravelLow[nAxis]); END_IF;
            FOR nIndex := 0 TO nKernel + 1 DO
                aKernelWide[nIndex + 2] := 0.0;
                IF nIndex < nKernel THEN
                    aKernelWide[nIndex + 2] := aKernel[nIndex];
                    IF bCalming THEN aKernelWide[nIndex + 2] := aCalming[nIndex]; END_IF;
                END_IF;
            END_FOR;
            FOR nIndex := 2 TO nKernel + 3 DO
                nColumn := nBase + nIndex;
                fSum := fSum + fSlot * aKernelWide[nIndex];
                fPath := fPath + fSlot * aFuture[nColumn];
                FOR nRow := 0 TO 3 DO
                    fBound := aBound[nRow];
                    CASE nRow OF
                        0:
                            fDelta := aKernelWide[nIndex];
                            fValue := aFuture[nColumn];
                        1:
                            fDelta := aKernelWide[nIndex] - aKernelWide[nIndex - 1];
                            fValue := aFuture[nColumn] - aFuture[nColumn - 1];
                        2:
                            fDelta := aKernelWide[nIndex] - 2.0 * aKernelWide[nIndex - 1]
                                + aKernelWide[nIndex - 2];
                            fValue := aFuture[nColumn] - 2.0 * aFuture[nColumn - 1] + aFuture[nColumn - 2];
                        3:
                            fDelta := fSum;
                            fValue := fPath - fHalf;
                    END_CASE;
                    IF (fDelta < 0.0) <> (fWanted < 0.0) THEN fValue := -fValue; END_IF;
                    fDelta := ABS(fDelta);
                    IF fDelta > 0.0 THEN
                        fValue := fBound - fValue;
                        IF fValue < fHigh * fDelta THEN fHigh := fValue / fDelta; END_IF;
                    END_IF;
                END_FOR;
            END_FOR;
            IF fHigh < 0.0 THEN fHigh := 0.0; END_IF;
            IF fWanted > fHigh THEN fWanted := fHigh; END_IF;
            IF fWanted < -fHigh THEN fWanted := -fHigh; END_IF;
            aShare[nAxis] := fWanted;
            nWeighed := nWeighed + 1;
            nWork := nWork + nFuture + 60 + 45 * nKernel;
        END_IF;
        IF bNew AND (nWeighed >= cAxes) THEN
            FOR nAxis := 0 TO cAxes - 1 DO
                fWanted := aShare[nAxis];
                IF fWanted <> 0.0 THEN
                    nBase := nAxis * cFuture;
                    FOR nIndex := 2 TO nKernel + 1 DO
                        aFuture[nBase + nIndex] := aFuture[nBase + nIndex] + fWanted * aKernelWide[nIndex];
                    END_FOR;
                    IF NOT bCalming THEN
                        aFinal[nAxis] := aFinal[nAxis] + fSlot * fWanted;
                        aRest[nAxis] := aRest[nAxis] + fWanted;
                    END_IF;
                    IF (nCommand = 1) AND (ABS(aGoal[nAxis] - aFinal[nAxis]) <= 1.0E-9) THEN
                        aFinal[nAxis] := aGoal[nAxis];
                    END_IF;
                    IF nFuture < nKernel + 2 THEN nFuture := nKernel + 2; END_IF;
                    nState := 2;
                    nWork := nWork + 2 * nKernel;
                END_IF;
            END_FOR;
            bCalming := FALSE;
            nWeighed := 0;
        ELSIF bNew AND (nState = 2) THEN
            nWeighed := 0;
            bCalming := FALSE; (* it was for this slot *)
        END_IF;
    ELSE
        nWeighed := 0;
    END_IF;
END_IF;
"""
