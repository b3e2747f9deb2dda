"""A log that begins while the axes still move: from when on it is a free swing of the machine."""

from collections.abc import Sequence

import attrs

from gen_profile.studies.identification.estimation import require_swings
from gen_profile.studies.identification.fit import fit_of
from gen_profile.studies.identification.measurements import DirectReading, Period, SwingLog
from gen_profile.studies.identification.misfit import misfits
from gen_profile.studies.identification.swing_model import SwingingMachine, require_likely, swing_model
from gen_profile.support.errors import CosimulationError, InfeasibleProblem

PARTS = 8  # of a log, at the beginnings of which it is tried
FIRST = 4  # of them that is: an end that is no swing makes the others not worth their while


def swings_from(
    machine: SwingingMachine, names: Sequence[str], readings: Sequence[DirectReading | Period], log: SwingLog
) -> SwingLog | None:
    """Find the part of a log that leaves nothing but noise of the machine's swing; None where there is none.

    Parameters
    ----------
    machine : SwingingMachine
    names : sequence of str
        Parameters to identify.
    readings : sequence of DirectReading or Period
    log : SwingLog
        That does not from its beginning on.

    Returns
    -------
    SwingLog or None
        What is left from its ``start_time`` on.
    """
    if not _swings(machine, names, readings, _later(log, FIRST)):
        return None
    earlier = (part for part in range(1, FIRST) if _swings(machine, names, readings, _later(log, part)))
    return _later(log, next(earlier, FIRST))


def _later(log: SwingLog, part: int) -> SwingLog:
    kept = log.times >= log.times[-1] * part / PARTS
    times = log.times[kept]
    return attrs.evolve(
        log, times=times - times[0], values=log.values[kept], start_time=log.start_time + float(times[0])
    )


def _swings(
    machine: SwingingMachine, names: Sequence[str], readings: Sequence[DirectReading | Period], log: SwingLog
) -> bool:
    try:
        model = swing_model(machine, log)
        require_likely(model)  # a search from far away takes minutes
        fit = fit_of(machine, names, readings, [model])
        unknowns, noise = fit.solve()
        if any(misfits(fit, unknowns)):
            return False
        require_swings(fit, fit.left(unknowns), noise, [None])
    except (InfeasibleProblem, CosimulationError):
        return False
    return True
