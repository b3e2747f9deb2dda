"""The scenarios of a check beyond its machines: other drives, random draws, faults of timing."""

from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.assurance.verification.setpoint_path import (
    followed_up,
    follows_exactly,
    lag_of,
    transmitted,
)
from gen_profile.assurance.verification.time_scales import SAMPLE_PHASE, longest_step, standstill, watched
from gen_profile.assurance.verification.verdict import Check, Finding
from gen_profile.dynamics.evaluation.clearance import Nearest, zones_of
from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.running.many_runs import ManyRuns

CHECKING = "checking by co-simulation"
BATCH = 50  # rows between two signs of life
CURVATURE = 1.2  # of a sway between samples, relative to a harmonic one's of the same peak


def with_further(
    spec: Spec,
    setpoints: SampledProfile,
    check: Check,
    rows: Sequence[Scenario],
    progress: Progress = no_progress,
) -> Check:
    """Try more scenarios on setpoints that were judged on the machines.

    Every row is a co-simulation of the plant's FMU, driven by the replayed setpoints on their way to the
    axes. How far its peaks are from those of a second one bounds its error: with every other setpoint where
    the drives interpolate them in time, else with integration steps of half the length. That comes on top of
    what the machines' check found.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
    check : Check
        Of the machines; it may hold none.
    rows : sequence of Scenario
        Of `gen_profile.dynamics.evaluation.scenarios.further_scenarios`.
    progress : callable
        Told how many rows are done, and of how many, at every tenth of the way.

    Raises
    ------
    SpecError
        What the spec says of the path does not fit the artefact's cycle.
    CosimulationError
    """
    if not rows:
        return check
    findings, error = list(check.findings), 0.0
    with many_machines(spec.machine()) as runs:
        for first in _batches(rows):
            batch = rows[first]
            peaks, apart = _batch(spec, setpoints, batch, runs)
            error = max(error, apart)
            findings += [_finding(spec, row, peak) for row, peak in zip(batch, peaks, strict=True)]
            if 10 * first.stop // len(rows) > 10 * first.start // len(rows):
                progress(CHECKING, first.stop, len(rows))
    return attrs.evolve(check, findings=tuple(findings), error_bound=check.error_bound + error)


def _batches(rows: Sequence[Scenario]) -> list[slice]:
    """Cut rows into batches of one group each."""
    cuts = [0]
    for index in range(1, len(rows)):
        if index - cuts[-1] == BATCH or rows[index].group != rows[index - 1].group:
            cuts.append(index)
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], len(rows)], strict=True)]


def _batch(
    spec: Spec, setpoints: SampledProfile, rows: Sequence[Scenario], runs: ManyRuns
) -> tuple[Array, float]:
    """Peaks of some rows, shape (rows, loads), and the error bound of them all in m."""
    plant, since, after = spec.machine(), standstill(spec, setpoints), watched(spec, setpoints)
    on_the_way = spec.limits.sway is not None
    max_step = np.array([longest_step(spec, row) for row in rows])
    tau = np.array([lag_of(spec, row) for row in rows])

    def peaks(feed: Feed, steps: Array) -> Array:
        return residual_peaks(
            runs,
            spec,
            followed_up(feed, after, spec.move.final_velocity),
            parameter_rows(plant, [row.parameters for row in rows]),
            tau=tau,
            max_step=steps,
            since=since,
            on_the_way=on_the_way,
        )

    feed = transmitted(spec, setpoints, rows)
    greatest = peaks(feed, max_step)
    straight = rows[0].group == "samples" and spec.check.path.between == "linear"
    if straight or follows_exactly(rows[0]):
        other = peaks(feed.thinned(2), max_step)
    else:
        other = peaks(feed, 0.5 * np.minimum(max_step, setpoints.cycle_time))
    nearest = spec.path is not None or spec.limits.overshoot is not None
    lengths = np.s_[:, : -2 if nearest else None]  # not when a load was nearest, and to what
    between = CURVATURE * SAMPLE_PHASE**2 / 8.0 * float(greatest[lengths].max())
    return greatest, float(np.abs(greatest - other)[lengths].max()) + between


def _finding(spec: Spec, row: Scenario, peaks: Array) -> Finding:
    """Take the peaks; amplitudes of modes are known of the machines' trajectories only."""
    residual = dict(zip(spec.machine().loads, map(float, peaks), strict=False))
    near = None
    if spec.path is not None:
        room, time, number = peaks[-3:].tolist()
        zone = zones_of(spec)[int(number)]
        body = spec.machine().bodies[zone.body]
        near = Nearest(room=room, time=time, obstacle=zone.obstacle, body=body)
    return Finding(
        scenario=row,
        residual=residual,
        modal=residual,
        on_the_way=None if spec.limits.sway is None else float(peaks[len(residual)]),
        nearest=near,
        overshoot=None if spec.limits.overshoot is None else -float(peaks[-3]),
    )
