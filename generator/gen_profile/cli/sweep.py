"""The commands around profile libraries: sweep, look one up, and put one into a PLC."""

from __future__ import annotations

from pathlib import Path

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import (
    OutputFile,
    chosen_text,
    debug_option,
    export_option,
    json_option,
    spec_options,
)
from gen_profile.cli.outcome import print_outcome


@cli.command(
    epilog="Example: gen-profile sweep crane.toml --vary move.distance=0.5:10:20 --vary plant.L1=2:8:25 "
    "--export plc --out library"
)
@spec_options
@click.option(
    "--vary",
    "axes",
    metavar="KEY=LO:HI:N",
    multiple=True,
    required=True,
    help="A key of the spec and its values: N from LO to HI, or KEY=VALUE,VALUE,… Repeatable: all "
    "combinations; the last one is solved along.",
)
@export_option("Format to write")
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("gen-profile-sweep"),
    help="Folder to write to; ./gen-profile-sweep by default. A sweep begun there goes on.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask scheduler whose workers do it, such as tcp://10.0.0.1:8786, in place of this computer.",
)
@click.option(
    "--workers",
    metavar="N",
    type=click.IntRange(min=1),
    help="Processes of this computer; one per processor by default.",
)
@json_option
@debug_option
def sweep(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    *,
    axes: tuple[str, ...],
    formats: tuple[str, ...],
    folder: Path,
    scheduler: str | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Design, check and export every combination of some values.

    Cases that fail are rows of the table with their reason; the exit code is 0 once all are done.
    """
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.sweep.grid import parse_grid
    from gen_profile.sweep.plan import prepare, require_libraries

    if scheduler is not None and workers is not None:
        raise click.UsageError("--workers is for processes of this computer; a scheduler has its own.")
    require_libraries()
    from gen_profile.sweep.run import sweep as run

    text = chosen_text(spec_path, preset)
    store = prepare(text, overrides, parse_grid(axes), formats, folder)
    with progress() as tell:
        done = run(
            store,
            scheduler=scheduler,
            workers=workers,
            progress=lambda at: tell(
                "designing cases", at.done, at.total, f"{at.failed} failed" if at.failed else ""
            ),
        )
    print_outcome(done.to_dict(), words.sweep(done), as_json)


@cli.command(
    epilog="Example: gen-profile lookup library --move.distance 0.73 --plant.L1 5.2",
    context_settings={"ignore_unknown_options": True},
)
@click.argument("words", metavar="DIR --KEY VALUE …", nargs=-1, type=click.UNPROCESSED)
@json_option
@debug_option
def lookup(words: tuple[str, ...], as_json: bool) -> None:
    """Find the nearest safe profile of a sweep.

    Every key that was varied is an option here. Nearness counts in steps of the grid: what is more than one
    away is no answer. Safe is what, played on the machine asked for, keeps the limits of the check.
    """
    from gen_profile.cli import words as tables
    from gen_profile.cli.progress import progress
    from gen_profile.sweep.plan import require_libraries

    require_libraries()
    from gen_profile.sweep.lookup import lookup as run

    folder, asked = _folder_and_values(words)
    with progress() as tell:
        found = run(folder, asked, tell)
    print_outcome(found.to_dict(), tables.found_profile(found), as_json)


@cli.command(epilog="Example: gen-profile library swept --out crane.st")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--out",
    "path",
    metavar="FILE",
    type=OutputFile(),
    default=Path("library.st"),
    help="File to write: its name is the block's, its suffix tells the format; ./library.st by default.",
)
@json_option
@debug_option
def library(folder: Path, path: Path, as_json: bool) -> None:
    """Put a sweep's PLC blocks into one.

    An input of the block selects the profile.
    """
    from gen_profile.cli import words as tables
    from gen_profile.cli.progress import progress
    from gen_profile.sweep.plan import require_libraries

    require_libraries()
    from gen_profile.sweep.library import write_library

    with progress() as tell:
        written = write_library(folder, path, tell)
    print_outcome(written.to_dict(), tables.library(written), as_json)


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
        raise click.UsageError("name one folder that was swept to, and a value for every key varied there.")
    return Path(folders[0]), asked
