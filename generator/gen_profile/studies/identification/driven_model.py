"""A log of a whole run: how a machine swings that follows the setpoints that were played."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np
from scipy.interpolate import CubicSpline

from gen_profile.dynamics.evaluation.simulation import driven_swing, motion_of
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.motion.profile import Array, Profile, SampledProfile
from gen_profile.studies.identification.measurements import SwingLog
from gen_profile.studies.identification.swing_model import (
    DERIVATIVES,
    OF_SWAY,
    SwingingMachine,
    SwingModel,
    swing_model,
)

FINE, COARSE = 60.0, 16.0  # places in a swing of the fastest mode, between which splines are laid
SWUNG = 0.1  # rad or m, about as far as loads swing: what steps of a start are compared with
OUTSIDE = 2.0  # periods of the slowest mode by which a log may begin after the motion's end


@attrs.frozen(kw_only=True, eq=False)
class DrivenModel(SwingModel):
    """A log beside the machine that follows a motion.

    Its start has three numbers more than how the load swung before the motion: when in the log that began
    (what the drives delay is part of it), how many times greater the sensor shows the swing (a phone that
    does not lie straight shows less, one that lies the other way round the opposite), and the sensor's zero.

    Attributes
    ----------
    motion : Profile
        Of the axes, through all setpoints.
    slowest, fastest : float
        Periods of the machine's modes, roughly, in s.
    lead : float
        s for which the axes stand before the motion; how the load swings is an unknown from then on.
    period : float
        Infinite: it takes the whole log to tell when the motion began, so no part of it is fitted first.
    """

    motion: Profile
    slowest: float
    fastest: float
    lead: float = 0.0

    @property
    def unknowns(self) -> int:
        """Numbers in a start."""
        return len(self.shown) + 3

    def guess(self, parameters: Mapping[str, float], until: float) -> Array:
        """Find the start that this machine agrees with best, as if it had hung at rest."""
        # it takes a whole motion to tell when that began
        starts, _ = self.guesses([parameters])
        return np.asarray(starts[0])

    def guesses(self, machines: Sequence[Mapping[str, float]]) -> tuple[Array, Array]:
        """Find the starts that machines agree with best, and what share of the log's variance they leave.

        Parameters
        ----------
        machines : sequence of mapping of str to float
            Every parameter of each.

        Returns
        -------
        starts : (machines, unknowns) array
        left : (machines,) array
        """
        if self.lead > 0.0:
            return attrs.evolve(self, lead=0.0).guesses(machines)
        log, step = self.log, self.fastest / COARSE
        logged = np.interp(np.arange(0.0, log.times[-1], step), log.times, log.values)
        logged = logged - logged.mean()
        before, after = len(logged), int((self.motion.duration + OUTSIDE * self.slowest) / step)
        rows = parameter_rows(self.machine.plant, machines)
        at_rest = np.zeros((len(rows), 2 * len(self.machine.plant.unactuated)))
        shown = self._shown(rows, at_rest, step * np.arange(float(before + after))).T
        swings = np.concatenate([np.zeros((len(rows), before)), shown], axis=1)  # and stands before
        windows = np.lib.stride_tricks.sliding_window_view(swings, before, axis=1)
        like, sums = windows @ logged, windows.sum(axis=2)
        power = np.maximum(np.einsum("mwk,mwk->mw", windows, windows) - sums**2 / before, 1e-30)
        places = np.argmax(like**2 / power, axis=1)
        best = np.arange(len(rows)), places
        gains = like[best] / power[best]
        starts = np.zeros((len(rows), self.unknowns))
        starts[:, -3:] = np.stack(
            [(before - places) * step, gains, log.values.mean() - gains * sums[best] / before], axis=1
        )
        return starts, 1.0 - (like[best] ** 2 / power[best]) / float(logged @ logged)

    def residuals(
        self, parameters: Mapping[str, float], names: Sequence[str], steps: Array, start: Array, until: float
    ) -> tuple[Array, Array]:
        """Compare the swing with the log up to a time in s; see `SwingModel.residuals`."""
        times = self.log.times[: self.samples(until)]
        begin, gain, zero = start[-3:]
        machines, starts, by = self.lanes(parameters, names, steps, start[:-3], SWUNG)
        step = self.fastest / FINE
        places = np.maximum(times - begin + self.lead, 0.0)
        grid = np.arange(4.0 + np.ceil(max(float(places[-1]), self.fastest) / step)) * step
        spline = CubicSpline(grid, self._shown(machines, starts, grid))
        outputs, pace = spline(places), np.where(places > 0.0, spline(places, 1)[:, 0], 0.0)
        slopes = gain * (outputs[:, 1:] - outputs[:, :1]) / by
        more = np.column_stack([-gain * pace, outputs[:, 0], np.ones(len(times))])
        return gain * outputs[:, 0] + zero - self.log.values[: len(times)], np.column_stack([slopes, more])

    def _shown(self, machines: Array, starts: Array, times: Array) -> Array:
        """Say what the log would show of machines, from `lead` before the motion on: (times, machines)."""
        plant, moving = self.machine.plant, motion_of(self.motion)

        def motion(nodes: Array) -> Array:
            values = moving(np.maximum(nodes - self.lead, 0.0))
            values[nodes < self.lead, self.motion.axes :] = 0.0
            return values

        sway, angle = driven_swing(plant, machines, motion=motion, starts=starts, times=times)
        shown = (sway if self.log.quantity in OF_SWAY else angle)[:, :, plant.loads.index(self.log.load)].T
        slopes = DERIVATIVES.get(self.log.quantity, 0)
        return np.asarray(CubicSpline(times, shown)(times, slopes) if slopes else shown)


def driven_model(machine: SwingingMachine, played: SampledProfile, log: SwingLog) -> DrivenModel:
    """Put a log beside a machine of about these parameters that plays setpoints.

    Raises
    ------
    InfeasibleProblem
        The log is too short or too sparse to show how the machine swings, or shows a greater swing than any.
    """
    free = swing_model(machine, log)
    fastest = 2.0 * np.pi / float(machine.linear.frequencies[-1])
    return DrivenModel(
        machine=machine,
        log=log,
        shown=free.shown,
        period=np.inf,
        motion=through(played, fastest / FINE),
        slowest=free.period,
        fastest=fastest,
    )


def through(setpoints: SampledProfile, apart: float) -> Profile:
    """Lay a smooth motion through setpoints about so many seconds apart."""
    every = max(int(apart / setpoints.cycle_time), 1)
    kept = np.unique([*range(0, len(setpoints.times), every), len(setpoints.times) - 1])
    spline = CubicSpline(setpoints.times[kept], setpoints.position[kept], bc_type="clamped")
    return Profile.from_ppoly(spline, "played")
