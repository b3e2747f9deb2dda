"""From a spec to a motion and its figures, before anything is written."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial

import attrs
import numpy as np

from gen_profile.design.shape import shaped_motion
from gen_profile.errors import InfeasibleProblem, LimitViolation
from gen_profile.evaluation.scenarios import scenarios
from gen_profile.evaluation.simulation import TRANSIENT_SAMPLES, Response, Swing
from gen_profile.motion.metrics import greatest, length, mean_square_root, overshoot, peak, root_mean_square
from gen_profile.motion.profile import Array, Profile, grid_length, grid_times
from gen_profile.plants.plant import Plant
from gen_profile.problem.actuator import lag_compensated
from gen_profile.problem.limits import breaches, rounded_down, rounded_up
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import problem_of
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.collocation import Trajectory
from gen_profile.solvers.minimum_time import least_beyond
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution
from gen_profile.spec.model import Spec
from gen_profile.verification.verdict import Scenario

SHORTEST_WATCH = 4.0  # s; a residual is watched for this long, or for two of the slowest periods
STANDSTILL = 10.0  # time constants after which a lagging drive counts as standing: its speed is down to e⁻¹⁰
RESIDUAL_SAMPLES = 4001
SLOW = 5.0  # periods of the slowest mode, which are time enough where no duration keeps the limits
CALM = 0.99  # share of the limits of residual sway, which leaves room for the setpoints' own errors
LONGEST = 10.0  # times the shortest duration within limits, after which a calmer motion is not looked for


@attrs.frozen(kw_only=True, eq=False)
class Trial:
    """A motion and what it does to the machines of its spec.

    Attributes
    ----------
    motion : Profile
        Of the axes.
    command : Profile
        Setpoints of the drives, which is the motion itself where they are ideal.
    machines : tuple of Scenario
        Nominal first.
    swing : Swing
        Of these machines.
    watch : float
        How long a residual is watched, in s.
    """

    motion: Profile
    command: Profile
    machines: tuple[Scenario, ...]
    swing: Swing
    watch: float


@attrs.frozen(kw_only=True, eq=False)
class Plan:
    """A design that is not yet written.

    Attributes
    ----------
    solution : Solution or None
        What the solver found; None where a shaper made the motion.
    solver_time : float
        s.
    trial : Trial
        Of the motion.
    figures : dict of str to float
    """

    solution: Solution | None
    solver_time: float
    trial: Trial
    figures: dict[str, float]


def timed(spec: Spec) -> Spec:
    """Find the shortest duration where a spec asks for it; it ends on a cycle of the controller.

    An optimal motion takes longer than its limits make it where it would otherwise leave more sway than the
    check allows on some machine.

    Raises
    ------
    InfeasibleProblem
        No duration was found to do.
    """
    if not spec.move.shortest:
        return spec
    if spec.solver.shaper is not None:
        return _lasting(spec, shaped_motion(spec, spec.solver.shaper).duration)
    problem = problem_of(spec)
    shortest = choice.minimum_time(problem)
    if shortest is None:
        slowest = linearize(problem.plant, problem.parameters, problem.target).frequencies[0]
        slow = attrs.evolve(problem, duration=float(rounded_up(SLOW * 2.0 * np.pi / slowest)))
        cure = choice.requirements(slow) or "Widen the limits."
        raise InfeasibleProblem(
            f"move.duration: no duration keeps the limits and brings the load to rest. {cure}"
        )
    quickest = _lasting(spec, shortest)
    if _calms(quickest):
        return quickest
    calm = least_beyond(lambda time: _calms(_lasting(spec, time)), shortest, LONGEST * shortest)
    if calm is None:
        raise InfeasibleProblem(
            "check.residual_sway: no duration leaves so little sway on every machine of "
            "robustness.uncertain; allow more, or narrow the ranges."
        )
    return _lasting(spec, calm)


def _lasting(spec: Spec, duration: float) -> Spec:
    """Give a spec a duration, rounded up to a cycle of its controller."""
    cycle = spec.export.cycle_time
    whole = float(grid_times(grid_length(duration, cycle), cycle)[-1])
    return attrs.evolve(spec, move=attrs.evolve(spec.move, duration=whole, shortest=False))


def _calms(spec: Spec) -> bool:
    """Whether the optimal motion of a spec leaves little enough sway on every machine."""
    solution = choice.attempt(problem_of(spec), spec.solver.solver)
    return solution.optimum is not None and _is_calm(spec, solution)


def _is_calm(spec: Spec, solution: Solution) -> bool:
    """Whether a solution leaves little enough sway on every machine of a spec."""
    return keeps_residual_sway(spec, try_motion(spec, optimal_profile(solution)), CALM)


def keeps_residual_sway(spec: Spec, trial: Trial, share: float = 1.0) -> bool:
    """Whether every load keeps a share of its limit of residual sway on all machines."""
    limits = share * np.array(list(spec.check.residual_sway.values()))
    after = trial.swing.at(trial.motion.duration + np.linspace(0.0, trial.watch, RESIDUAL_SAMPLES))
    return all(bool((peak(response.sway) <= limits).all()) for response in after)


def plan(spec: Spec, near: Trajectory | None = None) -> Plan:
    """Solve a spec, or shape a move for it, and try the motion on all machines.

    Parameters
    ----------
    spec : Spec
    near : Trajectory, optional
        Of a similar spec's solution, to begin at.

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation
    """
    began = time.perf_counter()
    if spec.solver.shaper is not None:
        solution, motion = None, shaped_motion(spec, spec.solver.shaper)
    else:
        attempt = choice.attempt(problem_of(spec), spec.solver.solver, near)
        solution = choice.explained(attempt, spec.solver.solver, partial(_is_calm, spec))
        motion = optimal_profile(solution)
    solver_time = time.perf_counter() - began
    trial = try_motion(spec, motion)
    found = figures(trial)
    broken = breaches(spec.limits, trial.command, found["sway_transient_peak_m"])
    if broken:
        sentences = [breach.sentence() for breach in broken]
        cure = choice.remedy(problem_of(spec), spec.solver.solver, partial(_is_calm, spec))
        raise LimitViolation("\n".join([*sentences, cure]).strip())
    return Plan(solution=solution, solver_time=solver_time, trial=trial, figures=found)


def try_motion(spec: Spec, motion: Profile) -> Trial:
    """Integrate every machine of a spec under a motion of its axes.

    Parameters
    ----------
    spec : Spec
    motion : Profile
    """
    plant, machines = spec.machine(), scenarios(spec)
    tau = spec.actuator.tau
    watch = watch_time(spec, machines)
    settle = 2.0 * max(spec.export.cycle_time, spec.can.sync_period) + STANDSTILL * (tau or 0.0)
    until = motion.duration + settle + watch
    _require_room(spec, until)
    swing = Swing(plant, motion, [m.parameters for m in machines], until, spec.move.initial)
    return Trial(
        motion=motion, command=lag_compensated(motion, tau), machines=machines, swing=swing, watch=watch
    )


def _require_room(spec: Spec, until: float) -> None:
    """Refuse to judge a motion that goes on, while it is watched, to where the machine cannot be."""
    move = spec.move
    beyond = np.array(move.target) + (until - move.duration) * np.array(move.final_velocity)
    for axis, target, at in zip(spec.machine().actuated, move.target, beyond, strict=True):
        if not axis.lower <= at <= axis.upper:
            room = (axis.upper if at > target else axis.lower) - target
            fast = rounded_down(abs(room) / (until - move.duration)) if room else "0"
            raise InfeasibleProblem(
                f"move.final_velocity: {axis.name} would be at {at:.3g} {axis.unit} while the sway is "
                f"watched, and its range is {axis.lower:g} to {axis.upper:g} {axis.unit}; "
                f"end at {'-' if at < target else ''}{fast} {axis.unit}/s or slower."
            )


def watch_time(spec: Spec, machines: Sequence[Scenario]) -> float:
    """Time in s in which every mode of every machine shows its greatest sway at the target."""
    plant, target = spec.machine(), spec.move.target
    slowest = min(linearize(plant, machine.parameters, target).frequencies[0] for machine in machines)
    return max(SHORTEST_WATCH, 2.0 * 2.0 * np.pi / float(slowest))


def figures(trial: Trial) -> dict[str, float]:
    """Measure a trial: first axis, end load; sway during the move of the nominal machine, after it of all."""
    motion, command, duration = trial.motion, trial.command, trial.motion.duration
    end_load = trial.swing.plant.end_load
    during = length(trial.swing.at(np.linspace(0.0, duration, TRANSIENT_SAMPLES))[0].sway[:, end_load])
    after = trial.swing.at(np.linspace(duration, duration + trial.watch, RESIDUAL_SAMPLES))
    residuals = [float(peak(length(response.sway[:, end_load]))[0]) for response in after]
    names = ("velocity", "acceleration", "jerk")
    units = ("m_per_s", "m_per_s2", "m_per_s3")
    table = {"duration_s": duration}
    for order, (name, unit) in enumerate(zip(names, units, strict=True), start=1):
        table[f"{name}_max_{unit}"] = greatest(motion, order)
        if order > 1:
            table[f"{name}_rms_{unit}"] = root_mean_square(motion, order)
    table |= {
        "sway_transient_peak_m": float(peak(during)[0]),
        "sway_transient_rms_m": float(mean_square_root(during)[0]),
        "sway_residual_peak_m": residuals[0],
        "sway_residual_peak_perturbed_m": residuals[min(1, len(residuals) - 1)],
        "sway_residual_worst_m": max(residuals),
    }
    if command is not motion:
        table |= {
            f"command_{name}_max_{unit}": greatest(command, order)
            for order, (name, unit) in enumerate(zip(names, units, strict=True), start=1)
        }
        table["command_overshoot_m"] = overshoot(command)
    return table


def modal_amplitudes(plant: Plant, machine: Scenario, standing: Response) -> Array:
    """Sum over the modes of what each adds to the sway of every load, in m, shape (loads,).

    Parameters
    ----------
    plant : Plant
    machine : Scenario
    standing : Response
        Of the machine from the standstill of its axes on.
    """
    linear = linearize(plant, machine.parameters, standing.position[0])
    q_u, dq_u = standing.q_u[0], standing.dq_u[0]
    z, dz = np.linalg.solve(linear.modes, np.stack([q_u, dq_u], axis=1)).T
    amplitudes = np.hypot(z, dz / linear.frequencies)
    return np.asarray(np.abs(linear.sway_gain @ linear.modes) @ amplitudes)
