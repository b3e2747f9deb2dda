"""Co-simulation of setpoints on machines of one's choice."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gen_profile.assurance.verification import cosimulation
from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.assurance.verification.setpoint_path import followed_up
from gen_profile.assurance.verification.time_scales import STEP_PHASE, arrival, watched
from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.dynamics.evaluation.simulation import AT_REST, Response
from gen_profile.dynamics.problem.linearization import eigenvalues
from gen_profile.motion.profile import Array, SampledProfile, require_samples
from gen_profile.spec.arguments import as_values
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import suggestion


def cosimulate(
    spec: Spec | Path | str, setpoints: SampledProfile, parameters: Mapping[str, float] = AT_REST
) -> Response:
    """Let the machine's FMU follow setpoints, and watch what swings on.

    Parameters
    ----------
    spec : Spec, or the path of one
    setpoints : SampledProfile
        Such as `gen_profile.sample` takes from a motion.
    parameters : mapping of str to float
        Of the plant, where they are not those of the spec.

    Raises
    ------
    SpecError
        The machine has no such parameter, or does not take this value; or these are no setpoints.
    CosimulationError
        The FMU cannot be built or run.

    Examples
    --------
    >>> spec = gp.preset_spec("paper")
    >>> setpoints = gp.sample(gp.plan(spec).command, cycle_time=0.01)
    >>> response = gp.cosimulate(spec, setpoints, {"L1": 0.5})  # a longer rope than the spec's
    >>> float(abs(response.sway).max()) < 0.2
    True
    """
    spec = as_spec(spec)
    require_samples(setpoints, len(spec.axis))
    values, *others = _machines(spec, parameters).tolist()
    if others:
        raise SpecError("parameters: one value of each; residual_sways takes many machines.")
    names = (parameter.name for parameter in spec.machine().parameters)
    machine = Scenario(name="asked for", parameters=dict(zip(names, values, strict=True)))
    (response,) = cosimulation.cosimulate(spec, setpoints, [machine], output_step=setpoints.cycle_time)
    return response


def residual_sways(
    spec: Spec | Path | str, setpoints: SampledProfile, parameters: Mapping[str, npt.ArrayLike]
) -> Array:
    """Let the FMUs of many machines follow setpoints, and find the greatest sway of each afterwards.

    Parameters
    ----------
    spec : Spec, or the path of one
    setpoints : SampledProfile
    parameters : mapping of str to (machines,) array
        Of the plant, where they are not those of the spec.

    Returns
    -------
    (machines, loads) array
        m; sampled closely enough to be right to 0.04 %.

    Raises
    ------
    SpecError
        The machine has no such parameter, does not take a value, or there are not as many values of each; or
        these are no setpoints.
    CosimulationError
        The FMU cannot be built or run.

    Examples
    --------
    >>> spec = gp.preset_spec("paper")
    >>> setpoints = gp.sample(gp.plan(spec).command, cycle_time=0.01)
    >>> gp.residual_sways(spec, setpoints, {"L1": np.linspace(0.4, 0.5, 5)}).shape
    (5, 2)
    """
    spec = as_spec(spec)
    require_samples(setpoints, len(spec.axis))
    plant, tau = spec.machine(), spec.actuator.tau or 0.0
    machines = _machines(spec, parameters)
    ends = (spec.move.start, spec.move.target)
    fastest = np.max([abs(eigenvalues(plant, machines, q_a)).max(axis=-1) for q_a in ends], axis=0)
    feed = Feed(times=setpoints.times, position=setpoints.position)
    with many_machines(plant) as runs:
        peaks = residual_peaks(
            runs,
            spec,
            followed_up(feed, watched(spec, setpoints, STEP_PHASE), spec.move.final_velocity),
            machines,
            tau=np.full(len(machines), tau),
            max_step=STEP_PHASE / fastest,
            since=arrival(spec, setpoints),
        )
    return peaks[:, : len(plant.loads)]


def _machines(spec: Spec, parameters: Mapping[str, npt.ArrayLike]) -> Array:
    """Put parameters of machines side by side, those that are not given as the spec has them."""
    known, plant = spec.plant.parameters, spec.machine()
    for name in as_values(parameters, "parameters"):
        if name not in known:
            raise SpecError(f"parameters: the machine has no {name!r}{suggestion(name, known)}")
    values = [parameters.get(q.name, known[q.name]) for q in plant.parameters]
    try:
        machines = np.stack(np.broadcast_arrays(*map(np.atleast_1d, values)), axis=-1).astype(float)
    except (TypeError, ValueError) as error:
        raise SpecError("parameters: one number of each for every machine, as many of all.") from error
    if machines.ndim != 2 or not len(machines):
        raise SpecError("parameters: a row of numbers of each, for one machine or more.")
    for parameter, column in zip(plant.parameters, machines.T, strict=True):
        taken = (parameter.lower <= column) & (column <= parameter.upper)  # never by what is no number
        if not taken.all():
            bounds = f"{parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
            worst = column[~taken][0]
            raise SpecError(f"parameters: {parameter.name} must be from {bounds}, found {worst:g}.")
    return machines
