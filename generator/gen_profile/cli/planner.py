"""The commands that write planner blocks and execute them."""

from __future__ import annotations

from pathlib import Path

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.group import DefaultGroup
from gen_profile.cli.options import OutputFile, chosen_spec, debug_option, json_option, spec_options
from gen_profile.cli.outcome import print_outcome
from gen_profile.errors import OutputError


class PlannerGroup(DefaultGroup):
    """Write where no command is named."""

    default = "write"


@cli.group(cls=PlannerGroup, epilog="Example: gen-profile planner crane.toml --out deploy")
def planner() -> None:
    """Write a PLC block that plans every motion itself, and execute it.

    Without a command: write.
    """


@planner.command(epilog="Example: gen-profile planner crane.toml --out deploy")
@spec_options
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("gen-profile-out"),
    help="Folder to write to; ./gen-profile-out by default.",
)
@json_option
@debug_option
def write(
    spec_path: Path | None, preset: str | None, overrides: tuple[str, ...], folder: Path, as_json: bool
) -> None:
    """Write the planner block of a machine as Structured Text."""
    spec = chosen_spec(spec_path, preset, overrides)
    from gen_profile.artefacts.writing import deliver
    from gen_profile.cli.progress import progress
    from gen_profile.planner.design import planner_block

    with progress() as tell:
        tell("finding the modes over the live ranges")
        block = planner_block(spec)
    path = folder / block.filename
    content = block.text.encode("ascii")
    deliver(path, content)
    document = {
        "name": spec.name,
        "path": str(path),
        "bytes": len(content),
        "modes": block.modes,
        "live": {name: list(ends) for name, ends in spec.planner.live.items()},
        "frequency_error": block.frequency_error,
    }
    text = f"{path}: {len(content)} bytes, {block.modes} modes. Its motions are not proved by co-simulation."
    print_outcome(document, text, as_json)


@planner.command(
    epilog="Example: gen-profile planner play deploy/bay-3.st --commands commands.csv --out setpoints.csv"
)
@click.argument("block", type=click.Path(path_type=Path))
@click.option(
    "--commands",
    "commands_path",
    metavar="FILE",
    type=click.Path(path_type=Path),
    required=True,
    help="CSV with time_s, command, value and live parameters; a row holds until the next.",
)
@click.option(
    "--out",
    "path",
    metavar="FILE",
    type=OutputFile(),
    required=True,
    help="CSV of the setpoints to write, one row per cycle.",
)
@json_option
@debug_option
def play(block: Path, commands_path: Path, path: Path, as_json: bool) -> None:
    """Execute a written planner block under a table of commands."""
    content, commands = _read(block, "the block"), _read(commands_path, "the commands")
    from gen_profile.artefacts.writing import deliver
    from gen_profile.cli.progress import progress
    from gen_profile.planner.commands import play as run

    with progress() as tell:
        tell("executing the block")
        setpoints = run(content, commands)
    deliver(path, setpoints.table.encode("ascii"))
    text = f"{path}: {setpoints.cycles} cycles"
    if setpoints.errors:
        ids = ", ".join(map(str, setpoints.errors))
        text += f"; the block showed error {ids}, which its header explains"
    document = {"path": str(path), "cycles": setpoints.cycles, "error_ids": list(setpoints.errors)}
    print_outcome(document, text, as_json)


def _read(path: Path, what: str) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise OutputError(f"Cannot read {what} {path}: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise OutputError(f"Cannot read {what} {path}: it is no UTF-8 text.") from error
