"""The commands that write planner blocks and execute them."""

from __future__ import annotations

from pathlib import Path

import click
from click.shell_completion import CompletionItem

from gen_profile.cli.commands import cli
from gen_profile.cli.group import DefaultGroup
from gen_profile.cli.options import (
    OutputFile,
    chosen_spec,
    debug_option,
    json_option,
    spec_options,
)
from gen_profile.cli.outcome import print_outcome
from gen_profile.errors import OutputError


class PlannerGroup(DefaultGroup):
    """Write where no command is named."""

    default = "write"


def _complete_forms(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile_exporters.registry import containers

    return [CompletionItem(name) for name in (*containers(), "c") if name.startswith(incomplete)]


@cli.group(cls=PlannerGroup, epilog="Example: gen-profile planner crane.toml --out deploy")
def planner() -> None:
    """Write a PLC block that plans every motion itself, and execute it.

    Without a command: write.
    """


@planner.command(epilog="Example: gen-profile planner crane.toml --export siemens-scl --out deploy")
@spec_options
@click.option(
    "--export",
    "formats",
    metavar="FORMAT",
    multiple=True,
    default=("plc",),
    shell_complete=_complete_forms,
    help="Form of the block: plc, another format that carries blocks, or c. Repeatable; plc by default.",
)
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
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    formats: tuple[str, ...],
    folder: Path,
    as_json: bool,
) -> None:
    """Write the planner block of a machine."""
    spec = chosen_spec(spec_path, preset, overrides)
    from gen_profile.artefacts.writing import staged
    from gen_profile.cli.progress import progress
    from gen_profile.planner.design import planner_block
    from gen_profile.planner.forms import block_files, require_forms

    require_forms(formats)

    with progress() as tell:
        tell("finding the modes over the live ranges")
        block = planner_block(spec)
    files = block_files(block, spec, formats)
    with staged(folder) as staging:
        for file in files:
            staging.write(file.filename, file.content)
        staging.deliver()
    sizes = {str(folder / file.filename): len(file.content) for file in files}
    path, size = next(iter(sizes.items()))
    document = {
        "name": spec.name,
        "path": path,
        "bytes": size,
        "files": [{"path": path, "bytes": size} for path, size in sizes.items()],
        "modes": block.modes,
        "live": {name: list(ends) for name, ends in spec.planner.live.items()},
        "frequency_error": block.frequency_error,
    }
    lines = [f"{path}: {size} bytes" for path, size in sizes.items()]
    lines.append(f"{block.modes} modes. Its motions are not proved by co-simulation.")
    print_outcome(document, "\n".join(lines), as_json)


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
    from gen_profile.artefacts.writing import deliver
    from gen_profile.cli.progress import progress
    from gen_profile.planner.commands import play as run
    from gen_profile.planner.forms import read_block

    content, commands = read_block(block), _read(commands_path)
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


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise OutputError(f"Cannot read the commands {path}: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise OutputError(f"Cannot read the commands {path}: it is no UTF-8 text.") from error
