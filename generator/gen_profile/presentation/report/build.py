"""A design as one page that an engineer can read, send and file."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import attrs

from gen_profile.assurance.verification.origin import origin_of
from gen_profile.assurance.verification.verdict import Check
from gen_profile.delivery.designs.design import Design, design
from gen_profile.dynamics.evaluation.phrases import move, uncertain
from gen_profile.presentation.report.content import Page, machine_data
from gen_profile.presentation.report.log import read_log
from gen_profile.presentation.report.measured import Measured, compare_measured
from gen_profile.presentation.report.measured_section import measured_verdict
from gen_profile.presentation.report.page import render, require_pages
from gen_profile.presentation.report.sections import facts, sections, verdict
from gen_profile.spec.model import Spec
from gen_profile.studies.comparison.compare import Comparison, compare
from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.artefacts.reading import read_motion
from gen_profile.support.errors import OutputError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.registry import format_of


@attrs.frozen(kw_only=True, eq=False)
class Report:
    """A page, and what it says.

    Attributes
    ----------
    design : Design
        Its artefacts were written and checked, and are gone; their hashes are what stays.
    comparison : Comparison or None
    measured : Measured or None
    content : bytes
        The page.
    """

    design: Design
    comparison: Comparison | None
    measured: Measured | None
    content: bytes

    @property
    def check(self) -> Check:
        """The verdict."""
        return _checked(self.design)

    def observed(self) -> tuple[str, ...]:
        """Say how the machine swung that the log is of; nothing without a log."""
        return () if self.measured is None else tuple(measured_verdict(self.measured).sentences)

    def faults(self) -> tuple[str, ...]:
        """Say why the design, or the machine, does not do what it should; a sentence each."""
        exceeded = self.measured is not None and self.measured.passed is False
        return (*self.check.reasons(), *(self.observed() if exceeded else ()))

    def to_dict(self, path: Path) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "name": self.design.spec.name,
            "spec_sha256": self.design.spec.sha256(),
            "figures": self.design.figures,
            "axes": self.design.plan.evaluation.axes,
            "check": self.check.to_dict(),
            "measured": None if self.measured is None else self.measured.to_dict(),
            "report": {"path": str(path), "sha256": sha256(self.content), "bytes": len(self.content)},
        }


def report(
    spec: Spec,
    formats: Sequence[str],
    *,
    log: Path | None = None,
    log_start: float | None = None,
    log_columns: str | None = None,
    compared: bool = True,
    fields: Sequence[tuple[str, str]] = (),
    progress: Progress = no_progress,
) -> Report:
    """Design, check and compare, and put what was found on one page.

    Parameters
    ----------
    spec : Spec
    formats : sequence of str
        Whose artefacts are checked and named by their hashes.
    log : Path, optional
        What the machine really did, as a table; see `gen_profile.presentation.report.log`.
    log_start : float, optional
        When the move begins in it, in s; the start that fits best by default.
    log_columns : str, optional
        Which of its columns holds what; see `gen_profile.presentation.report.log.read_log`.
    compared : bool
        Whether other methods are tried as well.
    fields : sequence of (str, str)
        Names and values that the page shall also hold, such as a customer; those without a value are lines
        to sign.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
    """
    require_pages()
    read = None if log is None else read_log(log, spec, log_columns)
    with TemporaryDirectory(prefix="gen-profile-") as folder:
        outcome = design(spec, formats, Path(folder), keep_failed=True, progress=progress)
    arrival = _checked(outcome).arrival
    measured = None
    if read is not None:
        measured = compare_measured(outcome.spec, outcome.plan.evaluation, read, arrival, log_start)
    comparison = compare(spec, progress) if compared and spec.path is None else None
    progress("writing the report")
    page = _page(outcome, comparison, measured).with_fields(fields)
    return Report(design=outcome, comparison=comparison, measured=measured, content=render(page))


def artefact_report(path: Path, **options: Any) -> Report:
    """Report on a delivered file: on the design that its manifest tells, which makes the same bytes again.

    Parameters
    ----------
    path : Path
    options
        As `report` takes them.

    Raises
    ------
    GenProfileError
        As of `report`; or the file is not what its manifest says, or this version writes another one.
    """
    content = read_motion(path)
    origin = origin_of(path, content)
    if origin.agreement != "matches":
        raise OutputError(f"{path} was altered after its export: gen-profile check judges it as it is now.")
    origin.require_unaltered()
    made = report(origin.spec, [format_of(path)], **options)
    if sha256(content) not in {artefact.sha256 for artefact in made.design.artefacts}:
        raise OutputError(
            f"{path} comes from another version of gen-profile, and is another file now; export again."
        )
    return made


def _page(outcome: Design, comparison: Comparison | None, measured: Measured | None) -> Page:
    spec, check = outcome.spec, _checked(outcome)
    return Page(
        title=spec.name,
        subtitle=f"{spec.machine().summary}: {move(spec)}; uncertain: {uncertain(spec)}",
        machine=machine_data(spec),
        verdicts=[verdict(check), *([] if measured is None else [measured_verdict(measured)])],
        facts=facts(spec, outcome.plan.evaluation, outcome.figures, check),
        sections=list(sections(outcome, check, comparison, measured)),
    )


def _checked(outcome: Design) -> Check:
    assert outcome.check is not None  # a design is checked unless asked otherwise
    return outcome.check
