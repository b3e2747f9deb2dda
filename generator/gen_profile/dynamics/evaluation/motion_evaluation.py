"""A motion on the machines of a spec: what it does to them, and its figures."""

import math
from collections.abc import Sequence
from functools import cached_property

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.residual_sway import RESIDUAL_SAMPLES, STANDSTILL, observation_time
from gen_profile.dynamics.evaluation.scenarios import Scenario, scenarios
from gen_profile.dynamics.evaluation.simulation import TRANSIENT_SAMPLES, PlantSimulation, Sway
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.dynamics.problem.overshoot import beyond
from gen_profile.dynamics.problem.parameter_box import machines_inside
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.metrics import (
    excursion,
    greatest,
    length,
    mean_square_root,
    overshoot,
    peak,
    root_mean_square,
)
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec
from gen_profile.spec.passed_target import BoundedTarget, targets
from gen_profile.support.errors import InfeasibleProblem, SpecError, rounded_down
from gen_profile.support.summary import Summarised

COARSE_SAMPLES = 501  # of machines all over the ranges, between which the greatest is a parabola's
PEAKS = {"velocity": "m_per_s", "acceleration": "m_per_s2", "jerk": "m_per_s3"}  # units as keys tell them
ACCURACY = 1e-6  # of their integration, relative
PICTURED = 1e-4  # likewise where nothing but a picture is made of it


@attrs.frozen(kw_only=True, eq=False, repr=False)
class MotionEvaluation(Summarised):
    """A motion and what it does to the machines of its spec.

    Attributes
    ----------
    motion : Profile
        Of the axes.
    command : Profile
        Setpoints of the drives, which is the motion itself where they are ideal.
    machines : tuple of Scenario
        Nominal first.
    swing : PlantSimulation
        Of these machines.
    everywhere : PlantSimulation
        Of machines all over the ranges, less accurately; of the same where nothing has a range.
    watch : float
        How long a residual is watched, in s.
    targets : tuple of BoundedTarget
        What the end load may pass by little only.
    """

    motion: Profile
    command: Profile
    machines: tuple[Scenario, ...]
    swing: PlantSimulation
    everywhere: PlantSimulation
    watch: float
    targets: tuple[BoundedTarget, ...] = ()

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        figures = self.figures
        return {
            "motion": f"{self.motion.method}, {self.motion.duration:g} s",
            "machines": len(self.machines),
            "residual sway": f"{1e3 * figures['sway_residual_worst_m']:.4g} mm at worst",
        }

    @cached_property
    def figures(self) -> dict[str, float]:
        """Of the leading axis and the end load: sway on the way of the nominal machine, afterwards of all."""
        motion, command, duration = self.motion, self.command, self.motion.duration
        end_load = self.swing.plant.end_load
        during = self.swing.sway(np.linspace(0.0, duration, TRANSIENT_SAMPLES))
        others = self.everywhere.sway(np.linspace(0.0, duration, COARSE_SAMPLES))
        transients, residuals = (
            [float(machine) for sway in sways for machine in peak(length(sway[:, :, end_load]))[:, 0]]
            for sways in ((during, others), _afterwards(self))
        )
        table = {"duration_s": duration}
        for order, (name, unit) in enumerate(PEAKS.items(), start=1):
            table[f"{name}_max_{unit}"] = greatest(motion, order, motion.leading)
            if order > 1:
                table[f"{name}_rms_{unit}"] = root_mean_square(motion, order)
        table |= {
            "sway_transient_peak_m": transients[0],
            "sway_transient_worst_m": max(transients),
            "sway_transient_rms_m": float(mean_square_root(length(during[0, :, end_load]))[0]),
            "sway_residual_peak_m": residuals[0],
            "sway_residual_peak_perturbed_m": residuals[min(1, len(self.machines) - 1)],
            "sway_residual_worst_m": max(residuals),
        }
        if self.targets:
            nominal, worst = self.overshoot
            table |= {"load_overshoot_peak_m": nominal, "load_overshoot_worst_m": worst}
        if command is not motion:
            table |= {
                f"command_{name}_max_{unit}": greatest(command, order, motion.leading)
                for order, (name, unit) in enumerate(PEAKS.items(), start=1)
            }
            table["command_overshoot_m"] = overshoot(command)
        return table

    @cached_property
    def overshoot(self) -> tuple[float, float]:
        """How far the end load passes its targets during the motion in m: nominal, and at worst."""
        if not self.targets:
            return -math.inf, -math.inf

        def greatest_of(swing: PlantSimulation, samples: int) -> list[float]:
            times = np.linspace(0.0, self.motion.duration, samples)
            sway = swing.sway(times)[:, :, swing.plant.end_load]
            found = beyond(self.targets, self.motion.derivative(times, 0), sway).max(axis=(0, 2))
            return [float(one) for one in found]

        known = greatest_of(self.swing, TRANSIENT_SAMPLES)
        return known[0], max(*known, *greatest_of(self.everywhere, COARSE_SAMPLES))

    @property
    def axes(self) -> dict[str, dict[str, float]]:
        """What the drive of every axis is asked for: how far apart the ends of its way are, and its peaks."""
        return {
            axis.name: {
                "excursion_m": excursion(self.command, column),
                **{
                    f"{name}_max_{unit}": greatest(self.command, order, column)
                    for order, (name, unit) in enumerate(PEAKS.items(), start=1)
                },
            }
            for column, axis in enumerate(self.swing.plant.actuated)
        }

    def followed(self, times: Array, others: Sequence[Scenario] = ()) -> tuple[Sway, ...]:
        """Tell how the loads of the machines, and of others, sway at rising times in s."""
        simulations = [self.swing]
        if others:
            parameters, initial = [machine.parameters for machine in others], self.swing.initial
            more = PlantSimulation(self.swing.plant, self.motion, parameters, float(times[-1]), initial)
            simulations.append(more)
        return tuple(Sway(times=times, sway=sway) for swing in simulations for sway in swing.sway(times))


