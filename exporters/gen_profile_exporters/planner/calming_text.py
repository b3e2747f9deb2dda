"""Phases of the planner block's planning that calm what sways since live parameters changed on the way.

The block follows the linear machine of now, `sway'' = acceleration - matrix * sway`, cycle by cycle, and its
slope by the logarithm of the frequencies, `slope'' = -matrix * (slope + 2 sway)`: what is unknown of them
changes sway and slope alike along all that was driven, so it adds up where the slope is not known. With the
left eigenvectors l of the matrix a mode is l * sway; what it will be left with by the committed future is a
sum over its coefficients, as of a plan, and so is its slope. A pulse that ends where it begins and leaves the
opposite of both takes them away: of the kernel's shape, by the factors of the kernel's conditions.
"""

CALMING = """\
            40: (* what is left in the modes without the coming slots, in units of their coefficients *)
                FOR nMode := 0 TO cModes - 1 DO
                    fRe := aTurnRe[nMode];
                    fIm := aTurnIm[nMode];
                    fSquare := aFrequency[nMode] * aFrequency[nMode];
                    fSlackA := 1.0;
                    fSlackB := 0.0;
                    IF cModes > 1 THEN
                        fHalf := fSquare - aMatrix[0] + aMatrix[cModes * (cModes - 1)];
                        fSlackA := aMatrix[cModes * (cModes - 1)] / fHalf;
                        fSlackB := (fSquare - aMatrix[0]) / fHalf;
                    END_IF;
                    FOR nIndex := 0 TO 3 DO
                        aLook[nIndex] := fSlackA * aSwayAt[nIndex * cModes]
                            + fSlackB * aSwayAt[(nIndex + 1) * cModes - 1];
                    END_FOR;
                    (* Of the acceleration, a sum of hats: the second half of one, and whole ones. *)
                    fBound := 1.0 / aFrequency[nMode];
                    fSquare := 1.0 / (fSquare * fSlot);
                    fHalf := 2.0 * (1.0 - fRe) * fSquare;
                    fValue := (aFuture[nPlanRow + 1] - aFuture[nPlanRow]) / fSlot;
                    fSum := aFrequency[nMode] * aLook[0] + (fIm * fSquare - fBound) * fValue;
                    fSlackA := aLook[3] + (fIm * fBound - fHalf) * fValue;
                    fSlackB := aFrequency[nMode] * (aLook[0] + aLook[2])
                        + ((1.0 + fRe) * fBound - 2.0 * fIm * fSquare) * fValue;
                    fDelta := aLook[1] + 0.5 * fHalf * fValue;
                    (* The same of the slope; the hats' own depends on the frequency, too. *)
                    fBound := aFrequency[nMode] * fSlot;
                    fValue := fBound * fIm / (1.0 - fRe) - 2.0;
                    fSlackA := fSlackA - fValue * fDelta - fBound * fSum;
                    fSlackB := fSlackB - fValue * fSum + fBound * fDelta;
                    fValue := fSlot / fHalf;
                    aLeftRe[nMode] := fValue * (fDelta * fRe - fSum * fIm);
                    aLeftIm[nMode] := fValue * (fSum * fRe + fDelta * fIm);
                    aSlopeRe[nMode] := fValue * (fSlackA * fRe - fSlackB * fIm);
                    aSlopeIm[nMode] := fValue * (fSlackB * fRe + fSlackA * fIm);
                END_FOR;
                nAt := nFuture - 1;
                nMany := 0;
                nPart := 0;
                nPhase := 41;
            41: (* and with them, the last one first; from steps of the velocity to the velocity *)
                fRe := aTurnRe[nPart];
                fIm := aTurnIm[nPart];
                IF nAt = nFuture - 1 THEN
                    fWaveRe := 0.0;
                    fWaveIm := 0.0;
                    fLateRe := 0.0;
                    fLateIm := 0.0;
                END_IF;
                fBound := -1.0;
                IF bOutdated THEN fBound := 1.0E-6 * cVelocity[nPlanAxis]; END_IF;
                nLast := nAt - cChunk;
                IF nLast < 0 THEN nLast := 0; END_IF;
                WHILE nAt > nLast DO
                    nIndex := nPlanRow + nAt + 1;
                    nAt := nAt - 1;
                    fDelta := aFuture[nIndex] - aFuture[nIndex - 1];
                    nMany := nMany + 1;
                    IF ABS(fDelta) > fBound THEN nMany := 0; END_IF;
                    IF nMany > 1 THEN (* what comes after a while of one velocity is calmed then *)
                        fWaveRe := 0.0;
                        fWaveIm := 0.0;
                        fLateRe := 0.0;
                        fLateIm := 0.0;
                    END_IF;
                    fValue := fWaveRe * fRe + fWaveIm * fIm;
                    fWaveIm := fWaveIm * fRe - fWaveRe * fIm;
                    fWaveRe := fValue + fDelta;
                    fSum := fLateRe * fRe + fLateIm * fIm;
                    fLateIm := fLateIm * fRe - fLateRe * fIm + fWaveIm;
                    fLateRe := fSum + fValue;
                END_WHILE;
                IF nAt <= 0 THEN
                    fHalf := aFrequency[nPart] * fSlot;
                    fValue := 0.5 * fIm / (1.0 - fRe);
                    fWaveRe := aLeftRe[nPart] + fWaveRe;
                    fWaveIm := aLeftIm[nPart] + fWaveIm;
                    aLeftRe[nPart] := 0.5 * fWaveRe + fValue * fWaveIm;
                    aLeftIm[nPart] := 0.5 * fWaveIm - fValue * fWaveRe;
                    fWaveRe := aSlopeRe[nPart]
                        + fHalf * (fLateIm + fRe * aLeftIm[nPart] - fIm * aLeftRe[nPart]);
                    fWaveIm := aSlopeIm[nPart]
                        - fHalf * (fLateRe + fRe * aLeftRe[nPart] + fIm * aLeftIm[nPart]);
                    aSlopeRe[nPart] := 0.5 * fWaveRe + fValue * fWaveIm;
                    aSlopeIm[nPart] := 0.5 * fWaveIm - fValue * fWaveRe;
                    nAt := nFuture - 1;
                    nMany := 0;
                    nPart := nPart + 1;
                    IF nPart >= cModes THEN nPhase := 42; END_IF;
                END_IF;
            42: (* weights of the pulse's conditions *)
                fLeft := 0.0;
                aMiss[0] := 0.0;
                FOR nMode := 0 TO cModes - 1 DO
                    fRe := aTurnRe[nMode];
                    fIm := aTurnIm[nMode];
                    fHalf := aFrequency[nMode] * fSlot;
                    fValue := 2.0 * (1.0 - fRe) / fHalf;
                    fWaveRe := aLeftRe[nMode];
                    fWaveIm := aLeftIm[nMode];
                    fLateRe := aSlopeRe[nMode];
                    fLateIm := aSlopeIm[nMode];
                    fLeft := fLeft + fValue * fValue / (aFrequency[nMode] * SQRT(2.0 * (1.0 - fRe)))
                        * SQRT(fWaveRe * fWaveRe + fWaveIm * fWaveIm
                        + cDoubt * cDoubt * (fLateRe * fLateRe + fLateIm * fLateIm));
                    IF nState = 2 THEN (* it begins one slot later *)
                        fSum := fLateRe - fHalf * fWaveIm;
                        fDelta := fLateIm + fHalf * fWaveRe;
                        fLateRe := fSum * fRe - fDelta * fIm;
                        fLateIm := fSum * fIm + fDelta * fRe;
                        fValue := fWaveRe * fRe - fWaveIm * fIm;
                        fWaveIm := fWaveRe * fIm + fWaveIm * fRe;
                        fWaveRe := fValue;
                    END_IF;
                    fHalf := 1.0 / (fHalf * 0.5 * DINT_TO_LREAL(nKernel - 1));
                    nRow := 4 * nMode + 1;
                    aMiss[nRow] := -fWaveRe;
                    aMiss[nRow + 1] := fWaveIm;
                    aMiss[nRow + 2] := fWaveRe + fHalf * fLateIm;
                    aMiss[nRow + 3] := fHalf * fLateRe - fWaveIm;
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

FORGET = """\
            bSways := FALSE;
            nFresh := cFresh;
            FOR nIndex := 0 TO cAxes - 1 DO
                aAccelerationBefore[nIndex] := 0.0;
            END_FOR;
            FOR nIndex := 0 TO 12 * cAxes * cModes - 1 DO
                aSway[nIndex] := 0.0;
            END_FOR;
