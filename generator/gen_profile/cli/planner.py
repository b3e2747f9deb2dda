"""The commands that write planner blocks and execute them, and what `stream` takes of them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.group import DefaultGroup
from gen_profile.cli.options import Count, InputFile, OutputFile, PathType, SpecChoice, option
from gen_profile.cli.outcome import fail, not_written, print_outcome, print_warnings, warn
from gen_profile.cli.progress import progress
from gen_profile.cli.signing import sign, signing_key, signing_option
from gen_profile.support.bounded_file import DOCUMENT
from gen_profile.support.errors import SpecError, StreamAborted
from gen_profile.support.progress import Progress

if TYPE_CHECKING:
    from gen_profile.delivery.streaming.outcome import Source

CLEARED = "\r\x1b[K"  # the line, of a terminal


def _complete_forms(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile_exporters.registry import containers

    return options.completed(dict.fromkeys((*containers(), "c", "linux", "openplc")), incomplete)


@cli.group(
    cls=DefaultGroup, default="write", epilog="Example: gen-profile planner --preset bay-crane --out deploy"
)
def planner() -> None:
    """Write a PLC block that plans every motion itself, and execute it.

    Without a command: write.
    """


@planner.command(epilog="Example: gen-profile planner --preset bay-crane --export siemens-scl --out deploy")
@options.spec
@options.export("Form of the block: plc, another that holds one, c, linux or openplc", "plc", _complete_forms)
@options.folder
@options.histories("Prove it on N histories of commands; 200 by default, fewer are only a trial.")
@option("--seed", "Prove it on other histories, drawn with this check.seed.", Count(0, 2**32 - 1))
@options.scheduler("run the histories")
@option("--no-check", "Skip the proof; the manifest then says unverified.")
@option("--keep-failed", "Write the block even where the proof fails.")
@options.block_plot
@signing_option("manifest")
@options.output
def write(
    chosen: SpecChoice,
    formats: tuple[str, ...],
    folder: Path,
    *,
    histories: int | None,
    seed: int | None,
    no_check: bool,
    picture: Path | None,
    key_path: Path | None,
    **given: Any,
) -> None:
    """Write the planner block of a machine, proved by co-simulation."""
    spec = chosen.spec() if seed is None else chosen.spec().changed({"check.seed": seed})
    if picture is not None and no_check:
        raise SpecError("--plot: draws what the proof found; leave --no-check out.")
    from gen_profile.assurance.proof.verdict import HISTORIES
    from gen_profile.cli import words
    from gen_profile.delivery.designs.planner import deploy_planner
    from gen_profile.planner.forms import require_forms

    require_forms(formats)
    key = signing_key(key_path)
    with progress() as tell:
        outcome = deploy_planner(
            spec,
            formats,
            folder,
            histories=histories or HISTORIES,
            check=not no_check,
            progress=tell,
            **given,
        )
        if picture is not None and outcome.proof is not None:
            from gen_profile.presentation.charts.proof import draw

            draw(spec, outcome.block.text, outcome.proof, picture, tell)
    if outcome.proof is None or outcome.proof.passed:
        sign(folder, key)
    print_outcome(outcome.to_dict(), words.deployment(outcome))
    warn(outcome.proof)
    print_warnings(outcome.warnings)
    if outcome.proof is not None and not outcome.proof.passed:
        kept = "The block was kept." if outcome.files else not_written(folder)
        if outcome.suggestions:
            tried = [f"{one} ({100.0 * one.fraction:.0f} % of the limit)" for one in outcome.suggestions]
            kept = f"It would pass with {'; or with '.join(tried)}.\n{kept}"
        fail(outcome.proof.reasons(), kept)


@planner.command(
    epilog="Example: gen-profile planner play deploy/bay-3.st --commands commands.csv --out setpoints.csv"
)
@click.argument("block", type=PathType(exists=True))
@option(
    "--commands",
    "CSV with time_s, command, value (or value_AXIS) and live parameters; a row holds until the next.",
    InputFile(),
    into="commands_path",
    required=True,
)
@option(
    "--out", "CSV of the setpoints to write, one row per cycle.", OutputFile(), into="path", required=True
)
@option(
    "--events",
    "CSV of the block's events to write, if it has them (planner.events).",
    OutputFile(),
    into="events_path",
)
@option(
    "--sensor",
    "CSV of the sensors' readings: time_s, value (or value_AXIS); each row holds until the next.",
    InputFile(),
    into="sensor_path",
)
@options.output
def play(
    block: Path, commands_path: Path, path: Path, events_path: Path | None, sensor_path: Path | None
) -> None:
    """Execute a written planner block under a table of commands."""
    from gen_profile.planner.commands import play as run
    from gen_profile.planner.events import error_words
    from gen_profile.planner.forms import read_block
    from gen_profile.planner.interface import LOST
    from gen_profile.support.artefacts.writing import deliver

    content, commands = read_block(block), _read(commands_path)
    with progress() as tell:
        tell("executing the block")
        shown = None if sensor_path is None else _read(sensor_path, "sensor log")
        setpoints = run(content, commands, with_events=events_path is not None, sensor_text=shown)
    deliver(path, setpoints.table.encode("ascii"))
    if events_path is not None:
        deliver(events_path, setpoints.events.encode("ascii"))
    text = f"{path}: {setpoints.cycles} cycles"
    if why := LOST.get(setpoints.unpromised):
        text += f"; the load may sway, because {why}"
    document = {
        "path": str(path),
        "cycles": setpoints.cycles,
        "error_ids": list(setpoints.errors),
        "promise": not setpoints.unpromised,
    }
    print_outcome(document, text)
    if setpoints.errors:
        click.echo(f"Error: the block showed {'; '.join(map(error_words, setpoints.errors))}.", err=True)
        raise SystemExit(StreamAborted.exit_code)


@planner.command(epilog="Example: gen-profile planner explain events.csv")
@click.argument("events", type=InputFile())
@options.output
def explain(events: Path) -> None:
    """Explain a planner block's events in words: a CSV with time_s, code, value."""
    from gen_profile.planner.events import read_events

    events_read = read_events(_read(events, "events"))
    document = {
        "events": [
            {"time_s": one.time, "code": one.code, "value": one.value, "words": one.words}
            for one in events_read
        ]
    }
    print_outcome(document, "\n".join(one.words for one in events_read) or "No events.")


