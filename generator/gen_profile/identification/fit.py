"""Weighted least squares: the parameters that agree best with all measurements.

Every residual is divided by its standard deviation. How a swing began and its sensor's zero are estimated
along. The noise of a log is taken from its residuals; where neighbouring ones are alike, they count as fewer,
n (1 − ρ)/(1 + ρ), ρ their correlation.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import attrs
import numpy as np
from scipy.optimize import least_squares

from gen_profile.identification.measurements import DirectReading, Period
from gen_profile.identification.swing_model import STEP, SwingModel
from gen_profile.plants.plant import Plant
from gen_profile.problem.linearization import linearize
from gen_profile.profile import Array

NOISE_ROUNDS = 2
HELD = 0.3  # relative, by which a parameter may leave the spec's while only a part of a log is looked at
TOLERANCE = 1e-6  # relative, of the sum of squares: it has as many terms as the logs have samples


@attrs.frozen(kw_only=True, eq=False)
class Machine:
    """What is known beforehand: the machine, all its parameters, and where its axes stood."""

    plant: Plant
    parameters: Mapping[str, float]
    q_a: tuple[float, ...]


@attrs.frozen(kw_only=True, eq=False)
class Fit:
    """The least-squares problem; unknowns are the parameters over `scale`, then every log's start.

    Attributes
    ----------
    machine : Machine
    names : (p,) tuple of str
        Parameters to identify.
    scale : (p,) array
        Their units.
    bounds : (2, p) array
        Least and greatest parameters, over `scale`.
    readings : tuple of DirectReading or Period
    models : tuple of SwingModel
        One per log.
    """

    machine: Machine
    names: tuple[str, ...]
    scale: Array
    bounds: Array
    readings: tuple[DirectReading | Period, ...]
    models: tuple[SwingModel, ...]

    @property
    def expected(self) -> Array:
        """Parameters of the spec, over `scale`, shape (p,)."""
        return np.array([self.machine.parameters[name] for name in self.names]) / self.scale

    def solve(self) -> tuple[Array, Array]:
        """Find the unknowns, and the noise of every log.

        A long log has many local minima, one for every period that a wrong frequency can lose over it. So its
        first period is fitted first, and then as much again, until it is used up. What a part of the log does
        not tell stays near the spec meanwhile.
        """
        names, guess = self.names, self.expected
        if not self.models:
            return self.improved(guess, np.empty(0)), np.empty(0)
        until, longest = self.models[0].period, max(model.log.times[-1] for model in self.models)
        starts = [model.guess(self.machine.parameters, until) for model in self.models]
        unknowns = np.concatenate([guess, *starts])
        noise = self._noise(unknowns, until, 0)
        while until < longest:
            unknowns = self.improved(unknowns, noise, until)
            noise = self._noise(unknowns, until, len(names))
            until *= 2.0
        for _ in range(NOISE_ROUNDS):
            unknowns = self.improved(unknowns, noise)
            noise = self._noise(unknowns, np.inf, len(names))
        return unknowns, noise

    def improved(self, guess: Array, noise: Array, until: float = np.inf) -> Array:
        """Find the unknowns that agree best up to a time in s, near a guess."""
        free = np.full(len(guess) - len(self.names), np.inf)
        lower, upper = self.bounds
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
            ftol=TOLERANCE,
        )
        return np.asarray(solution.x)

    def residuals(self, unknowns: Array, noise: Array, until: float = np.inf) -> tuple[Array, Array]:
        """Divide all residuals, and their slopes by the unknowns, by their standard deviations.

        Readings come first, then every log; for a part of the logs, then how far parameters left the spec.
        """
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
        if np.isfinite(until):
            known = np.flatnonzero(self.expected)
            blocks.append((unknowns[known] - self.expected[known]) / HELD)
            rows.append(np.eye(p, len(unknowns))[known] / HELD)
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
