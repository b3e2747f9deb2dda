"""The commands. Each imports its workflow when it runs: ``--help`` must not wait for CasADi."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from gen_profile.cli.group import DefaultGroup
from gen_profile.errors import CheckFailed, GenProfileError, OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.check import Check
    from gen_profile.spec import Spec

DEFAULT_PRESET = "paper"
INTERRUPTED = 128 + signal.SIGINT  # as shells count it

Command = TypeVar("Command", bound=Callable[..., Any])


def _complete_formats(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile_exporters.registry import formats

    return [
        CompletionItem(name, help=known.summary)
        for name, known in formats().items()
        if name.startswith(incomplete)
    ]


def _complete_presets(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile.spec_reading import presets

    return [
        CompletionItem(name, help=text) for name, text in presets().items() if name.startswith(incomplete)
    ]


def spec_options(command: Command) -> Command:
    """Add what every command that takes a spec takes."""
    for decorate in (
        click.option(
            "--set",
            "overrides",
            metavar="KEY=VALUE",
            multiple=True,
            help="Override a key of the spec, such as plant.L1=0.5. Repeatable.",
        ),
        click.option(
            "--preset",
            metavar="NAME",
            shell_complete=_complete_presets,
            help="Use a built-in spec (see gen-profile presets).",
        ),
        click.argument("spec_path", metavar="[SPEC.toml]", required=False, type=click.Path(path_type=Path)),
    ):
        command = decorate(command)
    return command


def export_option(what: str) -> Callable[[Command], Command]:
    """Add the choice of formats, and say what becomes of each."""
    return click.option(
        "--export",
        "formats",
        metavar="FORMAT",
        multiple=True,
        default=("csv",),
        shell_complete=_complete_formats,
        help=f"{what} (see gen-profile formats). Repeatable; csv by default.",
    )


plot_option = click.option(
    "--plot",
    "picture",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Draw it (png, svg or pdf).",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout.")
debug_option = click.option(
    "--debug", is_flag=True, expose_value=False, help="Log details, and show tracebacks."
)


@click.group(cls=DefaultGroup, epilog="Example: gen-profile crane.toml --export plc --out deploy")
@click.version_option(package_name="gen-profile", message="%(version)s")
def cli() -> None:
    """Design motion profiles that leave no sway, prove them by co-simulation, and export them.

    Without a command: design, export and verify.
    """


@cli.command(epilog="Example: gen-profile --preset paper --export plc --export can --out deploy")
@spec_options
@export_option("Format to write")
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("gen-profile-out"),
    help="Folder to write to; ./gen-profile-out by default.",
)
@click.option("--cycle-time", metavar="SECONDS", help="Cycle of the controller, and SYNC period of the bus.")
@click.option("--plc-layout", metavar="LAYOUT", help="Table of a PLC block: segments, samples or counts.")
@click.option("--csv-dialect", metavar="NAME", help="rfc4180, excel-de, sew, kollmorgen or lenze.")
@click.option(
    "--csv-columns", metavar="NAME,…", help="Of position, velocity, acceleration, jerk; all by default."
)
@click.option("--method", metavar="NAME", help="Solver (auto, indirect or direct), or a shaper such as zvd.")
@click.option("--no-check", is_flag=True, help="Skip the co-simulation; the manifest then says unverified.")
@click.option("--keep-failed", is_flag=True, help="Write the artefacts even where the check fails.")
@json_option
@debug_option
def design(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    formats: tuple[str, ...],
    folder: Path,
    cycle_time: str | None,
    plc_layout: str | None,
    csv_dialect: str | None,
    csv_columns: str | None,
    method: str | None,
    no_check: bool,
    keep_failed: bool,
    as_json: bool,
) -> None:
    """Design, export and verify (the default)."""
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.workflows.design import design as run

    columns = None if csv_columns is None else [name.strip() for name in csv_columns.split(",")]
    overrides += as_overrides(
        {
            "export.cycle_time": cycle_time,
            "can.sync_period": cycle_time,
            "export.plc_layout": plc_layout,
            "export.csv_dialect": csv_dialect,
            "export.csv_columns": columns,
            "solver.method": method,
        }
    )
    spec = chosen_spec(spec_path, preset, overrides)
    with progress() as tell:
        outcome = run(spec, formats, folder, check=not no_check, keep_failed=keep_failed, progress=tell)
    print_outcome(outcome.to_dict(), words.design(outcome), as_json)
    _warn(outcome.check)
    if not outcome.passed and outcome.check is not None:
        _fail(
            outcome.check.reasons(), "The files were kept." if outcome.artefacts else "Nothing was written."
        )


@cli.command(epilog="Example: gen-profile compare --preset paper --plot comparison.png")
@spec_options
@plot_option
@click.option(
    "--base",
    type=click.Choice(["quintic", "septic", "jerk-limited"]),
    help="What the shapers are fed with, in place of solver.base; jerk-limited needs limits.jerk.",
)
@json_option
@debug_option
def compare(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    picture: Path | None,
    base: str | None,
    as_json: bool,
) -> None:
    """Compare optimal profiles with shapers."""
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.workflows.compare import compare as run

    spec = chosen_spec(spec_path, preset, overrides + as_overrides({"solver.base": base}))
    if picture is not None:
        from gen_profile.workflows.comparison_plot import draw
        from gen_profile.workflows.picture import require_drawable

        require_drawable(picture)
    with progress() as tell:
        comparison = run(spec, tell)
        if picture is not None:
            tell("drawing")
            draw(comparison, picture)
    print_outcome(comparison.to_dict(), words.comparison(comparison), as_json)


@cli.command(epilog="Example: gen-profile check deploy/paper.st")
@click.argument("artefact", type=click.Path(path_type=Path))
@spec_options
@click.option(
    "--samples",
    metavar="N",
    type=click.IntRange(0, 1_000_000),
    help="Draw N machines, in place of check.samples.",
)
@click.option("--scenario", metavar="N", type=int, help="Try only the scenario of this number (row).")
@click.option("--strict", is_flag=True, help="Let faults in the timing of setpoints count as well.")
@click.option(
    "--csv",
    "table_path",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Write all scenarios as a table, one row each.",
)
@json_option
@debug_option
def check(
    artefact: Path,
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    *,
    samples: int | None,
    scenario: int | None,
    strict: bool,
    table_path: Path | None,
    as_json: bool,
) -> None:
    """Replay, co-simulate and judge an artefact.

    The spec comes from the manifest beside the artefact unless one is named.
    """
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.workflows.check import check_artefact
    from gen_profile.workflows.delivery import deliver
    from gen_profile.workflows.scenario_table import table

    given = spec_path is not None or preset is not None
    if overrides and not given:
        raise SpecError("--set: changes a spec that is named; the manifest's own stays as it is.")
    spec = chosen_spec(spec_path, preset, overrides) if given else None
    with progress() as tell:
        tell("checking by co-simulation")
        judgement = check_artefact(
            artefact,
            spec,
            lambda: tell("compiling the plant's FMU, once"),
            samples=samples,
            row=scenario,
            strict=strict,
            progress=lambda done, total: tell(f"checking by co-simulation, {done} of {total} scenarios"),
        )
    if table_path is not None:
        deliver(table_path, table(judgement.spec, judgement.check).encode("utf-8"))
    print_outcome(judgement.to_dict(), words.judgement(judgement), as_json)
    _warn(judgement.check)
    if not judgement.check.passed:
        _fail(judgement.check.reasons(), "Do not deploy it.")


@cli.command(epilog="Example: gen-profile formats")
@json_option
@debug_option
def formats(as_json: bool) -> None:
    """List the export formats."""
    from gen_profile_exporters.registry import formats as known

    rows = {name: f"{form.summary} ({form.suffix}; {form.proof})" for name, form in known().items()}
    print_outcome(
        {"formats": {name: form._asdict() for name, form in known().items()}}, _definitions(rows), as_json
    )


@cli.command(epilog="Example: gen-profile plants")
@json_option
@debug_option
def plants(as_json: bool) -> None:
    """List the machines with their parameters."""
    from gen_profile.plants.registry import find_plant, plant_types

    document, blocks = {}, []
    for type_ in plant_types():
        plant = find_plant(type_)
        document[type_] = {
            "summary": plant.summary,
            "axes": {axis.name: axis.unit for axis in plant.actuated},
            "loads": list(plant.loads),
            "parameters": {
                q.name: {"unit": q.unit, "nominal": q.nominal, "lower": q.lower, "upper": q.upper}
                for q in plant.parameters
            },
        }
        values = {
            q.name: f"{q.description}, {q.nominal:g} {q.unit} ({q.lower:g} to {q.upper:g})"
            for q in plant.parameters
        }
        blocks.append(f"{type_}: {plant.summary}\n{_definitions(values)}")
    print_outcome({"plants": document}, "\n\n".join(blocks), as_json)


@cli.command(epilog="Example: gen-profile presets")
@json_option
@debug_option
def presets(as_json: bool) -> None:
    """List the built-in specs."""
    from gen_profile.spec_reading import presets as known

    print_outcome({"presets": known()}, _definitions(known()), as_json)


def main() -> None:
    """Run the command line; the entry point."""
    _open_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal may lack β
    interruptions = _interruptible()
    debug, as_json = "--debug" in sys.argv, "--json" in sys.argv
    if debug:
        import logging

        logging.basicConfig(level=logging.DEBUG, format="%(name)s: %(message)s")
    try:
        sys.exit(cli.main(prog_name="gen-profile", standalone_mode=False))
    except Exception as error:
        if debug:
            raise
        # what is interrupted while compiled code runs may end in an error of that code's own
        sys.exit(_report(click.Abort() if interruptions else error, as_json))


def _open_streams() -> None:
    """Lead streams that the caller closed nowhere, lest a file that is opened gets their number."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")


