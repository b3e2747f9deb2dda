"""The statements of the playback block that depend on how its table is laid out."""

from typing import Any

from gen_profile_exporters.text_parts import text_parts

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

NO_PARTS = dict.fromkeys(("start", "segment", "counts_declaration", "counts_output"), "")


def _parts(layout: str) -> dict[str, Any]:
    """Read the statements that are a layout's own, whole lines each."""
    return {name: f"{text}\n" for name, text in text_parts(f"playback/text/layout_{layout}.st").items()}


# Between cycles, samples: position by the cubic that has the tabulated velocities, these and accelerations
# linearly.
_SAMPLES = {**NO_PARTS, "columns": "3", "constants": CONSTANTS, **_parts("samples")}
LAYOUTS = {
    "segments": {
        **NO_PARTS,
        "columns": "7",
        "constants": (*CONSTANTS, ("cLastSegment", "DINT", "@last_segment", "")),
        **_parts("segments"),
    },
    "samples": _SAMPLES,
    "counts": {**_SAMPLES, **_parts("counts")},
}
