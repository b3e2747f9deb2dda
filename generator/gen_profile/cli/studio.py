"""The command that opens the studio."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.deployment.access import controller_options
from gen_profile.cli.options import Count, PathType, option
from gen_profile.cli.outcome import as_json
from gen_profile.cli.progress import progress
from gen_profile.support.errors import SpecError
from gen_profile.support.plugins import require_installed

if TYPE_CHECKING:
    from gen_profile.cli.options import SpecChoice
    from gen_profile.presentation.studio.watching import Watching


@cli.command(epilog="Example: gen-profile studio bay-3.toml")
@options.spec
@option("--port", "Port on the loopback interface; any that is free by default.", Count(0, 65535), default=0)
@option("--no-browser", "Open no browser; print the address and a code for one.")
@option(
    "--watch FILE",
    "Watch the controller --to, which uses this file's table, as deploy --watch does.",
    PathType(),
    into="artefact",
)
@controller_options(required=False)
@options.output
def studio(
    chosen: SpecChoice, port: int, *, no_browser: bool, artefact: Path | None, **controller: Any
) -> None:
    """Turn every knob of a spec in the browser, and see the swing at once."""
    require_installed("gen-profile studio needs Tornado", "studio", "tornado")
    from gen_profile.presentation.studio.state import changed_start

    if (artefact is None) != (controller["url"] is None):
        raise SpecError("--watch, --to: go together: name the file, and the controller that uses its table.")
    text, source, folder = chosen.text()
    called = ("--preset", source) if chosen.path is None else (source,)
    start = changed_start(called, text, chosen.overrides, folder)
    if not start.programs:  # else the page asks first
        chosen.spec()
    import asyncio

    from gen_profile.presentation.studio.server import serve

    def ready(address: str, code: str) -> None:
        if as_json():
            import json

            click.echo(json.dumps({"address": address, "code": code}, indent=2))
        else:
            words = f"Studio at {address}\nA browser that asks for a code: {code}\nCtrl-C ends it."
            click.echo(words, err=True)

    def renew(code: str) -> None:
        click.echo(f"The code was used. Another browser that asks for one: {code}", err=True)

    with ExitStack() as stack:
        watching = None if artefact is None else _watching(artefact, controller, stack)
        try:
            pages = serve(start, port, browser=not no_browser, ready=ready, renew=renew, watching=watching)
            asyncio.run(pages)
        except KeyboardInterrupt:
            click.echo("The studio is closed.", err=True)


def _watching(artefact: Path, controller: dict[str, Any], stack: ExitStack) -> Watching:
    """Watch a controller until the context ends."""
    from gen_profile.cli.deployment.commands import verified
    from gen_profile.presentation.studio.watching import Watching

    with progress() as tell:
        table, link = verified(artefact, controller, stack, tell)
    return stack.enter_context(Watching(table, link))
