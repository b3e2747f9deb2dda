"""The command that turns measurements into a spec."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import (
    OutputFile,
    PathType,
    SpecChoice,
    output_options,
    plot_option,
    spec_options,
)
from gen_profile.cli.outcome import print_outcome
from gen_profile.errors import SpecError

if TYPE_CHECKING:
    from pathlib import Path


@cli.command(epilog="Example: gen-profile identify crane.toml --measured L1=6.2±0.1 --period 51.3±0.3/10")
@spec_options
@click.option(
    "--measured",
    "readings",
    metavar="NAME=VALUE±U",
    multiple=True,
    help="A parameter read off a tape or scale, with its standard deviation (+- will do for ±). Repeatable.",
)
@click.option(
    "--period",
    "periods",
    metavar="[MODE:]S±U[/N]",
    multiple=True,
    help="N small swings by stopwatch, of the slowest mode (1) by default. Repeatable.",
)
@click.option(
    "--swing",
    "log",
    metavar="CSV",
    type=PathType(),
    help="A swing logged while the axes stood still.",
)
@click.option("--columns", metavar="TIME,VALUE", default="1,2", help="Columns of the log: names, or numbers.")
@click.option(
    "--signal",
    metavar="SIGNAL",
    default="angle",
    help="What the log's values are: angle, sway or rate (of the angle), of the first load or, as in "
    "rate:hook, of another.",
)
@click.option(
    "--unit",
    metavar="UNIT",
    help="Unit of the log's values: rad, deg, m, mm, um, rad/s or deg/s; by default what their column's name "
    "says; for counts the size of one, as in '0.09 deg'.",
)
@click.option(
    "--time-unit",
    type=click.Choice(["s", "ms", "us"]),
    help="Unit of its times; by default what their column's name says, or s.",
)
@click.option(
    "--after",
    metavar="SECONDS",
    type=float,
    default=0.0,
    help="Leave out what the log holds before this time; of dates, so long after the first.",
)
@click.option(
    "--free",
    metavar="NAME",
    multiple=True,
    help="Identify a parameter that was not read directly. Repeatable.",
)
@click.option(
    "--at", metavar="POSITION,…", help="Where the axes stood, in m or rad; at the move's target by default."
)
@click.option(
    "--out",
    type=OutputFile(replaces="spec_path"),
    default="identified.toml",
    help="Spec to write; ./identified.toml by default.",
)
@plot_option
@output_options
def identify(
    chosen: SpecChoice,
    *,
    readings: tuple[str, ...],
    periods: tuple[str, ...],
    log: Path | None,
    columns: str,
    signal: str,
    unit: str | None,
    time_unit: str | None,
    after: float,
    free: tuple[str, ...],
    at: str | None,
    out: Path,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Find parameters from measurements on site, and write a spec."""
    from gen_profile.charts.plot import plot
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.identification.identify import identify as run
    from gen_profile.identification.identify import read_swing, write_spec
    from gen_profile.identification.measurements import Measurement, parse_period, parse_reading
    from gen_profile.spec.reading import parse_spec
    from gen_profile.spec.text import changed_text

    text, source, folder = chosen.text()
    spec = parse_spec(text, chosen.overrides, source, folder)
    if picture is not None and log is None:
        raise SpecError("--plot: draws a log and what is left of it: name one (--swing).")
    measurements: list[Measurement] = [*map(parse_reading, readings), *map(parse_period, periods)]
    with progress() as tell:
        if log is not None:
            time, comma, value = columns.partition(",")
            if not comma:
                raise SpecError(f"--columns {columns!r}: write TIME,VALUE, such as 1,2 or time,angle.")
            tell("reading the log")
            read = read_swing(
                log,
                spec,
                columns=(time, value),
                signal=signal,
                unit=unit,
                time_unit=time_unit,
                after=after,
            )
            measurements.append(read)
        identified = run(spec, measurements, free, None if at is None else _positions(at), tell)
        if picture is not None:
            tell("drawing")
            plot(identified, picture)
        write_spec(identified.spec, out, changed_text(text, chosen.overrides, spec, identified.spec, folder))
    print_outcome({**identified.to_dict(), "path": str(out)}, words.identification(identified, out), as_json)


def _positions(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise SpecError(f"--at {text!r}: write one number per axis, such as 3.5 or 0,3.5.") from error
