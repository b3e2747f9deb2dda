"""A block that runs, watched: a picture on the terminal, a log, and the outcome in words."""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.deployment.block_state import MOVING, PHASES, BlockState
from gen_profile.deployment.run_so_far import RunSoFar
from gen_profile.deployment.watch import Watched
from gen_profile.errors import OutputError

if TYPE_CHECKING:
    from rich.console import Group

    from gen_profile.deployment.table import BlockTable
    from gen_profile.deployment.watch import Report

HEIGHT, MARGIN = 6, 12  # lines of an axis's picture, and columns beside it
REDRAWN = 0.1  # s between two pictures
IDLE_PERIOD = 1.0  # s between two rows of a log while nothing moves
SUFFIXES = {"position": "", "velocity": "_per_s", "acceleration": "_per_s2"}


def words(watched: Watched, artefact: Path) -> str:
    """Say what was seen."""
    exact = watched.exact == watched.moving
    rounding = " bit for bit" if exact else f", {watched.exact} bit for bit, the others but for last digits"
    parts = [
        f"{artefact} watched for {watched.seconds:.1f} s: {watched.states} of {watched.cycles} cycles read",
        f"in {watched.moving} of them a motion's setpoints, all the table's{rounding}"
        if watched.moving
        else "no motion in them",
        f"motions begun: {watched.runs}, arrived: {watched.completed}",
    ]
    notes = {
        "with changed timing": watched.off_nominal,
        "starts refused": watched.refused,
        "connections taken up again": watched.lost,
    }
    return "; ".join([*parts, *(f"{what}: {count}" for what, count in notes.items() if count)]) + "."


@contextmanager
def reporting(table: BlockTable, log: Path | None) -> Iterator[Report]:
    """Give what shows each state, and writes it to a log.

    Raises
    ------
    OutputError
        The log cannot be written.
    """
    with ExitStack() as stack:
        reports: list[Report] = [_events_on_stderr]
        if sys.stderr.isatty():
            reports = [stack.enter_context(_on_terminal(table))]
        if log is not None:
            reports.append(stack.enter_context(_logged(table, log)))

        def report(state: BlockState, at: float, events: str) -> None:
            for one in reports:
                one(state, at, events)

        yield report


def _events_on_stderr(_state: BlockState, at: float, events: str) -> None:
    if events:
        click.echo(f"{at:.1f} s: {events}", err=True)


@contextmanager
def _logged(table: BlockTable, path: Path) -> Iterator[Report]:
    axes = table.spec.axis_scales()
    columns = [
        f"{axis.name}_{quantity}_{axis.unit}{suffix}"
        for axis in axes
        for quantity, suffix in SUFFIXES.items()
    ]
    began, last = datetime.now(UTC), -IDLE_PERIOD
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(
                ["time_s", "call", "phase", "error", "off_nominal", "place_cycles", "rate", *columns, "event"]
            )

            def report(state: BlockState, at: float, events: str) -> None:
                nonlocal last
                if state.phase != MOVING and not events and at - last < IDLE_PERIOD:
                    return
                if last < 0.0:
                    events = "; ".join(filter(None, (f"began {began.isoformat(timespec='seconds')}", events)))
                last = at
                row: list[Any] = [f"{at:.3f}", state.calls, PHASES[state.phase], state.error]
                row += [int(state.off_nominal), repr(state.place), repr(state.rate)]
                writer.writerow([*row, *map(repr, state.setpoints.T.ravel().tolist()), events])
                file.flush()

            yield report
    except OSError as error:
        raise OutputError(f"{path}: cannot be written on: {error.strerror}.") from error


@contextmanager
def _on_terminal(table: BlockTable) -> Iterator[Report]:
    from rich.console import Console
    from rich.live import Live

    console = Console(stderr=True)
    draw = _picture(table)
    drawn = -REDRAWN
    with Live(console=console, auto_refresh=False, refresh_per_second=1 / REDRAWN) as live:

        def report(state: BlockState, at: float, events: str) -> None:
            nonlocal drawn
            if events:
                live.console.print(f"{at:.1f} s: {events}", highlight=False, markup=False)
            picture = draw(state, at, console.width)
            if events or time.monotonic() - drawn >= REDRAWN:
                drawn = time.monotonic()
                live.update(picture, refresh=True)

        yield report


def _picture(table: BlockTable) -> Callable[[BlockState, float, int], Group]:
    """Give what draws a state: a line of figures, and for each axis its way so far over the table's."""
    from rich.console import Group
    from rich.text import Text

    from gen_profile.streaming.live_terminal import curves

    axes, run, period = table.spec.axis_scales(), RunSoFar(table), table.spec.export.cycle_time

    def draw(state: BlockState, at: float, width: int) -> Group:
        place = run.take(state)
        planned, seen = run.planned[0], run.seen[0]
        head = f"{at:.1f} s  {PHASES[state.phase]}, {place * period:.2f} of {(len(seen) - 1) * period:.2f} s"
        head += f", rate {state.rate:.3g}" * (state.phase == MOVING)
        head += f", error {state.error}" * bool(state.error) + ", timing changed" * state.off_nominal
        parts = [Text(head)]
        for column, axis in enumerate(axes):
            figures = [f"{value[column]:.6g}" for value in state.setpoints]
            unit = axis.unit
            parts.append(
                Text(f"{axis.name}: {figures[0]} {unit}, {figures[1]} {unit}/s, {figures[2]} {unit}/s²")
            )
            parts += curves(planned[:, column], seen[:, column], max(10, width - MARGIN), HEIGHT)
        return Group(*parts)

    return draw
