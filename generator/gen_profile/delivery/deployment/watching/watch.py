"""Watching a block in a controller while it runs, until something is not as proved."""

import time
from collections.abc import Callable
from typing import Any

from gen_profile.delivery.deployment.block_state import BlockState, read_state
from gen_profile.delivery.deployment.mailbox import LinkLostError, MailboxLink
from gen_profile.delivery.deployment.table import BlockTable, PlannerTable
from gen_profile.delivery.deployment.watching.judge import STANDSTILL, Judge, Watched
from gen_profile.delivery.deployment.watching.motion import MotionJudge
from gen_profile.delivery.deployment.watching.planner import PlannerJudge
from gen_profile.support.errors import CheckFailed, DeploymentError
from gen_profile.support.interrupts import interrupts_collected

LOST_FOR, RETRY = 15.0, 0.5  # s that a lost connection is taken up again for, and between two trials
TORN = 10  # reads of a state of two cycles, one after the other
LEAST_INTERVAL = 0.02  # s between two looks

Report = Callable[[BlockState, float, str], None]


def watch(
    table: BlockTable,
    link: MailboxLink,
    report: Report = lambda *_: None,
    *,
    seconds: float | None = None,
    now: Callable[[], float] = time.monotonic,
    pause: Callable[[float], None] = time.sleep,
) -> Watched:
    """Read a block's state over and over, until something is not as proved, or until Ctrl-C.

    Parameters
    ----------
    table : BlockTable
        Which the block uses.
    link : MailboxLink
        Only read.
    report : callable
        Is given each state, when it was read in s since the first look, and what happened.
    seconds : float, optional
        To watch for.
    now, pause : callable
        Give the time in s, and let so much of it pass.

    Returns
    -------
    Watched
        With what is not as proved as its `fault`.
    """
    judge: Judge[Any] = PlannerJudge(table) if isinstance(table, PlannerTable) else MotionJudge(table)
    course = _Course(table, link, judge, report, now=now, pause=pause)
    try:
        with interrupts_collected() as came:
            while not came and (seconds is None or course.elapsed() < seconds):
                course.look()
    except KeyboardInterrupt:  # which is how it ends
        pass
    except (CheckFailed, DeploymentError) as error:
        judge.seen.fault = error
    except LinkLostError as error:
        judge.seen.fault = DeploymentError(
            "The connection broke ({error}), and could not be taken up again within {seconds:g} s.",
            error=error,
            seconds=LOST_FOR,
        )
    return judge.seen


class _Course:
    """Looks at a block one after the other."""

    def __init__(
        self,
        table: BlockTable,
        link: MailboxLink,
        judge: Judge[Any],
        report: Report,
        *,
        now: Callable[[], float],
        pause: Callable[[float], None],
    ) -> None:
        self._link, self._judge, self._report, self._now, self._pause = link, judge, report, now, pause
        self._table, self._cycle = table, table.spec.export.cycle_time
        self._began = self._changed = self._now()
        self._calls = -1

    def elapsed(self) -> float:
        """Time since the first look, in s."""
        return self._now() - self._began

    def look(self) -> None:
        """Read a state, judge it if it is a new one, and wait until the next one is due."""
        try:
            state, lost = self._read(), ""
        except LinkLostError as error:
            lost = self._taken_up(error)
            state = self._read()
        now = self._now()
        if state is not None and state.calls != self._calls:
            self._calls, self._changed = state.calls, now
            events = lost
            try:
                events = ", ".join(filter(None, (lost, self._judge.take(state, now - self._began))))
            except (CheckFailed, DeploymentError) as error:
                events = str(error)
                raise
            finally:
                self._report(state, now - self._began, events)
        elif now - self._changed > STANDSTILL:
            raise DeploymentError(
                "The block is no longer called in the controller, since {seconds:.1f} s: it was stopped, or "
                "its task. What the axes do now is up to their drives.",
                seconds=now - self._changed,
            )
        self._pause(max(self._cycle, LEAST_INTERVAL))

    def _read(self) -> BlockState | None:
        for _ in range(TORN):
            values = self._link.state()
            state = read_state(values, len(self._table.axes), self._table.state)
            if state is not None or values[0] == 0.0:
                return state
        raise DeploymentError(
            "The block's state is of several cycles whenever it is read: let the controller's server take it "
            "over as a whole, between two cycles."
        )

    def _taken_up(self, error: LinkLostError) -> str:
        """Connect again, or raise the error."""
        began = self._now()
        while True:
            try:
                self._pause(RETRY)
                self._link.reopen()
            except LinkLostError:
                if self._now() - began > LOST_FOR:
                    raise error from None
                continue
            self._judge.seen.lost += 1
            self._changed = self._now()
            return f"connection lost for {self._changed - began:.1f} s"
