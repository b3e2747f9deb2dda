"""The main job: from a spec to artefacts that were proved by co-simulation before anyone can take them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from gen_profile.assurance.verification.judging import verdict
from gen_profile.assurance.verification.monte_carlo import CHECKING
from gen_profile.assurance.verification.time_scales import judged_from
from gen_profile.assurance.verification.verdict import Check
from gen_profile.assurance.verification.worst_machines import worst_machines
from gen_profile.delivery.designs.names import names_of, require_own_names
from gen_profile.dynamics.evaluation.scenarios import Scenario, further_scenarios
from gen_profile.dynamics.evaluation.simulation import Response, Sway
from gen_profile.dynamics.problem.held_axes import held_axes
from gen_profile.methods.solvers.draft import Plan
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.profile import Profile, SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import (
    FILENAME,
    Artefact,
    Manifest,
    artefact_of,
    versions,
)
from gen_profile.support.artefacts.writing import Kept, Staging, staged
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.summary import Drawable
from gen_profile_exporters.exporter import Exporter, target_of
from gen_profile_exporters.registry import find_exporter, format_named, require_end, require_targets

if TYPE_CHECKING:
    from gen_profile.assurance.proof.verdict import (
        Proof,  # SciPy's statistics take longer to load than the main job
    )


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Design(Drawable):
    """Outcome of the main job.

    Attributes
    ----------
    spec : Spec
    plan : Plan
    check : Check or None
        Of the artefact that came off worst; None when no check was asked for.
    artefacts : tuple of Artefact
        What was delivered, paths relative to `folder`; empty when the check failed.
    folder : Path

    Examples
    --------
    >>> written = gp.design(gp.preset_spec("paper"), ["csv", "plc"], "deploy")
    >>> written.passed, [artefact.path for artefact in written.artefacts]
    (True, ...)
    """

    spec: Spec
    plan: Plan
    check: Check | None
    artefacts: tuple[Artefact, ...]
    folder: Path

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "name": self.spec.name,
            "check": "not done" if self.check is None else "passed" if self.passed else "failed",
            "files": ", ".join(artefact.path for artefact in self.artefacts) or "none",
            "folder": self.folder,
        }

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return self.check is None or self.check.passed

    def reasons(self) -> tuple[str, ...]:
        """Say why the check failed, and what might help where the nominal machine itself sways too much."""
        if self.check is None or self.passed:
            return ()
        limit = self.check.limit[self.spec.machine().loads[-1]]
        cures = held_axes(self.spec) if self.plan.figures["sway_residual_peak_m"] > limit else ()
        return (*self.check.reasons(), *cures)

    @property
    def figures(self) -> dict[str, float]:
        """Figures of the plan, and the worst residual sway that the check's search has found."""
        if self.check is None:
            return self.plan.figures
        worst = "sway_residual_worst_m"
        return self.plan.figures | {worst: max(self.plan.figures[worst], self.check.worst_in_ranges)}

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "solver": self._solver(),
            "figures": self.figures,
            "axes": self.plan.evaluation.axes,
            "check": None if self.check is None else self.check.to_dict(),
            "artefacts": [{"format": one.format, **file_entry(self.folder, one)} for one in self.artefacts],
        }

    def _solver(self) -> dict[str, Any]:
        """Tell how the motion was found; what a shaper has not is null."""
        solution, spec, seconds = self.plan.solution, self.spec.solver, {"time_s": self.plan.solver_time}
        passage = self.plan.passage
        if passage is not None:
            passed = {"status": "converged", "method": "over-stacks", "iterations": passage.programs}
            more = {"one_by_one_s": passage.one_by_one, "lift_m": passage.lift}
            return {**passed, "residual": None, **seconds, "cost": None, **more}
        if solution is None:
            shaped = {"status": "shaped", "method": spec.method, "base": spec.base, "iterations": 0}
            return {**shaped, "residual": None, **seconds, "cost": None}
        optimum = solution.raise_for_status()
        return {
            "status": solution.status.name.lower(),
            "method": solution.method,
            "iterations": solution.iterations,
            "residual": solution.residual,
            **seconds,
            "cost": optimum.cost,
            "sway_weight": optimum.sway_weight,
            "sway_scale_per_m": optimum.sway_scale,
            "intervals": len(optimum.knots) - 1,
            "defect": optimum.defect,
            "hamiltonian_variation": optimum.hamiltonian_variation,
            "redundant": list(solution.redundant),
            "worst_case_bound_m": solution.worst_case_bound,
            "other_costs": None if solution.other_costs is None else list(solution.other_costs),
        }


def file_entry(folder: Path, artefact: Artefact) -> dict[str, Any]:
    """Nest what a JSON document tells of a file that was written."""
    path = os.path.relpath(folder / artefact.path)
    return {"path": path, "sha256": artefact.sha256, "bytes": artefact.bytes}


