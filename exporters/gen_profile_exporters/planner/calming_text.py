"""Phases of the planner block's planning that calm what sways since live parameters changed on the way.

The block follows the linear machine of now, `sway'' = acceleration - matrix * sway`, cycle by cycle. With
the left eigenvectors l of the matrix a mode is l * sway; what it will be left with by the committed future is
a sum over its coefficients, as of a plan. A pulse that ends where it begins and leaves the opposite takes it
away: of the kernel's shape, by the factors of the kernel's conditions.
"""

CALMING = """\
            40: (* what is left in the modes without the coming slots, in units of their coefficients *)
                FOR nMode := 0 TO cModes - 1 DO
                    fRe := aTurnRe[nMode];
                    fIm := aTurnIm[nMode];
                    fSum := aSwayAt[0];
                    fDelta := aSwayRateAt[0];
                    IF cModes > 1 THEN
                        fSquare := aFrequency[nMode] * aFrequency[nMode];
                        fHalf := fSquare - aMatrix[0] + aMatrix[cModes * (cModes - 1)];
                        fSum := (aMatrix[cModes * (cModes - 1)] * aSwayAt[0]
                            + (fSquare - aMatrix[0]) * aSwayAt[cModes - 1]) / fHalf;
                        fDelta := (aMatrix[cModes * (cModes - 1)] * aSwayRateAt[0]
                            + (fSquare - aMatrix[0]) * aSwayRateAt[cModes - 1]) / fHalf;
                    END_IF;
                    (* Of the acceleration, a sum of hats: the second half of one, and whole ones. *)
                    fSquare := 1.0 / (aFrequency[nMode] * aFrequency[nMode] * fSlot);
                    fHalf := 2.0 * (1.0 - fRe) * fSquare;
                    fValue := (aFuture[nPlanRow + 1] - aFuture[nPlanRow]) / fSlot;
                    fDelta := fDelta + 0.5 * fHalf * fValue;
                    fSum := aFrequency[nMode] * fSum + (fIm * fSquare - 1.0 / aFrequency[nMode]) * fValue;
                    fValue := fSlot / fHalf;
                    aLeftRe[nMode] := fValue * (fDelta * fRe - fSum * fIm);
                    aLeftIm[nMode] := fValue * (fSum * fRe + fDelta * fIm);
                END_FOR;
                nPart := 0;
                nPhase := 41;
            41: (* and with them; from steps of the velocity to the velocity *)
                fRe := aTurnRe[nPart];
                fIm := aTurnIm[nPart];
                fWaveRe := 0.0;
                fWaveIm := 0.0;
                fBound := -1.0;
                IF bOutdated THEN fBound := 1.0E-6 * cVelocity[0]; END_IF;
                nOther := 0;
                FOR nTerm := 2 TO nFuture DO
                    nIndex := nPlanRow + nFuture + 2 - nTerm;
                    fDelta := aFuture[nIndex] - aFuture[nIndex - 1];
                    nOther := nOther + 1;
                    IF ABS(fDelta) > fBound THEN nOther := 0; END_IF;
                    IF nOther > 1 THEN (* what comes after a while of one velocity is calmed then *)
                        fWaveRe := 0.0;
                        fWaveIm := 0.0;
                    END_IF;
                    fValue := fWaveRe * fRe + fWaveIm * fIm + fDelta;
                    fWaveIm := fWaveIm * fRe - fWaveRe * fIm;
                    fWaveRe := fValue;
                END_FOR;
                fWaveRe := aLeftRe[nPart] + fWaveRe;
                fWaveIm := aLeftIm[nPart] + fWaveIm;
                fValue := 0.5 * fIm / (1.0 - fRe);
                aLeftRe[nPart] := 0.5 * fWaveRe + fValue * fWaveIm;
                aLeftIm[nPart] := 0.5 * fWaveIm - fValue * fWaveRe;
                nPart := nPart + 1;
                IF nPart >= cModes THEN nPhase := 42; END_IF;
            42: (* weights of the pulse's conditions *)
                fLeft := 0.0;
                aMiss[0] := 0.0;
                FOR nMode := 0 TO cModes - 1 DO
                    fRe := aTurnRe[nMode];
                    fIm := aTurnIm[nMode];
                    fValue := 2.0 * (1.0 - fRe) / (fSlot * aFrequency[nMode]);
                    fLeft := fLeft + SQRT(2.0 * (1.0 - fRe) * (aLeftRe[nMode] * aLeftRe[nMode]
                        + aLeftIm[nMode] * aLeftIm[nMode])) * fValue * fValue
                        / (2.0 * (1.0 - fRe) * aFrequency[nMode]);
                    fWaveRe := aLeftRe[nMode];
                    fWaveIm := aLeftIm[nMode];
                    IF nState = 2 THEN (* it begins one slot later *)
                        fValue := fWaveRe * fRe - fWaveIm * fIm;
                        fWaveIm := fWaveRe * fIm + fWaveIm * fRe;
                        fWaveRe := fValue;
                    END_IF;
                    nRow := 4 * nMode + 1;
                    aMiss[nRow] := -fWaveRe;
                    aMiss[nRow + 1] := fWaveIm;
                    aMiss[nRow + 2] := 0.0;
                    aMiss[nRow + 3] := 0.0;
                END_FOR;
                FOR nRow := 1 TO cConditions - 1 DO
                    FOR nOther := 0 TO nRow - 1 DO
                        aMiss[nRow] := aMiss[nRow] - aFactors[nRow * cConditions + nOther] * aMiss[nOther];
                    END_FOR;
                END_FOR;
                FOR nTerm := 1 TO cConditions DO
                    nRow := cConditions - nTerm;
                    aMiss[nRow] := aMiss[nRow] / aFactors[nRow * cConditions + nRow];
                    FOR nOther := nRow + 1 TO cConditions - 1 DO
                        aMiss[nRow] := aMiss[nRow] - aFactors[nOther * cConditions + nRow] * aMiss[nOther];
                    END_FOR;
                END_FOR;
                nPart := 0;
                nPhase := 43;
                IF fLeft <= 0.5 * cCalm THEN nJob := 0; END_IF;
            43: (* the pulse *)
                fHalf := 0.5 * DINT_TO_LREAL(nKernel - 1);
                FOR nIndex := 0 TO nKernel - 1 DO
                    aCalming[nIndex] := aMiss[0];
                END_FOR;
                FOR nMode := 0 TO cModes - 1 DO
                    fWaveRe := 1.0;
                    fWaveIm := 0.0;
                    nRow := 4 * nMode + 1;
                    FOR nIndex := 0 TO nKernel - 1 DO
                        fValue := (DINT_TO_LREAL(nIndex) - fHalf) / fHalf;
                        aCalming[nIndex] := aCalming[nIndex]
                            + (aMiss[nRow] + fValue * aMiss[nRow + 2]) * fWaveRe
                            + (aMiss[nRow + 1] + fValue * aMiss[nRow + 3]) * fWaveIm;
                        fValue := fWaveRe * aTurnRe[nMode] - fWaveIm * aTurnIm[nMode];
                        fWaveIm := fWaveRe * aTurnIm[nMode] + fWaveIm * aTurnRe[nMode];
                        fWaveRe := fValue;
                    END_FOR;
                END_FOR;
                FOR nIndex := 0 TO nKernel - 1 DO
                    fValue := (DINT_TO_LREAL(nIndex) - fHalf) / (fHalf + 1.0);
                    aCalming[nIndex] := aCalming[nIndex] * (1.0 - fValue * fValue);
                END_FOR;
                nJob := 0;
                bCalming := TRUE;
"""

