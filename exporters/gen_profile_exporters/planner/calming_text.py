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
                        fHalf := fSquare - aMatrix[0] + aMatrix[2];
                        fSum := (aMatrix[2] * aSwayAt[0]
                            + (fSquare - aMatrix[0]) * aSwayAt[cModes - 1]) / fHalf;
                        fDelta := (aMatrix[2] * aSwayRateAt[0]
                            + (fSquare - aMatrix[0]) * aSwayRateAt[cModes - 1]) / fHalf;
                    END_IF;
                    (* Of the acceleration, a sum of hats: the first half of one, and a whole one. *)
                    fSquare := 1.0 / (aFrequency[nMode] * aFrequency[nMode] * fSlot);
                    fHalf := 2.0 * (1.0 - fRe) * fSquare;
                    fValue := (aFuture[1] - aFuture[0]) / fSlot;
                    fDelta := fDelta + 0.5 * fHalf * fValue - fHalf / fSlot * aFuture[1] * fRe;
                    fSum := aFrequency[nMode] * fSum + (fIm * fSquare - 1.0 / aFrequency[nMode]) * fValue
                        + fHalf / fSlot * aFuture[1] * fIm;
                    fValue := fSlot / (fHalf * 2.0 * (1.0 - fRe));
                    aLeftRe[nMode] := fValue * (fDelta * (fRe - 1.0) + fSum * fIm);
                    aLeftIm[nMode] := fValue * (fSum * (fRe - 1.0) - fDelta * fIm);
                END_FOR;
                nPart := 0;
                nPhase := 41;
            41: (* and with them *)
                fRe := aTurnRe[nPart];
                fIm := aTurnIm[nPart];
                fWaveRe := fRe * fRe - fIm * fIm;
                fWaveIm := -2.0 * fRe * fIm;
                FOR nIndex := 2 TO nFuture - 1 DO
                    aLeftRe[nPart] := aLeftRe[nPart] + aFuture[nIndex] * fWaveRe;
                    aLeftIm[nPart] := aLeftIm[nPart] + aFuture[nIndex] * fWaveIm;
                    fValue := fWaveRe * fRe + fWaveIm * fIm;
                    fWaveIm := fWaveIm * fRe - fWaveRe * fIm;
                    fWaveRe := fValue;
                END_FOR;
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
                    (* It begins one slot later than this one, or at once. *)
                    fWaveRe := fRe * fRe - fIm * fIm;
                    fWaveIm := 2.0 * fRe * fIm;
                    IF nState = 2 THEN
                        fValue := fWaveRe * fRe - fWaveIm * fIm;
                        fWaveIm := fWaveRe * fIm + fWaveIm * fRe;
                        fWaveRe := fValue;
                    END_IF;
                    nRow := 4 * nMode + 1;
                    aMiss[nRow] := -(aLeftRe[nMode] * fWaveRe - aLeftIm[nMode] * fWaveIm);
                    aMiss[nRow + 1] := aLeftRe[nMode] * fWaveIm + aLeftIm[nMode] * fWaveRe;
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
