"""The command that writes a report."""

from __future__ import annotations

from pathlib import Path

import attrs
import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import (
    OutputFile,
    chosen_spec,
    debug_option,
    export_option,
    json_option,
    spec_options,
)
from gen_profile.cli.outcome import fail, print_outcome
from gen_profile.errors import OutputError


@cli.command(epilog="Example: gen-profile report crane.toml --out crane.html")
@spec_options
@click.option(
    "--out",
    "path",
    metavar="FILE",
    type=OutputFile(),
    help="File to write, .html or .pdf; an .html named after the spec in this folder by default.",
)
@click.option(
    "--field",
    "fields",
    metavar="NAME=VALUE",
    multiple=True,
    help="What the page shall also say, as Customer=ACME; without a value, a line to sign. Repeatable.",
)
@export_option("Format whose file is checked and told by its hash")
@click.option(
    "--measured",
    "log",
    metavar="LOG.csv",
    type=click.Path(path_type=Path),
    help="What the machine really did: columns time_s, <axis>_position_mm, <load>_sway_mm, <load>_angle_deg.",
)
@click.option(
    "--measured-start",
    "log_start",
    metavar="SECONDS",
    type=float,
    help="When the move begins in the log; found by itself by default.",
)
@click.option(
    "--columns",
    "log_columns",
    metavar="MEANING=COLUMN,…",
    help="Which column of the log holds what, as in time_ms=Zeit,payload_sway_mm=4; by names by default.",
)
@click.option("--no-compare", is_flag=True, help="Leave other methods out, which takes less time.")
@json_option
@debug_option
def report(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    path: Path | None,
    fields: tuple[str, ...],
    formats: tuple[str, ...],
    log: Path | None,
    log_start: float | None,
    log_columns: str | None,
    no_compare: bool,
    as_json: bool,
) -> None:
    """Write everything about a design into one HTML file."""
    from gen_profile.artefacts.writing import deliver, require_place
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.report.build import report as run
    from gen_profile.report.print import printed, require_browser

    spec = chosen_spec(spec_path, preset, overrides)
    out = path or Path(f"{spec.name}.html")
    on_paper = out.suffix.lower() == ".pdf"
    if not on_paper and out.suffix.lower() not in {".html", ".htm"}:
        raise OutputError(f"--out {out}: name a file that ends in .html or .pdf.")
    if on_paper:
        require_browser()
    require_place(out)
    with progress() as tell:
        made = run(
            spec,
            formats,
            log=log,
            log_start=log_start,
            log_columns=log_columns,
            compared=not no_compare,
            fields=[
                (name.strip(), value.strip()) for name, _, value in (one.partition("=") for one in fields)
            ],
            progress=tell,
        )
        if on_paper:
            tell("printing")
            made = attrs.evolve(made, content=printed(made.content))
        deliver(out, made.content)
    print_outcome(made.to_dict(out), words.report(made, out), as_json)
    if faults := made.faults():
        fail(faults)
