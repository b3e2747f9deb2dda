"""Statements of the planner block that plan, some in each cycle: modes, kernel, motion to a target, stop.

A plan is a linear programme: the coefficients of the velocity's spline that go farthest within the limits on
value, difference and second difference, so that the modes and their derivatives by frequency are left at
rest.
"""

PLANNING = """\

(* Planning: as many steps as the operations of one cycle allow. *)
bRoom := nJob > 0;
WHILE bRoom AND (nJob > 0) AND NOT bPlanned DO
    nLast := nColumns;
    IF nOld > nLast THEN nLast := nOld; END_IF;
    CASE nPhase OF
        1: nCost := (cLives + 4 * cModes) * cTerms + 90 * cModes + 30 * cLives;
        31: nCost := (cLives + 2) * cTerms;
        2: nCost := 400;
        3: nCost := 13 * nLast + 100;
        4: nCost := 2 * nLast;
        5: nCost := 12 * nColumns;
        6, 12: nCost := (2 * cConditions + 4) * nColumns;
        7, 13: nCost := cConditions * cConditions * cConditions / 3 + (2 * cConditions + 8) * nColumns + 200;
        8: nCost := 34 * (nColumns + 2);
        9: nCost := 22 * (nColumns + 2);
        10: nCost := 38 * nColumns;
        11: nCost := 9 * nColumns;
        14: nCost := 36 * (nColumns + 2);
        15: nCost := 40 * (nColumns + 2);
        16: nCost := 9 * nColumns + 50;
        19: nCost := 14 * (nColumns + 2);
    ELSE
        nCost := 20 * nLast + 30;
    END_CASE;
    bRoom := nWork + nCost <= cWork;
    IF bRoom THEN
        nWork := nWork + nCost;
        CASE nPhase OF
            1: (* frequencies of the live parameters *)
                FOR nIndex := 0 TO cLives - 1 DO
                    aLive[nIndex] := aLiveNow[nIndex];
                    fValue := (2.0 * aLive[nIndex] - cLiveLow[nIndex] - cLiveHigh[nIndex])
                        / (cLiveHigh[nIndex] - cLiveLow[nIndex]);
                    nFirst := nIndex * cDegrees;
                    aPower[nFirst] := 1.0;
                    aPower[nFirst + 1] := fValue;
                    FOR nTerm := 2 TO cDegrees - 1 DO
                        aPower[nFirst + nTerm] := 2.0 * fValue * aPower[nFirst + nTerm - 1]
                            - aPower[nFirst + nTerm - 2];
                    END_FOR;
                END_FOR;
                FOR nMode := 0 TO cModes - 1 DO
                    aFrequency[nMode] := 0.0;
                    aDecay[nMode] := 0.0;
                END_FOR;
                FOR nTerm := 0 TO cTerms - 1 DO
                    fValue := 1.0;
                    FOR nIndex := 0 TO cLives - 1 DO
                        fValue := fValue * aPower[nIndex * cDegrees + cExponent[nIndex * cTerms + nTerm]];
                    END_FOR;
                    FOR nMode := 0 TO cModes - 1 DO
                        nIndex := nMode * cTerms + nTerm;
                        aFrequency[nMode] := aFrequency[nMode] + cFrequency[nIndex] * fValue;
                        aDecay[nMode] := aDecay[nMode] + cDecay[nIndex] * fValue;
                    END_FOR;
                END_FOR;
                IF cModes > 1 THEN
                    fSquare := aFrequency[0];
                    fHalf := 0.5 * (fSquare + SQRT(fSquare * fSquare - 4.0 * aFrequency[cModes - 1]));
                    aFrequency[0] := aFrequency[cModes - 1] / fHalf;
                    aFrequency[cModes - 1] := fHalf;
                END_IF;
                FOR nMode := 0 TO cModes - 1 DO
                    aFrequency[nMode] := SQRT(aFrequency[nMode]);
                END_FOR;
                nSlot := LREAL_TO_DINT(6.283185307179586 / (cSlotsPerPeriod * aFrequency[0] * cCycle));
                IF nSlot < 1 THEN nSlot := 1; END_IF;
                fSlot := DINT_TO_LREAL(nSlot) * cCycle;
                FOR nMode := 0 TO cModes - 1 DO
                    (* Sine and cosine from an eighth of the angle; the growth, too. *)
                    fHalf := 0.125 * aFrequency[nMode] * fSlot;
                    fSquare := fHalf * fHalf;
                    fIm := fHalf * (1.0 - fSquare / 6.0 * (1.0 - fSquare / 20.0 * (1.0 - fSquare / 42.0
                        * (1.0 - fSquare / 72.0 * (1.0 - fSquare / 110.0 * (1.0 - fSquare / 156.0))))));
                    fRe := 1.0 - fSquare / 2.0 * (1.0 - fSquare / 12.0 * (1.0 - fSquare / 30.0
                        * (1.0 - fSquare / 56.0 * (1.0 - fSquare / 90.0 * (1.0 - fSquare / 132.0)))));
                    fHalf := 0.125 * aDecay[nMode] * fSlot;
                    fGrowth := 1.0 + fHalf * (1.0 + fHalf / 2.0 * (1.0 + fHalf / 3.0 * (1.0 + fHalf / 4.0
                        * (1.0 + fHalf / 5.0 * (1.0 + fHalf / 6.0 * (1.0 + fHalf / 7.0))))));
                    FOR nIndex := 1 TO 3 DO
                        fValue := 2.0 * fRe * fIm;
                        fRe := (fRe - fIm) * (fRe + fIm);
                        fIm := fValue;
                        fGrowth := fGrowth * fGrowth;
                    END_FOR;
                    aTurnRe[nMode] := fGrowth * fRe;
                    aTurnIm[nMode] := fGrowth * fIm;
                END_FOR;
                nReach := 0;
                nPart := 0;
                nPhase := 31;
            31: (* a guess of how far so many slots lead *)
                aReach[nPart] := 0.0;
                FOR nTerm := 0 TO cTerms - 1 DO
                    fValue := 1.0;
                    FOR nOther := 0 TO cLives - 1 DO
                        fValue := fValue * aPower[nOther * cDegrees + cExponent[nOther * cTerms + nTerm]];
                    END_FOR;
                    aReach[nPart] := aReach[nPart] + cReach[nPart * cTerms + nTerm] * fValue;
                END_FOR;
                nPart := nPart + 1;
                IF nPart >= cReaches THEN nPhase := 29; END_IF;
            29: (* the shortest kernel that is tried *)
                nColumns := 17;
                nOld := 0;
                nPart := 0;
                nPhase := 30;
            30: (* a kernel one slot longer *)
                nColumns := nColumns + 1;
                nPart := 0;
                nPhase := 3;
            2: (* what is planned, from which slot on *)
                bPlanned := FALSE;
                nOld := 0;
                nAhead := 0;
                IF nState = 2 THEN
                    nAhead := 2 + 2 * cIterations * cColumnWork * cMost / (cWork * nSlot);
                    nOld := nFuture - nAhead - 2;
                    IF nOld < 0 THEN nOld := 0; END_IF;
                    IF nOld > cColumns THEN nOld := cColumns; END_IF;
                END_IF;
                fScale := fTop;
                fOldSum := 0.0;
                fValue := 0.0;
                fDelta := 0.0;
                FOR nIndex := 0 TO cFuture - 1 DO
                    IF ABS(aFuture[nIndex]) > fScale THEN fScale := ABS(aFuture[nIndex]); END_IF;
                    IF nIndex >= nAhead + 2 THEN
                        fOldSum := fOldSum + aFuture[nIndex];
                        IF aFuture[nIndex] > fValue THEN fValue := aFuture[nIndex]; END_IF;
                        IF aFuture[nIndex] < fDelta THEN fDelta := aFuture[nIndex]; END_IF;
                    END_IF;
                END_FOR;
                fSign := 1.0;
                IF nJob = 2 THEN
                    IF fGoal < fFinal THEN fSign := -1.0; END_IF;
                ELSIF fOldSum > 0.0 THEN
                    fSign := -1.0;
                END_IF;
                IF fSign < 0.0 THEN
                    fBound := -fDelta;
                    fDelta := -fValue;
                    fValue := fBound;
                    fOldSum := -fOldSum;
                END_IF;
                fUpper := 1.0 - cInside;
                fLower := -1.0 + cInside;
                IF nJob = 3 THEN
                    fUpper := fValue / fScale;
                    fNeed := 1.0E+9;
                ELSE
                    fNeed := fSign * (fGoal - fFinal) / (fScale * fSlot);
                    IF fDelta >= -1.0E-9 * fScale THEN fLower := fDelta / fScale; END_IF;
                END_IF;
                fOldSum := fOldSum / fScale;
                fRate := (1.0 - cInside) * cAcceleration * fSlot / fScale;
                fCurve := (1.0 - cInside) * cJerk * fSlot * fSlot / fScale;
                aX[0] := fSign * aFuture[nAhead] / fScale;
                aX[1] := fSign * aFuture[nAhead + 1] / fScale;
                FOR nIndex := 0 TO cColumns - 1 DO
                    aOld[nIndex] := 0.0;
                    IF nIndex < nOld THEN
                        aOld[nIndex] := fSign * aFuture[nIndex + nAhead + 2] / fScale;
                    END_IF;
                END_FOR;
                (* A first guess of how many slots it takes: what is known of motions from rest. *)
                nColumns := nKernel;
                IF nJob = 2 THEN
                    fWanted := fNeed + fOldSum;
                    IF fWanted < fNeed THEN fWanted := fNeed; END_IF;
                    nColumns := cReachFirst;
                    fWanted := fWanted * fScale * fSlot / cReachShare;
                    FOR nIndex := 0 TO cReaches - 1 DO
                        IF (aReach[nIndex] >= fWanted) AND (nReach = 0) THEN
                            nReach := 1;
                            nColumns := cReachFirst + cReachStep * nIndex;
                            IF nIndex > 0 THEN
                                fBound := (aReach[nIndex] - fWanted) / (aReach[nIndex] - aReach[nIndex - 1]);
                                nColumns := nColumns
                                    - LREAL_TO_DINT(DINT_TO_LREAL(cReachStep) * fBound - 0.499);
                            END_IF;
                        END_IF;
                    END_FOR;
                    IF nReach = 0 THEN nColumns := cMost; END_IF;
                    nReach := 0;
                    IF nColumns < nOld THEN nColumns := nOld; END_IF;
                END_IF;
                IF nColumns > cMost THEN nColumns := cMost; END_IF;
                nPhase := 3;
                nPart := 0;
            3: (* conditions of a mode: cosine, sine, both times the slot *)
                IF nPart = 0 THEN
                    FOR nIndex := 0 TO nLast - 1 DO
                        aE[nIndex] := 1.0;
                    END_FOR;
                END_IF;
                nRow := (4 * nPart + 1) * cColumns;
                fRe := 1.0;
                fIm := 0.0;
                fHalf := 0.5 * DINT_TO_LREAL(nColumns - 1);
                FOR nIndex := 0 TO nLast - 1 DO
                    fValue := (DINT_TO_LREAL(nIndex) - fHalf) / fHalf;
                    aE[nRow + nIndex] := fRe;
                    aE[nRow + cColumns + nIndex] := fIm;
                    aE[nRow + 2 * cColumns + nIndex] := fRe * fValue;
                    aE[nRow + 3 * cColumns + nIndex] := fIm * fValue;
                    fDelta := fRe * aTurnRe[nPart] - fIm * aTurnIm[nPart];
                    fIm := fRe * aTurnIm[nPart] + fIm * aTurnRe[nPart];
                    fRe := fDelta;
                END_FOR;
                nPart := nPart + 1;
                IF nPart >= cModes THEN
                    nPart := 0;
                    nPhase := 4;
                END_IF;
            4: (* what the committed future already does to the modes *)
                nRow := nPart * cColumns;
                aB[nPart] := 0.0;
                FOR nIndex := 0 TO nOld - 1 DO
                    aB[nPart] := aB[nPart] + aE[nRow + nIndex] * aOld[nIndex];
                END_FOR;
                nPart := nPart + 1;
                IF nPart >= cConditions THEN
                    nPart := 0;
                    nPhase := 5;
                    IF nJob > 1 THEN nPhase := 16; END_IF;
                END_IF;
            5: (* kernel: the weights of its conditions, a parabola *)
                fHalf := 0.5 * DINT_TO_LREAL(nColumns - 1);
                FOR nIndex := 0 TO nColumns - 1 DO
                    fValue := (DINT_TO_LREAL(nIndex) - fHalf) / (fHalf + 1.0);
                    aX[nIndex + 2] := 1.0 - fValue * fValue;
                END_FOR;
                nFirst := 0;
                nPhase := 6;
@programme
            17: (* the plan: as far as the target is, along the straight line from the old future *)
                fSum := 0.0;
                FOR nIndex := 2 TO nColumns + 1 DO
                    aX[nIndex] := aX[nIndex] + aDx[nIndex];
                    fSum := fSum + aX[nIndex];
                END_FOR;
                fSum := fSum - fOldSum;
                fShare := 1.0;
                IF fSum > fNeed THEN fShare := fNeed / fSum; END_IF;
                nPhase := 18;
            18: (* hold it against the limits *)
                bGood := fSum > 1.0E-9;
                fPath := fFinal - fSign * fScale * fSlot * fOldSum;
                fSquare := aX[1];
                fHalf := aX[0];
                FOR nIndex := 0 TO cColumns - 1 DO
                    fValue := 0.0;
                    IF nIndex < nColumns THEN fValue := aX[nIndex + 2]; END_IF;
                    fValue := aOld[nIndex] + fShare * (fValue - aOld[nIndex]);
                    IF nIndex < nLast + 2 THEN
                        IF NOT (ABS(fValue) <= cVelocity / fScale) THEN bGood := FALSE; END_IF;
                        IF NOT (ABS(fValue - fSquare) <= fRate / (1.0 - cInside)) THEN bGood := FALSE; END_IF;
                        IF NOT (ABS(fValue - 2.0 * fSquare + fHalf) <= fCurve / (1.0 - cInside)) THEN
                            bGood := FALSE;
                        END_IF;
                        fPath := fPath + fSign * fScale * fSlot * fValue;
                        IF NOT (fPath >= cTravelLow - 1.0E-10) OR NOT (fPath <= cTravelHigh + 1.0E-10) THEN
                            bGood := FALSE;
                        END_IF;
                    END_IF;
                    aPlan[nIndex] := fSign * fScale * fValue;
                    fHalf := fSquare;
                    fSquare := fValue;
                END_FOR;
                IF bGood AND ((fSum >= fNeed) OR (nJob = 3) OR (nColumns >= cMost)) THEN
                    bPlanned := TRUE;
                    IF (nJob = 2) AND (fSum >= fNeed) THEN fPath := fGoal; END_IF;
                ELSIF nColumns < cMost THEN
                    (* One slot more carries no farther than full speed does. *)
                    nOther := 1;
                    IF bGood AND (fNeed - fSum < 100.0) AND (nJob = 2) THEN
                        nOther := LREAL_TO_DINT(fNeed - fSum + 0.499);
                    END_IF;
                    IF NOT bGood THEN nOther := 3; END_IF;
                    IF nOther < 1 THEN nOther := 1; END_IF;
                    nColumns := nColumns + nOther;
                    IF nColumns > cMost THEN nColumns := cMost; END_IF;
                    nPart := 0;
                    nPhase := 3;
                ELSE
                    nJob := 0;
                    bSurrender := TRUE;
                    bStopPlanned := TRUE;
                END_IF;
        END_CASE;
    END_IF;
END_WHILE;
"""