"""

MATRIX = """\
                FOR nIndex := 0 TO cModes * cModes - 1 DO
                    aMatrix[nIndex] := aModel[2 * cModes + nIndex];
                END_FOR;
"""

LOOK = """\
    ELSIF bLook THEN
        nJob := 5;
        nPhase := 40;
        nCalmAxis := nCalmAxis + 1;
        IF nCalmAxis >= cAxes THEN nCalmAxis := 0; END_IF;
        nPlanAxis := nCalmAxis;
        nPlanRow := nPlanAxis * cFuture;
        nAhead := 0;
        bLooked := TRUE;
        bPlanned := FALSE;
        FOR nIndex := 0 TO 2 * cModes - 1 DO
            nBase := 12 * cModes * nPlanAxis;
            aSwayAt[nIndex] := aSway[nBase + nIndex];
            aSwayAt[nIndex + 2 * cModes] := aSway[nBase + 6 * cModes + nIndex];
        END_FOR;
"""

RENEW = """\
(* The matrix of the machine followed is renewed every few cycles, where there is room. *)
nFresh := nFresh + 1;
nCost := (cLives + 2 * (cRows - 2 * cModes)) * cTerms + (4 * cDegrees + 10) * cLives;
IF bReady AND bLiveGood AND (nState > 0) AND (nFresh >= cFresh) AND (nWork + nCost <= cWork) THEN
    nFresh := 0;
    nWork := nWork + nCost;
    nFirst := 2 * cModes;
