"""Weighted least squares: the parameters that agree best with all measurements, and how well they are known.

Every residual is divided by its standard deviation, so the covariance of the estimate is the inverse of JᵀJ,
J the residuals' slopes (Gauss and Markov; JCGM 102:2011). How a swing began and its sensor's zero are
estimated along and eliminated. The noise of a log is taken from its residuals; where neighbouring ones are
alike, they count as fewer, n (1 − ρ)/(1 + ρ), ρ their correlation. Where readings contradict one another
beyond chance, all uncertainties are widened by the Birge ratio √(χ²/ν).

The half-ranges hold with `CONFIDENCE` for all parameters at once (Šidák): the box that a robust design covers
has the machine in it that often.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import attrs
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2, norm

from gen_profile.errors import InfeasibleProblem
from gen_profile.identification.measurements import DirectReading, Period, SwingLog
from gen_profile.identification.swing_model import STEP, SwingModel
from gen_profile.plants.plant import Plant
from gen_profile.problem.linearization import linearize
from gen_profile.profile import Array

CONFIDENCE = 0.99
CHANCE = 1e-3  # how rarely good readings may look contradictory
INDISTINCT = 1e-6  # relative size of a combination of parameters that no measurement depends on
NOISE_ROUNDS = 2
TOLERANCE = 1e-8  # relative, of the unknowns and of the sum of squares


@attrs.frozen(kw_only=True, eq=False)
class Machine:
    """What is known beforehand: the machine, all its parameters, and where its axes stood."""

    plant: Plant
    parameters: Mapping[str, float]
    q_a: tuple[float, ...]


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
    contradiction : float
        Birge ratio by which the uncertainties were widened; 1 where the readings agree.
    """

    values: dict[str, float]
    standard_uncertainty: dict[str, float]
    half_range: dict[str, float]
    model: tuple[float, ...]
    noise: tuple[float, ...]
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
    fit = _Fit(
        machine=machine,
        names=tuple(names),
        scale=np.array([abs(machine.parameters[name]) or 1.0 for name in names]),
        readings=tuple(readings),
        models=tuple(SwingModel(plant=machine.plant, q_a=machine.q_a, log=log) for log in logs),
    )
    unknowns, noise = fit.solve()
    residuals, slopes = fit.residuals(unknowns, noise, np.inf)
    slopes = _eliminate(slopes, len(names))
    _require_determined(names, slopes)
    count = len(readings)
    birge = _birge_ratio(residuals[:count], count - (0 if logs else len(names)))
    standard = birge * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes))) * fit.scale
    factor = float(norm.ppf((1.0 + CONFIDENCE ** (1.0 / len(names))) / 2.0))
    return Estimate(
        values=dict(zip(names, map(float, unknowns[: len(names)] * fit.scale), strict=True)),
        standard_uncertainty=dict(zip(names, map(float, standard), strict=True)),
        half_range=dict(zip(names, map(float, factor * standard), strict=True)),
        model=tuple(map(float, fit.predicted(unknowns))),
        noise=tuple(map(float, noise)),
        contradiction=birge,
    )


