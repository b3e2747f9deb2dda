"""A motion of a spec, what it does to machines, and how they swing."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.dynamics.evaluation.motion_evaluation import evaluate as _evaluate
from gen_profile.dynamics.problem.linearization import Linearization
from gen_profile.dynamics.problem.linearization import linearize as _linearize
from gen_profile.methods.solvers.draft import Plan
from gen_profile.methods.solvers.plan import plan as _plan
from gen_profile.motion.profile import Profile, require_motion
from gen_profile.plants.plant import Plant
from gen_profile.spec.arguments import as_number, as_numbers, as_values
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress, require_progress
from gen_profile.support.suggestion import found


def plan(spec: Spec | Path | str, progress: Progress = no_progress) -> Plan:
    """Solve a spec, or shape a move for it, and try the motion on all machines.

    Parameters
    ----------
    spec : Spec, or the path of one
    progress : Progress

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation

    Examples
    --------
    >>> plan = gp.plan(gp.preset_spec("paper"))
    >>> plan.motion.duration
    3.0
    """
    require_progress(progress)
    return _plan(as_spec(spec), progress)


def evaluate(spec: Spec | Path | str, motion: Profile) -> MotionEvaluation:
    """Integrate every machine of a spec under a motion of its axes.

    Parameters
    ----------
    spec : Spec, or the path of one
    motion : Profile

    Raises
    ------
    SpecError
        It is no motion, or has not the machine's axes.
    InfeasibleProblem
        It goes on to where the machine cannot be.

    Examples
    --------
    >>> spec = gp.preset_spec("paper")
    >>> evaluation = gp.evaluate(spec, gp.plan(spec).motion)
    >>> round(1e3 * evaluation.figures["sway_residual_worst_m"], 3)  # mm
    1.955
    """
    spec = as_spec(spec)
    require_motion(motion)
    return _evaluate(spec, motion)


def linearize(
    plant: Plant, parameters: Mapping[str, float], q_a: Sequence[float] | None = None
) -> Linearization:
    """Linearise a plant at rest, where q_u = 0.

    Parameters
    ----------
    plant : Plant
    parameters : mapping of str to float
        Value of every parameter.
    q_a : (m,) sequence of float, optional
        Where the axes stand; 0 by default.

    Raises
    ------
    SpecError
        A parameter is missing, or no finite number; or there is not a place of each axis.
    InfeasibleProblem
        A mode has no restoring force, so the machine has no natural frequency to speak of.

    Examples
    --------
    >>> spec = gp.preset_spec("paper")
    >>> gp.linearize(spec.machine(), spec.plant.parameters).frequencies.round(2)  # rad/s
    array([3.64, 9.02])
    """
    if not isinstance(plant, Plant):
        raise SpecError(f"A machine is expected, such as spec.machine() gives, found {found(plant)}.")
    parameters = as_values(parameters, "parameters")
    for name in (parameter.name for parameter in plant.parameters):
        if not math.isfinite(as_number(parameters.get(name, math.nan), f"parameters: {name}")):
            raise SpecError(f"parameters: {name} must be a finite number; state every one of the machine.")
    axes = [0.0] * len(plant.actuated) if q_a is None else as_numbers(q_a, "at")
    if len(axes) != len(plant.actuated):
        template = "at: must hold one position per axis ({axes}), found {found}."
        raise SpecError(template, axes=len(plant.actuated), found=len(axes))
    if not all(map(math.isfinite, axes)):
        raise SpecError("at: must hold finite numbers, found {found}.", found=found(axes))
    return _linearize(plant, parameters, axes)
