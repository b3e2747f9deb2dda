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
import numpy as np

from gen_profile.delivery.deployment import block_state
from gen_profile.delivery.deployment.block_state import BlockState, MotionState, PlannerState
from gen_profile.delivery.deployment.table import PlannerTable
from gen_profile.delivery.deployment.watching.judge import Watched
from gen_profile.delivery.deployment.watching.run_so_far import so_far
from gen_profile.planner.interface import LOST
from gen_profile.support.errors import OutputError

if TYPE_CHECKING:
    from rich.console import Group

    from gen_profile.delivery.deployment.table import BlockTable
    from gen_profile.delivery.deployment.watching.watch import Report

HEIGHT, MARGIN = 6, 12  # lines of an axis's picture, and columns beside it
REDRAWN = 0.1  # s between two pictures
IDLE_PERIOD = 1.0  # s between two rows of a log while nothing moves
SUFFIXES = {"position": "", "velocity": "_per_s", "acceleration": "_per_s2"}


def words(watched: Watched, table: BlockTable) -> str:
    """Say what was seen."""
    planner = isinstance(table, PlannerTable)
    exact = watched.exact == watched.moving
    rounding = " bit for bit" if exact else f", {watched.exact} bit for bit, the others but for last digits"
    if not watched.moving:
        moving = "no motion in them"
    elif planner:
        moving = f"in {watched.moving} of them a motion, within all limits"
    else:
        moving = f"in {watched.moving} of them a motion's setpoints, all the table's{rounding}"
    parts = [
        f"{table.path} watched for {watched.seconds:.1f} s: {watched.states} of {watched.cycles} cycles read",
        moving,
        f"motions begun: {watched.runs}, {'targets reached' if planner else 'arrived'}: {watched.completed}",
    ]
    notes = {
        "promises withdrawn" if planner else "with changed timing": watched.off_nominal,
        "errors" if planner else "starts refused": watched.refused,
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
    planner = isinstance(table, PlannerTable)
    commanded = {"target": "", "speed": "_per_s"} if planner else {}
    columns = [
        f"{name}_{quantity}_{unit}{suffix}"
        for name, unit in table.axes
        for quantity, suffix in (SUFFIXES | commanded).items()
    ]
    own = ("promise", "command", "time_to_go_s") if planner else ("off_nominal", "place_cycles", "rate")
    began, last = datetime.now(UTC), -IDLE_PERIOD
    try:
        path.unlink(missing_ok=True)  # it may lead to another file
        with path.open("x", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["time_s", "call", "phase", "error", *own, *columns, "event"])

            def report(state: BlockState, at: float, events: str) -> None:
                nonlocal last
                moves = state.phase == block_state.MOVING or (state.velocity != 0.0).any()
                if not moves and not events and at - last < IDLE_PERIOD:
                    return
                if last < 0.0:
                    events = "; ".join(filter(None, (f"began {began.isoformat(timespec='seconds')}", events)))
                last = at
                row: list[Any] = [f"{at:.3f}", state.calls, state.phase_name, state.error]
                values = state.setpoints
                if isinstance(state, PlannerState):
                    row += [state.promise, state.command, repr(state.time_to_go)]
                    values = np.vstack((values, state.target, state.speed))
                elif isinstance(state, MotionState):
                    row += [int(state.off_nominal), repr(state.place), repr(state.rate)]
                writer.writerow([*row, *map(repr, values.T.ravel().tolist()), events])
                file.flush()

            yield report
    except OSError as error:
        raise OutputError(f"{path}: cannot be written on: {error.strerror}.") from error


@contextmanager
def _on_terminal(table: BlockTable) -> Iterator[Report]:
    from rich.console import Console
    from rich.live import Live

    console = Console(stderr=True)
    draw = picture(table)
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


def picture(table: BlockTable) -> Callable[[BlockState, float, int], Group]:
    """Give what draws a state: a line of figures, and each axis's way so far over what it was to be."""
    from rich.console import Group
    from rich.text import Text

    from gen_profile.delivery.streaming.live_terminal import curves

    run = so_far(table)

    def draw(state: BlockState, at: float, width: int) -> Group:
        head = f"{at:.1f} s  {state.phase_name}{_head(run.take(state))}"
        parts = [Text(head + f", error {state.error}" * bool(state.error))]
        for column, (name, unit) in enumerate(table.axes):
            figures = [f"{value[column]:.6g}" for value in state.setpoints]
            parts.append(Text(f"{name}: {figures[0]} {unit}, {figures[1]} {unit}/s, {figures[2]} {unit}/s²"))
            planned, seen = run.planned[0, :, column], run.seen[0, :, column]
            parts += curves(planned, seen, max(10, width - MARGIN), HEIGHT)
        return Group(*parts)

    return draw


def _head(figures: dict[str, Any]) -> str:
    """Put the figures beside the picture of a motion, or of a planner block, into words."""
    if "rate" in figures:
        head = f", {figures['time']:.2f} of {figures['duration']:.2f} s, rate {figures['rate']:.3g}"
        return f"{head}, timing changed" if figures["changed"] else head
    commanded = ", ".join(f"{value:.6g}" for value in figures["commanded"])
    words = {block_state.TO_POSITION: f", to {commanded}", block_state.AT_VELOCITY: f", stick at {commanded}"}
    head = words.get(figures["command"], "")
    if figures["to_go"] > 0.0:
        head += f", {figures['to_go']:.1f} s to go"
    return head + (f"; the load may sway, because {why}" if (why := LOST.get(figures["promise"])) else "")