def _read(path: Path, what: str = "commands") -> str:
    from gen_profile.support.artefacts.reading import decoded, read_artefact

    return decoded(read_artefact(path, DOCUMENT, f"the {what} "), path, f"the {what} ")


planner_options = options.together(
    option("--planner BLOCK", "Stream what this written planner block issues.", PathType(), into="block"),
    option(
        "--commands",
        "CSV of commands for --planner, as of planner play; without it, the keyboard.",
        InputFile(),
        into="commands_path",
    ),
    options.repeatable(
        "--live-parameter NAME=VALUE",
        "Initial value of a live parameter of --planner.",
        into="live_parameters",
    ),
)


def planned(
    block_path: Path, commands_path: Path | None, live_parameters: tuple[str, ...], *, accept_unverified: bool
) -> Source:
    """Take a written block, and the commands of a file or of the keyboard.

    Raises
    ------
    GenProfileError
        As `gen_profile.delivery.streaming.stream.verified_block` and
        `gen_profile.delivery.streaming.planned_motion.PlannedMotion`; or there is no terminal.
    """
    from gen_profile.delivery.streaming.keyboard import Keyboard
    from gen_profile.delivery.streaming.outcome import Source
    from gen_profile.delivery.streaming.planned_motion import CommandList, Operator, PlannedMotion
    from gen_profile.delivery.streaming.stream import verified_block
    from gen_profile.planner.commands import read_commands
    from gen_profile.planner.directions import planned_axes
    from gen_profile.planner.interface import live_inputs

    operator: Operator
    if commands_path is None and not sys.stderr.isatty():
        raise SpecError("--planner: standard error is no terminal to show the axis on; give --commands.")
    spec, block = verified_block(block_path, accept_unverified=accept_unverified)
    cycle = block.inputs["fCycleTime"]
    if commands_path is None:
        limits = [spec.limits.of(number).velocity or 0.0 for number in planned_axes(spec)]
        operator = Keyboard(sys.stdin.fileno(), block.axes, limits)
        click.echo(operator.help, err=True)
    else:
        commands = read_commands(_read(commands_path), block.axes, live_inputs(block.inputs, block.axes))
        operator = CommandList(commands, cycle)
    numbers, watched = _numbers(live_parameters), sys.stderr.isatty()
    return Source(spec=spec, plan=PlannedMotion(spec, block, operator, numbers, watched=watched))


@contextmanager
def status_line() -> Iterator[Progress]:
    """Keep one line of the terminal for what is said."""
    import shutil

    def tell(stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        width = shutil.get_terminal_size().columns - 1
        click.echo(f"{CLEARED}{stage[:width]}", err=True, nl=False)

    try:
        yield tell
    finally:
        with suppress(OSError):  # of a terminal that is gone, which must not hide what became of the stream
            click.echo(CLEARED, err=True, nl=False)


def _numbers(live_parameters: tuple[str, ...]) -> dict[str, float]:
    from gen_profile.support.suggestion import number_meant

    numbers = {}
    for text in live_parameters:
        name, _, number = text.partition("=")
        try:
            numbers[name] = float(number)
        except ValueError:
            hint = number_meant(number)
            raise SpecError(f"--live-parameter {text}: state a number, as {name}=5.5{hint}.") from None
    return numbers