def design(
    spec: Spec,
    formats: Sequence[str],
    folder: Path,
    *,
    check: bool = True,
    keep_failed: bool = False,
    progress: Progress = no_progress,
) -> Design:
    """Solve, export, replay what was written, co-simulate, and deliver what passes.

    Raises
    ------
    GenProfileError
        Nothing was written.
    """
    place = staged(folder)
    return _designed(spec, formats, folder, place, check=check, keep_failed=keep_failed, progress=progress)


def design_in_memory(spec: Spec, formats: Sequence[str], *, by_fmpy: bool) -> tuple[Design, dict[str, bytes]]:
    """Do what `design` does, but hand over the files that pass, by name, for others to write.

    Without `by_fmpy` FMPy does not drive the nominal machine, too.
    """
    kept = Kept()
    made = _designed(spec, formats, Path(), nullcontext(kept), by_fmpy=by_fmpy)
    return made, dict(sorted(kept.delivered.items()))


def _designed(
    spec: Spec,
    formats: Sequence[str],
    folder: Path,
    place: AbstractContextManager[Staging],
    *,
    check: bool = True,
    by_fmpy: bool = True,
    keep_failed: bool = False,
    progress: Progress = no_progress,
) -> Design:
    exporters = {name: find_exporter(name) for name in dict.fromkeys(map(format_named, formats))}
    if not exporters:
        raise SpecError("export: name at least one format.")
    require_end(exporters.keys(), stops=spec.move.stops)
    require_targets(exporters, target_of(spec))
    planned = plan(spec, progress)
    spec, command = planned.spec, planned.command
    with place as staging:
        progress("exporting")
        artefacts, replayed = _export(spec, command, exporters, staging)
        worst = _check(planned, replayed, by_fmpy=by_fmpy, progress=progress) if check else None
        digest = command.payload_hash()
        kept = deliver_judged(staging, spec, artefacts, worst, profile_sha256=digest, keep_failed=keep_failed)
    return Design(spec=spec, plan=planned, check=worst, artefacts=kept, folder=folder)


def deliver_judged(
    staging: Staging,
    spec: Spec,
    artefacts: tuple[Artefact, ...],
    judged: Check | Proof | None,
    *,
    profile_sha256: str,
    keep_failed: bool,
) -> tuple[Artefact, ...]:
    """Write the manifest and the files that its spec names; deliver all unless it failed; list what was."""
    for name, content in spec.files().items():
        staging.write(name, content)
    manifest = Manifest(
        name=spec.name,
        spec=spec.to_dict(),
        spec_sha256=spec.sha256(),
        profile_sha256=profile_sha256,
        versions=dict(versions()),
        artefacts=artefacts,
        check=None if judged is None else judged.to_dict(),
    )
    previous = require_own_names(spec.name, names_of(manifest), staging.earlier)
    staging.write(FILENAME, (manifest.after(previous) if previous else manifest).to_json())
    if judged is not None and not judged.passed and not keep_failed:
        return ()
    staging.deliver()
    return artefacts


def _export(
    spec: Spec, command: Profile, exporters: dict[str, Exporter], staging: Staging
) -> tuple[tuple[Artefact, ...], list[SampledProfile]]:
    """Write every format, and replay each one's first file as the disk holds it."""
    target = target_of(spec)
    artefacts, replayed = [], []
    for name, exporter in exporters.items():
        payload = ""
        for index, file in enumerate(exporter.encode(command, target)):
            written = staging.write(file.filename, file.content)
            if index == 0:
                replayed.append(exporter.replay(written, target))
                payload = replayed[-1].payload_hash()
            artefacts.append(artefact_of(name, file.filename, written, payload))
    return tuple(artefacts), replayed


def _check(planned: Plan, replayed: Sequence[SampledProfile], *, by_fmpy: bool, progress: Progress) -> Check:
    """Judge all artefacts against the continuous motion, and keep the verdict on the worst."""
    progress(CHECKING)
    spec, machines = planned.spec, planned.evaluation.machines
    known = [*machines, *further_scenarios(spec, machines)]
    checks = []
    for setpoints in replayed:
        worst, tried = worst_machines(spec, setpoints, known, progress)
        rows, reference = [*known, *worst], partial(_continuous, planned, setpoints)
        check = verdict(spec, setpoints, rows, reference, by_fmpy=by_fmpy, progress=progress)
        checks.append(attrs.evolve(check, searched=tried))
    return max(checks, key=lambda check: check.demand)


def _continuous(
    planned: Plan, setpoints: SampledProfile, machines: Sequence[Scenario], responses: Sequence[Response]
) -> Sequence[Sway]:
    """How machines, of which the evaluation's are the first, move by the motion before it was sampled."""
    times, evaluation = responses[0].times, planned.evaluation
    compared = times[times >= judged_from(planned.spec, setpoints)]
    return evaluation.followed(compared, machines[len(evaluation.machines) :])
