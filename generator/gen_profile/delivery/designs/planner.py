"""From a spec to a planner block that was proved by co-simulation before anyone can take it."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import attrs

from gen_profile.assurance.proof.prove import prove
from gen_profile.assurance.proof.verdict import HISTORIES, Proof
from gen_profile.delivery.designs.design import deliver_judged, file_entry
from gen_profile.delivery.designs.planner_suggestions import planner_suggestions
from gen_profile.planner.design import PlannerBlock, planner_block
from gen_profile.planner.forms import block_files, block_in, is_program
from gen_profile.planner.full_speed import slow_axes
from gen_profile.planner.margins import Margins, sensor_margins
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import PLANNER, Artefact, artefact_of
from gen_profile.support.artefacts.writing import staged
from gen_profile.support.errors import Suggestion
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.summary import Drawable
from gen_profile.support.units import require_one_way


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Deployment(Drawable):
    """A planner block, and how it was judged.

    Attributes
    ----------
    spec : Spec
    block : PlannerBlock
    proof : Proof or None
        None where none was asked for.
    folder : Path
    files : tuple of Artefact
        What was delivered; empty when the proof failed.
    suggestions : tuple of Suggestion
        Changes of a refused spec with which its block passes.
    warnings : tuple of str
        Sentences on axes that never reach the velocity of their limits; none where nothing was proved.
    margins : Margins or None
        Of the damping, where there is a sensor.
    """

    spec: Spec
    block: PlannerBlock
    proof: Proof | None
    folder: Path
    files: tuple[Artefact, ...]
    suggestions: tuple[Suggestion, ...] = ()
    warnings: tuple[str, ...] = ()
    margins: Margins | None = None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "name": self.spec.name,
            "files": ", ".join(file.path for file in self.files) or "none",
            "folder": self.folder,
            **({"proof": "not done"} if self.proof is None else self.proof.summary()),
        }

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        files = [file_entry(self.folder, file) for file in self.files]
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "path": files[0]["path"] if files else None,
            "bytes": files[0]["bytes"] if files else None,
            "files": files,
            "modes": self.block.modes,
            "live": {name: list(ends) for name, ends in self.spec.planner.live.items()},
            "frequency_error": self.block.frequency_error,
            "sensor_margins": None if self.margins is None else self.margins.to_dict(),
            "proof": None if self.proof is None else self.proof.to_dict(),
            "cures": [one.to_dict() for one in self.suggestions],
            "warnings": list(self.warnings),
        }


def deploy_planner(
    spec: Spec,
    formats: Sequence[str],
    folder: Path,
    *,
    histories: int = HISTORIES,
    check: bool = True,
    keep_failed: bool = False,
    scheduler: str | None = None,
    progress: Progress = no_progress,
) -> Deployment:
    """Write a planner block, prove what was written, and deliver what passes.

    Raises
    ------
    GenProfileError
        Nothing was written.
    """
    for axis in spec.axis_scales():
        require_one_way(
            axis,
            "planner blocks take no modulo axes",
            "leave axis.modulo out, and keep the axis within one turn by limits.travel",
        )
    progress("finding the modes over the live ranges")
    block = planner_block(spec)
    files = block_files(block, spec, formats)
    with staged(folder) as staging:
        written = {file.filename: staging.write(file.filename, file.content) for file in files}
        text = _executed(block, written)
        proof, warnings = None, tuple[str, ...]()
        prove_on = partial(prove, histories=histories, scheduler=scheduler, progress=progress)
        if check:
            proof, warnings = prove_on(spec, text), slow_axes(spec, block)
        artefacts = tuple(artefact_of(PLANNER, name, content) for name, content in written.items())
        kept = deliver_judged(staging, spec, artefacts, proof, profile_sha256="", keep_failed=keep_failed)
    suggestions: tuple[Suggestion, ...] = ()
    if proof is not None and not proof.passed and not keep_failed:
        progress("looking for what would pass")
        again = partial(prove_on, compares=spec.planner.lateness is not None)
        suggestions = planner_suggestions(
            spec, proof, lambda changed, count: again(changed, planner_block(changed).text, histories=count)
        )
    return Deployment(
        spec=spec,
        block=block,
        proof=proof,
        folder=folder,
        files=kept,
        suggestions=suggestions,
        warnings=warnings,
        margins=sensor_margins(spec, block.text),
    )


def _executed(block: PlannerBlock, written: Mapping[str, bytes]) -> str:
    """Read the text that is proved out of the first file that holds it; programs hold its translation."""
    texts = (
        block_in(Path(name), content, written) for name, content in written.items() if not is_program(name)
    )
    return next(texts, block.text)
