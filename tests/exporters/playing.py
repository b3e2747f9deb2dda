"""Running a playback block cycle by cycle in the interpreter of the language."""

import numpy as np
from st_interpreter import FunctionBlock

QUANTITIES = ("position", "velocity", "acceleration")
IDLE = {"bExecute": False, "bContinue": False, "bAbort": False, "bHold": False, "rOverride": 1.0}


def checked(text):
    """An instance that has found its table right, standing still."""
    fb = FunctionBlock(text)
    while not fb["bChecked"]:
        fb.call()
    return fb


def start(fb, **inputs):
    """Raise bExecute at the start position; that cycle's outputs."""
    fb.call(**IDLE)
    given = {"fCycleTime": fb["cCycleTime"], "fActPosition": fb["cStart"], **inputs}
    return fb.call(bExecute=True, **given)


def play(fb, outputs, most=100_000):
    """Go on until the block is no longer busy; every cycle's outputs, the given ones first."""
    rows = [outputs]
    while rows[-1]["bbusy"]:
        rows.append(fb.call())
        assert len(rows) <= most
    return rows


def column(rows, quantity):
    """One output of every cycle, shape (cycles, axes)."""
    return np.array([row[f"f{quantity}"] for row in rows]).reshape(len(rows), -1)
