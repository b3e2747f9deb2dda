"""A logged swing as a function of parameters, of how it began, and of the sensor's zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.identification.measurements import SwingLog
from gen_profile.plants.plant import Plant
from gen_profile.problem.linearization import linearize
from gen_profile.profile import Array
from gen_profile.response import free_swing

STEP = 1e-6  # relative, of numerical slopes


@attrs.frozen(kw_only=True, eq=False)
class SwingModel:
    """A log beside the machine that swings.

    The unknowns of a log beside the machine's parameters, its *start*, are q_u and q̇_u at its first sample
    and the sensor's zero: 2 n_u + 1 numbers.
    """

    plant: Plant
    q_a: tuple[float, ...]
    log: SwingLog

    @property
    def unknowns(self) -> int:
        """Numbers in a start."""
        return 2 * len(self.plant.unactuated) + 1

    def samples(self, until: float) -> int:
        """Count the samples before a time in s."""
        return int(np.searchsorted(self.log.times, until, side="right"))

    def guess(self, parameters: Mapping[str, float], until: float) -> Array:
        """Find the start that the linear model agrees with best, up to a time in s."""
        linear = linearize(self.plant, parameters, self.q_a)
        n_u, count = len(linear.frequencies), self.samples(until)
        system = np.block([[np.zeros((n_u, n_u)), np.eye(n_u)], [-linear.stiffness, -linear.damping]])
        rates, vectors = np.linalg.eig(system)
        seen = np.concatenate([self._gain(parameters), np.zeros(n_u)])
        decays = np.exp(self.log.times[:count, None] * rates)
        columns = ((seen @ vectors) * decays @ np.linalg.inv(vectors)).real
        design = np.column_stack([columns, np.ones(count)])
        size = np.linalg.norm(design, axis=0)
        start = np.linalg.lstsq(design / size, self.log.values[:count], rcond=1e-8)[0] / size
        return np.asarray(start)

    def residuals(
        self, parameters: Mapping[str, float], names: Sequence[str], steps: Array, start: Array, until: float
    ) -> tuple[Array, Array]:
        """Compare the swing with the log up to a time in s.

        Parameters
        ----------
        parameters : mapping of str to float
        names : (p,) sequence of str
            Parameters to take slopes by.
        steps : (p,) array
            How far to step for them, in their units.
        start : (2 n_u + 1,) array

        Returns
        -------
        residuals : (samples,) array
            In rad or m.
        slopes : (samples, p + 2 n_u + 1) array
        """
        count, n = self.samples(until), len(start) - 1
        step = STEP * (np.abs(start[:n]).max() or 1.0)
        order = [q.name for q in self.plant.parameters]
        machines = np.tile([parameters[name] for name in order], (1 + len(names) + n, 1))
        for lane, (name, by) in enumerate(zip(names, steps, strict=True), start=1):
            machines[lane, order.index(name)] += by
        starts = np.tile(start[:n], (len(machines), 1))
        starts[1 + len(names) :] += step * np.eye(n)
        sway, angle = free_swing(
            self.plant, machines, q_a=self.q_a, starts=starts, times=self.log.times[:count]
        )
        load = self.plant.loads.index(self.log.load)
        seen = (sway if self.log.quantity == "sway" else angle)[:, :, load]
        slopes = (seen[1:] - seen[0]).T / np.concatenate([steps, np.full(n, step)])
        return seen[0] + start[n] - self.log.values[:count], np.column_stack([slopes, np.ones(count)])

    def _gain(self, parameters: Mapping[str, float]) -> Array:
        """Slopes of the logged output by q_u, at rest."""
        p, n_u = SimpleNamespace(**parameters), len(self.plant.unactuated)
        load = self.plant.loads.index(self.log.load)
        outputs = [self.plant.outputs(q_u, self.q_a, p) for q_u in STEP * np.eye(n_u)]
        return np.array([getattr(output, self.log.quantity)[load] for output in outputs]) / STEP
