"""The command that writes a report."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from gen_profile.cli.commands import chosen_spec, cli, debug_option, json_option, print_outcome, spec_options
from gen_profile.errors import CheckFailed


@cli.command(epilog="Example: gen-profile report crane.toml --out crane.html")
@spec_options
@click.option(
    "--out",
    "path",
    metavar="FILE.html",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File to write; named after the spec in this folder by default.",
)
@click.option(
    "--export",
    "formats",
    metavar="FORMAT",
    multiple=True,
    default=("csv",),
    help="Format whose file is checked and told by its hash. Repeatable; csv by default.",
)
@click.option("--no-compare", is_flag=True, help="Leave other methods out, which takes less time.")
@json_option
@debug_option
def report(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    path: Path | None,
    formats: tuple[str, ...],
    no_compare: bool,
    as_json: bool,
) -> None:
    """Write everything about a design into one HTML file."""
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.workflows.report import report as run
    from gen_profile.workflows.report import write_report

    spec = chosen_spec(spec_path, preset, overrides)
    out = path or Path(f"{spec.name}.html")
    with progress() as tell:
        made = run(spec, formats, compared=not no_compare, progress=tell)
        write_report(made.content, out)
    print_outcome(made.to_dict(out), words.report(made, out), as_json)
    if not made.check.passed:
        for sentence in made.check.reasons():
            click.echo(f"Check failed: {sentence}", err=True)
        sys.exit(CheckFailed.exit_code)
