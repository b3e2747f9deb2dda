"""A fitted swing as a picture: the log and the machine's swing, what is left, and its spectrum."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gen_profile.charts.figure import FRAME, INK, PALETTE
from gen_profile.charts.picture import picture, require_drawable
from gen_profile.identification.identify import Identification
from gen_profile.identification.misfit import spectrum
from gen_profile.problem.linearization import linearize

__all__ = ["draw", "require_drawable"]
THIN = {"linewidth": 0.9}


def draw(found: Identification, path: Path) -> None:
    """Draw the first log beside the identified machine.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    log, swing, spec = found.logs[0], found.estimate.swings[0], found.spec
    left = log.values - swing
    natural = linearize(spec.machine(), spec.plant.parameters, found.q_a).frequencies
    shown = spectrum(log.times, left, float(natural[-1]))
    amplitude = 2.0 * np.sqrt(shown.power / len(left))
    chance = 2.0 * np.sqrt(shown.threshold / len(left))
    with picture(path, spec.name, (10.0, 8.0)) as figure:
        above, middle, below = figure.subplots(3, 1)
        above.plot(log.times, log.values, ".", color=PALETTE[1], markersize=2.5, label="logged")
        above.plot(log.times, swing, color=PALETTE[0], label="machine found", **THIN)
        above.set(xlabel="time (s)", ylabel=f"{log.quantity} of {log.load} ({log.unit})")
        middle.plot(log.times, left, color=PALETTE[1], **THIN)
        middle.set(xlabel="time (s)", ylabel=f"left of it ({log.unit})")
        below.semilogy(shown.frequencies, amplitude, color=PALETTE[1], label="what is left", **THIN)
        below.semilogy(shown.frequencies, chance, "--", color=INK, label="noise stays below", **THIN)
        for mode, frequency in enumerate(natural.tolist()):
            below.axvline(
                frequency, color=FRAME, linestyle=":", label="natural frequencies" if mode == 0 else ""
            )
        below.set(xlabel="frequency (rad/s)", ylabel=f"amplitude ({log.unit})")
        for axis in (above, below):
            axis.legend(loc="upper right", fontsize="small")
        figure.suptitle(f"{spec.name}: {', '.join(found.estimate.values)} identified")