@attrs.frozen(kw_only=True, eq=False)
class _Fit:
    """The least-squares problem; unknowns are the parameters over `scale`, then every log's start."""

    machine: Machine
    names: tuple[str, ...]
    scale: Array
    readings: tuple[DirectReading | Period, ...]
    models: tuple[SwingModel, ...]

    def solve(self) -> tuple[Array, Array]:
        """Find the unknowns, and the noise of every log.

        A long log has many local minima, one for every period that a wrong frequency can lose over it. So its
        first period is fitted first, and then as much again, until it is used up.
        """
        names = self.names
        guess = np.array([self.machine.parameters[name] for name in names]) / self.scale
        if not self.models:
            return self._solve(guess, np.empty(0), np.inf), np.empty(0)
        slowest = linearize(self.machine.plant, self.machine.parameters, self.machine.q_a).frequencies[0]
        until, longest = 2.0 * np.pi / slowest, max(model.log.times[-1] for model in self.models)
        starts = [model.guess(self.machine.parameters, until) for model in self.models]
        unknowns = np.concatenate([guess, *starts])
        noise = self._noise(unknowns, until, 0)
        while until < longest:
            unknowns = self._solve(unknowns, noise, until)
            noise = self._noise(unknowns, until, len(names))
            until *= 2.0
        for _ in range(NOISE_ROUNDS):
            unknowns = self._solve(unknowns, noise, np.inf)
            noise = self._noise(unknowns, np.inf, len(names))
        return unknowns, noise

    def _solve(self, guess: Array, noise: Array, until: float) -> Array:
        table = {q.name: q for q in self.machine.plant.parameters}
        free = np.full(len(guess) - len(self.names), np.inf)
        lower = np.array([table[name].lower for name in self.names]) / self.scale
        upper = np.array([table[name].upper for name in self.names]) / self.scale
        bounds = (np.concatenate([lower, -free]), np.concatenate([upper, free]))
        inside = np.nextafter(bounds[0], np.inf), np.nextafter(bounds[1], -np.inf)

        @lru_cache(maxsize=1)  # the solver asks for residuals first, then for slopes at the same place
        def at(place: bytes) -> tuple[Array, Array]:
            return self.residuals(np.frombuffer(place), noise, until)

        solution = least_squares(
            lambda z: at(z.tobytes())[0],
            np.clip(guess, *inside),
            jac=lambda z: at(z.tobytes())[1],
            bounds=bounds,
            x_scale="jac",
            xtol=TOLERANCE,
            ftol=TOLERANCE,
        )
        return np.asarray(solution.x)

    def residuals(self, unknowns: Array, noise: Array, until: float) -> tuple[Array, Array]:
        """Divide all residuals, and their slopes by the unknowns, by their standard deviations."""
        p = len(self.names)
        spread = np.array([reading.uncertainty for reading in self.readings])
        measured = np.array([_measured(reading) for reading in self.readings])
        slopes = np.zeros((len(measured), len(unknowns)))
        predicted = self.predicted(unknowns)
        for column, step in enumerate(STEP * np.eye(p, len(unknowns))):
            slopes[:, column] = (self.predicted(unknowns + step) - predicted) / STEP
        blocks, rows = [(predicted - measured) / spread], [slopes / spread[:, None]]
        first = p
        for model, sigma in zip(self.models, noise, strict=True):
            found, by = model.residuals(
                self._parameters(unknowns),
                self.names,
                STEP * self.scale,
                unknowns[first : first + model.unknowns],
                until,
            )
            wide = np.zeros((len(found), len(unknowns)))
            wide[:, :p] = by[:, :p] * self.scale
            wide[:, first : first + model.unknowns] = by[:, p:]
            blocks.append(found / sigma)
            rows.append(wide / sigma)
            first += model.unknowns
        return np.concatenate(blocks), np.concatenate(rows)

    def predicted(self, unknowns: Array) -> Array:
        """Say what the readings would be on a machine."""
        parameters = self._parameters(unknowns)
        linear = linearize(self.machine.plant, parameters, self.machine.q_a)
        damped = linear.frequencies * np.sqrt(np.maximum(1.0 - linear.damping_ratios**2, 1e-12))
        return np.array(
            [
                2.0 * np.pi / damped[reading.mode - 1]
                if isinstance(reading, Period)
                else parameters[reading.parameter]
                for reading in self.readings
            ]
        )

    def _parameters(self, unknowns: Array) -> dict[str, float]:
        values = map(float, unknowns[: len(self.names)] * self.scale)
        return {**self.machine.parameters, **dict(zip(self.names, values, strict=True))}

    def _noise(self, unknowns: Array, until: float, parameters: int) -> Array:
        """Estimate every log's standard deviation, widened where neighbouring residuals are alike."""
        residuals, _ = self.residuals(unknowns, np.ones(len(self.models)), until)
        first, noise = len(self.readings), []
        for model in self.models:
            count = model.samples(until)
            found = residuals[first : first + count]
            first += count
            square = found @ found
            alike = min(max(float(found[1:] @ found[:-1] / square), 0.0), 0.99) if square > 0.0 else 0.0
            freedom = max(count - model.unknowns - parameters, 1)
            resolution = np.ptp(model.log.values) * 1e-9 or 1e-12  # an exact log has no noise at all
            noise.append(max(np.sqrt(square / freedom * (1.0 + alike) / (1.0 - alike)), resolution))
        return np.array(noise)


def _measured(reading: DirectReading | Period) -> float:
    return reading.seconds if isinstance(reading, Period) else reading.value


def _eliminate(slopes: Array, parameters: int) -> Array:
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
        _, singular, directions = np.linalg.svd(slopes / size)
        if len(singular) == len(names) and singular[-1] > INDISTINCT:
            return
        worst = np.abs(directions[-1])
        blind = [name for name, share in zip(names, worst, strict=True) if share > 0.1]
    raise InfeasibleProblem(
        f"The measurements do not determine {' and '.join(blind)}; measure "
        f"{'it' if len(blind) == 1 else 'one of them'} directly (--measured), or another mode's period."
    )


def _birge_ratio(residuals: Array, freedom: int) -> float:
    square = float(residuals @ residuals)
    if freedom < 1 or chi2.sf(square, freedom) > CHANCE:
        return 1.0
    return float(np.sqrt(square / freedom))
