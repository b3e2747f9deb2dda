"""Statements of the planner block that begin a plan: which way is left, from which slot on, over how many.

A plan that takes longer than the motion lasts comes too late; one over too few slots does not get there.
"""

REQUEST = """\
            2: (* what is planned, from which slot on *)
                bPlanned := FALSE;
                nPlanRow := nPlanAxis * cFuture;
                nPlanReach := nPlanAxis * cReaches;
                bMirror := nState <> 2;
                bUnfolded := FALSE;
                bScaled := FALSE;
                IF (nSized = 0) OR (nJob = 4) THEN
                    nSlots := 0;
                    nSlowest := 0;
                    bTurns := FALSE;
                    nAhead := 0;
                    IF NOT bMirror THEN
                        nLast := cMost;
                        IF nJob = 3 THEN nLast := nKernel; END_IF;
                        nAhead := 2 + 2 * cAxes * cWayIterations * cColumnWork * nLast / (cWork * nSlot);
                    END_IF;
                END_IF;
                IF (nSized = 0) AND (nJob = 2) THEN (* a plan that came too late was for one that long *)
                    nSlots := nLeast - nAhead / 2;
                    nLeast := 0;
                END_IF;
                nOld := nFuture - nAhead - 2;
                IF bMirror OR (nOld < 0) THEN nOld := 0; END_IF;
                fScale := aTop[nPlanAxis];
                IF nJob = 4 THEN fScale := cVelocity[nPlanAxis]; END_IF;
                fOldSum := 0.0;
                fValue := 0.0;
                fDelta := 0.0;
                FOR nIndex := 0 TO nFuture - 1 DO
                    fWanted := aFuture[nPlanRow + nIndex];
                    IF ABS(fWanted) > fScale THEN fScale := ABS(fWanted); END_IF;
                    IF nIndex >= nAhead + 2 THEN
                        fOldSum := fOldSum + fWanted;
                        IF fWanted > fValue THEN fValue := fWanted; END_IF;
                        IF fWanted < fDelta THEN fDelta := fWanted; END_IF;
                    END_IF;
                END_FOR;
                fSign := 1.0;
                IF nJob = 2 THEN
                    IF aGoal[nPlanAxis] < aFinal[nPlanAxis] THEN fSign := -1.0; END_IF;
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
                ELSIF nJob = 4 THEN
                    fLower := 0.0;
                    fNeed := 1.0E+9;
                ELSE
                    fNeed := fSign * (aGoal[nPlanAxis] - aFinal[nPlanAxis]) / (fScale * fSlot);
                    IF fDelta >= -1.0E-9 * fScale THEN fLower := fDelta / fScale; END_IF;
                END_IF;
                fOldSum := fOldSum / fScale;
                fRate := (1.0 - cInside) * cAcceleration[nPlanAxis] * fSlot / fScale;
                fCurve := (1.0 - cInside) * cJerk[nPlanAxis] * fSlot * fSlot / fScale;
                aX[0] := fSign * aFuture[nPlanRow + nAhead] / fScale;
                aX[1] := fSign * aFuture[nPlanRow + nAhead + 1] / fScale;
                (* How many slots it takes: from what is known of motions from rest to rest. *)
                nNeeded := nKernel;
                IF nJob = 4 THEN nNeeded := cReachSlots[nReach]; END_IF;
                IF nJob = 2 THEN
                    fWanted := fNeed;
                    IF fOldSum > 0.0 THEN fWanted := fNeed + fOldSum; END_IF;
                    (* Beyond what was measured yet, each slot more is one at full speed. *)
                    nNeeded := cLongest + 1;
                    fHalf := fWanted - aReached[nPlanAxis];
                    IF fHalf < DINT_TO_LREAL(cLongest) THEN
                        nOther := nKernel;
                        IF nReach > 0 THEN nOther := cReachSlots[nReach - 1]; END_IF;
                        IF bMeasured THEN nOther := cLongest; END_IF;
                        IF nOther + LREAL_TO_DINT(fHalf + 0.999) < cLongest THEN
                            nNeeded := nOther + LREAL_TO_DINT(fHalf + 0.999);
                        END_IF;
                    END_IF;
                    FOR nTerm := 1 TO cReaches DO
                        nIndex := cReaches - nTerm;
                        IF aReach[nPlanReach + nIndex] >= fWanted THEN
                            nNeeded := cReachSlots[nIndex];
                            IF nIndex > 0 THEN
                                fHalf := aReach[nPlanReach + nIndex - 1];
                                IF (fHalf > 0.0) AND (fWanted > fHalf) THEN
                                    fBound := (fWanted - fHalf) / (aReach[nPlanReach + nIndex] - fHalf);
                                    nOther := cReachSlots[nIndex - 1];
                                    fHalf := DINT_TO_LREAL(nNeeded - nOther);
                                    fBound := fBound * fHalf;
                                    (* Between measured ones, a little more. *)
                                    fHalf := cSpare * (fHalf - 1.0);
                                    IF fHalf > 0.8 THEN fHalf := 0.8; END_IF;
                                    fBound := fBound + fHalf + 0.499;
                                    IF nOther + LREAL_TO_DINT(fBound) < nNeeded THEN
                                        nNeeded := nOther + LREAL_TO_DINT(fBound);
                                    END_IF;
                                END_IF;
                            END_IF;
                        END_IF;
                    END_FOR;
                    (* Where it has full speed, that lasts longer. *)
                    IF (fValue >= 0.998 * fScale) AND (fNeed < DINT_TO_LREAL(cLongest)) THEN
                        nOther := nOld + LREAL_TO_DINT(fNeed + 0.999);
                        IF nOther < nNeeded THEN nNeeded := nOther; END_IF;
                    END_IF;
                    IF nNeeded < nOld THEN nNeeded := nOld; END_IF;
                    IF (nSized < cAxes) AND (nState = 2) AND (aX[1] < -cAgainst) AND (fNeed > 1.0E-9) THEN
                        bTurns := TRUE;
                        bBrakes := NOT bBraked AND (nOld > nKernel + 4) AND (fNeed > cNearer);
                    END_IF;
                END_IF;
                IF nSized < cAxes THEN
                    (* All axes come to rest together: that takes what the slowest one does. *)
                    nSized := nSized + 1;
                    IF nNeeded > nSlots THEN
                        nSlots := nNeeded;
                        nSlowest := nPlanAxis;
                    END_IF;
                    nLast := cLongest;
                    IF NOT bMirror THEN nLast := cLongestOnWay; END_IF;
                    IF (nSized >= cAxes) AND (nJob = 2) AND (nSlots > nLast)
                        AND NOT (bTurns AND (nOld > nKernel + 4)) THEN (* far: by pulses *)
                        bSurrender := TRUE;
                        nJob := 0;
                    ELSIF (nSized >= cAxes) AND bTurns THEN
                        IF nSlots <= cMost THEN bTurns := FALSE; ELSE nSlots := cMost; END_IF;
                        IF nSlots < nOld THEN nSlots := nOld; END_IF;
                    END_IF;
                    bFirst := (nSized < cAxes) OR (bMirror AND (nJob = 2) AND (nPlanAxis <> nSlowest));
                ELSE
                    bFirst := FALSE;
                END_IF;
                bGood := (nJob = 3) AND (fValue <= 0.0) AND (fDelta >= 0.0);
                IF nJob = 2 THEN bGood := ABS(aGoal[nPlanAxis] - aFinal[nPlanAxis]) <= 1.0E-9; END_IF;
                IF bGood THEN fNeed := 0.0; END_IF;
                IF bTurns AND (nSized >= cAxes) AND (aX[1] >= -cAgainst) THEN bGood := TRUE; END_IF;
                IF bBrakes THEN (* a nearer target: the stop comes first, and the way from there next *)
                    bBrakes := FALSE;
                    bBraked := TRUE;
                    nJob := 3;
                    nPlanAxis := 0;
                    nSized := 0;
                ELSIF bFirst THEN (* another axis is sized next, or planned first *)
                    nPlanAxis := nPlanAxis + 1;
                    IF nSized >= cAxes THEN nPlanAxis := nSlowest; END_IF;
                ELSIF bGood THEN (* this axis has nowhere else to go, or waits for one that turns round *)
                    fSum := 0.0;
                    fPlanShare := 0.0;
                    nAt := 0;
                    nPhase := 18;
                ELSIF bMirror AND (nJob = 2) AND (nFitted > 0) AND NOT bDamped AND (fNeed <= fSum) THEN
                    (* As the axis before, but less far: tried first, as its own limits may not allow it. *)
                    bScaled := TRUE;
                    bGood := TRUE;
                    fPlanShare := fNeed / fSum;
                    nAt := 0;
                    nPhase := 18;
                ELSE
                    nPhase := 4;
                END_IF;
"""
