"""From replayed setpoints to a verdict in all scenarios, of a new design and of a file on disk alike."""

from collections.abc import Callable, Sequence

import attrs

from gen_profile.assurance.verification.cosimulation import cosimulate, judge
from gen_profile.assurance.verification.external_fmu import judge_external
from gen_profile.assurance.verification.monte_carlo import with_further
from gen_profile.assurance.verification.time_scales import sample_spacing
from gen_profile.assurance.verification.verdict import Check
from gen_profile.dynamics.evaluation.scenarios import Scenario, scenarios
from gen_profile.dynamics.evaluation.simulation import Response, Sway
from gen_profile.motion.profile import SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.progress import Progress, no_progress

# how machines ought to move, beside how they did
Reference = Callable[[Sequence[Scenario], Sequence[Response]], Sequence[Sway]]


def verdict(
    spec: Spec,
    setpoints: SampledProfile,
    rows: Sequence[Scenario],
    reference: Reference,
    *,
    followed: SampledProfile | None = None,
    resolution: float = 0.0,
    by_fmpy: bool = True,
    progress: Progress = no_progress,
) -> Check:
    """Judge setpoints in scenarios, by the plant's FMU or by that of another tool.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
        Replayed from an artefact.
    rows : sequence of Scenario
        Without any machine among them, the nominal one tells what cycles err by.
    reference : callable
        Takes machines and how they moved, and gives how they move by another simulation, see
        `gen_profile.assurance.verification.cosimulation.judge`. Not asked where another tool's FMU judges.
    followed : SampledProfile, optional
        What the machines follow, where it goes on for longer than the setpoints.
    resolution : float
        In m or rad, what the reference does not know of the setpoints' rounding; added to the error's bound.
    by_fmpy : bool
        Whether FMPy drives the first machine, too.
    progress : callable

    Raises
    ------
    SpecError
    CosimulationError
    """
    if spec.check.foreign is not None:
        check = judge_external(spec, spec.check.foreign, setpoints, rows)
        return attrs.evolve(check, error_bound=check.error_bound + resolution)
    machines = [row for row in rows if row.followed]
    tried = machines or scenarios(spec)[:1]
    spacing = sample_spacing(spec, setpoints)
    responses = cosimulate(
        spec, followed or setpoints, tried, output_step=spacing, by_fmpy=by_fmpy, progress=progress
    )
    check = judge(spec, setpoints, tried, responses, reference(tried, responses), followed=followed)
    findings = check.findings if machines else ()
    check = attrs.evolve(check, findings=findings, error_bound=check.error_bound + resolution)
    return with_further(spec, setpoints, check, [row for row in rows if not row.followed], progress)
