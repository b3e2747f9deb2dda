"""What a person sees on stderr while work goes on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Show the current step with a spinner on a terminal, and as lines elsewhere."""
    if not sys.stderr.isatty():
        yield _print_line
        return
    from rich.console import Console

    with Console(stderr=True).status("starting …") as status:
        yield lambda text: status.update(f"{text} …")


def _print_line(text: str) -> None:
    click.echo(f"{text} …", err=True)
