"""The command that shows how much sway is left on machines that are not as specified."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import Count, OutputFile, SpecChoice, output_options, plot_option, spec_options
from gen_profile.cli.outcome import print_outcome
from gen_profile.cli.progress import draw, progress

if TYPE_CHECKING:
    from pathlib import Path


@cli.command(epilog="Example: gen-profile robustness crane.toml --parameter L1 --plot robustness.png")
@spec_options
@click.option(
    "--parameter",
    "parameters",
    metavar="NAME",
    multiple=True,
    help="What is off: once for a curve, twice for a map; the first uncertain parameter by default.",
)
@click.option(
    "--method",
    "methods",
    metavar="NAME",
    multiple=True,
    help="Method to try, as compare names them. Repeatable; all by default.",
)
@click.option(
    "--range",
    "half_range",
    metavar="SHARE",
    type=click.FloatRange(0.0, 0.9, min_open=True),
    help="Greatest relative error, such as 0.3; one and a half times the spec's range by default.",
)
@click.option(
    "--points",
    type=Count(3, 1001),
    help="Errors tried per parameter; 61 of a curve, 25 of a map by default.",
)
@plot_option
@click.option("--csv", "path", type=OutputFile(), help="Write the numbers as a table.")
@output_options
def robustness(
    chosen: SpecChoice,
    *,
    parameters: tuple[str, ...],
    methods: tuple[str, ...],
    half_range: float | None,
    points: int | None,
    picture: Path | None,
    path: Path | None,
    as_json: bool,
) -> None:
    """Show residual sway over one or two parameters, optimal motions beside shapers."""
    spec = chosen.spec()
    from gen_profile.artefacts.writing import deliver
    from gen_profile.cli import words
    from gen_profile.comparison.robustness import robustness as run

    with progress() as tell:
        curves = run(spec, parameters, methods=methods, points=points, half_range=half_range, progress=tell)
        draw(curves, picture, tell)
        if path is not None:
            deliver(path, curves.table().encode("utf-8"))
    print_outcome(curves.to_dict(), words.robustness(curves), as_json)
