"""The command that writes a report."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import Number, OutputFile, PathType, SpecChoice, option
from gen_profile.cli.outcome import fail, print_outcome
from gen_profile.cli.progress import progress
from gen_profile.support.errors import OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.spec.model import Spec


@cli.command(epilog="Example: gen-profile report crane.toml --out crane.html")
@options.spec_shown_as("[SPEC.toml|FILE]")
@option(
    "--out",
    "File to write, .html or .pdf; an .html named after the spec in this folder by default.",
    OutputFile(),
    into="path",
)
@options.repeatable(
    "--field NAME=VALUE",
    "A line to add to the page, as Customer=ACME; without a value, a line to fill in by hand.",
    into="fields",
)
@options.export("Format whose file is checked and named by its hash (see gen-profile formats)")
@option(
    "--measured LOG.csv",
    "Log of the real machine: columns time_s, <axis>_position_mm, <load>_sway_mm, <load>_angle_deg.",
    PathType(),
    into="log",
)
@option(
    "--measured-start SECONDS",
    "When the move begins in the log; detected by default.",
    Number(),
    into="log_start",
)
@option(
    "--columns MEANING=COLUMN,…",
    "Which column of the log holds what, as in time_ms=Zeit,payload_sway_mm=4; by their names by default.",
    into="log_columns",
)
@option("--no-compare", "Leave out the comparison with other methods, to save time.")
@options.output
def report(
    chosen: SpecChoice,
    path: Path | None,
    fields: tuple[str, ...],
    formats: tuple[str, ...],
    no_compare: bool,
    **log: Any,
) -> None:
    """Write everything about a design, or about a planner block and its proof, into one HTML file."""
    from gen_profile.presentation.report.print import printed, require_browser
    from gen_profile.support.artefacts.writing import deliver, require_place

    given = {**log, "compared": not no_compare}
    if chosen.path is not None and _holds_block(chosen.path):
        name, make, words = _of_block(chosen.path)
    elif chosen.path is not None and _is_artefact(chosen.path):
        name, make, words = _of_artefact(chosen.path, **given)
    else:
        name, make, words = _of_design(chosen.spec(), formats, **given)
    out = path or Path(f"{name}.html")
    on_paper = out.suffix.lower() == ".pdf"
    if not on_paper and out.suffix.lower() not in {".html", ".htm"}:
        raise OutputError(f"--out {out}: name a file that ends in .html or .pdf.")
    if on_paper:
        require_browser()
    require_place(out)
    parted = (one.partition("=") for one in fields)
    pairs = [(name.strip(), value.strip()) for name, _, value in parted]
    with progress() as tell:
        made = make(fields=pairs, progress=tell)
        if on_paper:
            from attrs import evolve

            tell("printing")
            made = evolve(made, content=printed(made.content))
        deliver(out, made.content)
    print_outcome(made.to_dict(out), words(made, out))
    if faults := made.faults():
        fail(faults)


# what a report is about: its name, and how a page is made and described
_Subject = tuple[str, Callable[..., Any], Callable[[Any, Path], str]]


def _of_design(spec: Spec, formats: tuple[str, ...], **given: Any) -> _Subject:
    from gen_profile.cli import words
    from gen_profile.presentation.report.build import report as run

    return spec.ascii_name, partial(run, spec, formats, **given), words.report


def _of_block(path: Path) -> _Subject:
    """Refuse what only a design has, and make a report of a planner block."""
    from gen_profile.cli import words
    from gen_profile.presentation.report.planner import planner_report

    taken = {"spec_path", "path", "fields", "as_json", "debug"}
    for parameter in click.get_current_context().command.params:
        if parameter.name not in taken and _given(parameter.name):
            raise SpecError(f"{parameter.opts[0]}: is for a design, and {path} holds a planner block.")
    return path.stem, partial(planner_report, path), words.planner_report


def _of_artefact(path: Path, **given: Any) -> _Subject:
    """Make a report of the design that a file comes from."""
    from gen_profile.cli import words
    from gen_profile.presentation.report.build import artefact_report

    for name, flag in {"preset": "--preset", "overrides": "--set", "formats": "--export"}.items():
        if _given(name):
            raise SpecError(f"{flag}: is for a spec; {path} is of the one in its manifest.")
    return path.name.partition(".")[0], partial(artefact_report, path, **given), words.report


def _given(name: str | None) -> bool:
    source = click.get_current_context().get_parameter_source(name or "")
    return source is click.core.ParameterSource.COMMANDLINE


def _is_artefact(path: Path) -> bool:
    """Tell specs from exported files by their suffix; refuse those that only go with one."""
    from gen_profile.support.artefacts.reading import read_motion
    from gen_profile_exporters.registry import formats

    if path.suffix.lower() == ".toml" or not (path.is_file() or path.is_dir()):
        return False
    read_motion(path)  # says of a folder which file is meant
    return any(path.name.endswith(known.suffix) for known in formats().values())


def _holds_block(path: Path) -> bool:
    """Tell specs from planner blocks; what cannot be read is taken for a spec, whose reader says so."""
    from gen_profile.assurance.proof.check import is_planner_block

    return path.suffix.lower() != ".toml" and path.is_file() and is_planner_block(path)
