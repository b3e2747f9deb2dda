"""The commands around profile libraries: sweep, look one up, and put one into a PLC."""

from pathlib import Path

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import Count, OutputFile, PathType, SpecChoice, option
from gen_profile.cli.outcome import print_outcome
from gen_profile.cli.progress import progress


@cli.command(
    epilog="Example: gen-profile sweep crane.toml --vary move.distance=0.5:10:20 --vary plant.L1=2:8:25 "
    "--export plc --out library"
)
@options.spec
@option(
    "--vary KEY=LO:HI:N",
    "A key of the spec and its values: N from LO to HI, or KEY=VALUE,VALUE,… Repeatable: all "
    "combinations; the last one is solved along.",
    into="axes",
    multiple=True,
    required=True,
)
@options.export("Format to write (see gen-profile formats)")
@option(
    "--out DIR|FILE.sqlite",
    "Folder to write to, or one file for everything; ./gen-profile-sweep by default. A sweep begun "
    "there is continued.",
    PathType(),
    into="folder",
    default="gen-profile-sweep",
)
@options.scheduler("run the cases")
@option("--workers", "Processes on this computer; as many as are worthwhile by default.", Count(min=1))
@options.output
def sweep(
    chosen: SpecChoice,
    *,
    axes: tuple[str, ...],
    formats: tuple[str, ...],
    folder: Path,
    scheduler: str | None,
    workers: int | None,
) -> None:
    """Design, check and export every combination of some values.

    Cases that fail are rows of the table with their reason; the exit code is 0 once all are done.
    """
    from gen_profile.cli import words
    from gen_profile.studies.sweep.grid import parse_grid
    from gen_profile.studies.sweep.run import prepare
    from gen_profile.studies.sweep.run import sweep as run

    if scheduler is not None and workers is not None:
        raise click.UsageError("--workers is for processes of this computer; a scheduler has its own.")

    text = chosen.text()
    store = prepare(text, chosen.overrides, parse_grid(axes), formats, folder)
    with progress() as tell:
        done = run(store, scheduler=scheduler, workers=workers, progress=tell)
    print_outcome(done.to_dict(), words.sweep(done))


@cli.command(
    epilog="Example: gen-profile lookup library --move.distance 0.73 --plant.L1 5.2",
    context_settings={"ignore_unknown_options": True},
)
@click.argument("words", metavar="DIR|FILE --KEY VALUE …", nargs=-1, type=click.UNPROCESSED)
@option(
    "--out DIR",
    "Folder to write the profile to, with its manifest; it stays where it is by default.",
    PathType(file_okay=False),
)
@options.output
def lookup(words: tuple[str, ...], out: Path | None) -> None:
    """Find the nearest safe profile of a sweep.

    Every key that was varied is an option here. Nearness counts in steps of the grid: what is more than one
    away is no answer. A profile is safe if it keeps the check's limits on the machine asked for.
    """
    from gen_profile.cli import words as tables
    from gen_profile.studies.sweep.lookup import lookup as run

    folder, asked = _folder_and_values(words)
    with progress() as tell:
        nearest = run(folder, asked, tell, out=out)
    print_outcome(nearest.to_dict(), tables.found_profile(nearest))


@cli.command(epilog="Example: gen-profile library swept --out crane.st")
@click.argument("folder", metavar="DIR|FILE", type=PathType())
@option(
    "--out",
    "File to write: its name is the block's, its suffix tells the format; ./library.st by default.",
    OutputFile(),
    into="path",
    default="library.st",
)
@options.output
def library(folder: Path, path: Path) -> None:
    """Combine a sweep's PLC blocks into one.

    An input of the block selects the profile.
    """
    from gen_profile.cli import words as tables
    from gen_profile.studies.sweep.library import write_library

    with progress() as tell:
        written = write_library(folder, path, tell)
    print_outcome(written.to_dict(), tables.library(written))


def _folder_and_values(words: tuple[str, ...]) -> tuple[Path, dict[str, str]]:
    """Tell the folder from options whose names only the sweep in it knows."""
    folders, asked = [], {}
    rest = iter(words)
    for word in rest:
        if not word.startswith("--"):
            folders.append(word)
            continue
        key, equals, value = word.removeprefix("--").partition("=")
        value = value if equals else next(rest, "")
        if not value or value.startswith("--"):
            raise click.UsageError(f"--{key} needs a value.")
        if key in asked:
            raise click.UsageError(f"--{key} is stated twice.")
        asked[key] = value
    if len(folders) != 1:
        raise click.UsageError(
            "name one folder or file that was swept to, and a value for every key varied there, "
            "such as --plant.L1 5.2."
        )
    return Path(folders[0]), asked
