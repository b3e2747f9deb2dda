"""What stated errors leave, as a planner block watches it: constants, and on how many machines."""

from collections.abc import Mapping

import numpy as np

VARIATIONS = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # of the stated errors: machines watched
CLOSE = 1.1  # rad, between two finer machines, up to which what lies between them is known
SPREAD = 4.0  # rad, from none to the whole error: epochs end; up to a quarter later on the way
MOST_FINE, LEAST_FINE = 128, 16  # finer machines of each mode
FINE_WORK = 0.1  # of a cycle's operations, that they take at most
FINE_STEP = 17  # operations of one
FINE_BEGIN = 150  # where those of another mode begin


def finer(operations: int, slot: int, modes: int) -> int:
    """Give the number of finer machines of a mode, for so many modes of all axes and cycles in a slot."""
    return max(LEAST_FINE, min(MOST_FINE, int(FINE_WORK * operations / FINE_STEP * (slot - 1) / modes)))


def whole_constants(fine: int, slot: int, modes: int) -> dict[str, int]:
    """Give the constants that count; each cycle takes so many finer machines on that a slot is enough."""
    return {
        "cVariations": len(VARIATIONS),
        "cFine": fine,
        "cFineChunk": -(-fine * modes // (slot - 1)),
        "cFineBegin": FINE_BEGIN,
    }


def cycle_work(constants: Mapping[str, int]) -> int:
    """Count the floating-point operations that finer machines take in a cycle, where no mode begins."""
    return FINE_STEP * constants.get("cFineChunk", 0)


def rest_work(constants: Mapping[str, int], modes: int) -> int:
    """Count those of a cycle at rest, for so many modes of all axes."""
    return (16 * constants["cVariations"] + 20) * modes if constants["cVariations"] else 0


def real_constants(fine: int, least_decay: float) -> dict[str, float]:
    """Give the others."""
    return {
        "cBetween": 1.02,  # of the sway on the machines watched and halfway: those between
        "cFineBetween": 1.05,  # likewise on finer ones
        "cSpread": SPREAD,
        "cFineSpread": 0.5 * CLOSE * (fine - 1),
        "cFineStep": 2.0 / (fine - 1),
        "cLeastDecay": least_decay,
        "cLeastRoom": 0.15,  # of the allowed sway, that an epoch may leave at least
        "cStopRoom": 0.4,  # where it stops
        "cKeptBack": 0.15,  # of what it may leave, towards its end
        "cTighter": 20.0,  # weight of second order, where as much of it is left as plans may spend
        # of what an epoch may leave: no plan or pulse that leaves more, if that is more than now
        "cAdmitted": 0.8,
        "cVariationSum": float(np.sum(np.power(VARIATIONS, 4))),
    }