def evaluate(spec: Spec, motion: Profile) -> MotionEvaluation:
    """Integrate every machine of a spec under a motion of its axes.

    Raises
    ------
    SpecError
        The motion has not the machine's axes.
    InfeasibleProblem
        It goes on to where the machine cannot be.
    """
    plant, until = spec.machine(), _watched_until(spec, motion)
    named = [machine.parameters for machine in scenarios(spec)]
    swing = PlantSimulation(plant, motion, named, until, spec.move.initial)
    inside = machines_inside(problem_of(spec, whole=True))
    known, inside_rows = (parameter_rows(plant, rows) for rows in (named, inside))
    same = np.isclose(inside_rows[:, None], known, 1e-9)
    others = [values for values, rows in zip(inside, same, strict=True) if not rows.all(axis=1).any()]
    everywhere = swing
    if others:
        everywhere = PlantSimulation(plant, motion, others, until, spec.move.initial, accuracy=ACCURACY)
    return _evaluation(spec, motion, swing, everywhere)


def sketch(spec: Spec, motion: Profile) -> MotionEvaluation:
    """Integrate the machines of a spec under a motion as exactly as a picture needs, and no others.

    Parameters
    ----------
    spec : Spec
    motion : Profile

    Raises
    ------
    SpecError, InfeasibleProblem
        As `evaluate` does.
    """
    parameters, until = [m.parameters for m in scenarios(spec)], _watched_until(spec, motion)
    swing = PlantSimulation(spec.machine(), motion, parameters, until, spec.move.initial, accuracy=PICTURED)
    return _evaluation(spec, motion, swing, swing)


def _evaluation(
    spec: Spec, motion: Profile, swing: PlantSimulation, everywhere: PlantSimulation
) -> MotionEvaluation:
    return MotionEvaluation(
        motion=motion,
        command=lag_compensated(motion, spec.actuator.tau),
        machines=scenarios(spec),
        swing=swing,
        everywhere=everywhere,
        watch=observation_time(spec),
        targets=targets(spec),
    )


def _watched_until(spec: Spec, motion: Profile) -> float:
    """Tell until when in s the machines are looked at; refuse a motion that is not one of theirs."""
    plant = spec.machine()
    if motion.axes != len(plant.actuated):
        names = ", ".join(axis.name for axis in plant.actuated)
        raise SpecError(
            f"The motion moves {motion.axes} axes, and the machine has {len(plant.actuated)} ({names})."
        )
    settle = 2.0 * max(spec.export.cycle_time, spec.can.sync_period) + STANDSTILL * (spec.actuator.tau or 0.0)
    until = motion.duration + settle + observation_time(spec)
    _require_room(spec, until)
    return until


def _require_room(spec: Spec, until: float) -> None:
    """Refuse to judge a motion that goes on, while it is watched, to where the machine cannot be."""
    move = spec.move
    beyond = np.array(move.target) + (until - move.duration) * np.array(move.final_velocity)
    for axis, target, at in zip(spec.machine().actuated, move.target, beyond, strict=True):
        if not axis.lower <= at <= axis.upper:
            room = (axis.upper if at > target else axis.lower) - target
            fast = rounded_down(abs(room) / (until - move.duration)) if room else 0.0
            raise InfeasibleProblem(
                f"move.final_velocity: {axis.name} would be at {at:.3g} {axis.unit} while the sway is "
                f"watched, and its range is {axis.lower:g} to {axis.upper:g} {axis.unit}; "
                f"end at {'-' if at < target else ''}{fast:.3g} {axis.unit}/s or slower."
            )


def keeps_residual_sway(spec: Spec, evaluation: MotionEvaluation) -> bool:
    """Whether every load keeps its limit of residual sway on all machines."""
    return share_of_residual_sway(spec, evaluation) <= 1.0


def share_of_residual_sway(spec: Spec, evaluation: MotionEvaluation) -> float:
    """Greatest share of its limit of residual sway that a load takes, on all machines."""
    limits = np.array(list(spec.check.residual_sway.values()))
    return float(max((peak(sway) / limits).max() for sway in _afterwards(evaluation)))


def _afterwards(evaluation: MotionEvaluation) -> tuple[Array, Array]:
    """Sway after the motion of the evaluation's machines, and of others all over the ranges."""
    begin, watch = evaluation.motion.duration, evaluation.watch
    return (
        evaluation.swing.sway(np.linspace(begin, begin + watch, RESIDUAL_SAMPLES)),
        evaluation.everywhere.sway(np.linspace(begin, begin + watch, COARSE_SAMPLES)),
    )
