"""A check by an external FMU."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from gen_profile.assurance.verification.batch import Feed
from gen_profile.assurance.verification.cosimulation import ERROR_FLOOR, above_samples
from gen_profile.assurance.verification.plausibility import implausibilities
from gen_profile.assurance.verification.setpoint_path import follows_exactly, lag_of, transmitted
from gen_profile.assurance.verification.time_scales import arrival, standstill
from gen_profile.assurance.verification.verdict import Check, Finding
from gen_profile.dynamics.evaluation.residual_sway import STANDSTILL, observation_time
from gen_profile.dynamics.evaluation.scenarios import TIMING, Scenario
from gen_profile.motion.metrics import peak
from gen_profile.motion.profile import Array, SampledProfile, grid_length, grid_times
from gen_profile.spec.external_fmu import ExternalFmu
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import plausibility_warnings
from gen_profile.support.units import units_of
from gen_profile_fmu.running.external_fmu import ForeignResult, ForeignRun, run_foreign

STEPS_PER_LAG = 4  # at least, of drives that lag
SPACING = 0.01  # s, at most, of samples while the axes stand


def judge_external(
    spec: Spec, foreign: ExternalFmu, setpoints: SampledProfile, machines: Sequence[Scenario]
) -> Check:
    """Let an external FMU judge replayed setpoints.

    Its inputs are held over communication steps; the same with steps of half the length tells how much its
    integration errs. Where it takes steps of one length only, the same half a step later tells what comes of
    holding the inputs, and nothing tells what its integration errs by.

    Parameters
    ----------
    spec : Spec
    foreign : ExternalFmu
    setpoints : SampledProfile
    machines : sequence of Scenario
        Parameters that the FMU has no variable for stay what they are in it. Those that share setpoints and
        drives share one process of the FMU, and its time limit.

    Raises
    ------
    SpecError
        What the spec says of the setpoints' path does not fit the artefact's cycle.
    CosimulationError
        The FMU cannot be run to the end.
    """
    together = [list(rows) for _, rows in groupby(machines, _driven_alike)]
    judged = [_judged(spec, foreign, setpoints, rows) for rows in together]
    remarks = dict.fromkeys(remark for _, _, said in judged for remark in said)
    return Check(
        limit={load: spec.check.residual_sway[load] for load in foreign.sway},
        error_bound=max(apart for _, apart, _ in judged) + ERROR_FLOOR,
        arrival=arrival(spec, setpoints),
        findings=tuple(finding for findings, _, _ in judged for finding in findings),
        faults=implausibilities(spec, setpoints),
        plausibility_warnings=(*plausibility_warnings(spec), *remarks),
    )


def _driven_alike(scenario: Scenario) -> tuple[object, ...]:
    """Tell scenarios apart that differ in more than their machines."""
    return follows_exactly(scenario), scenario.lag, scenario.row if scenario.group == TIMING else None


def _judged(
    spec: Spec, foreign: ExternalFmu, setpoints: SampledProfile, rows: Sequence[Scenario]
) -> tuple[list[Finding], float, tuple[str, ...]]:
    """Run scenarios that share setpoints and drives; their findings, error in m at most, and remarks."""
    first = rows[0]
    exact = follows_exactly(first)
    since = arrival(spec, setpoints) if exact else standstill(spec, setpoints)
    feed = transmitted(spec, setpoints, rows[:1])
    if feed.times.ndim == 2:
        feed = Feed(times=feed.times[0], position=feed.position[0])
    velocity = setpoints.velocity if exact else None
    times, inputs = _axis_inputs(foreign.input, feed, velocity, lag_of(spec, first))
    settle = max(since - times[-1], 0.0) + observation_time(spec)
    held = grid_times(grid_length(settle, SPACING), SPACING)[1:]
    rest = inputs[-1:] if foreign.input == "setpoint" else np.zeros_like(inputs[-1:])
    times = np.concatenate([times, times[-1] + held])
    inputs = np.concatenate([inputs, np.repeat(rest, len(held), axis=0)])
    if foreign.step is not None:
        later = _in_steps(foreign.input, times, inputs, foreign.step, 0.5 * foreign.step)
        times, inputs = _in_steps(foreign.input, times, inputs, foreign.step)
    result = _run(spec, foreign, times, inputs, rows)
    after = times >= since * (1.0 - 1e-12)
    responses = result.outputs[:, after]
    if foreign.step is None:
        finer = _run(spec, foreign, *_halved(foreign, times, inputs), rows).outputs[:, ::2]
        error = float(np.abs(responses - finer[:, after]).max())
    else:  # by a sampling of the same motion between those of this one
        after = later[0] >= since + 0.5 * foreign.step
        others = _run(spec, foreign, *later, rows).outputs[:, after]
        error = max(
            float(np.abs(peak(one) - peak(other)).max()) for one, other in zip(responses, others, strict=True)
        )
    error += max(above_samples(sways) for sways in responses)
    findings = [_finding(foreign, row, sways) for row, sways in zip(rows, responses, strict=True)]
    return findings, error, result.remarks


def _finding(foreign: ExternalFmu, machine: Scenario, sways: Array) -> Finding:
    """Take the peaks; nothing is known of a foreign machine's modes that would bound them."""
    residual = dict(zip(foreign.sway, map(float, peak(sways)), strict=True))
    return Finding(scenario=machine, residual=residual, modal=residual)


