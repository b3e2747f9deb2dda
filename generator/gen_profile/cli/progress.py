"""What a person sees on stderr while work goes on."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import click


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Show the current step with a spinner on a terminal, and as lines elsewhere."""
    if not sys.stderr.isatty():
        yield _print_line
        return
    from rich.console import Console

    status = Console(stderr=True).status("starting …")
    status.start()
    try:
        yield lambda text: status.update(f"{text} …")
    finally:
        with suppress(OSError, SystemExit):  # of Rich, on a terminal that is gone
            status.stop()


def _print_line(text: str) -> None:
    click.echo(f"{text} …", err=True)


@contextmanager
def counting(things: str) -> Iterator[Callable[[int, int, str], None]]:
    """Show how many of some things are done and the time left: a bar on a terminal, lines elsewhere.

    What it yields takes how many are done, of how many, and a remark.
    """
    if not sys.stderr.isatty():
        yield _Lines(things)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn(things),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[remark]}"),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(things, total=None, remark="")

        def tell(done: int, total: int, remark: str) -> None:
            if bar.tasks[0].total is None:  # what was done before says nothing about the speed
                bar.reset(task, total=total, completed=done, remark=remark)
            bar.update(task, completed=done, remark=remark)

        yield tell


class _Lines:
    """A line at every tenth of the way, for logs."""

    def __init__(self, things: str) -> None:
        self._things = things
        self._began: tuple[float, int] | None = None
        self._tenth = -1

    def __call__(self, done: int, total: int, remark: str) -> None:
        now = time.monotonic()
        began, before = self._began = self._began or (now, done)
        if (tenth := 10 * done // total) > self._tenth:
            self._tenth = tenth
            left = ""
            if before < done < total:
                left = f", {(now - began) / (done - before) * (total - done):.0f} s left"
            _print_line(f"{done} of {total} {self._things}{remark and f', {remark}'}{left}")