FOLLOWING = """\

(* Where nothing is to be planned: the machine of the live parameters of now, and what its plans reach. *)
IF bNew AND ((nState = 1) OR (nState = 2)) AND ((nJob = 0) OR (bMeasured AND (nJob = 4))) THEN
    bLook := cFollows AND bReady AND bSettled AND NOT bCalming AND ((nState = 2) OR bSways);
    IF bLiveGood AND (bStale OR NOT bReady) AND (bMeasured OR (nUnmeasured = 0) OR bLook OR bWaits)
        AND (bLooked OR NOT bLook) THEN
        nJob := 1;
        nPhase := 1;
        bLooked := FALSE;
        bPlanned := FALSE;
    ELSIF bLook THEN
        nJob := 5;
        nPhase := 40;
        nPlanAxis := 0;
        nPlanRow := 0;
        nAhead := 0;
        bLooked := TRUE;
        bPlanned := FALSE;
        FOR nIndex := 0 TO cModes - 1 DO
            aSwayAt[nIndex] := aSway[nIndex];
            aSwayRateAt[nIndex] := aSwayRate[nIndex];
        END_FOR;
    ELSIF (nState = 1) AND (nJob = 0) AND (nUnmeasured > 0) THEN
        nJob := 4;
        nPlanAxis := nReachAxis;
        nSized := cAxes - 1;
        nPhase := 2;
        bPlanned := FALSE;
    END_IF;
END_IF;
(* The matrix of the machine followed is renewed every few cycles, where there is room. *)
nFresh := nFresh + 1;
nCost := (cLives + 2 * (cRows - 2 * cModes)) * cTerms + (4 * cDegrees + 10) * cLives;
IF cFollows AND bReady AND bLiveGood AND (nState > 0) AND (nFresh >= cFresh) AND (nWork + nCost <= cWork) THEN
    nFresh := 0;
    nWork := nWork + nCost;
    nFirst := 2 * cModes;
@model
END_IF;
IF (nState = 2) AND bNew THEN
    FOR nAxis := 0 TO cAxes - 1 DO
        nBase := nAxis * cFuture;
        aFrom[nAxis] := aFinal[nAxis]
            - fSlot * (aFuture[nBase] / 6.0 + 5.0 * aFuture[nBase + 1] / 6.0 + aRest[nAxis]);
    END_FOR;
END_IF;
"""