@model
END_IF;
"""

FOLLOW = """\
(* What the loads do: a Taylor step of the machine of now, and of its slope by the frequencies. *)
IF nState > 0 THEN
    bSways := FALSE;
    FOR nAxis := 0 TO cAxes - 1 DO
        fDelta := (aAcceleration[nAxis] - aAccelerationBefore[nAxis]) / cCycle;
        FOR nPair := 0 TO 1 DO
            nBase := (12 * nAxis + 6 * nPair) * cModes;
            FOR nIndex := 0 TO 4 * cModes - 1 DO
                nRow := nIndex - nIndex / cModes * cModes;
                nColumn := nBase + nIndex;
                fValue := 0.0;
                IF nIndex < cModes THEN
                    fValue := aAccelerationBefore[nAxis];
                ELSIF nIndex < 2 * cModes THEN
                    fValue := fDelta;
                END_IF;
                IF nPair = 1 THEN fValue := 2.0 * (aSway[nColumn - 4 * cModes] - fValue); END_IF;
                FOR nOther := 0 TO cModes - 1 DO
                    fValue := fValue
                        - aModel[(2 + nRow) * cModes + nOther] * aSway[nColumn - nRow + nOther];
                END_FOR;
                aSway[nColumn + 2 * cModes] := fValue;
            END_FOR;
            FOR nColumn := nBase TO nBase + cModes - 1 DO
                FOR nOther := 0 TO 1 DO
                    fValue := 0.0;
                    nRow := 5 - nOther;
                    WHILE nRow > 0 DO
                        fValue := cCycle / DINT_TO_LREAL(nRow)
                            * (aSway[nColumn + (nOther + nRow) * cModes] + fValue);
                        nRow := nRow - 1;
                    END_WHILE;
                    nRow := nColumn + nOther * cModes;
                    aSway[nRow] := aSway[nRow] + fValue;
                END_FOR;
            END_FOR;
        END_FOR;
        FOR nColumn := nBase TO nBase + cModes - 1 DO
            fValue := 0.0;
            FOR nOther := 0 TO 1 DO
                nRow := nColumn + nOther * cModes;
                fPath := aSway[nRow - 6 * cModes] * aSway[nRow - 6 * cModes]
                    + cDoubt * cDoubt * aSway[nRow] * aSway[nRow];
                IF nOther = 1 THEN fPath := fPath / (aFrequency[0] * aFrequency[0]); END_IF;
                fValue := fValue + fPath;
            END_FOR;
            IF fValue > cCalm * cCalm THEN bSways := bReady AND bSettled; END_IF;
        END_FOR;
        aAccelerationBefore[nAxis] := aAcceleration[nAxis];
    END_FOR;
