"""How well parameters are known that agree best with measurements.

Every residual counts in standard deviations, so the covariance of the estimate is the inverse of JᵀJ, J the
residuals' slopes, of which what a swing's start can make up for is taken off (Gauss and Markov; JCGM
102:2011). Three things widen what follows from it:

- Readings that contradict one another beyond chance: the Birge ratio √(χ²/ν).
- A log's resolution, as of an encoder that counts. Such errors repeat with the swing and do not average out
  as noise does; they are followed through the fit for many places of the sensor's zero.
- Equations that are not straight within a range: its ends are moved outward until there the best fit is as
  much worse as it should be (profile likelihood; D. M. Bates and D. G. Watts, 1988, ch. 6).
"""

import math
from collections.abc import Sequence

import attrs
import numpy as np
from scipy.special import chdtrc

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.fit import Fit
from gen_profile.studies.identification.measurements import DirectReading
from gen_profile.support.errors import InfeasibleProblem
from gen_profile.support.phrase import AND, joined

WIDEST = 0.9  # relative half-range beyond which it is of no use: a spec cannot state it
IMPOSSIBLE = 10.0  # standard deviations off a reading, which no chance brings about
CHANCE = 1e-3  # how rarely good readings may look contradictory
INDISTINCT = 1e-6  # relative size of a combination of parameters that no measurement depends on
ZEROS = 32  # of a sensor that are tried, all over one step of its resolution
STRAIGHT = 0.1  # how far residuals may be from straight lines, in shares of a range
REACHED = 0.95  # of how much worse the fit shall be at a range's ends
WIDENINGS = 6
PINNED = 1e-3  # of a standard deviation, by which a parameter may leave its place


@attrs.frozen(kw_only=True, eq=False)
class Uncertainty:
    """What surrounds the best fit.

    Attributes
    ----------
    fit : Fit
    unknowns : (u,) array
        At the best fit.
    noise : (logs,) array
        Standard deviation of every log's samples, in rad or m.
    residuals, slopes : (residuals,) and (residuals, u) arrays
        There, in standard deviations.
    contradiction : float
        Birge ratio; 1 where the readings agree.
    covariance : (p, p) array
        Of the parameters over the fit's scale, without any widening.
    """

    fit: Fit
    unknowns: Array
    noise: Array
    residuals: Array
    slopes: Array
    contradiction: float
    covariance: Array

    @property
    def standard(self) -> Array:
        """Standard deviation of every parameter, shape (p,), over the fit's scale."""
        by_noise = self.contradiction * np.sqrt(np.diag(self.covariance))
        return np.maximum(by_noise, self._by_resolution())

    def half_ranges(self, factor: float) -> Array:
        """Find half of the range of so many standard deviations for every parameter, shape (p,)."""
        return np.array([self._half_range(index, factor) for index in range(len(self.fit.names))])

    def initial_residual_ratio(self) -> tuple[float, ...]:
        """Say how many times farther off than the rest the first period of every log is."""
        ratios = []
        for model, squares in zip(self.fit.models, self.fit.of_logs(self.residuals**2), strict=True):
            early, late = np.split(squares, [model.samples(model.period)])
            ratios.append(float(np.sqrt(early.mean() / late.mean())) if len(late) and late.any() else 1.0)
        return tuple(ratios)

    def _by_resolution(self) -> Array:
        """Follow the logs' rounding errors through the fit, shape (p,)."""
        answers = self.covariance @ _own_slopes(self.slopes, len(self.fit.names)).T
        variance, fit = np.zeros(len(answers)), self.fit
        parts = fit.models, self.noise, fit.of_logs(self.residuals), fit.of_logs(answers)
        for model, sigma, residuals, by in zip(*parts, strict=True):
            step = model.log.resolution
            exact = residuals * sigma + model.log.values
            zeros = step * (np.arange(ZEROS)[:, None] / ZEROS - 0.5)
            errors = np.round((exact + zeros) / step) * step - (exact + zeros)
            variance += np.square(by @ errors.T / sigma).mean(axis=1)
        return np.sqrt(variance)

    def _half_range(self, index: int, factor: float) -> float:
        half = factor * float(self.standard[index])
        if self._is_straight(index, half):
            return half
        return max(self._reach(index, side, half, factor) for side in (-1.0, 1.0))

    def _is_straight(self, index: int, half: float) -> bool:
        """Tell whether residuals change along straight lines within a range."""
        scale = half / math.sqrt(self.covariance[index, index])
        lower, upper = self.fit.bounds
        for side in (-1.0, 1.0):
            moved = side * half * self._direction(index)
            place = self.unknowns + moved
            if not ((lower < place[: len(lower)]) & (place[: len(lower)] < upper)).all():
                return False
            bent, _ = self.fit.residuals(place, self.noise)
            if np.linalg.norm(bent - self.residuals - self.slopes @ moved) > STRAIGHT * scale:
                return False
        return True

    def _reach(self, index: int, side: float, half: float, factor: float) -> float:
        """Go outward from the best fit until the fit is worse by `factor` standard deviations."""
        lower, upper = self.fit.bounds[:, index]
        best, widening = float(self.residuals @ self.residuals), float(self.standard[index])
        widening /= math.sqrt(self.covariance[index, index])
        for _ in range(WIDENINGS):
            place = float(np.clip(self.unknowns[index] + side * half, lower, upper))
            half = abs(place - self.unknowns[index])
            worse = self._best_at(index, place) - best
            deviations = math.sqrt(max(worse, 0.0)) / widening
            useless = half > WIDEST * abs(self.unknowns[index]) > 0.0
            if deviations >= REACHED * factor or place in (lower, upper) or useless:
                break
            half *= min(factor / max(deviations, 1e-9), 2.0)
        return half

    def _best_at(self, index: int, place: float) -> float:
        """Fit everything but one parameter, which stays at a place: the sum of squares.

        Where another one leaves what is of use, its own range will say so; machines are too wild there.
        """
        fit = self.fit
        pin = DirectReading(
            parameter=fit.names[index],
            value=place * fit.scale[index],
            uncertainty=PINNED * float(self.standard[index]) * fit.scale[index],
        )
        values = self.unknowns[: len(fit.names)]
        ends = np.sort([values * (1.0 - WIDEST), values * (1.0 + WIDEST)], axis=0)
        near = np.where(values == 0.0, fit.bounds, np.clip(ends, *fit.bounds))
        pinned = attrs.evolve(fit, readings=(*fit.readings, pin), bounds=near)
        guess = self.unknowns + (place - self.unknowns[index]) * self._direction(index)
        best = pinned.improved(guess, self.noise)
        residuals, _ = fit.residuals(best, self.noise)
        return float(residuals @ residuals)

    def _direction(self, index: int) -> Array:
        """Say how all unknowns follow where one of them moves by one, shape (u,)."""
        others = np.delete(np.arange(len(self.unknowns)), index)
        direction = np.ones(len(self.unknowns))
        follow, *_ = np.linalg.lstsq(self.slopes[:, others], -self.slopes[:, index], rcond=INDISTINCT)
        direction[others] = follow
        return direction


