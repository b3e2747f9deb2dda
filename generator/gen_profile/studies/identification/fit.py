"""Weighted least squares: the parameters that agree best with all measurements.

Every residual is divided by its standard deviation. How a swing began and its sensor's zero are estimated
along. The noise of a log is taken from its residuals; where neighbouring ones are alike, they count as fewer,
n (1 − ρ)/(1 + ρ), ρ their correlation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import attrs
import numpy as np
from scipy.optimize import least_squares

from gen_profile.motion.profile import Array
from gen_profile.studies.identification.measurements import DirectReading, Period
from gen_profile.studies.identification.swing_model import SLOPE_STEP, SwingingMachine, SwingModel
from gen_profile.support.errors import CosimulationError, InfeasibleProblem
from gen_profile.support.phrase import AND, joined

NOISE_ROUNDS = 2
HELD = 0.3  # relative, by which a parameter may leave the spec's while only a part of a log is looked at
TOLERANCE = 1e-6  # relative, of the sum of squares: it has as many terms as the logs have samples
HALF = 0.5  # of a swing, which is left where two have the same phase within a twelfth of a period
STEPS = 30  # of a search; near a solution five are enough


@attrs.frozen(kw_only=True, eq=False)
class Fit:
    """The least-squares problem; unknowns are the parameters over `scale`, then every log's start.

    Attributes
    ----------
    machine : SwingingMachine
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

    machine: SwingingMachine
    names: tuple[str, ...]
    scale: Array
    bounds: Array
    readings: tuple[DirectReading | Period, ...]
    models: tuple[SwingModel, ...]

    @property
    def expected(self) -> Array:
        """Parameters of the spec, over `scale`, shape (p,)."""
        return np.array([self.machine.parameters[name] for name in self.names]) / self.scale

    def solve(self, *, small_first: bool = True) -> tuple[Array, Array]:
        """Find the unknowns, and the noise of every log.

        A long log has many local minima, one for every period that a wrong frequency can lose over it. So its
        first period is fitted first, and then as much again, until it is used up. What a part of the log does
        not tell stays near the spec meanwhile. Small swings, which take no integration, are tried first,
        if asked: where swings are large, they may lead to another minimum.
        """
        names, guess = self.names, self.expected
        if not self.models:
            return self.improved(guess, np.empty(0)), np.empty(0)
        if small_first and (near := self.as_of_small_swings()) is not None:
            return self.near(near)
        until, longest = self.models[0].period, max(model.log.times[-1] for model in self.models)
        starts = [model.guess(self.machine.parameters, until) for model in self.models]
        unknowns = np.concatenate([guess, *starts])
        noise = self._noise(unknowns, until, 0)
        while until < longest:
            unknowns = self.improved(unknowns, noise, until)
            noise = self._noise(unknowns, until, len(names))
            until *= 2.0
        return self.near(unknowns)

    def as_of_small_swings(self) -> Array | None:
        """Find the unknowns of small swings, where the machine's own swing is hardly another one."""
        if all(model.small for model in self.models):
            return None
        try:
            unknowns, _ = self.small().solve()
            left = self.left(unknowns)
        except (InfeasibleProblem, CosimulationError, np.linalg.LinAlgError):
            return None
        pairs = zip(self.models, left, strict=True)
        linear = all(np.std(one) < HALF * np.std(model.log.values) for model, one in pairs)
        return unknowns if linear else None

    def near(self, unknowns: Array) -> tuple[Array, Array]:
        """Find the unknowns that agree best with all that was logged, near a guess, and the noise."""
        noise = self._noise(unknowns, np.inf, len(self.names))
        for _ in range(NOISE_ROUNDS):
            unknowns = self.improved(unknowns, noise)
            noise = self._noise(unknowns, np.inf, len(self.names))
        return unknowns, noise

    def freed(self, more: Sequence[str]) -> Fit:
        """Identify more parameters."""
        return fit_of(self.machine, (*self.names, *more), self.readings, self.models)

    def beginning(self, parameters: Mapping[str, float]) -> Fit:
        """Begin the search at other parameters."""
        return attrs.evolve(self, machine=self.machine.of(parameters))

    def small(self) -> Fit:
        """Take all swings to be small."""
        return attrs.evolve(self, models=tuple(attrs.evolve(model, small=True) for model in self.models))

    def improved(self, guess: Array, noise: Array, until: float = np.inf) -> Array:
        """Find the unknowns that agree best up to a time in s, near a guess."""
        unbounded = np.full(len(guess) - len(self.names), np.inf)
        lower, upper = self.bounds
        bounds = (np.concatenate([lower, -unbounded]), np.concatenate([upper, unbounded]))
        inside = np.nextafter(bounds[0], np.inf), np.nextafter(bounds[1], -np.inf)

        @lru_cache(maxsize=1)  # the solver asks for residuals first, then for slopes at the same place
        def at(place: bytes) -> tuple[Array, Array]:
            return self.residuals(np.frombuffer(place), noise, until)

        if not (np.isfinite(guess).all() and np.isfinite(at(np.clip(guess, *inside).tobytes())[0]).all()):
            raise InfeasibleProblem(
                "No such machine swings like the measurements, nor near; look for a wrong reading or unit."
            )
        solution = least_squares(
            lambda z: at(z.tobytes())[0],
            np.clip(guess, *inside),
            jac=lambda z: at(z.tobytes())[1],
            bounds=bounds,
            x_scale="jac",
            ftol=TOLERANCE,
            max_nfev=STEPS,
        )
        if solution.status == 0 and not np.isfinite(until):  # of a part, the next one goes on from there
            template = (
                "The search for {names} does not come to rest: no such machine swings like the "
                "measurements; look for a wrong unit or signal, or start from a nearer value of the "
                "spec."
            )
            raise InfeasibleProblem(template, names=joined(AND, self.names))
        return np.asarray(solution.x)

    def residuals(self, unknowns: Array, noise: Array, until: float = np.inf) -> tuple[Array, Array]:
        """Divide all residuals, and their slopes by the unknowns, by their standard deviations.

        Readings come first, then every log; for a part of the logs, then how far parameters left the spec.
        """
        p = len(self.names)
        spread = np.array([reading.uncertainty for reading in self.readings])
        measured = np.array([one.seconds if isinstance(one, Period) else one.value for one in self.readings])
        slopes = np.zeros((len(measured), len(unknowns)))
        predicted = self.predicted(unknowns)
        for column, step in enumerate(SLOPE_STEP * np.eye(p, len(unknowns))):
            slopes[:, column] = (self.predicted(unknowns + step) - predicted) / SLOPE_STEP
        blocks, rows = [(predicted - measured) / spread], [slopes / spread[:, None]]
        first = p
        for model, sigma in zip(self.models, noise, strict=True):
            left, by = model.residuals(
                self.parameters(unknowns),
                self.names,
                SLOPE_STEP * self.scale,
                unknowns[first : first + model.unknowns],
                until,
            )
            wide = np.zeros((len(left), len(unknowns)))
            wide[:, :p] = by[:, :p] * self.scale
            wide[:, first : first + model.unknowns] = by[:, p:]
            blocks.append(left / sigma)
            rows.append(wide / sigma)
            first += model.unknowns
        if np.isfinite(until):
            known = np.flatnonzero(self.expected)
            blocks.append((unknowns[known] - self.expected[known]) / HELD)
            rows.append(np.eye(p, len(unknowns))[known] / HELD)
        return np.concatenate(blocks), np.concatenate(rows)

    def predicted(self, unknowns: Array) -> Array:
        """Say what the readings would be on a machine."""
        parameters = self.parameters(unknowns)
        linear = self.machine.of(parameters).linear
        damped = linear.frequencies * np.sqrt(np.maximum(1.0 - linear.damping_ratios**2, 1e-12))
        values = (
            2.0 * np.pi / damped[one.mode - 1] if isinstance(one, Period) else parameters[one.parameter]
            for one in self.readings
        )
        return np.array([*values])

    def parameters(self, unknowns: Array) -> dict[str, float]:
        """Put the unknowns' parameters among the others, by name."""
        values = map(float, unknowns[: len(self.names)] * self.scale)
        return {**self.machine.parameters, **dict(zip(self.names, values, strict=True))}

    def left(self, unknowns: Array, until: float = np.inf) -> list[Array]:
        """Say what is left of every log up to a time in s, in rad or m."""
        residuals, _ = self.residuals(unknowns, np.ones(len(self.models)), until)
        return self.of_logs(residuals, until)

    def of_logs(self, values: Array, until: float = np.inf) -> list[Array]:
        """Pick every log's part of residuals, or of what has their places last, up to a time in s."""
        ends = np.cumsum([len(self.readings), *(model.samples(until) for model in self.models)])
        return np.split(values, ends, axis=-1)[1:-1]

    def _noise(self, unknowns: Array, until: float, parameters: int) -> Array:
        """Estimate every log's standard deviation, widened where neighbouring residuals are alike."""
        noise = []
        for model, residuals in zip(self.models, self.left(unknowns, until), strict=True):
            count = len(residuals)
            square = residuals @ residuals
            alike = float(residuals[1:] @ residuals[:-1] / square) if square > 0.0 else 0.0
            correlation = min(max(alike, 0.0), 0.99)
            freedom = max(count - model.unknowns - parameters, 1)
            resolution = np.ptp(model.log.values) * 1e-9 or 1e-12  # an exact log has no noise at all
            wide = np.sqrt(square / freedom * (1.0 + correlation) / (1.0 - correlation))
            noise.append(max(wide, resolution))
        return np.array(noise)


def fit_of(
    machine: SwingingMachine,
    names: Sequence[str],
    readings: Sequence[DirectReading | Period],
    models: Sequence[SwingModel],
) -> Fit:
    """Pose the problem for some of the machine's parameters, in the machine's order."""
    asked = [q for q in machine.plant.parameters if q.name in names]
    scale = np.array([abs(machine.parameters[q.name]) or 1.0 for q in asked])
    return Fit(
        machine=machine,
        names=tuple(q.name for q in asked),
        scale=scale,
        bounds=np.array([(q.lower, q.upper) for q in asked]).T / scale,
        readings=tuple(readings),
        models=tuple(models),
    )
