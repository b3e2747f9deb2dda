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
    bAborted is set; otherwise they mean nothing. A rising edge of bExecute starts, once the table's CRC-32
    was found right (@check_cycles cycles after power-up, in the background). Dropping bExecute does not stop
    the motion, it ends the hold at the target. bHold stops on the path until it drops, bAbort for good, and
    rOverride (0 to 1) slows the motion down; all three keep to the peaks above and to the stop jerk.
    bOffNominal then tells that the timing no longer cancels the sway: the load swings.
    fScale (0 to 1) makes the move smaller with the same timing, bMirror turns its direction, fStartOffset
    shifts it; they and fActPosition are taken over at the start.

    nErrorId: 0 none
              1 fCycleTime is not the cycle time of the table
              2 fActPosition is farther than fStartTolerance from the start of the motion
              3 fScale does not lie between 0 and 1
              4 bAbort was set at the start
              5 the table was altered: its CRC-32 is wrong
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
    fScale : LREAL := 1.0; (* of the distance *)
    bMirror : BOOL; (* move the other way *)
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
    bOffNominal : BOOL; (* hold, abort or override changed the timing *)
END_VAR
VAR
    nState : INT;
    bExecuteBefore : BOOL;
    bStopping : BOOL; (* bAbort was seen *)
    nCycle : DINT; (* along the path, and *)
    fFraction : LREAL; (* of the next cycle *)
%   nAxis : DINT;
    fRate : LREAL; (* along the path, 1.0 as planned *)
    fRateBefore : LREAL;
    fSlope : LREAL; (* 1/s, of the rate *)
    fGoal : LREAL; (* of the rate *)
    fStep : LREAL;
    fSteps : LREAL;
    nSteps : DINT;
    fWanted : LREAL;
    fBound : LREAL;
    fPush : LREAL;
    fGain : LREAL;
    fShift : $reals;
$variables
    bChecked : BOOL;
    bTableGood : BOOL;
    nCheckRow : DINT;
    nCheckColumn : INT;
    nCheck : INT;
    nNibble : INT;
    fValue : LREAL;
    fMantissa : LREAL;
    nHead : DINT;
    nUpper : DINT;
    nLower : DINT;
    dwCrc : DWORD := 16#FFFFFFFF;
END_VAR
VAR CONSTANT
    cIdle : INT := 0;
    cWaiting : INT := 1;
    cMoving : INT := 2;
    cDone : INT := 3;
    cAborted : INT := 4;
    cFailed : INT := 5;