def uncertainty(fit: Fit, unknowns: Array, noise: Array) -> Uncertainty:
    """Look around the best fit.

    Raises
    ------
    InfeasibleProblem
        The measurements do not determine the parameters, or ask for more than the machine takes.
    """
    residuals, slopes = fit.residuals(unknowns, noise)
    own, count = _own_slopes(slopes, len(fit.names)), len(fit.readings)
    _require_determined(fit.names, own)
    _require_possible(fit, unknowns, residuals[:count])
    return Uncertainty(
        fit=fit,
        unknowns=unknowns,
        noise=noise,
        residuals=residuals,
        slopes=slopes,
        contradiction=_birge_ratio(residuals[:count], count - (0 if fit.models else len(fit.names))),
        covariance=np.asarray(np.linalg.inv(own.T @ own), dtype=np.float64),
    )


def _own_slopes(slopes: Array, parameters: int) -> Array:
    """Take off the parameters' slopes what the other unknowns can make up for."""
    others, kept = slopes[:, parameters:], slopes[:, :parameters]
    if others.shape[1] == 0:
        return kept
    size = np.linalg.norm(others, axis=0)
    basis, singular, _ = np.linalg.svd(others / np.where(size > 0.0, size, 1.0), full_matrices=False)
    basis = basis[:, singular > INDISTINCT * singular[0]]
    return np.asarray(kept - basis @ (basis.T @ kept))


def _require_determined(names: Sequence[str], slopes: Array) -> None:
    size = np.linalg.norm(slopes, axis=0)
    blind = [name for name, length in zip(names, size, strict=True) if length == 0.0]
    if not blind:
        # of the triangle alone: the left vectors of all rows would take the square of a log's length
        _, singular, directions = np.linalg.svd(np.linalg.qr(slopes / size, mode="r"))
        if len(singular) == len(names) and singular[-1] > INDISTINCT:
            return
        worst = np.abs(directions[-1])
        blind = [name for name, fraction in zip(names, worst, strict=True) if fraction > 0.1]
    template = (
        "The measurements do not determine {blind}; measure {which} directly, or another mode's period."
    )
    raise InfeasibleProblem(
        template, blind=joined(AND, blind), which="it" if len(blind) == 1 else "one of them"
    )


def _require_possible(fit: Fit, unknowns: Array, residuals: Array) -> None:
    """Refuse readings that no such machine shows: the best one lies at a bound, and is far off them."""
    if np.abs(residuals).max(initial=0.0) < IMPOSSIBLE:
        return
    values = unknowns[: len(fit.names)]
    for bounds, word in zip(fit.bounds, ("least", "most"), strict=True):
        for name, at in zip(fit.names, np.isclose(values, bounds, rtol=1e-6, atol=1e-9), strict=True):
            if at:
                edge = float((bounds * fit.scale)[fit.names.index(name)])
                template = (
                    "With no {name} would the machine show these readings, not even with {edge:g}, the "
                    "{word} that it takes; look for a wrong reading, or a wrong unit."
                )
                raise InfeasibleProblem(template, name=name, edge=edge, word=word)


def _birge_ratio(residuals: Array, freedom: int) -> float:
    square = float(residuals @ residuals)
    if freedom < 1 or chdtrc(freedom, square) > CHANCE:
        return 1.0
    return float(np.sqrt(square / freedom))
