"""The statements of the playback block that depend on how its table is laid out."""

from typing import Any

from gen_profile_exporters.templates import FOLDER, text_parts


def _constant(line: str) -> tuple[str, str, str, str]:
    """Read name, type (``~``: one of every axis), initial value and comment."""
    name, type_, initial, *comment = line.split(maxsplit=3)
    return name, type_, initial, "".join(comment)


# all enter the checksum, in this order
CONSTANTS = tuple(map(_constant, (FOLDER / "playback/text/constants.txt").read_text("ascii").splitlines()))
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
