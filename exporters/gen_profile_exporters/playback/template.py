"""Text of the playback function block: portable IEC 61131-3 Structured Text with holes.

``@name`` is a hole for a value. ``$name`` is a part that the number of axes or the layout of the table
decides; alone on its line, it is whole lines. A line that begins with ``%`` stands in blocks of several axes
only. ``~`` after a name is the index of the axis there, and nothing where there is one axis.
"""

from __future__ import annotations

HEADER = """\
(*
    @name: playback function block, IEC 61131-3 Structured Text, from gen-profile.

    @samples cycles of @cycle s. Table: @layout, @kilobytes kB. @accuracy
@axis_lines
    Payload SHA-256: @sha256

    Call the block once in every cycle of its task and give its outputs to the drive while bBusy, bDone or
    bAborted is set; otherwise they mean nothing. A rising edge of bExecute starts, once the checksum of all
    constants was found right (@check_cycles cycles after power-up, in the background). Dropping bExecute does
    not stop the motion, it ends the hold at the target. bHold stops on the path until it drops, and rOverride
    (0 to 1) slows the motion down; both keep to the peaks above and to the stop jerk.
    bAbort stops on the path for good, no later than the motion itself would end, with fStopDeceleration and
    fStopJerk where they are greater than these; a rising edge of bContinue then plays the way that is left.
    bOffNominal tells that the timing no longer cancels the sway: the load swings.
    The motion begins where the axis stands, up to fStartTolerance from its start, and ends at its target.
    fScale (0 to 1) makes the move of an axis smaller with the same timing, bMirror turns its direction,
    fStartOffset shifts it, each where the machine allows it (see the axis); they and fActPosition are taken
    over at the start.

    nErrorId: 0 none
              1 fCycleTime is not the cycle time of the table
              2 fActPosition is farther than fStartTolerance from where the motion begins
              3 fScale does not lie between 0 and 1
              4 bAbort was set at the start
              5 a constant was altered: the checksum is wrong
              7 the machine does not allow fScale, bMirror or fStartOffset of an axis
              8 bContinue, but no way is left
*)
"""

