"""Co-simulation of replayed setpoints on the plant FMU, and the verdict."""

from collections.abc import Iterator, Sequence
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.assurance.verification.plausibility import implausibilities
from gen_profile.assurance.verification.time_scales import (
    TIME_TOLERANCE,
    arrival,
    judged_from,
    max_step,
    whole_way,
)
from gen_profile.assurance.verification.verdict import Check, Finding
from gen_profile.dynamics.evaluation.clearance import nearest
from gen_profile.dynamics.evaluation.residual_sway import (
    STANDSTILL,
    modal_amplitudes,
    observation_time,
)
from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.dynamics.evaluation.simulation import Response, Sway, body_places
from gen_profile.dynamics.evaluation.static_deflection import in_wind
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.motion.metrics import length, peak
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.spec.passed_target import targets
from gen_profile.spec.plausibility import plausibility_warnings
from gen_profile.support.errors import CosimulationError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.running.cosimulation import PlantCosimulation

ERROR_FLOOR = 1e-8  # m; covers what both integrations leave


def cosimulate(
    spec: Spec,
    setpoints: SampledProfile,
    machines: Sequence[Scenario],
    *,
    output_step: float,
    by_fmpy: bool = True,
    progress: Progress = no_progress,
) -> tuple[Response, ...]:
    """Let the plant's FMU follow setpoints, once with every machine, in a compiled loop.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
        Replayed from an artefact.
    machines : sequence of Scenario
    output_step : float
        Spacing of samples in s, at most the cycle.
    by_fmpy : bool
        Whether FMPy drives the first one, too, and must find the same to the last bit.
    progress : callable
        Told of a compilation, which takes seconds.

    Returns
    -------
    tuple of Response
        One per machine, from the first setpoint on.

    Raises
    ------
    CosimulationError
        The FMU cannot be built or run, or FMPy finds something else.
    """
    tau = spec.actuator.tau or 0.0
    settle = STANDSTILL * tau + observation_time(spec)
    with PlantCosimulation(spec.machine(), progress) as fmu:

        def run(machine: Scenario, *, by_fmpy: bool = False) -> Response:
            return fmu.run(
                setpoints,
                machine.parameters,
                tau=tau,
                max_step=max_step(spec, machine),
                settle=settle,
                output_step=output_step,
                initial=spec.move.initial,
                final_velocity=spec.move.final_velocity,
                by_fmpy=by_fmpy,
            )

        responses = tuple(run(machine) for machine in machines)
        if by_fmpy and not np.array_equal(run(machines[0], by_fmpy=True).sway, responses[0].sway):
            raise CosimulationError("FMPy and the compiled loop move the FMU differently; report this.")
    return responses


def judge(
    spec: Spec,
    setpoints: SampledProfile,
    machines: Sequence[Scenario],
    responses: Sequence[Response],
    expected: Sequence[Sway],
    *,
    followed: SampledProfile | None = None,
) -> Check:
    """Compare what swings on with what is allowed.

    Parameters
    ----------
    responses : sequence of Response
        Of `cosimulate`, one per machine.
    expected : sequence of Sway
        Of another simulation, all at some of the same times, such that how far the two are apart bounds the
        error of `responses`.
    followed : SampledProfile, optional
        What `responses` followed, where it goes on for longer than the setpoints.
    """
    arrival_time = arrival(spec, followed or setpoints)
    after = [_from(response, arrival_time) for response in responses]
    error = _greatest_distance(responses, expected, judged_from(spec, followed or setpoints))
    between = max(above_samples(response.sway) for response in after)
    if whole_way(spec):  # until the last setpoint samples are farther apart
        moving = len(setpoints.times)
        between = max(between, *(above_samples(response.sway[:moving]) for response in responses))
    pairs = zip(machines, responses, strict=True)
    return Check(
        limit=dict(spec.check.residual_sway),
        error_bound=error + between + ERROR_FLOOR,
        arrival=arrival(spec, setpoints),
        findings=tuple(_finding(spec, machine, response, arrival_time) for machine, response in pairs),
        sway_limit=spec.limits.sway,
        overshoot_limit=min((one.most for one in targets(spec)), default=None),
        path=spec.path,
        wind=in_wind(spec, machines),
        directions=spec.machine().directions,
        faults=implausibilities(spec, setpoints),
        plausibility_warnings=(*plausibility_warnings(spec), *beyond_equations(spec, machines, responses)),
    )


def beyond_equations(
    spec: Spec, machines: Sequence[Scenario], responses: Sequence[Response]
) -> Iterator[str]:
    """Warn of the machine that sways farthest beyond what its equations hold for."""
    plant = spec.machine()
    if plant.small_sway is None:
        return
    small = [plant.small_sway(SimpleNamespace(**machine.parameters)) for machine in machines]
    swayed = [float(np.abs(response.sway[:, plant.end_load]).max()) for response in responses]
    worst = int(np.argmax(np.divide(swayed, small)))
    if swayed[worst] > small[worst]:
        yield (
            f"The {plant.end_load_name} sways by {1e3 * swayed[worst]:.4g} mm on the way "
            f"({machines[worst].name}), and the linear equations of a {plant.type} hold up to "
            f"{1e3 * small[worst]:.4g} mm: what is stated of more is rough; allow more time (move.duration)."
        )


def _greatest_distance(responses: Sequence[Sway], expected: Sequence[Sway], since: float) -> float:
    """Greatest difference of sways in m from a time on, at the expected times, which the others have, too."""
    times = expected[0].times
    compared = times >= since * (1.0 - TIME_TOLERANCE)
    own = responses[0].times
    rows = np.searchsorted(0.5 * (own[:-1] + own[1:]), times[compared])
    apart = (one.sway[rows] - other.sway[compared] for one, other in zip(responses, expected, strict=True))
    return max(float(np.abs(distance).max()) for distance in apart)


def above_samples(values: Array) -> float:
    """Bound how far a peak between two samples rises above them: h²/8 of the curvature."""
    return float(np.abs(np.diff(values, n=2, axis=0)).max()) / 8.0


def _from(response: Response, since: float) -> Response:
    """Cut what comes before."""
    kept = slice(int(np.searchsorted(response.times, since * (1.0 - TIME_TOLERANCE))), None)
    columns = attrs.asdict(response, recurse=False)
    return Response(**{name: values[kept] for name, values in columns.items()})


def _finding(spec: Spec, machine: Scenario, response: Response, arrival: float) -> Finding:
    plant, after = spec.machine(), _from(response, arrival)
    modal = modal_amplitudes(plant, machine.parameters, after)
    end_load = length(response.sway[:, plant.end_load])
    near = None
    if spec.path is not None:
        p = parameter_rows(plant, [machine.parameters])
        near = nearest(spec, response.times, body_places(plant, response.q_u, response.position, p))
    return Finding(
        scenario=machine,
        residual=dict(zip(plant.loads, map(float, peak(after.sway)), strict=True)),
        modal=dict(zip(plant.loads, map(float, modal), strict=True)),
        on_the_way=None if spec.limits.sway is None else float(np.abs(end_load).max()),
        nearest=near,
        overshoot=None if spec.limits.overshoot is None else _overshoot(spec, machine, response),
    )


def _overshoot(spec: Spec, machine: Scenario, response: Response) -> float:
    """Find how far the end load passes its targets at any time, in m."""
    p = parameter_rows(spec.machine(), [machine.parameters])
    places = body_places(spec.machine(), response.q_u, response.position, p)
    passed = (
        one.sign * (places[:, one.direction.body, one.direction.coordinate] - one.at) for one in targets(spec)
    )
    return max(float(way.max()) for way in passed)
