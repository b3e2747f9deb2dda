"""Statements of the planner block that plan, some in each cycle: modes, kernel, motion to a target, stop.

A plan is a linear programme: the coefficients of the velocity's spline that go farthest within the limits on
value, difference and second difference, so that the modes and their derivatives by frequency are left at
rest.
"""

PLANNING = """\

(* Planning: as many steps as the operations of one cycle allow. *)
bRoom := nJob > 0;
WHILE bRoom AND (nJob > 0) AND NOT bPlanned DO
    nOther := cChunk;
    IF nSlots < nOther THEN nOther := nSlots; END_IF;
    IF nOld > nOther THEN nOther := cChunk; END_IF;
    CASE nPhase OF
        1: nCost := (cLives + 2 * cRows) * cTerms + 90 * cModes + 30 * cLives;
        2: nCost := 125 + 6 * (nFuture + cReaches);
        3: nCost := 25 * nOther + 10;
        5: nCost := 7 * nColumns + 10;
        6, 12: nCost := (2 * nPart + 5) * nColumns;
        7: nCost := nGiven * nGiven * (nGiven + 6) / 3 + (2 * nGiven + 8) * nColumns + 100;
        8: nCost := 18 * nColumns + 60;
        10: nCost := 26 * nColumns;
        11: nCost := 9 * nColumns + 10;
        13: nCost := nGiven * nGiven * (nGiven + 4) / 3 + 2 * nGiven * nColumns;
        14: nCost := 24 * nColumns + 60;
        15: nCost := 14 * nColumns + 40;
        16: nCost := 8 * nColumns + 10;
        17: nCost := 3 * nColumns + 60;
        18: nCost := 32 * nOther + 80;
        19: nCost := 22 * nColumns + 60;
        40: nCost := 100 * cModes;
        41: nCost := 20 * cChunk + 50;
        42: nCost := 90 * cModes + 2 * cConditions * cConditions;
        43: nCost := (10 + 20 * cModes) * nKernel + 20;
    ELSE
        nCost := 4 * nColumns;
    END_CASE;
    IF bMirror THEN
        CASE nPhase OF
            3: nCost := 16 * nOther + 10;
            8: nCost := 11 * nColumns + 35;
            14: nCost := 17 * nColumns + 60;
            18: nCost := 28 * nOther + 80;
            19: nCost := 15 * nColumns + 40;
        END_CASE;
    END_IF;
    IF (nPhase = 10) AND NOT bMirror AND bTurns THEN
        nCost := nCost + 3 * nColumns;
    END_IF;
    bRoom := nWork + nCost <= cWork;
    IF bRoom THEN
        nWork := nWork + nCost;
        CASE nPhase OF
            1: (* frequencies of the live parameters *)
                bOutdated := nState = 2;
                FOR nIndex := 0 TO cLives - 1 DO
                    aLive[nIndex] := aLiveNow[nIndex];
                    IF nState <> 2 THEN aLiveFollowed[nIndex] := aLive[nIndex]; END_IF;
                END_FOR;
                nFirst := 0;
@model
                FOR nMode := 0 TO cModes - 1 DO
                    aFrequency[nMode] := aModel[nMode];
                END_FOR;
@matrix
                IF cModes = 2 THEN
                    fSquare := aFrequency[0];
                    fHalf := 0.5 * (fSquare + SQRT(fSquare * fSquare - 4.0 * aFrequency[cModes - 1]));
                    aFrequency[0] := aFrequency[cModes - 1] / fHalf;
                    aFrequency[cModes - 1] := fHalf;
                END_IF;
                FOR nMode := 0 TO cModes - 1 DO
                    aFrequency[nMode] := SQRT(aFrequency[nMode]);
                END_FOR;
                IF nState <> 2 THEN
                    nSlot := LREAL_TO_DINT(6.283185307179586 / (cSlotsPerPeriod * aFrequency[0] * cCycle));
                    IF nSlot < 1 THEN nSlot := 1; END_IF;
                END_IF;
                fSlot := DINT_TO_LREAL(nSlot) * cCycle;
                bDamped := FALSE;
                FOR nMode := 0 TO cModes - 1 DO
                    (* Sine and cosine from an eighth of the angle; the growth, too. *)
                    fHalf := 0.125 * aFrequency[nMode] * fSlot;
                    fSquare := fHalf * fHalf;
                    fIm := fHalf * (1.0 - fSquare / 6.0 * (1.0 - fSquare / 20.0 * (1.0 - fSquare / 42.0
                        * (1.0 - fSquare / 72.0 * (1.0 - fSquare / 110.0 * (1.0 - fSquare / 156.0))))));
                    fRe := 1.0 - fSquare / 2.0 * (1.0 - fSquare / 12.0 * (1.0 - fSquare / 30.0
                        * (1.0 - fSquare / 56.0 * (1.0 - fSquare / 90.0 * (1.0 - fSquare / 132.0)))));
                    fHalf := 0.125 * aModel[cModes + nMode] * fSlot;
                    fGrowth := 1.0 + fHalf * (1.0 + fHalf / 2.0 * (1.0 + fHalf / 3.0 * (1.0 + fHalf / 4.0
                        * (1.0 + fHalf / 5.0 * (1.0 + fHalf / 6.0 * (1.0 + fHalf / 7.0))))));
                    FOR nIndex := 1 TO 3 DO
                        aHalfRe[nMode] := fRe;
                        aHalfIm[nMode] := fIm;
                        fValue := 2.0 * fRe * fIm;
                        fRe := (fRe - fIm) * (fRe + fIm);
                        fIm := fValue;
                        fGrowth := fGrowth * fGrowth;
                    END_FOR;
                    bDamped := bDamped OR (ABS(aModel[cModes + nMode]) > 1.0E-9 * aFrequency[nMode]);
                    aTurnRe[nMode] := fGrowth * fRe;
                    aTurnIm[nMode] := fGrowth * fIm;
                END_FOR;
                nPhase := 29;
            29: (* the shortest kernel that is tried *)
                nSlots := cKernelFirst - 1;
                IF nKernel - 3 > nSlots THEN nSlots := nKernel - 3; END_IF;
                nOld := 0;
                bMirror := FALSE;
                nPhase := 30;
            30: (* a kernel one slot longer *)
                nSlots := nSlots + 1;
                nPhase := 4;
@request
            4: (* which slots are unknowns: those in the middle are one; mirrored, the second half is none *)
                nGiven := 1 + 4 * cModes;
                FOR nMode := 0 TO cModes - 1 DO
                    fValue := aModel[cModes + nMode] * fSlot * DINT_TO_LREAL(nSlots);
                    IF fValue > cMirrorDecay THEN bMirror := FALSE; END_IF;
                END_FOR;
                IF bMirror THEN
                    nGiven := 1 + 2 * cModes;
                    nColumns := (nSlots + 1) / 2;
                    IF nColumns > cHalf THEN nColumns := cHalf; END_IF;
                    nTied := nColumns - 1;
                    nMany := nSlots - 2 * nTied;
                ELSE
                    nColumns := nSlots;
                    IF (nColumns > cMost) AND (nJob > 1) THEN nColumns := cMost; END_IF;
                    IF bUnfolded THEN nColumns := 2 * nTied + 1; END_IF;
                    nTied := nColumns / 2;
                    nMany := 1 + nSlots - nColumns;
                END_IF;
                FOR nRow := 0 TO nGiven - 1 DO
                    aB[nRow] := 0.0;
                    FOR nIndex := 0 TO nColumns - 1 DO
                        aE[nRow * cColumns + nIndex] := 0.0;
                    END_FOR;
                END_FOR;
                nPart := 0;
                nAt := 0;
                nPhase := 3;
            3: (* conditions of a mode: cosine and sine, both times the slot; what the old future does *)
                fHalf := 0.5 * DINT_TO_LREAL(nSlots - 1);
                nLast := nSlots;
                IF nOld > nLast THEN nLast := nOld; END_IF;
                fRe := aTurnRe[nPart];
                fIm := aTurnIm[nPart];
                IF bMirror THEN
                    nLast := (nSlots + 1) / 2;
                    fRe := (aHalfRe[nPart] - aHalfIm[nPart]) * (aHalfRe[nPart] + aHalfIm[nPart]);
                    fIm := 2.0 * aHalfRe[nPart] * aHalfIm[nPart];
                END_IF;
                IF nAt = 0 THEN
                    fWaveRe := 1.0;
                    fWaveIm := 0.0;
                    IF bMirror AND (nSlots = 2 * nLast) THEN
                        fWaveRe := aHalfRe[nPart];
                        fWaveIm := aHalfIm[nPart];
                    END_IF;
                END_IF;
                nFirst := nAt;
                nAt := nAt + cChunk;
                IF nAt > nLast THEN nAt := nLast; END_IF;
                FOR nIndex := nFirst TO nAt - 1 DO
                    IF bMirror THEN (* from the middle outwards *)
                        nColumn := nLast - 1 - nIndex;
                        IF nColumn > nTied THEN nColumn := nTied; END_IF;
                        fValue := fHalf - DINT_TO_LREAL(nLast - 1 - nIndex);
                        fShare := 2.0;
                        IF fValue < 0.25 THEN fShare := 1.0; END_IF;
                        nRow := (2 * nPart + 1) * cColumns + nColumn;
                        aE[nRow] := aE[nRow] + fShare * fWaveRe;
                        aE[nRow + cColumns] := aE[nRow + cColumns] + fShare * fWaveIm * fValue / fHalf;
                    ELSE
                        nColumn := nIndex;
                        IF nColumn > nTied THEN
                            nColumn := nTied;
                            IF nIndex >= nTied + nMany THEN nColumn := nIndex - nMany + 1; END_IF;
                        END_IF;
                        fValue := (DINT_TO_LREAL(nIndex) - fHalf) / fHalf;
                        fShare := 1.0;
                        nRow := (4 * nPart + 1) * cColumns + nColumn;
                        IF nIndex < nSlots THEN
                            aE[nRow] := aE[nRow] + fWaveRe;
                            aE[nRow + cColumns] := aE[nRow + cColumns] + fWaveIm;
                            aE[nRow + 2 * cColumns] := aE[nRow + 2 * cColumns] + fWaveRe * fValue;
                            aE[nRow + 3 * cColumns] := aE[nRow + 3 * cColumns] + fWaveIm * fValue;
                        END_IF;
                        IF nIndex < nOld THEN
                            fDelta := fSign * aFuture[nPlanRow + nIndex + nAhead + 2] / fScale;
                            nRow := 4 * nPart + 1;
                            aB[nRow] := aB[nRow] + fDelta * fWaveRe;
                            aB[nRow + 1] := aB[nRow + 1] + fDelta * fWaveIm;
                            aB[nRow + 2] := aB[nRow + 2] + fDelta * fWaveRe * fValue;
                            aB[nRow + 3] := aB[nRow + 3] + fDelta * fWaveIm * fValue;
                        END_IF;
                    END_IF;
                    IF (nPart = 0) AND (nIndex < nSlots) THEN aE[nColumn] := aE[nColumn] + fShare; END_IF;
                    fDelta := fWaveRe * fRe - fWaveIm * fIm;
                    fWaveIm := fWaveRe * fIm + fWaveIm * fRe;
                    fWaveRe := fDelta;
                END_FOR;
                IF nAt >= nLast THEN
                    nPart := nPart + 1;
                    nAt := 0;
                END_IF;
                IF nPart >= cModes THEN
                    nPart := 0;
                    nPhase := 5;
                    IF nJob > 1 THEN nPhase := 16; END_IF;
                    IF (nJob > 1) AND bUnfolded THEN nPhase := 10; END_IF;
                END_IF;
            5: (* kernel: the weights of its conditions, a parabola *)
                fHalf := 0.5 * DINT_TO_LREAL(nColumns - 1);
                FOR nIndex := 0 TO nColumns - 1 DO
                    fValue := (DINT_TO_LREAL(nIndex) - fHalf) / (fHalf + 1.0);
                    aX[nIndex + 2] := 1.0 - fValue * fValue;
                END_FOR;
                nPhase := 6;
@programme
@calming
            17: (* the plan: as far as the target is, along the straight line from the old future *)
                fSum := 0.0;
                FOR nIndex := 0 TO nColumns - 1 DO
                    aX[nIndex + 2] := aX[nIndex + 2] + aDx[nIndex + 2];
                    fSum := fSum + aE[nIndex] * aX[nIndex + 2];
                END_FOR;
                fSum := fSum - fOldSum;
                fPlanShare := 1.0;
                IF fSum > fNeed THEN fPlanShare := fNeed / fSum; END_IF;
                IF bTurns AND (cAxes > 1) AND (fSum > 0.5 * fNeed) THEN (* all are to arrive together *)
                    fPlanShare := 0.5 * fNeed / fSum;
                    fSum := 0.5 * fNeed;
                END_IF;
                bGood := fSum > 1.0E-9;
                nAt := 0;
                nPhase := 18;
            18: (* hold it against the limits *)
                nLast := nSlots;
                IF nOld > nLast THEN nLast := nOld; END_IF;
                nFirst := nAt;
                IF nAt = 0 THEN
                    aPlanEnd[nPlanAxis] := aFinal[nPlanAxis] - fSign * fScale * fSlot * fOldSum;
                    fPlanned := aX[1];
                    fPlannedBefore := aX[0];
                END_IF;
                nAt := nAt + cChunk;
                IF nAt > nLast + 2 THEN nAt := nLast + 2; END_IF;
                FOR nIndex := nFirst TO nAt - 1 DO
                    fDelta := 0.0;
                    IF nIndex < nOld THEN
                        fDelta := fSign * aFuture[nPlanRow + nIndex + nAhead + 2] / fScale;
                    END_IF;
                    fValue := 0.0;
                    IF (nIndex < nSlots) AND (fPlanShare > 0.0) THEN
                        nColumn := nIndex;
                        IF bMirror AND (2 * nIndex >= nSlots) THEN nColumn := nSlots - 1 - nIndex; END_IF;
                        IF nColumn > nTied THEN
                            IF bMirror OR (nIndex < nTied + nMany) THEN
                                nColumn := nTied;
                            ELSE
                                nColumn := nIndex - nMany + 1;
                            END_IF;
                        END_IF;
                        fValue := aX[nColumn + 2];
                    END_IF;
                    fValue := fDelta + fPlanShare * (fValue - fDelta);
                    IF NOT (ABS(fValue) <= cVelocity[nPlanAxis] / fScale) THEN bGood := FALSE; END_IF;
                    IF NOT (ABS(fValue - fPlanned) <= fRate / (1.0 - cInside)) THEN bGood := FALSE; END_IF;
                    IF NOT (ABS(fValue - 2.0 * fPlanned + fPlannedBefore) <= fCurve / (1.0 - cInside)) THEN
                        bGood := FALSE;
                    END_IF;
                    aPlanEnd[nPlanAxis] := aPlanEnd[nPlanAxis] + fSign * fScale * fSlot * fValue;
                    IF nJob <> 4 THEN
                        fHalf := aPlanEnd[nPlanAxis];
                        IF NOT (fHalf >= cTravelLow[nPlanAxis] - 1.0E-10) THEN bGood := FALSE; END_IF;
                        IF NOT (fHalf <= cTravelHigh[nPlanAxis] + 1.0E-10) THEN bGood := FALSE; END_IF;
                    END_IF;
                    aPlan[nPlanRow + nIndex] := fSign * fScale * fValue;
                    fPlannedBefore := fPlanned;
                    fPlanned := fValue;
                END_FOR;
                IF nAt >= nLast + 2 THEN
                    nAt := 0;
                    IF bScaled AND NOT bGood THEN
                        bScaled := FALSE;
                        nPhase := 4;
                    ELSIF (bMirror OR (nJob < 4)) AND NOT bGood AND (nEnough = cIterations) THEN
                        (* Some more iterations. *)
                        nEnough := cIterations + cMoreIterations;
                        FOR nIndex := 2 TO nColumns + 1 DO
                            aX[nIndex] := aX[nIndex] - aDx[nIndex];
                            aDx[nIndex] := 0.0;
                        END_FOR;
                        nPart := 0;
                        nPhase := 8;
                    ELSIF nJob = 4 THEN
                        IF NOT bGood THEN fSum := 0.0; END_IF;
                        aReach[nPlanReach + nReach] := fSum;
                        IF fSum > aReached[nPlanAxis] THEN aReached[nPlanAxis] := fSum; END_IF;
                        nReachAxis := nReachAxis + 1;
                        IF nReachAxis >= cAxes THEN
                            nReachAxis := 0;
                            nReach := nReach + 1;
                        END_IF;
                        IF nReach >= cReaches THEN
                            nReach := 0;
                            bMeasured := TRUE;
                        END_IF;
                        nUnmeasured := nUnmeasured - 1;
                        nJob := 0;
                    ELSIF bGood AND ((fSum >= fNeed) OR (nJob = 3) OR bTurns) THEN
                        bBraked := bBraked OR bTurns;
                        IF (nJob = 2) AND (fSum >= fNeed) THEN
                            aPlanEnd[nPlanAxis] := aGoal[nPlanAxis];
                        END_IF;
                        nFitted := nFitted + 1;
                        bPlanned := nFitted >= cAxes;
                        nPlanAxis := nPlanAxis + 1;
                        IF nPlanAxis >= cAxes THEN nPlanAxis := 0; END_IF;
                        nPhase := 2;
                    ELSIF nSlots < cLongest THEN
                        (* One slot more carries no farther than full speed does. *)
                        nOther := 1;
                        IF bGood AND (fNeed - fSum < 100.0) AND (nJob = 2) THEN
                            nOther := LREAL_TO_DINT(fNeed - fSum + 0.499);
                        END_IF;
                        IF NOT bGood THEN nOther := 3; END_IF;
                        IF nOther < 1 THEN nOther := 1; END_IF;
                        nSlots := nSlots + nOther;
                        IF nSlots > cLongest THEN nSlots := cLongest; END_IF;
                        nFitted := 0;
                        bMirror := nState <> 2;
                        bUnfolded := FALSE;
                        nPhase := 4;
                    ELSE
                        bStopPlanned := nJob = 3;
                        bSurrender := nJob = 2;
                        nJob := 0;
                    END_IF;
                END_IF;
        END_CASE;
    END_IF;
END_WHILE;
"""

MODEL = """\
FOR nIndex := 0 TO cLives - 1 DO
    fValue := (2.0 * aLiveNow[nIndex] - cLiveLow[nIndex] - cLiveHigh[nIndex])
        / (cLiveHigh[nIndex] - cLiveLow[nIndex]);
    nOther := nIndex * cDegrees;
    aPower[nOther] := 1.0;
    aPower[nOther + 1] := fValue;
    FOR nTerm := 2 TO cDegrees - 1 DO
        aPower[nOther + nTerm] := 2.0 * fValue * aPower[nOther + nTerm - 1] - aPower[nOther + nTerm - 2];
    END_FOR;
END_FOR;
FOR nRow := nFirst TO cRows - 1 DO
    aModel[nRow] := 0.0;
END_FOR;
FOR nTerm := 0 TO cTerms - 1 DO
    fValue := 1.0;
    FOR nIndex := 0 TO cLives - 1 DO
        fValue := fValue * aPower[nIndex * cDegrees + cExponent[nIndex * cTerms + nTerm]];
    END_FOR;
    FOR nRow := nFirst TO cRows - 1 DO
        aModel[nRow] := aModel[nRow] + cModel[nRow * cTerms + nTerm] * fValue;
    END_FOR;
END_FOR;
"""