INTERFACE = """\
FUNCTION_BLOCK @block
VAR_INPUT
    bExecute : BOOL; (* rising edge: start *)
    bAbort : BOOL; (* stop on the path, for good *)
    bHold : BOOL; (* stop on the path, go on when it drops *)
    rOverride : LREAL := 1.0; (* rate along the path, 0.0 to 1.0 *)
    fCycleTime : LREAL; (* s, of the task that calls this block *)
    fActPosition : $reals; (* @units, where the axis stands *)
    fStartTolerance : $reals := @start_tolerance; (* @units *)
    fStartOffset : $reals; (* @units *)
    fScale : $reals := $ones; (* of the distance *)
    bMirror : $switches; (* move the other way *)
    bContinue : BOOL; (* rising edge after an abort: play the way that is left *)
    fStopDeceleration : $reals; (* @units/s2, of bAbort; 0.0: the peak acceleration *)
    fStopJerk : $reals; (* @units/s3, of bAbort; 0.0: as the deceleration asks for *)
END_VAR
VAR_OUTPUT
    fPosition : $reals := @start; (* @units *)
    fVelocity : $reals; (* @units/s *)
    fAcceleration : $reals; (* @units/s2 *)
$counts_declaration
    bBusy : BOOL; (* waits for the checksum, or moves *)
    bDone : BOOL; (* holds the target *)
    bAborted : BOOL; (* holds where it stopped *)
    bError : BOOL; (* did not start, see nErrorId *)
    nErrorId : INT;
    bOffNominal : BOOL; (* the sway is not cancelled as planned *)
    fTimeToGo : LREAL; (* s, at full rate *)
    fDistanceToGo : $reals; (* @units *)
END_VAR
VAR
    nState : DINT;
    bExecuteBefore : BOOL;
    bContinueBefore : BOOL;
    bGuiding : BOOL; (* the actual position was taken over *)
    bMoving : BOOL;
    bStopping : BOOL; (* bAbort was seen *)
    bLeft : BOOL; (* there is way left after an abort *)
    nCycle : DINT; (* along the path, and *)
    fFraction : LREAL; (* of the next cycle *)
%   nAxis : DINT;
    fRate : LREAL; (* along the path, 1.0 as planned *)
    fRateBefore : LREAL;
    fSlope : LREAL; (* 1/s, of the rate *)
    fGoal : LREAL; (* of the rate *)
    fFull : LREAL := 1.0; (* greatest rate: less than 1.0 where the way is longer than planned *)
    fStopGoal : LREAL; (* of the rate, after bAbort *)
    fHard : LREAL; (* acceleration that may be used, as a share of the peak *)
    fSharp : LREAL; (* jerk, as a share of the stop jerk *)
    fStep : LREAL;
    fSteps : LREAL;
    nSteps : DINT;
    fWanted : LREAL;
    fBound : LREAL;
    fPush : LREAL;
    fShare : LREAL;
    fAway : LREAL;
    fDue : $reals; (* where the axis should stand at the start *)
    fPath : $reals; (* position along the path as planned *)
    fGain : $reals;
    fShift : $reals;
$variables
    bChecked : BOOL;
    bIntact : BOOL;
    nCheckRow : DINT;
    nCheckRows : DINT;
    nCheckColumn : DINT;
    nCheck : DINT;
    nWord : DINT;
    fValue : LREAL;
    fMantissa : LREAL;
    nHead : DINT;
    nUpper : DINT;
    fWord : LREAL;
    fSum : LREAL;
END_VAR
VAR CONSTANT
$constants
    cChecksum : DINT := @checksum; (* of all others *)
$table
END_VAR
"""

