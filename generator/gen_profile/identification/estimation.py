"""The parameters of a machine that agree best with all measurements, and how well they are known.

The half-ranges hold with `CONFIDENCE` for all parameters at once (Šidák): the box that a robust design covers
has the machine in it that often.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np
from scipy.stats import norm

from gen_profile.identification.fit import Fit, Machine
from gen_profile.identification.measurements import DirectReading, Period, SwingLog
from gen_profile.identification.swing_model import swing_model
from gen_profile.identification.uncertainty import uncertainty
from gen_profile.profile import Array

CONFIDENCE = 0.99


@attrs.frozen(kw_only=True, eq=False)
class Estimate:
    """Identified parameters.

    Attributes
    ----------
    values : dict of str to float
    standard_uncertainty : dict of str to float
        One standard deviation, in the parameter's unit.
    half_range : dict of str to float
        Half of the range that the parameter is in with `CONFIDENCE`, all parameters at once.
    model : tuple of float
        What the identified machine would have shown instead of the readings.
    noise : tuple of float
        Standard deviation of every log's samples, in rad or m.
    unrest : tuple of float
        How many times farther off the model than the rest every log's first period is: about 1, unless the
        axes still moved then.
    contradiction : float
        Birge ratio by which the uncertainties were widened; 1 where the readings agree.
    """

    values: dict[str, float]
    standard_uncertainty: dict[str, float]
    half_range: dict[str, float]
    model: tuple[float, ...]
    noise: tuple[float, ...]
    unrest: tuple[float, ...]
    contradiction: float


def estimate(
    machine: Machine,
    names: Sequence[str],
    readings: Sequence[DirectReading | Period],
    logs: Sequence[SwingLog] = (),
) -> Estimate:
    """Identify parameters.

    Parameters
    ----------
    machine : Machine
        Its parameters are where the search starts.
    names : sequence of str
        Parameters to identify.
    readings : sequence of DirectReading or Period
    logs : sequence of SwingLog

    Raises
    ------
    InfeasibleProblem
        The measurements do not determine the parameters.
    """
    table = {q.name: q for q in machine.plant.parameters}
    scale = np.array([abs(machine.parameters[name]) or 1.0 for name in names])
    fit = Fit(
        machine=machine,
        names=tuple(names),
        scale=scale,
        bounds=np.array([(table[name].lower, table[name].upper) for name in names]).T / scale,
        readings=tuple(readings),
        models=tuple(swing_model(machine.plant, machine.parameters, machine.q_a, log) for log in logs),
    )
    unknowns, noise = fit.solve()
    around = uncertainty(fit, unknowns, noise)
    factor = float(norm.ppf((1.0 + CONFIDENCE ** (1.0 / len(names))) / 2.0))
    half_ranges = around.half_ranges(factor)

    def by_name(relative: Array) -> dict[str, float]:
        return dict(zip(names, map(float, relative * fit.scale), strict=True))

    return Estimate(
        values=by_name(unknowns[: len(names)]),
        standard_uncertainty=by_name(half_ranges / factor),
        half_range=by_name(half_ranges),
        model=tuple(map(float, fit.predicted(unknowns))),
        noise=tuple(map(float, noise)),
        unrest=around.unrest(),
        contradiction=around.contradiction,
    )
