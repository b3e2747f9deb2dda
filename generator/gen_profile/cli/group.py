"""Command groups of which one command runs when none is named, and commands that load when called."""

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import suggestion


class Later(click.Command):
    """Stands for a command of a module that is not imported yet, in its group's help."""

    def __init__(self, name: str, module: str, summary: str) -> None:
        super().__init__(name, help=summary)
        self.module = module


class DefaultGroup(click.Group):
    """Put `default` before arguments that begin with neither a command nor an option of the group."""

    def __init__(self, *arguments: Any, default: str = "design", **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.default = default

    def load(self) -> Mapping[str, click.Command]:
        """Give all commands, none of which stands for another."""
        for command in list(self.commands.values()):
            if isinstance(command, Later):
                import_module(command.module)  # which adds it
        return self.commands

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, and import it."""
        if isinstance(later := self.commands.get(args[0]), Later):
            import_module(later.module)
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments, the default command put in."""
        if args[:1] == ["help"] and not Path("help").exists():
            args = [*args[1:], "--help"]
        own = {option for parameter in self.get_params(ctx) for option in parameter.opts}
        completing_first_word = ctx.resilient_parsing and not args
        if not completing_first_word and (not args or (args[0] not in self.commands and args[0] not in own)):
            self._refuse_mistyped(ctx, args)
            args = [self.default, *args]
        return super().parse_args(ctx, args)

    def _refuse_mistyped(self, ctx: click.Context, args: list[str]) -> None:
        """Refuse a first word that is meant as a command: the default would complain of the rest."""
        word = args[0] if args and not ctx.resilient_parsing else ""
        if not word.isidentifier() or os.path.exists(word):  # noqa: PTH110  (of a name that is too long, too)
            return
        near = suggestion(word, self.load())
        inner = (name for name, group in self.commands.items() if word in getattr(group, "commands", ()))
        if group := next(inner, ""):
            near = f"; did you mean '{group} {word}'?"
        meant = "did you mean" in near or (len(args) > 1 and not args[1].startswith("-"))
        if meant:
            raise SpecError(f"There is no command or spec {word}{near}")

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show both ways of calling."""
        formatter.write_usage(ctx.command_path, "[SPEC.toml] [OPTIONS]")
        formatter.write_usage(ctx.command_path, "COMMAND [ARGS]...", prefix="   or: ")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show the default command's options with the group's own."""
        default = self.commands[self.default]
        records = (parameter.get_help_record(ctx) for parameter in (*default.params, *self.get_params(ctx)))
        with formatter.section("Options"):
            formatter.write_dl([record for record in records if record is not None])
        self.format_commands(ctx, formatter)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete commands and what the default command takes."""
        default = self.commands[self.default]
        inner = default.make_context(self.default, [], parent=ctx, resilient_parsing=True)
        return [*super().shell_complete(ctx, incomplete), *default.shell_complete(inner, incomplete)]
