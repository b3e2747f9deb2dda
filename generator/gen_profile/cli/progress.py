"""What a person sees on stderr while work goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Show the current step with a spinner on a terminal, and as lines elsewhere."""
    if click.get_text_stream("stderr").isatty():
        from rich.console import Console

        with Console(stderr=True).status("starting …") as status:

            def show(text: str) -> None:
                status.update(f"{text} …")

            yield show
    else:

        def print_line(text: str) -> None:
            click.echo(f"{text} …", err=True)

        yield print_line
