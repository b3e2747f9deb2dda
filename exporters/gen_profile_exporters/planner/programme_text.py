"""Phases of the planner block's planning that solve its linear programme.

By a primal-dual interior-point method (Mehrotra 1992, with a fixed centring); the normal matrix has five
diagonals, and the conditions enter by its Schur complement.
"""

PROGRAMME = """\
            6:
                nRow := nPart * cColumns;
                FOR nIndex := 0 TO nColumns - 1 DO
                    aY[nRow + nIndex] := aX[nIndex + 2] * aE[nRow + nIndex];
                END_FOR;
                FOR nOther := 0 TO nPart DO
                    fSum := 0.0;
                    FOR nIndex := 0 TO nColumns - 1 DO
                        fSum := fSum + aY[nRow + nIndex] * aE[nOther * cColumns + nIndex];
                    END_FOR;
                    aS[nPart * cConditions + nOther] := fSum;
                END_FOR;
                aMiss[nPart] := 0.0;
                nPart := nPart + 1;
                IF nPart >= nGiven THEN
                    nPart := 0;
                    aMiss[0] := 1.0;
                    nPhase := 7;
                END_IF;
            12: (* Schur complement, and by how much the conditions are missed *)
                nRow := nPart * cColumns;
                FOR nOther := 1 TO nPart DO
                    fSum := 0.0;
                    FOR nIndex := 0 TO nColumns - 1 DO
                        fSum := fSum + aY[nRow + nIndex] * aE[nOther * cColumns + nIndex];
                    END_FOR;
                    aS[nPart * cConditions + nOther] := fSum;
                END_FOR;
                fSum := -aB[nPart];
                FOR nIndex := 0 TO nColumns - 1 DO
                    fSum := fSum + aE[nRow + nIndex] * (aX[nIndex + 2] + aDx[nIndex + 2]);
                END_FOR;
                aMiss[nPart] := fSum;
                nPart := nPart + 1;
                IF nPart >= nGiven THEN
                    nPart := 0;
                    nPhase := 13;
                END_IF;
            7, 13: (* multipliers of the conditions (factors L D L'), and what follows from them *)
                nFirst := 0;
                IF nPhase = 13 THEN nFirst := 1; END_IF;
                FOR nRow := nFirst TO nGiven - 1 DO
                    FOR nOther := nFirst TO nRow - 1 DO
                        fSum := aS[nRow * cConditions + nOther];
                        FOR nIndex := nFirst TO nOther - 1 DO
                            fSum := fSum
                                - aS[nRow * cConditions + nIndex] * aS[nOther * cConditions + nIndex];
                        END_FOR;
                        aS[nRow * cConditions + nOther] := fSum;
                    END_FOR;
                    fSum := aS[nRow * cConditions + nRow];
                    FOR nOther := nFirst TO nRow - 1 DO
                        fValue := aS[nRow * cConditions + nOther] / aS[nOther * cConditions + nOther];
                        fSum := fSum - fValue * aS[nRow * cConditions + nOther];
                        aS[nRow * cConditions + nOther] := fValue;
                        aMiss[nRow] := aMiss[nRow] - fValue * aMiss[nOther];
                    END_FOR;
                    aS[nRow * cConditions + nRow] := fSum;
                END_FOR;
                FOR nTerm := nFirst TO nGiven - 1 DO
                    nRow := nGiven - 1 + nFirst - nTerm;
                    aMiss[nRow] := aMiss[nRow] / aS[nRow * cConditions + nRow];
                    FOR nOther := nRow + 1 TO nGiven - 1 DO
                        aMiss[nRow] := aMiss[nRow] - aS[nOther * cConditions + nRow] * aMiss[nOther];
                    END_FOR;
                END_FOR;
                IF nPhase = 7 THEN
                    (* The first kernel that never turns round and keeps the limits from 0 to full speed. *)
                    bGood := TRUE;
                    fDelta := 0.0;
                    FOR nIndex := 0 TO nColumns - 1 DO
                        fValue := 0.0;
                        FOR nOther := 0 TO nGiven - 1 DO
                            fValue := fValue + aMiss[nOther] * aY[nOther * cColumns + nIndex];
                        END_FOR;
                        aKernel[nIndex] := fValue;
                        IF NOT (fValue >= 0.0) THEN bGood := FALSE; END_IF;
                        IF nColumns < cLongKernel THEN
                            IF fValue > cRate * fSlot THEN bGood := FALSE; END_IF;
                            IF ABS(fValue - fDelta) > cCurve * fSlot * fSlot THEN bGood := FALSE; END_IF;
                        END_IF;
                        fDelta := fValue;
                    END_FOR;
                    nPhase := 30;
                    IF bGood OR (nColumns >= cLongestKernel) THEN
                        nKernel := nColumns;
                        FOR nIndex := 0 TO cConditions * cConditions - 1 DO
                            aFactors[nIndex] := aS[nIndex];
                        END_FOR;
                        bReady := TRUE;
                        bTaken := TRUE;
                        nUnmeasured := cAxes * cReaches;
                        nJob := 0;
                    END_IF;
                ELSE
                    FOR nOther := 1 TO nGiven - 1 DO
                        FOR nIndex := 0 TO nColumns - 1 DO
                            aDx[nIndex + 2] := aDx[nIndex + 2]
                                - aMiss[nOther] * aY[nOther * cColumns + nIndex];
                        END_FOR;
                    END_FOR;
                    nPhase := 14;
                    fStepX := 1.0;
                    fStepZ := 1.0;
                    IF nIteration > nEnough THEN nPhase := 17; END_IF;
                END_IF;
            16: (* where the search begins *)
                fHalf := 0.5 * DINT_TO_LREAL(nSlots - 1);
                fValue := fRate;
                IF fCurve < fValue THEN fValue := fCurve; END_IF;
                fValue := 0.075 * fValue * DINT_TO_LREAL(nSlots + 1);
                IF fValue > 0.3 THEN fValue := 0.3; END_IF;
                FOR nIndex := 0 TO nColumns - 1 DO
                    IF bMirror THEN
                        fDelta := (DINT_TO_LREAL(nIndex) - fHalf) / (fHalf + 1.0);
                        aX[nIndex + 2] := fValue * (1.0 - fDelta * fDelta);
                    ELSE
                        nOther := nIndex;
                        IF nIndex > nTied THEN nOther := nIndex + nMany - 1; END_IF;
                        aX[nIndex + 2] := 0.0;
                        IF nOther < nOld THEN
                            aX[nIndex + 2] := fSign * aFuture[nPlanRow + nOther + nAhead + 2] / fScale;
                        END_IF;
                    END_IF;
                END_FOR;
                aX[nColumns + 2] := 0.0;
                aX[nColumns + 3] := 0.0;
                FOR nIndex := 0 TO cWide - 1 DO
                    aDx[nIndex] := 0.0;
                END_FOR;
                FOR nIndex := 0 TO 3 * cWide - 1 DO
                    aWeight[nIndex] := 0.0;
                    aPush[nIndex] := 0.0;
                END_FOR;
                bUnfolded := FALSE;
                nIteration := 1;
                nEnough := cIterations;
                fLack := 0.0;
                IF NOT bMirror THEN
                    nIteration := 1 + cIterations - cWayIterations;
                    fLack := 1.0;
                END_IF;
                nPart := 0;
                nPhase := 19;
                fGap := 0.0;
            19: (* first slacks and multipliers of the bounds of a kind *)
@extent
                FOR nIndex := 2 TO nLast DO
                    nColumn := nPart * cWide + nIndex;
                    fHalf := 1.0;
                    IF nPart = 1 THEN
                        fValue := fRate;
                        IF (nIndex = nTied + 2) AND (bMirror OR (nMany > 1)) THEN
                            fDelta := fCurve;
                            IF bMirror AND (nMany = 1) THEN fDelta := 0.5 * fCurve; END_IF;
                            IF fDelta < fValue THEN fValue := fDelta; END_IF;
                        END_IF;
                        IF (nIndex = nTied + 3) AND (nMany > 1) AND (fCurve < fValue) THEN
                            fValue := fCurve;
                        END_IF;
                        fHalf := 1.0 / fValue;
                    END_IF;
                    IF nPart = 2 THEN fHalf := 1.0 / fCurve; END_IF;
                    aSteep[nColumn] := fHalf;
                    fValue := aX[nIndex];
                    IF nPart = 1 THEN fValue := aX[nIndex] - aX[nIndex - 1]; END_IF;
                    IF nPart = 2 THEN fValue := aX[nIndex] - 2.0 * aX[nIndex - 1] + aX[nIndex - 2]; END_IF;
                    fSlackA := 1.0 - fHalf * fValue;
                    fSlackB := 1.0 + fHalf * fValue;
                    IF nPart = 0 THEN
                        fSlackA := fUpper - fValue;
                        fSlackB := fValue - fLower;
                    END_IF;
                    aLackA[nColumn] := fSlackA;
                    aLackB[nColumn] := fSlackB;
                    IF NOT bMirror THEN
                        IF fSlackA < 0.3 THEN fSlackA := 0.3; END_IF;
                        IF fSlackB < 0.3 THEN fSlackB := 0.3; END_IF;
                    END_IF;
                    aLackA[nColumn] := aLackA[nColumn] - fSlackA;
                    aLackB[nColumn] := aLackB[nColumn] - fSlackB;
                    aSlackA[nColumn] := fSlackA;
                    aSlackB[nColumn] := fSlackB;
                    aPriceA[nColumn] := 0.1 / DINT_TO_LREAL(nColumns);
                    aPriceB[nColumn] := aPriceA[nColumn];
                    IF NOT bMirror THEN
                        aPriceA[nColumn] := aPriceA[nColumn] / fSlackA;
                        aPriceB[nColumn] := aPriceB[nColumn] / fSlackB;
                    END_IF;
                    fGap := fGap + aPriceA[nColumn] * fSlackA + aPriceB[nColumn] * fSlackB;
                END_FOR;
                nPart := nPart + 1;
                IF nPart > 2 THEN
                    nPart := 0;
                    nPhase := 8;
                END_IF;
            8: (* weights of the bounds of a kind *)
                IF nPart = 0 THEN fGap := cCentre * fGap / DINT_TO_LREAL(6 * nColumns + 6); END_IF;
@extent
                FOR nIndex := 2 TO nLast DO
                    nColumn := nPart * cWide + nIndex;
                    fSlackA := 1.0 / aSlackA[nColumn];
                    fSlackB := 1.0 / aSlackB[nColumn];
                    aRatioA[nColumn] := aPriceA[nColumn] * fSlackA;
                    aRatioB[nColumn] := aPriceB[nColumn] * fSlackB;
                    aTurnA[nColumn] := fGap * fSlackA;
                    aTurnB[nColumn] := fGap * fSlackB;
                    fHalf := aSteep[nColumn];
                    aWeight[nColumn] := fHalf * fHalf * (aRatioA[nColumn] + aRatioB[nColumn]);
                    fValue := aTurnA[nColumn] - aTurnB[nColumn];
                    IF fLack > 0.0 THEN
                        fValue := fValue - fLack
                            * (aRatioA[nColumn] * aLackA[nColumn] - aRatioB[nColumn] * aLackB[nColumn]);
                    END_IF;
                    aPush[nColumn] := fHalf * fValue;
                END_FOR;
                nPart := nPart + 1;
                IF nPart > 2 THEN
                    nPart := 0;
                    nPhase := 10;
                END_IF;
            10: (* normal matrix of five diagonals, its factors, and the right-hand side *)
                FOR nIndex := 2 TO nColumns + 1 DO
                    fValue := aE[nIndex - 2] / DINT_TO_LREAL(nSlots);
                    (* Of an axis that turns round, what comes first counts most. *)
                    IF bTurns AND NOT bMirror THEN
                        fValue := fValue * (1.5 - DINT_TO_LREAL(nIndex) / DINT_TO_LREAL(nColumns));
                    END_IF;
                    nRow := cWide + nIndex;
                    nOther := 2 * cWide + nIndex;
                    aH0[nIndex] := aWeight[nIndex] + aWeight[nRow] + aWeight[nRow + 1] + aWeight[nOther]
                        + 4.0 * aWeight[nOther + 1] + aWeight[nOther + 2];
                    aH1[nIndex] := -aWeight[nRow] - 2.0 * (aWeight[nOther] + aWeight[nOther + 1]);
                    aH2[nIndex] := aWeight[nOther];
                    aDx[nIndex] := fValue - aPush[nIndex] - aPush[nRow] + aPush[nRow + 1] - aPush[nOther]
                        + 2.0 * aPush[nOther + 1] - aPush[nOther + 2];
                    IF nIndex > 3 THEN
                        fDelta := aH2[nIndex];
                        aH2[nIndex] := fDelta / aH0[nIndex - 2];
                        aH1[nIndex] := aH1[nIndex] - fDelta * aH1[nIndex - 1];
                        aH0[nIndex] := aH0[nIndex] - fDelta * aH2[nIndex];
                    END_IF;
                    IF nIndex > 2 THEN
                        fDelta := aH1[nIndex];
                        aH1[nIndex] := fDelta / aH0[nIndex - 1];
                        aH0[nIndex] := aH0[nIndex] - fDelta * aH1[nIndex];
                    END_IF;
                END_FOR;
                nPart := 0;
                IF bUnfolded THEN
                    FOR nIndex := 2 TO nColumns + 1 DO
                        aDx[nIndex] := 0.0;
                    END_FOR;
                    nPart := 1;
                END_IF;
                nPhase := 11;
            11: (* solve for the right-hand side, then for each condition *)
                IF nPart > 0 THEN
                    nRow := nPart * cColumns;
                    FOR nIndex := 0 TO nColumns - 1 DO
                        aWork[nIndex + 2] := aE[nRow + nIndex];
                    END_FOR;
                ELSE
                    FOR nIndex := 2 TO nColumns + 1 DO
                        aWork[nIndex] := aDx[nIndex];
                    END_FOR;
                END_IF;
                aWork[3] := aWork[3] - aH1[3] * aWork[2];
                FOR nIndex := 4 TO nColumns + 1 DO
                    aWork[nIndex] := aWork[nIndex] - aH1[nIndex] * aWork[nIndex - 1]
                        - aH2[nIndex] * aWork[nIndex - 2];
                END_FOR;
                aWork[nColumns + 1] := aWork[nColumns + 1] / aH0[nColumns + 1];
                aWork[nColumns] := aWork[nColumns] / aH0[nColumns] - aH1[nColumns + 1] * aWork[nColumns + 1];
                FOR nTerm := 3 TO nColumns DO
                    nIndex := nColumns + 2 - nTerm;
                    aWork[nIndex] := aWork[nIndex] / aH0[nIndex] - aH1[nIndex + 1] * aWork[nIndex + 1]
                        - aH2[nIndex + 2] * aWork[nIndex + 2];
                END_FOR;
                FOR nIndex := 2 TO nColumns + 1 DO
                    IF nPart > 0 THEN
                        aY[nRow + nIndex - 2] := aWork[nIndex];
                    ELSE
                        aDx[nIndex] := aWork[nIndex];
                    END_IF;
                END_FOR;
                nPart := nPart + 1;
                IF nPart >= nGiven THEN
                    nPart := 1;
                    nPhase := 12;
                END_IF;
            14: (* how far the step may go *)
@extent
                FOR nIndex := 2 TO nLast DO
                    nColumn := nPart * cWide + nIndex;
                    fDelta := aDx[nIndex];
                    IF nPart = 1 THEN fDelta := aDx[nIndex] - aDx[nIndex - 1]; END_IF;
                    IF nPart = 2 THEN fDelta := aDx[nIndex] - 2.0 * aDx[nIndex - 1] + aDx[nIndex - 2]; END_IF;
                    fSlackB := aSteep[nColumn] * fDelta;
                    fSlackA := -fSlackB;
                    IF fLack > 0.0 THEN
                        fSlackA := fSlackA + fLack * aLackA[nColumn];
                        fSlackB := fSlackB + fLack * aLackB[nColumn];
                    END_IF;
                    aStepA[nColumn] := fSlackA;
                    aStepB[nColumn] := fSlackB;
                    IF -fSlackA * fStepX > aSlackA[nColumn] THEN
                        fStepX := -aSlackA[nColumn] / fSlackA;
                    END_IF;
                    IF -fSlackB * fStepX > aSlackB[nColumn] THEN
                        fStepX := -aSlackB[nColumn] / fSlackB;
                    END_IF;
                    fDelta := aTurnA[nColumn] - aPriceA[nColumn] - aRatioA[nColumn] * fSlackA;
                    IF -fDelta * fStepZ > aPriceA[nColumn] THEN fStepZ := -aPriceA[nColumn] / fDelta; END_IF;
                    aTurnA[nColumn] := fDelta;
                    fDelta := aTurnB[nColumn] - aPriceB[nColumn] - aRatioB[nColumn] * fSlackB;
                    IF -fDelta * fStepZ > aPriceB[nColumn] THEN fStepZ := -aPriceB[nColumn] / fDelta; END_IF;
                    aTurnB[nColumn] := fDelta;
                END_FOR;
                nPart := nPart + 1;
                IF nPart > 2 THEN
                    nPart := 0;
                    nPhase := 15;
                    fStepX := cStep * fStepX;
                    fStepZ := cStep * fStepZ;
                    fGap := 0.0;
                END_IF;
            15: (* take it *)
@extent
                FOR nIndex := 2 TO nLast DO
                    nColumn := nPart * cWide + nIndex;
                    aPriceA[nColumn] := aPriceA[nColumn] + fStepZ * aTurnA[nColumn];
                    aPriceB[nColumn] := aPriceB[nColumn] + fStepZ * aTurnB[nColumn];
                    aSlackA[nColumn] := aSlackA[nColumn] + fStepX * aStepA[nColumn];
                    aSlackB[nColumn] := aSlackB[nColumn] + fStepX * aStepB[nColumn];
                    fGap := fGap + aSlackA[nColumn] * aPriceA[nColumn] + aSlackB[nColumn] * aPriceB[nColumn];
                END_FOR;
                nPart := nPart + 1;
                IF nPart > 2 THEN
                    FOR nIndex := 2 TO nColumns + 1 DO
                        aX[nIndex] := aX[nIndex] + fStepX * aDx[nIndex];
                        aDx[nIndex] := 0.0;
                    END_FOR;
                    fLack := fLack * (1.0 - fStepX);
                    nIteration := nIteration + 1;
                    nPart := 0;
                    nPhase := 8;
                    IF nIteration > nEnough THEN
                        nPhase := 12;
                        nPart := 1;
                        IF bMirror AND bDamped THEN nPhase := 20; END_IF;
                    END_IF;
                END_IF;
            20: (* damping tells the halves apart: the last projection takes both *)
                FOR nRow := 0 TO 2 DO
                    FOR nIndex := nColumns TO 2 * nTied + nRow DO
                        nOther := nRow * cWide + 2 * nTied + nRow - nIndex + 2;
                        nColumn := nRow * cWide + nIndex + 2;
                        aWeight[nColumn] := aWeight[nOther];
                        IF (nRow = 2) AND (nIndex = nColumns) THEN aWeight[nColumn] := 0.0; END_IF;
                        IF nRow = 0 THEN aX[nColumn] := aX[nOther]; END_IF;
                    END_FOR;
                END_FOR;
                bMirror := FALSE;
                bUnfolded := TRUE;
                nPhase := 4;
"""

EXTENT = """\
nLast := nColumns + 1;
IF NOT bMirror THEN nLast := nLast + nPart; END_IF;
"""
