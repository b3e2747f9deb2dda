"""What several commands take, and the spec that comes of it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from gen_profile.cli.outcome import print_warnings
from gen_profile.support.errors import GenProfileError, OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.spec.model import Spec

DEFAULT_PRESET = "paper"

Command = TypeVar("Command", bound=Callable[..., Any])
Completion = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


class Count(click.IntRange):
    """A whole number within bounds."""

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Call it N in the help."""
        return "N"


class Number(click.FloatRange):
    """A finite number within bounds: NaN lies beyond none of them."""

    def _describe_range(self) -> str:
        """Say nothing in the help where there are no bounds, in place of click's ``x<=None``."""
        return "" if self.min is self.max is None else super()._describe_range()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Take the number."""
        from gen_profile.support.suggestion import number_meant

        try:
            float(value)
        except ValueError:
            self.fail(f"{value!r} is no number{number_meant(value)}.", param, ctx)
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is no finite number.", param, ctx)
        return number


class PathType(click.Path):
    """A path as Python's own type."""

    def __init__(self, **options: Any) -> None:
        super().__init__(path_type=Path, **options)


class InputFile(PathType):
    """A file to read."""

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Call it FILE in the help."""
        return "FILE"


class OutputFile(InputFile):
    """A file to write, in a folder that exists; refused before there is any work to lose.

    Parameters
    ----------
    replaces : str
        Name of the parameter whose file it may replace. None that the command reads, if not given.
    """

    def __init__(self, replaces: str = "") -> None:
        super().__init__()
        self.replaces = replaces

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Take the path.

        Raises
        ------
        OutputError
            Its folder is not there, or it cannot be written.
        """
        from gen_profile.support.artefacts.writing import require_place

        path = cast("Path", super().convert(value, param, ctx))
        if ctx is not None and ctx.resilient_parsing:  # of a line that is still being typed
            return path
        if not path.parent.exists():
            name = "" if param is None else f"{param.opts[0]} {path}: "
            raise OutputError(f"{name}there is no folder {path.parent}; make it, or name another one.")
        require_place(path)
        return path


class PictureFile(OutputFile):
    """A picture to draw; refused where it cannot be drawn."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Take the path.

        Raises
        ------
        OutputError
            As of `OutputFile`; or Matplotlib is not installed, or the suffix is none of a picture.
        """
        from gen_profile.presentation.charts.picture import require_drawable

        path = super().convert(value, param, ctx)
        if ctx is None or not ctx.resilient_parsing:
            try:
                require_drawable(path)
            except OutputError as error:
                _name_by_option(error, param.opts if param else ())
                raise
        return path


class SpecChoice(NamedTuple):  # attrs would take as long to load as half of click
    """The spec that a command line names, a file or a preset, and what it changes of that."""

    path: Path | None
    preset: str | None
    overrides: tuple[str, ...]

    @property
    def stated(self) -> bool:
        """Whether one is named."""
        return self.path is not None or self.preset is not None

    def changed(self, values: Mapping[str, object]) -> SpecChoice:
        """Add options that stand for keys of the spec, as --set would; None is for one that was not given."""
        more = (f"{key}={value}" for key, value in values.items() if value is not None)
        return self._replace(overrides=(*self.overrides, *more))

    def spec(self) -> Spec:
        """Read it, and warn of implausible values."""
        from gen_profile.spec.plausibility import plausibility_warnings
        from gen_profile.spec.reading import parse_spec

        text, source, folder = self.text()
        spec = parse_spec(text, self.overrides, source, folder)
        print_warnings(plausibility_warnings(spec))
        return spec

    def text(self) -> tuple[str, str, Path]:
        """Read its text; also give its source, and the folder that its files are relative to."""
        from gen_profile.spec.reading import HERE, preset_text, read_text

        path = self.path
        if path is not None and self.preset is not None:
            raise SpecError("--preset: name either a spec file or a preset, not both.")
        if path is None:
            name = self.preset or DEFAULT_PRESET
            return preset_text(name), name, HERE
        try:
            return read_text(path), str(path), path.parent
        except OutputError as error:
            root = click.get_current_context().find_root().command
            if isinstance(root, click.Group) and str(path) in root.commands:
                meant = f"a command comes before its options: gen-profile {path} …"
                raise OutputError(f"{str(error).rstrip('.')}; {meant}") from error
            raise