END_IF;
"""

FOLLOWED = """\

    (* The machine followed: what sways where live parameters change on the way, and a pulse that takes it. *)
    aMatrix : ARRAY [0..@last_matrix] OF LREAL; (* as the modes were taken over *)
    nFresh : DINT; (* cycles since that of now was renewed *)
    (* Of each axis the sway of the loads in m with five time derivatives, then its slope by the logarithm of
       the frequencies with as many. *)
    aSway : ARRAY [0..@last_sway] OF LREAL;
    nPair : DINT; (* 0 sway, 1 slope *)
    aSwayAt : ARRAY [0..@last_look] OF LREAL; (* sway, its rate, slope and its rate where the slot begins *)
    aLook : ARRAY [0..3] OF LREAL; (* the same of a mode *)
    aLeftRe : ARRAY [0..@last_mode] OF LREAL; (* m/s: what the committed future leaves in a mode *)
    aLeftIm : ARRAY [0..@last_mode] OF LREAL;
    aSlopeRe : ARRAY [0..@last_mode] OF LREAL; (* its slope *)
    aSlopeIm : ARRAY [0..@last_mode] OF LREAL;
    fLateRe : LREAL; (* steps by their times *)
    fLateIm : LREAL;
    aAccelerationBefore : ARRAY [0..@last_axis] OF LREAL;
    fLeft : LREAL; (* m, all modes together, with the slope by the stated errors *)
"""

NEXT_JOB = """\

(* Where nothing is to be planned: the machine of the live parameters of now, and what its plans reach. *)
IF bNew AND ((nState = 1) OR (nState = 2)) AND ((nJob = 0) OR (bMeasured AND (nJob = 4))) THEN
    bLook := cFollows AND bReady AND bSettled AND NOT bCalming AND ((nState = 2) OR bSways);
    IF bLiveGood AND (bStale OR NOT bReady) AND (bMeasured OR (nUnmeasured = 0) OR bLook OR bWaits)
        AND (bLooked OR NOT bLook) THEN
        nJob := 1;
        nPhase := 1;
        bLooked := FALSE;
        bPlanned := FALSE;
@look
    ELSIF (nState = 1) AND (nJob = 0) AND (nUnmeasured > 0) THEN
        nJob := 4;
        nPlanAxis := nReachAxis;
        nSized := cAxes - 1;
        nPhase := 2;
        bPlanned := FALSE;
    END_IF;
END_IF;
@renew
IF (nState = 2) AND bNew THEN
    FOR nAxis := 0 TO cAxes - 1 DO
        nBase := nAxis * cFuture;
        aFrom[nAxis] := aFinal[nAxis]
            - fSlot * (aFuture[nBase] / 6.0 + 5.0 * aFuture[nBase + 1] / 6.0 + aRest[nAxis]);
    END_FOR;
END_IF;
"""
