"""What several commands take, and the spec that comes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from gen_profile.cli.outcome import beware
from gen_profile.errors import OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.spec.model import Spec

DEFAULT_PRESET = "paper"

Command = TypeVar("Command", bound=Callable[..., Any])


class OutputFile(click.Path):
    """A file to write, in a folder that exists; refused before there is any work to lose."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Take the path.

        Raises
        ------
        OutputError
            Its folder is not there, or it cannot be written.
        """
        from gen_profile.artefacts.writing import require_place

        path = Path(str(super().convert(value, param, ctx)))
        if ctx is not None and ctx.resilient_parsing:  # of a line that is still being typed
            return path
        if not path.parent.exists():
            option = "" if param is None else f"{param.opts[0]} {path}: "
            raise OutputError(f"{option}there is no folder {path.parent}; make it, or name another one.")
        require_place(path)
        return path


def _complete_formats(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile_exporters.registry import formats

    return [
        CompletionItem(name, help=known.summary)
        for name, known in formats().items()
        if name.startswith(incomplete)
    ]


def complete_presets(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Offer presets with their summaries."""
    from gen_profile.spec.reading import presets

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
            shell_complete=complete_presets,
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


def require_formats(names: Iterable[str]) -> None:
    """Refuse unknown formats.

    Raises
    ------
    SpecError
    """
    from gen_profile_exporters.registry import find_exporter

    for name in names:
        find_exporter(name)


plot_option = click.option(
    "--plot",
    "picture",
    metavar="FILE",
    type=OutputFile(),
    help="Draw it (png, svg or pdf).",
)
block_plot_option = click.option(
    "--plot",
    "picture",
    metavar="FILE",
    type=OutputFile(),
    help="Draw a planner block's worst history (or --history), and the worst over the live parameters.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout.")
debug_option = click.option(
    "--debug", is_flag=True, expose_value=False, help="Log details, and show tracebacks."
)


def as_overrides(values: Mapping[str, object]) -> tuple[str, ...]:
    """Write options that stand for keys of the spec as --set would; None is for one that was not given."""
    return tuple(f"{key}={value}" for key, value in values.items() if value is not None)


def chosen_spec(path: Path | None, preset: str | None, overrides: tuple[str, ...]) -> Spec:
    """Read the spec that the command line names, or the default preset; doubt its values aloud."""
    from gen_profile.spec.plausibility import doubts
    from gen_profile.spec.reading import parse_spec

    text, source, folder = chosen_text(path, preset)
    spec = parse_spec(text, overrides, source, folder)
    beware(doubts(spec))
    return spec


def chosen_text(path: Path | None, preset: str | None) -> tuple[str, str, Path]:
    """Read the text of that spec; also give its source, and the folder that its files are relative to."""
    from gen_profile.spec.reading import HERE, preset_text, read_text

    if path is not None and preset is not None:
        raise SpecError("--preset: name either a spec file or a preset, not both.")
    if path is None:
        name = preset or DEFAULT_PRESET
        return preset_text(name), name, HERE
    try:
        return read_text(path), str(path), path.parent
    except OutputError as error:
        root = click.get_current_context().find_root().command
        if isinstance(root, click.Group) and str(path) in root.commands:
            meant = f"a command comes before its options: gen-profile {path} …"
            raise OutputError(f"{str(error).rstrip('.')}; {meant}") from error
        raise