def _run(
    spec: Spec, foreign: ExternalFmu, times: Array, inputs: Array, rows: Sequence[Scenario]
) -> ForeignResult:
    """Have the FMU give the sway of the loads that it has."""
    names, plant = foreign.parameters, spec.machine()
    si_units = foreign.si_units(plant)
    stated = {
        name: 1.0 / {si_units[name]: 1.0, **units_of(si_units[name])}[unit]
        for name, unit in foreign.units.items()
    }
    parameters = {
        name: (value, plant.units[name], names.get(name)) for name, value in spec.plant.parameters.items()
    }
    return run_foreign(
        ForeignRun(
            archive=foreign.path,
            times=times,
            inputs=inputs,
            input_names=foreign.inputs,
            output_names=tuple(foreign.sway.values()),
            machines=[{names[name]: row.parameters[name] for name in names} for row in rows],
            si_units=si_units,
            stated_units=stated,
            parameters=parameters,
            time_limit=foreign.time_limit,
            step=foreign.step,
        )
    )


def _in_steps(kind: str, times: Array, inputs: Array, step: float, delay: float = 0.0) -> tuple[Array, Array]:
    """Feed the same in steps of one length, a while later: setpoints at their ends, of others the means."""
    count = grid_length(times[-1] - times[0] + delay, step)
    grid = times[0] + grid_times(count, step)
    if kind == "setpoint":
        places = (np.interp(grid[1:] - delay, times[1:], column) for column in inputs.T)
        return grid, np.column_stack(list(places))
    held = np.diff(times)[:, None] * inputs
    reached = np.concatenate([np.zeros_like(held[:1]), np.cumsum(held, axis=0)])
    changes = (np.diff(np.interp(grid - delay, times, column)) for column in reached.T)
    return grid, np.column_stack(list(changes)) / step


def _halved(foreign: ExternalFmu, times: Array, inputs: Array) -> tuple[Array, Array]:
    """Split every communication step; setpoints are reached half-way in the first half of their step."""
    middles = 0.5 * (times[:-1] + times[1:])
    twice = np.repeat(inputs, 2, axis=0)
    if foreign.input == "setpoint":
        before = np.concatenate([inputs[:1], inputs[:-1]])
        twice[::2] = 0.5 * (before + inputs)
    return np.sort(np.concatenate([times, middles])), twice


def _axis_inputs(kind: str, feed: Feed, velocities: Array | None, tau: float) -> tuple[Array, Array]:
    """Choose communication points during the motion, and what the axes are fed with between them.

    A plant that takes velocities or setpoints has drives of its own. One that takes accelerations gets those
    of our drives: exactly the change of velocity in each step.
    """
    times, position = feed.times, feed.position
    steps = np.diff(times)[:, None]
    velocity = np.diff(position, axis=0) / steps
    if kind == "setpoint":
        return times, position[1:]
    if kind == "velocity":
        return times, velocity
    if tau > 0.0:
        return _lagging(times, velocity, tau)
    if velocities is not None:
        return times, np.diff(velocities, axis=0) / steps
    # between the middles of two cycles velocity rises evenly: of second order where a step would be of first
    grid = np.concatenate([times[:1], times[:-1] + 0.5 * steps[:, 0], times[-1:]])
    still = np.zeros_like(velocity[:1])
    return grid, np.diff(np.concatenate([still, velocity, still]), axis=0) / np.diff(grid)[:, None]


def _lagging(times: Array, reference: Array, tau: float) -> tuple[Array, Array]:
    """Mean accelerations of drives with a first-order lag, in steps that resolve it, until they stand."""
    cycle = float(times[-1] - times[-2])
    more = grid_times(grid_length(STANDSTILL * tau, cycle), cycle)[1:]
    times = np.concatenate([times, times[-1] + more])
    reference = np.concatenate([reference, np.zeros((len(more), reference.shape[1]))])
    parts = np.ceil(np.diff(times) * STEPS_PER_LAG / tau).astype(int)
    steps = np.repeat(np.diff(times) / parts, parts)
    reference = np.repeat(reference, parts, axis=0)
    times = times[0] + np.concatenate([[0.0], np.cumsum(steps)])
    decay = np.exp(-steps / tau)
    velocity = np.zeros((len(reference) + 1, reference.shape[1]))
    for k, asked in enumerate(reference):
        velocity[k + 1] = asked + (velocity[k] - asked) * decay[k]
    return times, np.diff(velocity, axis=0) / steps[:, None]
