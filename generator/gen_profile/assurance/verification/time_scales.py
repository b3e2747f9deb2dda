"""From when, how long and how finely an artefact's sway is watched, and in which steps it is integrated."""

from gen_profile.assurance.verification.setpoint_path import delay
from gen_profile.dynamics.evaluation.residual_sway import RESIDUAL_SAMPLES, STANDSTILL, observation_time
from gen_profile.dynamics.evaluation.scenarios import Scenario, scenarios
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array, SampledProfile, grid_length, grid_times
from gen_profile.spec.model import Spec

LONGEST_STEP = 1e-3  # s, of the FMU's integrator; a quarter changes residuals of four machines by 3e-12 m
STEP_PHASE = 0.05  # rad of the fastest mode that one step may cover
TIME_TOLERANCE = 1e-12  # of times, relative
SAMPLE_PHASE = 0.02  # rad of the fastest mode between two samples of a residual


def arrival(spec: Spec, setpoints: SampledProfile) -> float:
    """Time in s from which the axes stand still, the drives' lag included."""
    return float(setpoints.times[-1]) + STANDSTILL * (spec.actuator.tau or 0.0)


def standstill(spec: Spec, setpoints: SampledProfile) -> float:
    """Time in s from which the axes stand in all scenarios beyond the machines."""
    path = spec.check.path
    lag = max(spec.actuator.tau or 0.0, *(path.lag or (0.0,)))
    return float(setpoints.times[-1]) + setpoints.cycle_time + delay(path) + STANDSTILL * lag


def judged_from(spec: Spec, setpoints: SampledProfile) -> float:
    """Time in s from which sway counts."""
    return 0.0 if whole_way(spec) else (1.0 - TIME_TOLERANCE) * arrival(spec, setpoints)


def whole_way(spec: Spec) -> bool:
    """Whether what loads do on the way is judged, too."""
    return spec.limits.sway is not None or spec.limits.overshoot is not None or spec.path is not None


def watched(spec: Spec, setpoints: SampledProfile, phase: float = SAMPLE_PHASE) -> Array:
    """Choose times in s after the last setpoint, alike for all rows: no row depends on another.

    Parameters
    ----------
    phase : float
        rad of the fastest mode between two of them.
    """
    machines = scenarios(spec)
    begin = float(setpoints.times[-1]) + setpoints.cycle_time + delay(spec.check.path)
    spacing = phase / STEP_PHASE * min(longest_step(spec, machine) for machine in machines)
    until = standstill(spec, setpoints) + observation_time(spec)
    return begin + grid_times(grid_length(until - begin, spacing), spacing)


def sample_spacing(spec: Spec, setpoints: SampledProfile) -> float:
    """Choose the spacing in s at which residuals are sampled."""
    return min(setpoints.cycle_time, observation_time(spec) / (RESIDUAL_SAMPLES - 1))


def max_step(spec: Spec, machine: Scenario) -> float:
    """Choose the longest integration step in s, where trajectories are to be had."""
    return min(LONGEST_STEP, longest_step(spec, machine))


def longest_step(spec: Spec, machine: Scenario) -> float:
    """Find the longest integration step in s that a machine's fastest mode permits."""
    ends = (spec.move.start, spec.move.target)
    fastest = max(linearize(spec.machine(), machine.parameters, q_a).frequencies[-1] for q_a in ends)
    return STEP_PHASE / float(fastest)