def completed(known: Mapping[str, str | None], incomplete: str) -> list[CompletionItem]:
    """Offer what goes on as a word begins, with what help says of each."""
    return [CompletionItem(name, help=text) for name, text in known.items() if name.startswith(incomplete)]


def _complete_formats(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from gen_profile_exporters.registry import formats

    return completed({name: known.summary for name, known in formats().items()}, incomplete)


def complete_presets(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Offer presets with their summaries."""
    from gen_profile.spec.reading import presets

    return completed(presets(), incomplete)


def option(
    name: str, words: str, value: Any = None, *, into: str | None = None, **more: Any
) -> Callable[[Command], Command]:
    """Take an option such as ``--out DIR``; one that names neither a DIR nor a type is a flag."""
    own_name, _, metavar = name.partition(" ")
    names = [own_name] if into is None else [own_name, into]
    is_flag = (not metavar and value is None) or None  # for Click, False lets the value be left out
    return click.option(*names, metavar=metavar or None, type=value, is_flag=is_flag, help=words, **more)


def repeatable(
    name: str, words: str, value: Any = None, *, into: str | None = None
) -> Callable[[Command], Command]:
    """Take an option that may be given more than once; its values go into one parameter."""
    return option(name, f"{words} Repeatable.", value, into=into, multiple=True)


def preset(text: str) -> Callable[[Command], Command]:
    """Take a preset by its name."""
    return option("--preset NAME", text, shell_complete=complete_presets)


def bitrate(channel: str) -> Callable[[Command], Command]:
    """Take the bit rate of a CAN channel."""
    words = f"Bit rate of the {channel} in bit/s, where the system does not set it; 500000 by default."
    return option("--bitrate", words, Count(10_000, 1_000_000), default=500_000)


def spec_output(name: str) -> Callable[[Command], Command]:
    """Take the file of a spec that is written, which may be the one that was read."""
    words = f"Spec to write; ./{name} by default."
    return option("--out", words, OutputFile(replaces="spec_path"), default=name)


def spec_shown_as(metavar: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add what every command that takes a spec takes; the command gets it as `chosen`."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @click.argument("spec_path", metavar=metavar, required=False, type=PathType())
        @preset("Use a built-in spec (see gen-profile presets).")
        @repeatable("--set KEY=VALUE", "Override a key of the spec, such as plant.L1=0.5.", into="overrides")
        @wraps(command)
        def choosing(
            *, spec_path: Path | None, preset: str | None, overrides: tuple[str, ...], **options: Any
        ) -> Any:
            chosen = SpecChoice(path=spec_path, preset=preset, overrides=overrides)
            return command(chosen=chosen, **options)

        return choosing

    return decorate


spec = spec_shown_as("[SPEC.toml]")


def together(*several: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Take several options, which the help lists in this order."""

    def decorate(command: Any) -> Any:
        for each in reversed(several):
            command = each(command)
        return command

    return decorate


def version(command: Command) -> Command:
    """Add ``--version``, which tells the commit, too, where the distribution was built from a checkout."""

    def show(context: click.Context, _: click.Parameter, asked: bool) -> None:
        if asked and not context.resilient_parsing:
            from importlib import metadata
            from importlib.resources import files

            commit = files("gen_profile") / "commit.txt"  # of hatch_build.py
            built_from = f" ({commit.read_text('utf-8').strip()})" if commit.is_file() else ""
            click.echo(metadata.version("gen-profile") + built_from)
            context.exit()

    return option("--version", "Show the version.", expose_value=False, is_eager=True, callback=show)(command)


def scheduler(work: str) -> Callable[..., Any]:
    """Name the Dask scheduler whose workers do some work."""
    return option(
        "--scheduler ADDRESS",
        f"Dask scheduler whose workers {work}, such as tcp://10.0.0.1:8786, in place of this computer.",
    )


def export(
    what: str, default: str = "csv", complete: Completion = _complete_formats
) -> Callable[[Command], Command]:
    """Add the choice of formats, and say what becomes of each."""
    return option(
        "--export FORMAT",
        f"{what}. Repeatable; {default} by default.",
        into="formats",
        multiple=True,
        default=(default,),
        shell_complete=complete,
    )


def histories(text: str) -> Callable[[Command], Command]:
    """Take a number of histories of commands, on which a planner block is proved."""
    return option("--histories", text, Count(1, 1_000_000))


def require_formats(names: Iterable[str]) -> None:
    """Refuse unknown formats.

    Raises
    ------
    SpecError
    """
    from gen_profile_exporters.registry import find_exporter

    for name in names:
        find_exporter(name)


folder = option(
    "--out DIR",
    "Folder to write to; ./gen-profile-out by default.",
    PathType(),
    into="folder",
    default="gen-profile-out",
)
plot = option("--plot", "Draw it (png, svg or pdf).", PictureFile(), into="picture")
block_plot = option(
    "--plot",
    "Draw a planner block's worst history (or --history), and the worst over the live parameters.",
    PictureFile(),
    into="picture",
)
certify = option("--certify", "Prove it for all machines in the ranges, and write a certificate.")


def output(command: Command) -> Command:
    """Add how every command says what came of it; let none write over what it reads."""

    @option("--json", "Print one JSON document on stdout.", into="as_json")
    @option("--debug", "Log details, and show tracebacks.", expose_value=False)
    @wraps(command)
    def careful(*, as_json: bool, **values: Any) -> Any:
        # `as_json` is for `print_outcome`
        context = click.get_current_context()
        _require_apart(context)
        try:
            return command(**values)
        except GenProfileError as error:
            _name_by_option(error, _given(context))
            raise

    return cast("Command", careful)


def _given(context: click.Context) -> list[str]:
    """List the options that a command was given."""
    given = [
        parameter.opts[0]
        for parameter in context.command.params
        if context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
    ]
    if context.ignore_unknown_options:  # which are words of an argument
        given += [word.partition("=")[0] for word in context.params["words"]]
    return given


def _name_by_option(error: GenProfileError, given: Iterable[str]) -> None:
    """Name an argument that a sentence begins with by its option: ``vary: …`` becomes ``--vary: …``."""
    flags = {option.removeprefix("--"): option for option in given if option.startswith("--")}
    flags |= {name.replace("-", "_"): option for name, option in flags.items()}
    begin = re.compile(r"^[\w.]+(?=[: ,])", re.MULTILINE)
    error.args = tuple(
        begin.sub(lambda match: flags.get(match[0], match[0]), sentence) for sentence in error.args
    )


def _require_apart(context: click.Context) -> None:
    """Refuse to write a file that is read, or two files of one name."""
    files: dict[Path, click.Parameter] = {}
    by_role = sorted(context.command.params, key=lambda parameter: isinstance(parameter.type, OutputFile))
    for parameter in by_role:
        path = context.params.get(parameter.name or "")
        if not isinstance(path, Path):
            continue
        other, own = files.setdefault(path.resolve(), parameter), parameter.type
        if other is not parameter and isinstance(own, OutputFile) and own.replaces != other.name:
            argument = isinstance(other, click.Argument)
            other_name = other.human_readable_name.strip("[]") if argument else other.opts[0]
            raise SpecError(f"{parameter.opts[0]} {path}: is the file of {other_name}; name another one.")