%   cAxes : DINT := $axes;
    cLast : DINT := @last;
    cCycleTime : LREAL := @cycle_time; (* s *)
    cSlope : LREAL := @slope; (* 1/s, greatest of the rate *)
    cSlopeRate : LREAL := @slope_rate; (* 1/s2 *)
    cRoom : $reals := @room; (* 1/s, peak acceleration over peak velocity *)
    cInverse : $reals := @inverse; (* 1 over the peak velocity *)
    cStart : $reals := @start; (* @units *)
    cTarget : $reals := @target; (* @units *)
    cCrc : DWORD := @crc;
    cNibbles : ARRAY [0..15] OF DWORD := [16#00000000, 16#1DB71064, 16#3B6E20C8, 16#26D930AC,
        16#76DC4190, 16#6B6B51F4, 16#4DB26158, 16#5005713C, 16#EDB88320, 16#F00F9344, 16#D6D6A3E8,
        16#CB61B38C, 16#9B64C2B0, 16#86D3D2D4, 16#A00AE278, 16#BDBDF21C];
$table
END_VAR
"""

BODY = """\

(* The checksum goes round and round while nothing moves. *)
IF nState <> cMoving THEN
    FOR nCheck := 1 TO $values_per_cycle DO
$checked_value
        (* A double as whole numbers: sign and exponent, and the two halves of its mantissa. *)
        nHead := 2048;
        fMantissa := 0.0;
        IF (ABS(fValue) > 0.0) AND (ABS(fValue) < 1.0E+37) THEN fMantissa := ABS(fValue); END_IF;
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
        nLower := LREAL_TO_DINT(134217728.0 * (fMantissa - DINT_TO_LREAL(nUpper)));
        FOR nNibble := 0 TO 23 DO
            IF nNibble = 0 THEN dwCrc := dwCrc XOR DINT_TO_DWORD(nHead); END_IF;
            IF nNibble = 8 THEN dwCrc := dwCrc XOR DINT_TO_DWORD(nUpper); END_IF;
            IF nNibble = 16 THEN dwCrc := dwCrc XOR DINT_TO_DWORD(nLower); END_IF;
            dwCrc := SHR(dwCrc, 4) XOR cNibbles[DWORD_TO_DINT(dwCrc AND 16#0000000F)];
        END_FOR;
        nCheckRow := nCheckRow + 1;
        IF nCheckRow > @last_row THEN
            nCheckRow := 0;
            nCheckColumn := nCheckColumn + 1;
        END_IF;
        IF nCheckColumn >= $columns THEN
            nCheckColumn := 0;
            bTableGood := (dwCrc XOR 16#FFFFFFFF) = cCrc;
            bChecked := TRUE;
            dwCrc := 16#FFFFFFFF;
        END_IF;
    END_FOR;
END_IF;

IF bExecute AND NOT bExecuteBefore AND (nState <> cWaiting) AND (nState <> cMoving) THEN
    nState := cWaiting;
    nErrorId := 0;
ELSIF NOT bExecute AND (nState <> cWaiting) AND (nState <> cMoving) THEN
    nState := cIdle;
    nErrorId := 0;
END_IF;
bExecuteBefore := bExecute;

(* Not-a-number fails every comparison, so these ask for what must hold. *)
fGoal := 0.0;
IF rOverride > 0.0 THEN fGoal := rOverride; END_IF;
IF fGoal > 1.0 THEN fGoal := 1.0; END_IF;
IF bHold THEN fGoal := 0.0; END_IF;

IF nState = cMoving THEN
    IF bAbort THEN bStopping := TRUE; END_IF;
    IF bStopping THEN fGoal := 0.0; END_IF;
    fRateBefore := fRate;
    fRate := fRate + fSlope * cCycleTime;
    fFraction := fFraction + 0.5 * (fRateBefore + fRate);
    IF fFraction >= 1.0 THEN
        fFraction := fFraction - 1.0;
        nCycle := nCycle + 1;
    END_IF;
ELSIF nState = cWaiting THEN
    (* Checked in every cycle of waiting, as the start position is issued meanwhile. *)
    IF bChecked AND NOT bTableGood THEN nErrorId := 5; END_IF;
    IF bAbort THEN nErrorId := 4; END_IF;
    IF NOT ((fScale >= 0.0) AND (fScale <= 1.0)) THEN nErrorId := 3; END_IF;
%   FOR nAxis := 1 TO cAxes DO
    IF NOT (ABS(fActPosition~ - (cStart~ + fStartOffset~)) <= fStartTolerance~) THEN nErrorId := 2; END_IF;
%   END_FOR;
    IF NOT (ABS(fCycleTime - cCycleTime) <= 1.0E-6 * cCycleTime) THEN nErrorId := 1; END_IF;
    IF nErrorId <> 0 THEN
        nState := cFailed;
    ELSE
        fGain := fScale;
        IF bMirror THEN fGain := -fScale; END_IF;
%       FOR nAxis := 1 TO cAxes DO
        fShift~ := fStartOffset~ + (1.0 - fGain) * cStart~;
        fPosition~ := cStart~ + fStartOffset~;
%       END_FOR;
        IF bChecked THEN nState := cMoving; END_IF;
    END_IF;
    bStopping := FALSE;
    bOffNominal := FALSE;
    nCycle := 0;
    fFraction := 0.0;
$start
    fRate := fGoal;
    fSlope := 0.0;
END_IF;

IF (nState = cMoving) AND (nCycle >= cLast) THEN
    nState := cDone;
    IF bStopping THEN nState := cAborted; END_IF;
%   FOR nAxis := 1 TO cAxes DO
    fPosition~ := fGain * cTarget~ + fShift~;
    fVelocity~ := 0.0;
    fAcceleration~ := 0.0;
%   END_FOR;
ELSIF nState = cMoving THEN
    (* The slope that brings the rate to its goal, and itself to zero there, by steps of cSlopeRate. *)
    fStep := cSlopeRate * cCycleTime;
    fWanted := 0.0;
    IF (ABS(fGoal - fRate) <= 1.0E-12) AND (ABS(fSlope) <= fStep) THEN
        fRate := fGoal;
    ELSE
        fSteps := ABS(fGoal - fRate) / (fStep * cCycleTime);
        nSteps := LREAL_TO_DINT(0.5 * SQRT(1.0 + 8.0 * fSteps));
        IF nSteps < 1 THEN nSteps := 1; END_IF;
        fWanted := fStep * (fSteps / DINT_TO_LREAL(nSteps) + 0.5 * DINT_TO_LREAL(nSteps - 1));
        IF fWanted > cSlope THEN fWanted := cSlope; END_IF;
        IF fGoal < fRate THEN fWanted := -fWanted; END_IF;
    END_IF;
    IF fWanted > fSlope + fStep THEN fWanted := fSlope + fStep; END_IF;
    IF fWanted < fSlope - fStep THEN fWanted := fSlope - fStep; END_IF;
    fSlope := fWanted;
    IF (fRate < 1.0) OR (fSlope < 0.0) THEN bOffNominal := TRUE; END_IF;

    (* Motion along the path, and the slopes that keep its acceleration within the peak. *)
$segment
%   FOR nAxis := 1 TO cAxes DO
$path
    fPush := fAcceleration~ * fRate * fRate * cInverse~;
    fBound := cRoom~ - ABS(fPush);
    IF fBound < 0.0 THEN fBound := 0.0; END_IF;
    IF fSlope > fBound THEN fSlope := fBound; END_IF;
    IF fPush * fVelocity~ > 0.0 THEN fBound := cRoom~; END_IF;
    IF fSlope < -fBound THEN fSlope := -fBound; END_IF;
%   END_FOR;
%   FOR nAxis := 1 TO cAxes DO
    fPosition~ := fGain * fPosition~ + fShift~;
    fAcceleration~ := fGain * (fAcceleration~ * fRate * fRate + fVelocity~ * fSlope);
    fVelocity~ := fGain * fVelocity~ * fRate;
%   END_FOR;
    IF bStopping AND (fRate <= 0.0) THEN nState := cAborted; END_IF;
ELSE
%   FOR nAxis := 1 TO cAxes DO
    fVelocity~ := 0.0;
    fAcceleration~ := 0.0;
%   END_FOR;
END_IF;
$counts_output
bBusy := (nState = cWaiting) OR (nState = cMoving);
bDone := nState = cDone;
bAborted := nState = cAborted;
bError := nState = cFailed;
END_FUNCTION_BLOCK
"""


_SEGMENTS = {
    "columns": "7",
    "variables": """\
    nSegment : DINT;
    nRow : DINT;
    fTime : LREAL; (* s, since the segment began *)
    fC0 : LREAL;
    fC1 : LREAL;
    fC2 : LREAL;
    fC3 : LREAL;
    fC4 : LREAL;
    fC5 : LREAL;
""",
    "table": """\
    cLastSegment : DINT := @last_segment;
    cFirst : ARRAY @segments OF DINT := @first; (* cycle at which each segment begins *)
    (* Position by powers of the time in s since then; in s, @units. *)
    cPower0 : ARRAY @rows OF LREAL := @power0;
    cPower1 : ARRAY @rows OF LREAL := @power1;
    cPower2 : ARRAY @rows OF LREAL := @power2;
    cPower3 : ARRAY @rows OF LREAL := @power3;
    cPower4 : ARRAY @rows OF LREAL := @power4;
    cPower5 : ARRAY @rows OF LREAL := @power5;
""",
    "checked_value": """\
        CASE nCheckColumn OF
            0: fValue := cPower0[nCheckRow];
            1: fValue := cPower1[nCheckRow];
            2: fValue := cPower2[nCheckRow];
            3: fValue := cPower3[nCheckRow];
            4: fValue := cPower4[nCheckRow];
            5: fValue := cPower5[nCheckRow];
            6: fValue := DINT_TO_LREAL(cFirst[$per_axis(nCheckRow)]);
        END_CASE;
""",
    "start": """\
    nSegment := 0;
""",
    "segment": """\
    IF nSegment < cLastSegment THEN
        IF nCycle >= cFirst[nSegment + 1] THEN nSegment := nSegment + 1; END_IF;
    END_IF;
    fTime := (DINT_TO_LREAL(nCycle - cFirst[nSegment]) + fFraction) * cCycleTime;
""",
    "path": """\
    nRow := $row(nSegment);
    fC0 := cPower0[nRow];
    fC1 := cPower1[nRow];
    fC2 := cPower2[nRow];
    fC3 := cPower3[nRow];
    fC4 := cPower4[nRow];
    fC5 := cPower5[nRow];
    fPosition~ := fC0 + fTime * (fC1 + fTime * (fC2 + fTime * (fC3 + fTime * (fC4 + fTime * fC5))));
    fVelocity~ := fC1 + fTime * (2.0 * fC2 + fTime * (3.0 * fC3 + fTime * (4.0 * fC4 + fTime * (5.0 * fC5))));
    fAcceleration~ := 2.0 * fC2 + fTime * (6.0 * fC3 + fTime * (12.0 * fC4 + fTime * (20.0 * fC5)));
""",
    "counts_declaration": "",
    "counts_output": "",
}

# Between cycles: position by the cubic that has the tabulated velocities, these and accelerations linearly.
_SAMPLES = {
    "columns": "3",
    "variables": """\
    nRow : DINT;
    fNext : LREAL;
    fAdvance : LREAL;
""",
    "table": """\
    cPosition : ARRAY @rows OF $number := @position; (* @units, one value per cycle *)
    cVelocity : ARRAY @rows OF $number := @velocity; (* @units/s *)
    cAcceleration : ARRAY @rows OF $number := @acceleration; (* @units/s2 *)
""",
    "checked_value": """\
        CASE nCheckColumn OF
            0: fValue := $real(cPosition[nCheckRow]);
            1: fValue := $real(cVelocity[nCheckRow]);
            2: fValue := $real(cAcceleration[nCheckRow]);
        END_CASE;
""",
    "start": "",
    "segment": "",
    "path": """\
    nRow := $row(nCycle);
    fPosition~ := $real(cPosition[nRow]);
    fVelocity~ := $real(cVelocity[nRow]);
    fAcceleration~ := $real(cAcceleration[nRow]);
    nRow := nRow + $axes;
    fAdvance := $real(cPosition[nRow]) - fPosition~;
    fNext := $real(cVelocity[nRow]);
    fPosition~ := fPosition~ + fFraction * (fAdvance
        + (1.0 - fFraction) * (1.0 - fFraction) * (fVelocity~ * cCycleTime - fAdvance)
        - (1.0 - fFraction) * fFraction * (fNext * cCycleTime - fAdvance));
    fVelocity~ := fVelocity~ + fFraction * (fNext - fVelocity~);
    fNext := $real(cAcceleration[nRow]);
    fAcceleration~ := fAcceleration~ + fFraction * (fNext - fAcceleration~);
""",
    "counts_declaration": "",
    "counts_output": "",
}

_COUNTS = _SAMPLES | {
    "counts_declaration": """\
    nPosition : $whole_numbers; (* fPosition, rounded *)
""",
    "counts_output": """\
%FOR nAxis := 1 TO cAxes DO
nPosition~ := LREAL_TO_DINT(fPosition~);
%END_FOR;
""",
}

LAYOUTS = {"segments": _SEGMENTS, "samples": _SAMPLES, "counts": _COUNTS}
