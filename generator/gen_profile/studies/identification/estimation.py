"""The parameters of a machine that agree best with all measurements, and how well they are known.

The half-ranges hold with `CONFIDENCE` for all parameters at once (Šidák): the box that a robust design covers
has the machine in it that often.
"""

from collections.abc import Sequence

import attrs
import numpy as np
from scipy.special import ndtri

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.fit import Fit, fit_of
from gen_profile.studies.identification.measurements import DirectReading, Period, SwingLog
from gen_profile.studies.identification.misfit import Misfit, elsewhere, explanations, misfits
from gen_profile.studies.identification.swing_model import SwingingMachine, require_likely, swing_model
from gen_profile.studies.identification.uncertainty import Uncertainty, uncertainty
from gen_profile.support.errors import InfeasibleProblem
from gen_profile.support.phrase import AND, OR_WITH, Phrase, joined
from gen_profile.support.progress import Progress, no_progress

CONFIDENCE = 0.99
INITIAL_RESIDUAL_RATIO = 2.0  # times farther off at first, from which on the axes may still have moved then
MISFIT_RATIO = 2.0  # times as far off a machine as off its own a log may be beside others
SEEN = 100.0  # variances of its noise by which a swing of the machine makes up for a log
GRAVITY = "g"  # is known wherever a crane stands


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
        Standard deviation of what is left of every log, in rad or m.
    initial_residual_ratio : tuple of float
        How many times farther off the model than the rest every log's first period is: about 1, unless the
        axes still moved then.
    contradiction : float
        Birge ratio by which the uncertainties were widened; 1 where the readings agree.
    misfits : tuple of Misfit or None
        What swings in every log beside the machine.
    widened : tuple of float
        How many times wider ranges are that follow from every log, because of that.
    rests_on : dict of str to dict of str to float
        By how much every parameter found would change if another one, taken as exact, were 1 % greater.
    swings : tuple of Array
        What the identified machine would have shown instead of every log.
    """

    values: dict[str, float]
    standard_uncertainty: dict[str, float]
    half_range: dict[str, float]
    model: tuple[float, ...]
    noise: tuple[float, ...]
    initial_residual_ratio: tuple[float, ...]
    contradiction: float
    misfits: tuple[Misfit | None, ...]
    widened: tuple[float, ...]
    rests_on: dict[str, dict[str, float]]
    swings: tuple[Array, ...]


def estimate(
    machine: SwingingMachine,
    names: Sequence[str],
    readings: Sequence[DirectReading | Period],
    logs: Sequence[SwingLog] = (),
    progress: Progress = no_progress,
) -> Estimate:
    """Identify parameters.

    Parameters
    ----------
    machine : SwingingMachine
        Its parameters are where the search starts.
    names : sequence of str
        Parameters to identify.
    readings : sequence of DirectReading or Period
    logs : sequence of SwingLog
    progress : callable
        Told what is being done.

    Raises
    ------
    InfeasibleProblem
        The measurements do not determine the parameters.
    """
    models = [swing_model(machine, log) for log in logs]
    for model in models:
        require_likely(model)
    fit = fit_of(machine, names, readings, models)
    progress("fitting")
    try:
        unknowns, noise = fit.solve()
        progress("looking at what the fit leaves")
        around, misfit_of_logs = uncertainty(fit, unknowns, noise), misfits(fit, unknowns)
        again = elsewhere(fit) if any(misfit_of_logs) else None
    except InfeasibleProblem:
        if (again := elsewhere(fit)) is None:
            raise
    if again is not None:
        around, noise = uncertainty(again.fit, again.unknowns, again.noise), again.noise
        misfit_of_logs = misfits(again.fit, again.unknowns)
    if not any(misfit_of_logs):
        return _estimate(around, noise, misfit_of_logs, noise, progress)
    _require_unexplained(fit, misfit_of_logs, progress)
    effective = [
        sigma if one is None else one.widened(sigma, len(model.log.times))
        for one, sigma, model in zip(misfit_of_logs, noise.tolist(), fit.models, strict=True)
    ]
    around = uncertainty(fit, unknowns, np.array(effective))
    return _estimate(around, noise, misfit_of_logs, effective, progress)


def _estimate(
    around: Uncertainty,
    noise: Array,
    misfit_of_logs: tuple[Misfit | None, ...],
    effective: Sequence[float] | Array,
    progress: Progress,
) -> Estimate:
    """Tell the ranges that hold all parameters at once, and what they follow from."""
    fit, unknowns = around.fit, around.unknowns
    factor = float(ndtri((1.0 + CONFIDENCE ** (1.0 / len(fit.names))) / 2.0))
    progress("finding the ranges")
    half_ranges, lefts = around.half_ranges(factor), fit.left(unknowns)
    require_swings(fit, lefts, noise, misfit_of_logs)
    if len(lefts) > 1:
        _require_one_machine(fit, lefts)

    def by_name(relative: Array) -> dict[str, float]:
        return dict(zip(fit.names, map(float, relative * fit.scale), strict=True))

    return Estimate(
        values=by_name(unknowns[: len(fit.names)]),
        standard_uncertainty=by_name(half_ranges / factor),
        half_range=by_name(half_ranges),
        model=tuple(map(float, fit.predicted(unknowns))),
        noise=tuple(float(np.std(left)) for left in lefts),
        initial_residual_ratio=around.initial_residual_ratio(),
        contradiction=around.contradiction,
        misfits=misfit_of_logs,
        widened=tuple(float(wide / sigma) for wide, sigma in zip(effective, noise, strict=True)),
        rests_on=_rests_on(around),
        swings=tuple(one.log.values + left for one, left in zip(fit.models, lefts, strict=True)),
    )


def require_swings(
    fit: Fit, lefts: Sequence[Array], noise: Array, misfit_of_logs: Sequence[Misfit | None]
) -> None:
    """Refuse a log that shows noise alone: some frequency always explains a little of that."""
    for model, left, sigma, misfit in zip(fit.models, lefts, noise.tolist(), misfit_of_logs, strict=True):
        zeros, values = model.zeros(), model.log.values
        still = values - zeros @ np.linalg.lstsq(zeros, values)[0]
        if misfit is None and still @ still - left @ left < SEEN * sigma**2:
            template = (
                "The log of {log.load} shows no swing of this machine, but noise of {noise:.2g} {log.unit} "
                "RMS; look at its columns, signal and unit, and let the load swing wider."
            )
            raise InfeasibleProblem(template, log=model.log, noise=float(np.std(left)))


def _require_one_machine(fit: Fit, lefts: Sequence[Array]) -> None:
    """Refuse logs that fit a machine each, and not one together: their range would hold neither."""
    for number, (model, left) in enumerate(zip(fit.models, lefts, strict=True), 1):
        alone = fit_of(fit.machine, fit.names, (), [model])
        try:
            least = alone.left(alone.solve()[0])[0]
        except InfeasibleProblem:  # one log may tell too little
            continue
        if np.std(left) > MISFIT_RATIO * np.std(least):
            raise InfeasibleProblem(
                f"The logs are not of one machine: number {number}, of {model.log.load}, is "
                f"{np.std(left) / np.std(least):.2g} times as far off it as off one of its own. Identify "
                "from each by itself, and look what was changed in between."
            )


def taken_as_exact(fit: Fit) -> list[str]:
    """Name the parameters that are neither identified nor known anyway."""
    return [q.name for q in fit.machine.plant.parameters if q.name not in (*fit.names, GRAVITY)]


def _require_unexplained(fit: Fit, misfit_of_logs: Sequence[Misfit | None], progress: Progress) -> None:
    """Refuse to identify some parameters by a log that tells that others are wrong.

    The range of a wrong model holds nothing.
    """
    explained = explanations(fit, taken_as_exact(fit), progress)
    if not explained:
        return
    model, left = next((m, one) for m, one in zip(fit.models, misfit_of_logs, strict=True) if one is not None)
    template = "another {freed} than the spec's ({values})"
    others = [Phrase(template, freed=joined(AND, one.freed), values=one.words) for one in explained]
    freed = joined(AND, explained[0].freed)
    template = "free {freed}, too, or measure {which} directly"
    cure: str = Phrase(template, freed=freed, which="it" if len(explained[0].freed) == 1 else "them")
    if len(others) > 1:
        cure = "the log cannot tell which: measure one of them directly, or free one that is not certain"
    template = (
        "The log of {model.log.load} is not of this machine: a swing of {left.rms:.2g} "
        "{model.log.unit} RMS, {ratio:.2g} times the noise, is left of it, strongest at "
        "{left.frequency:.3g} rad/s. Nothing is left with {others}; {cure}."
    )
    ratio, others_joined = left.rms / left.noise, joined(OR_WITH, others)
    raise InfeasibleProblem(template, model=model, left=left, ratio=ratio, others=others_joined, cure=cure)


def _rests_on(around: Uncertainty) -> dict[str, dict[str, float]]:
    """Follow 1 % of every parameter that was taken as exact through the fit, for small swings."""
    fit, exact = around.fit, taken_as_exact(around.fit)
    exact = [name for name in exact if fit.machine.parameters[name] != 0.0]
    wider = fit.freed(exact).small()
    places = {name: wider.names.index(name) for name in wider.names}
    own = [places[name] for name in fit.names]
    unknowns = np.concatenate([wider.expected, around.unknowns[len(fit.names) :]])
    unknowns[own] = around.unknowns[: len(fit.names)]
    _, slopes = wider.residuals(unknowns, around.noise)
    starts = list(range(len(wider.names), slopes.shape[1]))
    free = slopes[:, [*own, *starts]]
    moved = {name: np.linalg.lstsq(free, -0.01 * slopes[:, places[name]], rcond=None)[0] for name in exact}
    return {
        name: {other: float(by[place] * fit.scale[place]) for other, by in moved.items()}
        for place, name in enumerate(fit.names)
    }