def _interruptible() -> list[int]:
    """Clean up on SIGTERM as on Ctrl-C; list the signals that come."""
    signals: list[int] = []

    def interrupt(number: int, _frame: object) -> None:
        signals.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # and not ignored, as in the background
        signal.signal(signal.SIGINT, interrupt)
    return signals


def as_overrides(values: Mapping[str, object]) -> tuple[str, ...]:
    """Write options that stand for keys of the spec as --set would; None is for one that was not given."""
    return tuple(f"{key}={value}" for key, value in values.items() if value is not None)


def chosen_spec(path: Path | None, preset: str | None, overrides: tuple[str, ...]) -> Spec:
    """Read the spec that the command line names, or the default preset."""
    from gen_profile.spec_reading import parse_spec

    text, source, folder = chosen_text(path, preset)
    return parse_spec(text, overrides, source, folder)


def chosen_text(path: Path | None, preset: str | None) -> tuple[str, str, Path]:
    """Read the text of that spec; also give its source, and the folder that its files are relative to."""
    from gen_profile.spec_reading import HERE, preset_text, read_text

    if path is not None and preset is not None:
        raise SpecError("--preset: name either a spec file or a preset, not both.")
    if path is None:
        name = preset or DEFAULT_PRESET
        return preset_text(name), name, HERE
    try:
        return read_text(path), str(path), path.parent
    except OutputError as error:
        if str(path) in cli.commands:
            meant = f"a command comes before its options: gen-profile {path} …"
            raise OutputError(f"{str(error).rstrip('.')}; {meant}") from error
        raise


