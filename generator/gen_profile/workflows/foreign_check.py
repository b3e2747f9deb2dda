"""A check by somebody else's FMU."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gen_profile.check import Check, Finding, Scenario
from gen_profile.metrics import peak
from gen_profile.profile import Array, SampledProfile, grid_length, grid_times
from gen_profile.spec import ForeignFmu, Spec
from gen_profile.workflows.planning import STANDSTILL, watch_time
from gen_profile.workflows.verification import ERROR_FLOOR, above_samples, arrival, contradictions
from gen_profile_fmu.foreign_fmu import ForeignRun, run_foreign

SPACING = 0.01  # s, at most, of samples while the axes stand


def judge_foreign(
    spec: Spec,
    foreign: ForeignFmu,
    setpoints: SampledProfile,
    machines: Sequence[Scenario],
) -> Check:
    """Let somebody else's FMU judge replayed setpoints.

    Its inputs are held over communication steps; the same with steps of half the length tells how much its
    integration errs.

    Parameters
    ----------
    spec : Spec
    foreign : ForeignFmu
    setpoints : SampledProfile
    machines : sequence of Scenario
        Parameters that the FMU has no variable for stay what they are in it.

    Raises
    ------
    CosimulationError
        The FMU cannot be run to the end.
    """
    tau = spec.actuator.tau or 0.0
    times, inputs = _axis_inputs(foreign.input, setpoints, tau)
    settle = STANDSTILL * tau + watch_time(spec, machines)
    held = grid_times(grid_length(settle, SPACING), SPACING)[1:]
    rest = inputs[-1:] if foreign.input == "setpoint" else np.zeros_like(inputs[-1:])
    times = np.concatenate([times, times[-1] + held])
    inputs = np.concatenate([inputs, np.repeat(rest, len(held), axis=0)])
    found = _sways(foreign, times, inputs, machines)
    finer = _sways(foreign, *_halved(foreign, times, inputs), machines)[:, ::2]
    standing = times >= arrival(spec, setpoints) * (1.0 - 1e-12)
    found, finer = found[:, standing], finer[:, standing]
    error = float(np.abs(found - finer).max()) + max(above_samples(sways) for sways in found)
    return Check(
        limit={load: spec.check.residual_sway[load] for load in foreign.sway},
        error_bound=error + ERROR_FLOOR,
        arrival=arrival(spec, setpoints),
        findings=tuple(
            _finding(foreign, machine, sways) for machine, sways in zip(machines, found, strict=True)
        ),
        faults=contradictions(setpoints),
    )


def _finding(foreign: ForeignFmu, machine: Scenario, sways: Array) -> Finding:
    """Take the peaks; nothing is known of a foreign machine's modes that would bound them."""
    residual = dict(zip(foreign.sway, map(float, peak(sways)), strict=True))
    return Finding(scenario=machine, residual=residual, modal=residual)


def _sways(foreign: ForeignFmu, times: Array, inputs: Array, machines: Sequence[Scenario]) -> Array:
    """Sway of the loads that the FMU has, shape (machines, samples, loads)."""
    names = foreign.parameters
    return run_foreign(
        ForeignRun(
            archive=foreign.path,
            times=times,
            inputs=inputs,
            input_names=foreign.inputs,
            output_names=tuple(foreign.sway.values()),
            machines=[{names[name]: machine.parameters[name] for name in names} for machine in machines],
            time_limit=foreign.time_limit,
        )
    )


def _halved(foreign: ForeignFmu, times: Array, inputs: Array) -> tuple[Array, Array]:
    """Split every communication step; setpoints are reached half-way in the first half of their step."""
    middles = 0.5 * (times[:-1] + times[1:])
    twice = np.repeat(inputs, 2, axis=0)
    if foreign.input == "setpoint":
        before = np.concatenate([inputs[:1], inputs[:-1]])
        twice[::2] = 0.5 * (before + inputs)
    return np.sort(np.concatenate([times, middles])), twice


def _axis_inputs(kind: str, setpoints: SampledProfile, tau: float) -> tuple[Array, Array]:
    """Choose communication points during the motion, and what the axes are fed with between them.

    A plant that takes velocities or setpoints has drives of its own. One that takes accelerations gets those
    of our drives: exactly the change of velocity in each step.
    """
    cycle, position = setpoints.cycle_time, setpoints.position
    times, velocity = setpoints.times, np.diff(position, axis=0) / cycle
    if kind == "setpoint":
        return times, position[1:]
    if kind == "velocity":
        return times, velocity
    if tau > 0.0:
        return _lagging(times, velocity, cycle, tau)
    if setpoints.velocity is not None:
        return times, np.diff(setpoints.velocity, axis=0) / cycle
    # between the middles of two cycles velocity rises evenly: of second order where a step would be of first
    grid = np.concatenate([times[:1], times[:-1] + 0.5 * cycle, times[-1:]])
    still = np.zeros_like(velocity[:1])
    return grid, np.diff(np.concatenate([still, velocity, still]), axis=0) / np.diff(grid)[:, None]


def _lagging(times: Array, reference: Array, cycle: float, tau: float) -> tuple[Array, Array]:
    """Mean accelerations in each cycle of drives with a first-order lag, until they stand."""
    more = grid_length(STANDSTILL * tau, cycle)
    reference = np.concatenate([reference, np.zeros((more, reference.shape[1]))])
    decay = np.exp(-cycle / tau)
    velocity = np.zeros((len(reference) + 1, reference.shape[1]))
    for k, asked in enumerate(reference):
        velocity[k + 1] = asked + (velocity[k] - asked) * decay
    return grid_times(len(reference), cycle), np.diff(velocity, axis=0) / cycle
