"""What the best fit leaves of a log, and which parameter explains it.

Noise has a smooth spectrum. Where the machine is another one than the spec says, the residuals hold lines:
the swing of a wrong second mode, or of a damping that is not modelled. A line stands out of its neighbours in
the periodogram (N. R. Lomb, 1976), whose ordinates are distributed exponentially where there is none.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import attrs
import numpy as np
from scipy.ndimage import median_filter

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.fit import Fit
from gen_profile.studies.identification.swing_model import WIDEST_SWING, SwingModel, shortened
from gen_profile.studies.identification.uncertainty import WIDEST, uncertainty
from gen_profile.support.errors import CosimulationError, InfeasibleProblem
from gen_profile.support.phrase import AND, joined
from gen_profile.support.progress import Progress, no_progress

HARMONICS = 4.0  # times the fastest natural frequency up to which lines are looked for
MOST_LINES = 2000
AT_ONCE = 1_000_000  # products of a frequency and a time: arrays of all take more than the log
FEWEST = 64.0  # ordinates, which tell what noise is
NEIGHBOURS = 33  # ordinates whose median is the noise around a line
CHANCE = 1e-4  # how rarely noise may look like a line
DOUBT = 1.5  # by which a median of so few may be off
QUANTISATION_NOISE = 0.35  # of a sensor's step: rounding errors repeat with the swing
EXACT = 1e-5  # of the swing, which is the integrator's business
EQUIVALENT = 1.1  # times the least sum of squares, within which parameters may explain the same
DISTINCT = 12.0  # by which the squares of an explanation are more by chance once in 2000 times
STARTS = (1.0, 0.5, 0.7, 1.4, 2.0)  # times a parameter of the spec, where it is looked for
ROUGHLY = 1200  # samples, four of each of the fastest swings, by which parameters are chosen
TRIED = 2  # parameters at once that may explain what is left
GROSS = 0.5  # of a log's standard deviation: a machine that leaves more of it explains nothing
BENT = 0.5  # of what small swings leave, by which large ones must differ to explain it


@attrs.frozen(kw_only=True, eq=False)
class Spectrum:
    """Periodogram of a log's residuals.

    Attributes
    ----------
    frequencies : (k,) array
        rad/s, as many as are independent.
    power : (k,) array
        White noise has its variance everywhere.
    background : (k,) array
        What noise alone would have there.
    """

    frequencies: Array
    power: Array
    background: Array

    @property
    def threshold(self) -> Array:
        """Power that noise does not reach, shape (k,)."""
        return DOUBT * math.log(len(self.power) / CHANCE) * self.background


@attrs.frozen(kw_only=True)
class Misfit:
    """Lines that the fit leaves of a log.

    Attributes
    ----------
    rms : float
        Root mean square of all of them together, in rad or m.
    frequency : float
        Of the strongest, in rad/s.
    noise : float
        Root mean square of the rest, in rad or m.
    """

    rms: float
    frequency: float
    noise: float

    def widened(self, sigma: float, samples: int) -> float:
        """Widen the samples' standard deviation by the misfit.

        The lines may hide as much again at the swing's own frequency, where the fit took it for the swing.
        Such an error does not average out: of n samples it counts √n times.
        """
        return math.hypot(sigma, math.sqrt(samples) * self.rms)


def spectrum(times: Array, residuals: Array, fastest: float) -> Spectrum:
    """Take the periodogram of residuals up to some harmonics of the fastest natural frequency in rad/s."""
    from scipy.signal import lombscargle  # noqa: PLC0415  (half of what a command that draws takes to start)

    apart = 2.0 * np.pi / float(times[-1] - times[0])
    highest = min(max(HARMONICS * fastest, FEWEST * apart), np.pi / float(np.median(np.diff(times))))
    count = min(max(int(highest / apart), 1), MOST_LINES)
    frequencies = np.linspace(1.0, highest / apart, count) * apart
    # a line that swells or dies would hide all around it in its own skirt, which a window takes away
    place = (times - times[0]) / (times[-1] - times[0])
    window = 1.0 - np.cos(2.0 * np.pi * place)
    swinging = window * (residuals - float(window @ residuals / window.sum()))
    swinging *= math.sqrt(len(times) / float(window @ window))
    parts = np.array_split(frequencies, max(count * len(times) // AT_ONCE, 1))
    power = np.concatenate([lombscargle(np.array(times), swinging, part) for part in parts])
    around = median_filter(power, min(NEIGHBOURS, len(power)), mode="reflect")
    around = np.maximum(around, np.median(power)) / math.log(2.0)  # smooth noise may have deep valleys
    return Spectrum(frequencies=frequencies, power=power, background=around)


def misfit(model: SwingModel, parameters: Mapping[str, float], residuals: Array) -> Misfit | None:
    """Look for lines in the residuals of a log, in rad or m; None where there is nothing but noise."""
    log, fastest = model.log, float(model.machine.of(parameters).linear.frequencies[-1])
    periodogram = spectrum(log.times, residuals, fastest)
    lines = periodogram.power > periodogram.threshold
    if not lines.any():
        return None
    bin_fraction = 1.0 / len(periodogram.power)
    square = float(np.square(residuals - residuals.mean()).mean())
    in_lines = 2.0 / len(residuals) * float((periodogram.power - periodogram.background)[lines].sum())
    rms = math.sqrt(min(in_lines, (1.0 - bin_fraction) * square))
    if rms < max(QUANTISATION_NOISE * log.resolution, EXACT * float(np.ptp(log.values))):
        return None
    return Misfit(
        rms=rms,
        frequency=float(periodogram.frequencies[np.argmax(np.where(lines, periodogram.power, 0.0))]),
        noise=math.sqrt(square - rms**2),
    )


def misfits(fit: Fit, unknowns: Array) -> tuple[Misfit | None, ...]:
    """Look for lines in what is left of every log."""
    parameters = fit.parameters(unknowns)
    left = fit.left(unknowns)
    return tuple(misfit(m, parameters, residuals) for m, residuals in zip(fit.models, left, strict=True))


@attrs.frozen(kw_only=True, eq=False)
class Explanation:
    """Parameters whose other values leave nothing but noise.

    Attributes
    ----------
    freed : tuple of str
        That were taken as known.
    fit : Fit
        That identifies them, too.
    unknowns : (u,) array
        At its best.
    noise : (logs,) array
        Standard deviation of every log's samples then, in rad or m.
    """

    freed: tuple[str, ...]
    fit: Fit
    unknowns: Array
    noise: Array

    @property
    def words(self) -> str:
        """All parameters that are then identified, with their values."""
        parameters, units = self.fit.parameters(self.unknowns), self.fit.machine.plant.units
        return ", ".join(f"{name} {parameters[name]:.4g} {units[name]}" for name in self.fit.names)

    def squares(self, noise: Array) -> float:
        """Sum up the squares of what is left, in variances of some noise."""
        residuals, _ = self.fit.residuals(self.unknowns, noise)
        return float(residuals @ residuals)


def elsewhere(fit: Fit) -> Explanation | None:
    """Find a fit that leaves nothing but noise, by large swings, or begun at another value of a parameter."""
    if not fit.models:
        return None
    near = fit.as_of_small_swings()
    tried = near is not None and _may_explain(fit, near)
    if tried and (patiently := nothing_left(fit, (), small_first=False)) is not None:
        return patiently
    rough, read = _rough(fit), {getattr(reading, "parameter", "") for reading in fit.readings}
    begun = (_of_small_swings(rough, name) for name in fit.names if name not in read)
    found = (nothing_left(attrs.evolve(one.fit, models=fit.models), ()) for one in begun if one.explains)
    return next((one for one in found if one is not None), None)


def _rough(fit: Fit) -> Fit:
    """Fit fewer averages of the logs."""
    models = (attrs.evolve(one, log=shortened(one.log, fit.machine, ROUGHLY)) for one in fit.models)
    return attrs.evolve(fit, models=tuple(models))


def explanations(fit: Fit, more: Sequence[str], progress: Progress = no_progress) -> tuple[Explanation, ...]:
    """Find which parameters, identified as well, leave nothing but noise of every log.

    As few as will do are taken up, first those with which small swings fit best, which is fast to find out.
    Each is tried on the whole logs then. Where logs tell some apart beyond chance (by the likelihood ratio;
    S. S. Wilks, 1938), those that explain less are left out; what remains explains them alike.

    Parameters
    ----------
    fit : Fit
    more : sequence of str
        Parameters that were taken as known.
    progress : callable
        Told what is being done.
    """
    rough = _rough(fit)
    begun: list[tuple[str, ...]] = [()]
    for count in range(1, min(TRIED, len(more)) + 1):
        longer = [(*freed, name) for freed in begun for name in more if name not in freed]
        sets = {frozenset(freed): freed for freed in longer}
        stage, tried = f"looking for parameters that explain it, {count} at once", {}
        for number, freed in enumerate(sets.values()):
            progress(stage, number, len(sets), joined(AND, freed))
            tried[freed] = _of_small_swings(rough.freed(freed), freed[-1])
        most = EQUIVALENT * min(one.squares for one in tried.values())
        begun = [freed for freed, one in tried.items() if one.squares <= most < math.inf]
        worthwhile = {freed: tried[freed].fit for freed in begun if tried[freed].explains}
        found = []
        for number, (freed, one) in enumerate(worthwhile.items()):
            progress("trying what may explain it", number, len(worthwhile), joined(AND, freed))
            found.append(nothing_left(attrs.evolve(one, models=fit.models), freed))
        if likely := likeliest([one for one in found if one is not None]):
            return likely
        if not begun:
            return ()
    return ()


def likeliest(candidates: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """Leave out explanations that another one surpasses beyond chance."""
    if not candidates:
        return ()
    noise = np.min([one.noise for one in candidates], axis=0)
    squares = [one.squares(noise) for one in candidates]
    upper = min(squares) + DISTINCT
    return tuple(one for one, left in zip(candidates, squares, strict=True) if left <= upper)


@attrs.frozen(kw_only=True, eq=False)
class _SmallSwings:
    """The best fit of small swings.

    Attributes
    ----------
    fit : Fit
        That begins where it is.
    squares : float
        Left of all logs; infinite where they do not tell the parameters.
    unknowns : (u,) array
        There.
    """

    fit: Fit
    squares: float = math.inf
    unknowns: Array = attrs.field(factory=partial(np.empty, 0))

    @property
    def explains(self) -> bool:
        """Whether it leaves so little that it is worth its while to try large swings, which takes seconds."""
        squares = (float(np.var(model.log.values)) * len(model.log.times) for model in self.fit.models)
        return self.squares <= GROSS**2 * sum(squares) and _may_explain(self.fit, self.unknowns)


def _of_small_swings(fit: Fit, name: str) -> _SmallSwings:
    """Find the best fit of small swings, from some values of one parameter around the spec's."""
    stated = fit.machine.parameters
    starts = [fit.beginning({**stated, name: factor * stated[name]}) for factor in STARTS if stated[name]]
    fits = [_SmallSwings(fit=fit)]
    for start in starts or [fit]:
        small = start.small()
        try:
            unknowns, noise = small.solve()
            uncertainty(small, unknowns, noise)
        except (InfeasibleProblem, np.linalg.LinAlgError):
            continue
        squares = float(sum(residuals @ residuals for residuals in small.left(unknowns)))
        begun = fit.beginning(fit.parameters(unknowns))
        fits.append(_SmallSwings(fit=begun, squares=squares, unknowns=unknowns))
    return min(fits, key=lambda one: one.squares)


