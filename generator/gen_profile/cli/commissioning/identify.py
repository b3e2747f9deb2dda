"""The commands that turn measurements into a spec."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import InputFile, Number, PathType, SpecChoice, option
from gen_profile.cli.outcome import fail, print_outcome, warn
from gen_profile.cli.progress import draw, progress
from gen_profile.support.errors import GenProfileError, OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.spec.model import Spec
    from gen_profile.studies.identification.measurements import SwingLog
    from gen_profile.support.progress import Progress


def log_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add how a table of a swing is read; the command gets what reads one of a spec's machine as `read`."""

    @option(
        "--columns TIME,VALUE",
        "Columns of the log: names, or numbers; by default those whose names tell it, or the first two.",
    )
    @option(
        "--signal SIGNAL",
        "What the log's values are: angle, sway, rate (of the angle) or acceleration (without gravity), of "
        "the first load or, as in rate:hook, of another.",
        default="angle",
    )
    @option(
        "--unit UNIT",
        "Unit of the log's values: rad, deg, m, mm, um, rad/s, deg/s, m/s² or g; by default what their "
        "column's name says; for counts the size of one, as in '0.09 deg'.",
    )
    @option(
        "--time-unit",
        "Unit of the log's times; by default what their column's name says, or the times show.",
        click.Choice(["s", "ms", "us", "ns"]),
    )
    @wraps(command)
    def reading(
        *, columns: str | None, signal: str, unit: str | None, time_unit: str | None, **given: Any
    ) -> Any:
        time, comma, value = (columns or ",").partition(",")
        if not comma:
            raise SpecError(f"--columns {columns!r}: write TIME,VALUE, such as 1,2 or time,angle.")

        from gen_profile.studies.identification.identify import read_swing

        named = (time, value) if columns else None
        read = partial(read_swing, columns=named, signal=signal, unit=unit, time_unit=time_unit)
        return command(read=read, **given)

    return reading


@cli.command(epilog="Example: gen-profile identify crane.toml --measured L1=6.2±0.1 --period 51.3±0.3/10")
@options.spec
@options.repeatable(
    "--measured NAME=VALUE±U",
    "A parameter read off a tape or scale, with its standard deviation (+- will do for ±).",
    into="readings",
)
@options.repeatable(
    "--period [MODE:]S±U[/N]",
    "N small swings by stopwatch, of the slowest mode (1) by default.",
    into="periods",
)
@options.repeatable("--swing CSV", "A swing logged while the axes stood still.", PathType(), into="logs")
@log_options
@option(
    "--after SECONDS",
    "Ignore the log before this time; where times are dates, this long after the first.",
    Number(),
)
@options.repeatable("--free NAME", "Identify a parameter that was not read directly.")
@option("--at POSITION,…", "Where the axes stood, in m or rad; at the move's target by default.")
@options.spec_output("identified.toml")
@options.plot
@options.output
def identify(
    chosen: SpecChoice,
    *,
    readings: tuple[str, ...],
    periods: tuple[str, ...],
    logs: tuple[Path, ...],
    read: Callable[..., SwingLog],
    after: float | None,
    free: tuple[str, ...],
    at: str | None,
    out: Path,
    picture: Path | None,
) -> None:
    """Find parameters from measurements on site, and write a spec."""
    from gen_profile.cli.commissioning.words import identification
    from gen_profile.studies.identification.identify import identify as run
    from gen_profile.studies.identification.identify import write_spec
    from gen_profile.studies.identification.measurements import Measurement, parse_period, parse_reading

    spec, rewritten = _to_change(chosen)
    if picture is not None and not logs:
        raise SpecError("--plot: draws a log and what is left of it: name one (--swing).")
    measurements: list[Measurement] = [*map(parse_reading, readings), *map(parse_period, periods)]
    with progress() as tell:
        if logs:
            tell("reading the log")
            swings = [_read(log, picture, tell, lambda log: read(log, spec, after=after)) for log in logs]
            measurements += swings
        try:
            identified = run(spec, measurements, free, None if at is None else _positions(at), tell)
        except GenProfileError:
            if logs:  # which shows a wrong column or unit at once
                draw(swings[0], picture, tell)
            raise
        draw(identified, picture, tell)
        write_spec(identified.spec, out, rewritten(identified.spec))
    print_outcome({**identified.to_dict(), "path": str(out)}, identification(identified, out))


