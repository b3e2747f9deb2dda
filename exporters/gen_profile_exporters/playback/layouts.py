"""The statements of the playback block that depend on how its table is laid out."""

from __future__ import annotations

from typing import Any

# Name, type (``~``: one of every axis), initial value and comment. All enter the checksum, in this order.
CONSTANTS = (
    ("cIdle", "DINT", "0", ""),
    ("cWaiting", "DINT", "1", ""),
    ("cMoving", "DINT", "2", ""),
    ("cDone", "DINT", "3", ""),
    ("cAborted", "DINT", "4", ""),
    ("cFailed", "DINT", "5", ""),
    ("cAxes", "DINT", "$axes", ""),
    ("cLast", "DINT", "@last", "cycle of the end"),
    ("cRows", "DINT", "@row_count", "of the table"),
    ("cChecks", "DINT", "@checks", "values that enter the checksum in a cycle"),
    ("cPlayOn", "DINT", "@play_on", "cycle from which the motion ends before its own peaks could stop it"),
    ("cCycleTime", "LREAL", "@cycle_time", "s"),
    ("cSlope", "LREAL", "@slope", "1/s, greatest of the rate"),
    ("cSlopeRate", "LREAL", "@slope_rate", "1/s2"),
    ("cRoom", "LREAL~", "@room", "1/s, peak acceleration over peak velocity"),
    ("cInverse", "LREAL~", "@inverse", "1 over the peak velocity"),
    ("cStopJerk", "LREAL~", "@stop_jerk", "@units/s3"),
    ("cStart", "LREAL~", "@start", "@units"),
    ("cTarget", "LREAL~", "@target", "@units"),
    ("cLeastScale", "LREAL~", "@least_scale", "least fScale that the machine allows"),
    ("cMirrors", "BOOL~", "@mirrors", "bMirror is allowed"),
    ("cShifts", "BOOL~", "@shifts", "fStartOffset is allowed"),
)

_SEGMENTS: dict[str, Any] = {
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
    "constants": (*CONSTANTS, ("cLastSegment", "DINT", "@last_segment", "")),
    "table": """\
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
_SAMPLES: dict[str, Any] = {
    "columns": "3",
    "variables": """\
    nRow : DINT;
    fNext : LREAL;
    fAdvance : LREAL;
""",
    "constants": CONSTANTS,
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