def _may_explain(fit: Fit, unknowns: Array) -> bool:
    """Tell whether large swings may leave only noise where the best small ones, at these unknowns, did not.

    They cannot where they differ from small ones by far less than what those leave. A machine whose loads,
    seen by the log or not, would swing farther than any load is let explains nothing; as its damping may be
    endless, to integrate it once may take half a minute.
    """
    small, parameters = fit.small(), fit.parameters(unknowns)
    ends = np.cumsum([len(fit.names), *(model.unknowns for model in fit.models)])
    starts = np.split(unknowns, ends)[1:-1]
    pairs = zip(fit.models, starts, strict=True)
    if any(model.widest(parameters, start) > WIDEST_SWING for model, start in pairs):
        return False
    if not any(misfits(small, unknowns)):
        return True
    try:
        large = np.concatenate(fit.left(unknowns))
    except CosimulationError:
        return True
    left = np.concatenate(small.left(unknowns))
    return bool(np.linalg.norm(large - left) > BENT * np.linalg.norm(left))


def nothing_left(fit: Fit, freed: tuple[str, ...], *, small_first: bool = True) -> Explanation | None:
    """Identify the parameters; None where lines are left even so, or a range is of no use."""
    try:
        unknowns, noise = fit.solve(small_first=small_first)
        around = uncertainty(fit, unknowns, noise)
    except (InfeasibleProblem, CosimulationError, np.linalg.LinAlgError):
        return None
    values = unknowns[: len(fit.names)]
    if any(misfits(fit, unknowns)) or (around.standard > WIDEST * np.abs(values)).any():
        return None
    return Explanation(freed=freed, fit=fit, unknowns=unknowns, noise=noise)
