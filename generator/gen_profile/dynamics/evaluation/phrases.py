"""How figures, moves and machines read, in a terminal and in a report."""

import re
from collections.abc import Mapping

from gen_profile.spec.model import Spec
from gen_profile.support.units import UNITS

MANIFEST_WORDS = {
    "matches": "the file is the one that was exported",
    "differs": "the file is NOT the one that was exported",
    "none": "no manifest of this spec beside the file",
}
COMPANION_WORDS = {
    "matches": "as exported",
    "differs": "NOT as exported",
    "missing": "missing, not compared",
    "earlier": "NOT of this export but left over from an earlier one",
}
UNPROMISED = ", and nothing is promised"  # of sway that remains
SMALLEST, LARGEST = 1e-4, 1e4  # beyond, four digits would need a power of ten


def companions(found: Mapping[str, str]) -> str:
    """Tell of the files that were exported with one which are as they were."""
    words = ([name for name, word in found.items() if word == one] for one in COMPANION_WORDS)
    return "; ".join(
        f"{', '.join(names)} {said}"
        for names, said in zip(words, COMPANION_WORDS.values(), strict=True)
        if names
    )


def number(value: float) -> str:
    """Write four digits, and none below a hundred-thousandth: of a millimetre, that is numerical error."""
    kept = round(value, 5) + 0.0
    if abs(kept) >= LARGEST:
        text = f"{kept:.0f}"
    elif 0.0 < abs(kept) < SMALLEST:
        text = f"{kept:.5f}"
    else:
        text = f"{kept:.4g}"
    return text.replace("-", "−")


def mm(metres: float) -> str:
    """Write a length in mm."""
    return f"{number(1e3 * metres)} mm"


def named(values: Mapping[str, object]) -> list[str]:
    """Write each value behind its name."""
    return [
        f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in values.items()
    ]


def bound(metres: float) -> str:
    """Write a numerical error in µm, two digits."""
    return f"{1e6 * metres:.2g} µm"


def machine(name: str) -> str:
    """Write a scenario's name with signs and units that stay together."""
    return re.sub(r"-(?=[0-9.])", "−", name).replace(" %", "\N{NO-BREAK SPACE}%")


def place_unit(spec: Spec, column: int) -> tuple[str, float]:
    """Say in which unit an axis's places are shown, its controller's, and how many of it make one SI unit.

    Counts of an encoder mean nothing to a reader; they are shown in SI units.
    """
    scale, axis = spec.axis_scales()[column], spec.machine().actuated[column]
    if scale.unit not in UNITS:
        return axis.unit, 1.0
    return scale.unit, UNITS[scale.unit][1]


def move(spec: Spec) -> str:
    """Say what moves, how far, and in what time."""
    axes, words = spec.machine().actuated, list[str]()
    for column, (axis, distance) in enumerate(zip(axes, spec.move.distance, strict=True)):
        unit, factor = place_unit(spec, column)
        words.append(f"{axis.name} {number(factor * distance)} {unit}")
    return f"{' and '.join(words)} in {number(spec.move.duration)} s"


def uncertain(spec: Spec) -> str:
    """Say which parameters may be off, and by how much."""
    ranges = spec.robustness.uncertain
    stated = ", ".join(f"{name} ±{number(100.0 * fraction)} %" for name, fraction in ranges.items())
    return stated or "none stated"
