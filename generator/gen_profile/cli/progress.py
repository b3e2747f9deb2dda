"""What a person sees on stderr while work goes on: the stage, how far it is, and for how long."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.support.progress import Progress

if TYPE_CHECKING:
    from gen_profile.presentation.charts.plot import Drawn

FIRST_LINE, LONGEST_PAUSE = 2.0, 30.0  # s after which a log hears of work again, and at the longest
REFRESH = 4.0  # times a second, on a terminal


class _Step:
    """How far a stage is."""

    def __init__(self, stage: str = "") -> None:
        self.stage, self.done, self.total, self.remark = stage, 0, 0, ""
        self.began, self.before = 0.0, 0  # when, and after how many steps, the stage began

    def take(self, stage: str, done: int, total: int, remark: str) -> bool:
        """Take a report, and find out whether a stage begins."""
        new = stage != self.stage
        if new:
            self.began, self.before = time.monotonic(), done
        self.stage, self.done, self.total, self.remark = stage, done, total, remark
        return new

    def words(self) -> str:
        """Put it into words: the stage, steps, remark, time so far and, where it can be known, time to go."""
        seconds = time.monotonic() - self.began
        parts = [self.stage]
        if self.total:
            parts.append(f"{self.done} of {self.total}")
        if self.remark:
            parts.append(self.remark)
        if seconds >= FIRST_LINE:
            parts.append(f"{seconds:.0f} s")
            if self.before < self.done < self.total:
                left = seconds / (self.done - self.before) * (self.total - self.done)
                parts.append(f"about {left:.0f} s left")
        return f"{', '.join(parts)} …"


def draw(result: Drawn, picture: Path | None, tell: Progress, **options: bool) -> None:
    """Draw a result in a file, where one is named; options are those of `plot`."""
    if picture is not None:
        from gen_profile.presentation.charts.plot import plot

        tell("drawing")
        plot(result, picture, **options)


@contextmanager
def progress() -> Iterator[Progress]:
    """Show the current stage: one line that changes on a terminal, lines now and then elsewhere."""
    shown = _OnTerminal() if sys.stderr.isatty() else _InLog()
    with shown:
        yield shown.tell


class _InLog:
    """A line for every stage and its end, and for one that lasts further ones, ever more rarely."""

    def __init__(self) -> None:
        self._step, self._lock, self._over = _Step(), threading.Lock(), threading.Event()
        self._due, self._pause = float("inf"), FIRST_LINE
        self._clock = threading.Thread(target=self._remind, daemon=True)

    def __enter__(self) -> None:
        self._clock.start()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._clock.join()

    def tell(self, stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        with self._lock:
            new = self._step.take(stage, done, total, remark)
            if new:
                self._pause = FIRST_LINE
            if new or 0 < total == done:
                self._print()

    def _print(self) -> None:
        click.echo(self._step.words(), err=True)
        self._due = time.monotonic() + self._pause

    def _remind(self) -> None:
        while not self._over.wait(FIRST_LINE / 4.0):
            with self._lock, suppress(OSError):  # the reader may be gone
                if time.monotonic() >= self._due:
                    self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
                    self._print()


class _OnTerminal:
    """A spinner, and beside it the words."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.spinner import Spinner
        from rich.text import Text

        self._step, self._spinner, self._text = _Step("starting"), Spinner("dots"), Text
        self._step.began = time.monotonic()
        self._live = Live(
            get_renderable=self._shown,
            console=Console(stderr=True),
            refresh_per_second=REFRESH,
            transient=True,
        )

    def __enter__(self) -> None:
        self._live.__enter__()

    def __exit__(self, *error: Any) -> None:
        with suppress(OSError, SystemExit):  # of Rich, on a terminal that is gone
            self._live.__exit__(*error)

    def tell(self, stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        self._step.take(stage, done, total, remark)

    def _shown(self) -> Any:
        self._spinner.update(text=self._text(self._step.words()))
        return self._spinner