def print_outcome(document: dict[str, Any], text: str, as_json: bool) -> None:
    """Print an outcome for people, or for programs.

    Raises
    ------
    OutputError
        stdout does not take it, as on a full disk.
    """
    try:
        click.echo(json.dumps(document, indent=2, allow_nan=False) if as_json else text)
    except BrokenPipeError:  # a reader that left early, which click knows
        raise
    except OSError as error:
        raise OutputError(f"Cannot print the outcome: {error.strerror}.") from error


def _definitions(rows: dict[str, str]) -> str:
    formatter = click.HelpFormatter(width=110)
    formatter.indent()
    formatter.write_dl(list(rows.items()))
    return formatter.getvalue().rstrip("\n")


def _warn(check: Check | None) -> None:
    for sentence in () if check is None else check.warnings():
        click.echo(f"Beware: {sentence}", err=True)


def _fail(reasons: tuple[str, ...], consequence: str) -> None:
    for sentence in reasons:
        click.echo(f"Check failed: {sentence}", err=True)
    click.echo(consequence, err=True)
    sys.exit(CheckFailed.exit_code)


def _report(error: Exception, as_json: bool) -> int:
    """Tell an error in sentences, and in JSON where that was asked for; return its exit code."""
    match error:
        case GenProfileError():
            code, message = error.exit_code, str(error)
        case click.ClickException():
            code, message = error.exit_code, error.format_message()
        case click.Abort():
            code, message = INTERRUPTED, "Interrupted."
        case _:
            code, message = 1, f"Internal error ({type(error).__name__}: {error}). Run again with --debug."
    if as_json:
        document = {"error": {"type": type(error).__name__, "message": message, "exit_code": code}}
        with suppress(OSError):  # the error may be that stdout takes nothing
            click.echo(json.dumps(document, indent=2))
    if isinstance(error, click.ClickException):
        error.show()
    else:
        for line in message.splitlines():
            click.echo(f"Error: {line}", err=True)
    return code