BODY = """\

(* The checksum goes round and round while nothing moves. *)
IF nState <> cMoving THEN
    FOR nCheck := 1 TO cChecks DO
        fValue := 0.0;
        nCheckRows := cRows;
        IF nCheckColumn = $columns THEN
            nCheckRows := $constant_count;
$checked_constant
        ELSE
$checked_value
        END_IF;
        (* A double as whole numbers: sign and exponent, and the two halves of its mantissa. *)
        nHead := 2048;
        fMantissa := 0.0;
        IF (ABS(fValue) > 0.0) AND (ABS(fValue) < 1.0E+37) THEN fMantissa := ABS(fValue); END_IF;
        WHILE fMantissa >= 256.0 DO
            fMantissa := 0.00390625 * fMantissa;
            nHead := nHead + 8;
        END_WHILE;
        WHILE (fMantissa < 0.00390625) AND (fMantissa > 0.0) DO
            fMantissa := 256.0 * fMantissa;
            nHead := nHead - 8;
        END_WHILE;
        WHILE fMantissa >= 1.0 DO
            fMantissa := 0.5 * fMantissa;
            nHead := nHead + 1;
        END_WHILE;
        WHILE (fMantissa < 0.5) AND (fMantissa > 0.0) DO
            fMantissa := 2.0 * fMantissa;
            nHead := nHead - 1;
        END_WHILE;
        nHead := 2 * nHead;
        IF fValue < 0.0 THEN nHead := nHead + 1; END_IF;
        fMantissa := 67108864.0 * fMantissa;
        nUpper := LREAL_TO_DINT(fMantissa);
        IF DINT_TO_LREAL(nUpper) > fMantissa THEN nUpper := nUpper - 1; END_IF;
        (* Polynomial of these modulo the prime 2147483647: every product and sum below is exact. *)
        FOR nWord := 1 TO 3 DO
            fWord := DINT_TO_LREAL(nHead);
            IF nWord = 2 THEN fWord := DINT_TO_LREAL(nUpper); END_IF;
            IF nWord = 3 THEN fWord := 134217728.0 * (fMantissa - DINT_TO_LREAL(nUpper)); END_IF;
            fSum := 1999993.0 * fSum + fWord;
            fSum := fSum - 2147483647.0 * DINT_TO_LREAL(LREAL_TO_DINT(fSum / 2147483647.0));
            IF fSum < 0.0 THEN fSum := fSum + 2147483647.0; END_IF;
        END_FOR;
        nCheckRow := nCheckRow + 1;
        IF nCheckRow >= nCheckRows THEN
            nCheckRow := 0;
            nCheckColumn := nCheckColumn + 1;
        END_IF;
        IF nCheckColumn > $columns THEN
            nCheckColumn := 0;
            bIntact := LREAL_TO_DINT(fSum) = cChecksum;
            bChecked := TRUE;
            fSum := 0.0;
        END_IF;
    END_FOR;
END_IF;

IF bExecute AND NOT bExecuteBefore AND (nState <> cWaiting) AND (nState <> cMoving) THEN
    nState := cWaiting;
    nErrorId := 0;
    bGuiding := FALSE;
    bOffNominal := FALSE;
    bLeft := FALSE;
    fFull := 1.0;
    nCycle := 0;
    fFraction := 0.0;
$start
%   FOR nAxis := 1 TO cAxes DO
    fGain~ := fScale~;
    IF bMirror~ THEN fGain~ := -fScale~; END_IF;
    fShift~ := fStartOffset~ + (1.0 - fGain~) * cStart~;
    fPath~ := cStart~;
    fDue~ := cStart~ + fStartOffset~;
    (* Not-a-number fails every comparison, so these ask for what must hold. *)
    IF NOT (fScale~ >= cLeastScale~) THEN nErrorId := 7; END_IF;
    IF bMirror~ AND NOT cMirrors~ THEN nErrorId := 7; END_IF;
    IF NOT (ABS(fStartOffset~) <= 0.0) AND NOT cShifts~ THEN nErrorId := 7; END_IF;
%   END_FOR;
%   FOR nAxis := 1 TO cAxes DO
    IF NOT (fScale~ >= 0.0) OR NOT (fScale~ <= 1.0) THEN nErrorId := 3; END_IF;
%   END_FOR;
ELSIF bContinue AND NOT bContinueBefore AND (nState <> cWaiting) AND (nState <> cMoving) THEN
    nState := cWaiting;
    nErrorId := 0;
    bGuiding := FALSE;
    fFull := 1.0;
    IF NOT bLeft THEN
        nState := cFailed;
        nErrorId := 8;
    END_IF;
ELSIF NOT bExecute AND NOT bContinue AND (nState <> cWaiting) AND (nState <> cMoving) THEN
    nState := cIdle;
    nErrorId := 0;
END_IF;
bExecuteBefore := bExecute;
bContinueBefore := bContinue;

fGoal := 0.0;
IF rOverride > 0.0 THEN fGoal := rOverride; END_IF;
IF fGoal > fFull THEN fGoal := fFull; END_IF;
IF bHold THEN fGoal := 0.0; END_IF;

bMoving := bIntact AND (nState = cMoving);
IF bMoving THEN
    IF bAbort AND NOT bStopping THEN
        bStopping := TRUE;
        (* How much harder than the motion itself every axis may brake. *)
        fHard := 1.0E+6;
        fSharp := 1.0E+12;
%       FOR nAxis := 1 TO cAxes DO
        IF ABS(fGain~) * cInverse~ > 0.0 THEN
            fShare := fStopDeceleration~ * cInverse~ / (ABS(fGain~) * cRoom~);
            IF NOT (fShare >= fFull) THEN fShare := fFull; END_IF;
            IF fShare < fHard THEN fHard := fShare; END_IF;
            fBound := fShare * fShare;
            IF fStopJerk~ > 0.0 THEN fBound := fStopJerk~ / (ABS(fGain~) * cStopJerk~); END_IF;
            IF NOT (fBound >= fFull) THEN fBound := fFull; END_IF;
            IF fBound < fSharp THEN fSharp := fBound; END_IF;
        END_IF;
%       END_FOR;
        IF fHard > fSharp THEN fHard := fSharp; END_IF;
        (* A stop that would take longer than the way that is left is not begun. *)
        fStopGoal := fGoal;
        IF fRate > fGoal THEN fStopGoal := fRate; END_IF;
        fBound := fHard * cSlope;
%       FOR nAxis := 1 TO cAxes DO
        fWanted := cRoom~ * (fHard - fStopGoal * fStopGoal);
        IF fWanted < fBound THEN fBound := fWanted; END_IF;
%       END_FOR;
        fWanted := (DINT_TO_LREAL(cLast - nCycle) - fFraction) * cCycleTime;
        IF (fGoal <= 0.0) OR (nCycle < cPlayOn) THEN
            fStopGoal := 0.0;
        ELSIF fBound > 0.0 THEN
            fSteps := fStopGoal / fBound + (fBound + 2.0 * ABS(fSlope)) / (fSharp * cSlopeRate)
                + 2.0 * cCycleTime;
            IF fStopGoal * fSteps < fWanted THEN fStopGoal := 0.0; END_IF;
        END_IF;
        IF fStopGoal > 0.0 THEN
            fHard := fFull;
            fSharp := fFull;
        END_IF;
    END_IF;
    IF bStopping THEN fGoal := fStopGoal; END_IF;
    fRateBefore := fRate;
    fRate := fRate + fSlope * cCycleTime;
    fFraction := fFraction + 0.5 * (fRateBefore + fRate);
    IF fFraction >= 1.0 THEN
        fFraction := fFraction - 1.0;
        nCycle := nCycle + 1;
    END_IF;
ELSIF nState = cWaiting THEN
    (* Checked in every cycle of waiting, as the position of the start is issued meanwhile. *)
    IF bChecked AND NOT bIntact THEN nErrorId := 5; END_IF;
    IF bAbort THEN nErrorId := 4; END_IF;
%   FOR nAxis := 1 TO cAxes DO
    IF NOT (ABS(fActPosition~ - fDue~) <= fStartTolerance~) THEN nErrorId := 2; END_IF;
%   END_FOR;
    IF NOT (ABS(fCycleTime - cCycleTime) <= 1.0E-6 * cCycleTime) THEN nErrorId := 1; END_IF;
    IF nErrorId <> 0 THEN
        nState := cFailed;
    ELSIF NOT bGuiding THEN
        (* The motion leads from where the axis stands to the target; a longer way takes longer. *)
        bGuiding := TRUE;
%       FOR nAxis := 1 TO cAxes DO
        fPosition~ := fActPosition~;
        fAway := fActPosition~ - fDue~;
        fShift~ := fShift~ + fAway;
        IF ABS(fAway) < ABS(fGain~ * (cTarget~ - fPath~)) THEN
            fAway := fAway / (cTarget~ - fPath~);
            fGain~ := fGain~ - fAway;
            fShift~ := fShift~ + fAway * fPath~;
        END_IF;
        IF fFull * ABS(fGain~) > 1.0 THEN fFull := 1.0 / ABS(fGain~); END_IF;
%       END_FOR;
        IF fFull < 0.99 THEN bOffNominal := TRUE; END_IF;
        IF fGoal > fFull THEN fGoal := fFull; END_IF;
    END_IF;
    IF bChecked AND (nErrorId = 0) THEN
        nState := cMoving;
        bMoving := bIntact;
    END_IF;
    bStopping := FALSE;
    fHard := fFull;
    fSharp := fFull;
    fRate := fGoal;
    IF bLeft THEN fRate := 0.0; END_IF;
    fSlope := 0.0;
END_IF;

IF bMoving AND (nCycle >= cLast) THEN
    nState := cDone;
    bLeft := FALSE;
    IF bStopping THEN nState := cAborted; END_IF;
%   FOR nAxis := 1 TO cAxes DO
    fPosition~ := fGain~ * cTarget~ + fShift~;
    fVelocity~ := 0.0;
    fAcceleration~ := 0.0;
%   END_FOR;
ELSIF bMoving THEN
    (* The slope that brings the rate to its goal, and itself to zero there, by steps of its own rate. *)
    fStep := fSharp * cSlopeRate * cCycleTime;
    fWanted := 0.0;
    IF (ABS(fGoal - fRate) <= 1.0E-12) AND (ABS(fSlope) <= fStep) THEN
        fRate := fGoal;
    ELSE
        fSteps := ABS(fGoal - fRate) / (fStep * cCycleTime);
        nSteps := LREAL_TO_DINT(0.5 * SQRT(1.0 + 8.0 * fSteps));
        IF nSteps < 1 THEN nSteps := 1; END_IF;
        fWanted := fStep * (fSteps / DINT_TO_LREAL(nSteps) + 0.5 * DINT_TO_LREAL(nSteps - 1));
        IF fWanted > fHard * cSlope THEN fWanted := fHard * cSlope; END_IF;
        IF fGoal < fRate THEN fWanted := -fWanted; END_IF;
    END_IF;
    IF fWanted > fSlope + fStep THEN fWanted := fSlope + fStep; END_IF;
    IF fWanted < fSlope - fStep THEN fWanted := fSlope - fStep; END_IF;
    fSlope := fWanted;
    IF (fRate < fFull) OR (fSlope < 0.0) THEN bOffNominal := TRUE; END_IF;

    (* Motion along the path, and the slopes that keep its acceleration within the peak. *)
$segment
%   FOR nAxis := 1 TO cAxes DO
$path
    fPush := fAcceleration~ * fRate * fRate * cInverse~;
    fBound := fHard * cRoom~ - ABS(fPush);
    IF fBound < 0.0 THEN fBound := 0.0; END_IF;
    IF fSlope > fBound THEN fSlope := fBound; END_IF;
    IF fPush * fVelocity~ > 0.0 THEN fBound := fHard * cRoom~; END_IF;
    IF fSlope < -fBound THEN fSlope := -fBound; END_IF;
%   END_FOR;
%   FOR nAxis := 1 TO cAxes DO
    fPath~ := fPosition~;
    fPosition~ := fGain~ * fPosition~ + fShift~;
    fAcceleration~ := fGain~ * (fAcceleration~ * fRate * fRate + fVelocity~ * fSlope);
    fVelocity~ := fGain~ * fVelocity~ * fRate;
    fDue~ := fPosition~;
%   END_FOR;
    IF bStopping AND (fRate <= 0.0) THEN
        nState := cAborted;
        bLeft := TRUE;
    END_IF;
ELSE
%   FOR nAxis := 1 TO cAxes DO
    fVelocity~ := 0.0;
    fAcceleration~ := 0.0;
%   END_FOR;
END_IF;
$counts_output
bBusy := (nState = cWaiting) OR (nState = cMoving);
bDone := (nState = cDone) AND (nErrorId = 0);
bAborted := (nState = cAborted) AND (nErrorId = 0);
bError := nState = cFailed;
fTimeToGo := 0.0;
%FOR nAxis := 1 TO cAxes DO
fDistanceToGo~ := 0.0;
%END_FOR;
IF bGuiding AND (bBusy OR bAborted) AND (nCycle < cLast) THEN
    fTimeToGo := (DINT_TO_LREAL(cLast - nCycle) - fFraction) * cCycleTime / fFull;
%   FOR nAxis := 1 TO cAxes DO
    fDistanceToGo~ := fGain~ * cTarget~ + fShift~ - fPosition~;
%   END_FOR;
END_IF;
END_FUNCTION_BLOCK
"""