def _read(log: Path, picture: Path | None, tell: Progress, read: Callable[[Path], SwingLog]) -> SwingLog:
    """Read a log; draw the columns of one that is refused."""
    from gen_profile.studies.identification.log_table import read_table, read_text

    try:
        return read(log)
    except OutputError:
        with suppress(OutputError):  # of what is no table
            draw(read_table(read_text(log, "swing"), str(log)), picture, tell)
        raise


def _to_change(chosen: SpecChoice) -> tuple[Spec, Callable[[Spec], str]]:
    """Read a spec, and give what writes another one into its text."""
    from gen_profile.spec.reading import parse_spec
    from gen_profile.spec.text import changed_text

    text, source, folder = chosen.text()
    spec = parse_spec(text, chosen.overrides, source, folder)
    return spec, lambda other: changed_text(text, chosen.overrides, spec, other, folder)


def _positions(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise SpecError(f"--at {text!r}: write one number per axis, such as 3.5 or 0,3.5.") from error


@cli.command(
    epilog="Example: gen-profile learn crane.toml run.csv --played deploy/crane.st --signal rate:hook"
)
@options.spec
@click.argument("logs", metavar="[LOG.csv]...", nargs=-1, type=PathType())
@option("--played", "The file whose setpoints the axes followed in these runs.", InputFile(), required=True)
@options.repeatable(
    "--seen LOAD=M±M", "Greatest sway in m observed after a run, with its bound (+- will do for ±)."
)
@log_options
@options.spec_output("learned.toml")
@options.repeatable(
    "--export FORMAT", "Design for the narrowed ranges, check, and write in this format.", into="formats"
)
@option(
    "--folder DIR",
    "Folder for these files; ./gen-profile-out by default.",
    PathType(),
    default="gen-profile-out",
)
@options.output
def learn(
    chosen: SpecChoice,
    *,
    logs: tuple[Path, ...],
    played: Path,
    seen: tuple[str, ...],
    read: Callable[..., SwingLog],
    out: Path,
    formats: tuple[str, ...],
    folder: Path,
) -> None:
    """Narrow a spec's ranges by what runs of a motion showed.

    A run is a log of the swing, from before the motion until some swings after it, or the sway observed then.
    """
    from gen_profile.assurance.verification.check import replayed
    from gen_profile.cli import words
    from gen_profile.cli.commissioning.words import learning
    from gen_profile.delivery.designs.design import design
    from gen_profile.studies.identification.identify import write_spec
    from gen_profile.studies.identification.learning import learn as run
    from gen_profile.studies.identification.measurements import parse_reading

    spec, rewritten = _to_change(chosen)
    options.require_formats(formats)
    sights = [parse_reading(one, "seen") for one in seen]
    with progress() as tell:
        tell("reading the runs")
        setpoints = replayed(played, spec)
        learned = run(spec, setpoints, [*(read(log, spec) for log in logs), *sights], tell)
        write_spec(learned.spec, out, rewritten(learned.spec))
        made = design(learned.spec, formats, folder, progress=tell) if formats else None
    document = {**learned.to_dict(), "path": str(out), "design": None if made is None else made.to_dict()}
    text = learning(learned, out)
    print_outcome(document, text if made is None else f"{text}\n{words.design(made)}")
    if made is not None:
        warn(made.check)
        if not made.passed and made.check is not None:
            fail(made.check.reasons(), f"{out} was written, and nothing to {folder}.")
