"""How many operations the blocks of a planner take in a cycle, and what they are made for by what they have.

In a cycle the search needs enough operations for its longest part that is not spread over cycles, beside
what axes take that rest: with fewer it would never get on. The counts are those of the texts, as cautious.
"""

from itertools import product
from math import factorial

import attrs
import numpy as np

from gen_profile.support.errors import ExportError, SpecError
from gen_profile.support.phrase import Phrase, placed
from gen_profile_exporters.planner.constants import PlannerConstants, SwayConstants
from gen_profile_exporters.planner.interface import SLOTS_PER_PERIOD
from gen_profile_exporters.planner.sensor_constants import cycle_work

# slots of the longest programme: mostly, where a drive takes long to rest, and where operations are few
LONGEST, SLOWEST, FEWEST = 64, 96, 40
FOLLOWED_WORK = 3_700  # operations of a slot for each of them, of a machine that is followed
AROUND = 16  # slots more than an axis takes to rest, of a decline
MACHINES = 28  # that are watched, where there are operations for them
ENDS = (-1.0, 1.0)  # shares of the errors, of the machines that programmes have rows of
BETWEEN = 14  # more that are weighed of a machine that is followed, where there are operations for them:
OF_CYCLE, OF_MODEL, OF_SLOT = 10, 4, 12  # parts of operations: to follow them, for a model, to foresee them
SHELL_WORK, ZONES_WORK = 200, 150  # operations of every cycle: of an axis, and where it has zones
QUICK = 2.0  # s; machines whose slowest mode is quicker have more operations in a cycle,
QUICK_WORK = 600_000  # for so many in a slot: by default, or at least where they are followed
FOLLOWING_WORK = 2_800  # in a cycle, for each mode and axis of a machine that is followed, at least
LEFT_OUT = 1e-7  # of a mode, by the series of a slot or a cycle


@attrs.frozen(kw_only=True)
class Sizes:
    """What the blocks of a planner are made for.

    Attributes
    ----------
    watched : tuple of float
        Machines that are watched: shares of the stated errors.
        None for as many as there are operations for.
    """

    watched: tuple[float, ...] | None = None

    def of(self, constants: PlannerConstants) -> tuple[float, ...]:
        """Give the machines that are watched."""
        if self.watched is not None:
            return self.watched
        if not constants.stated_error:
            return ENDS
        most, slots = operations(constants), longest(constants)
        number = next((k for k in range(MACHINES, 2, -1) if _work(constants, k, slots) <= most), 2)
        return tuple(np.linspace(-1.0, 1.0, number).tolist())


def operations(c: PlannerConstants) -> int:
    """Give what a cycle may spend: what is stated, or more for machines that are quick or followed.

    Raises
    ------
    SpecError
        Less is stated than this machine needs.
    """
    period = min(c.periods)
    quick = QUICK_WORK // int(period / (SLOTS_PER_PERIOD * c.cycle)) if period < QUICK else 0
    least = _work(c, 0 if _follows(c) else 2, FEWEST)
    if _follows(c):
        least = max(least, quick, FOLLOWING_WORK * c.modes * len(c.axes))
    if c.states_operations and c.operations < least:
        problem = Phrase("at least {least} for this machine, found {found}", least=least, found=c.operations)
        raise SpecError(placed("planner.operations", problem))
    if c.states_operations:
        return c.operations
    return max(c.operations, least, quick)


def longest(c: PlannerConstants) -> int:
    """Give the slots of the longest programme: a decline from full speed, but of very slow drives."""
    slot = min(c.periods) / SLOTS_PER_PERIOD
    stop = max(axis.velocity / axis.acceleration + axis.acceleration / axis.jerk for axis in c.axes)
    most = min(SLOWEST, max(LONGEST, round(stop / slot) + AROUND))
    room, watched = operations(c), 0 if _follows(c) else 2
    if _follows(c):
        most = min(most, int(room * slot / c.cycle) // FOLLOWED_WORK)
    return next((k for k in range(most, FEWEST, -1) if _work(c, watched, k) <= room), FEWEST)


def between(c: PlannerConstants) -> tuple[float, ...]:
    """Give machines between the ends of the errors, evenly beside that as given: shares of the errors."""
    if not c.stated_error:
        return ()
    slots, room = longest(c), operations(c) // len(c.axes)
    cycles = min(c.periods) / (SLOTS_PER_PERIOD * c.cycle)
    slot, cycle, run, follow = machine_work(c)
    in_cycle, in_slot = follow, slot + slots * run  # of each machine
    if c.rates:
        in_cycle, in_slot = follow + cycle, slots * (slot + run)
    each = room / OF_CYCLE / in_cycle, room / OF_MODEL / slot, room * cycles / OF_SLOT / in_slot
    pairs = int(min(BETWEEN, *each)) // 2
    while pairs and _work(c, 2 * pairs, slots) > operations(c):
        pairs -= 1
    return tuple(np.delete(np.linspace(-1.0, 1.0, 2 * pairs + 3), [0, pairs + 1, -1]).tolist())


def _work(c: PlannerConstants, watched: int, slots: int) -> int:
    """Find the operations of a cycle in which the search of an axis gets on, while the others rest.

    Those that are watched are, of a machine that is followed, those between the ends of its errors.
    """
    rows, rowed, plan = 6 * c.modes + 1, 3 * c.modes, 2 * slots + 4
    swings = rowed if _follows(c) else c.modes * (1 + watched)
    programme = 100 + 8 * slots + max(432, 20 + rows * (rows + 14)) - 15 * swings
    if _follows(c):
        account = account_work(c, 1 + len(ENDS) + watched)
        rests = 95 + account["cFollowWork"] + account["cNowWork"]
        found = 13 * plan + 4 * c.modes * (1 + len(ENDS) + watched)
        searches = account["cModelWork"] + max(
            30 * rowed + account["cSweepWork"], found + account["cRunWork"]
        )
    else:
        rests = 95 + 12 * swings
        searches = max(11 * plan + 80 * (swings + rowed) + 10, model_work(c) + 90 * swings, 120 * swings)
    sensors = len(c.sensor.words) * cycle_work(c.sensor, c.modes) if c.sensor else 0
    return shell_work(c) + sensors + len(c.axes) * rests + 150 + 30 * swings + max(searches, programme)


def _follows(c: PlannerConstants) -> bool:
    return bool(c.rates or c.sensor)


def shell_work(c: PlannerConstants) -> int:
    """Count operations that the shell takes in every cycle, without sensors."""
    return len(c.axes) * (SHELL_WORK + (ZONES_WORK if c.zones else 0)) + 15 * len(c.live)


def model_work(c: PlannerConstants) -> int:
    """Count operations for the modes of the live parameters."""
    columns = int(c.model.shape[1])
    return 80 + columns * (2 * len(c.model) + 4) + 4 * max(1, len(c.live)) * c.degrees


def account_work(c: PlannerConstants, machines: int) -> dict[str, int]:
    """Count operations of an account that follows so many machines, by the names of its constants."""
    n, sway = c.modes, sway_of(c)
    rows, series, found = n + n**2, 2 * n**3 + n**2, sway.coefficients.shape[1]
    evaluated = found * (len(c.live) + 2 * rows) + len(c.live) * (20 + 4 * degrees(c))
    modes = n * (n * n * n * (2 * n + 4) + 4 * n * n) + 20 * machines * n
    longest_series, short_series = terms(c, longest_slot(c)), terms(c, c.cycle)
    slot, cycle, run, follow = machine_work(c)
    model = evaluated + modes + longest_series * (series + 14) + machines * slot
    return {
        "cModesWork": evaluated + modes,
        "cModelWork": model,
        "cNowWork": evaluated + short_series * series + 14 * longest_series + machines * cycle,
        "cAheadWork": model if c.rates else 0,  # more for each slot ahead
        "cRunWork": 20 + machines * run,
        "cSweepWork": 20 + (1 + len(ENDS)) * 2 * n * (n * (8 * n + 8) + 8),
        "cFollowWork": machines * follow + 15 * len(c.live),
    }


def machine_work(c: PlannerConstants) -> tuple[int, int, int, int]:
    """Count operations for a machine: models of a slot and of a cycle, foreseeing it and following it."""
    n, series = c.modes, (terms(c, longest_slot(c)), terms(c, c.cycle))
    slot, cycle = (k * (5 * n**2 + 8 * n + 2) + 3 * n**3 for k in series)
    return slot, cycle, n * (8 + 8 * n), n * (16 + 10 * n)


def terms(c: PlannerConstants, time: float) -> int:
    """Find the terms of a time's series: what they leave out of a mode is less than `LEFT_OUT`."""
    sway, corners = sway_of(c), product((-1.0, 1.0), repeat=len(c.live))
    signs = [np.prod(np.where(sway.exponents % 2, np.array(at)[:, None], 1.0), axis=0) for at in corners]
    squares = (sway.coefficients[: c.modes] @ np.array(signs).T).max(axis=1)
    angle = time * float(np.sqrt(squares[0 if c.modes == 2 else -1]))  # of two by their sum, which is more
    return next(k for k in range(2, 20) if angle ** (2 * k) / factorial(2 * k) < LEFT_OUT)


def longest_slot(c: PlannerConstants) -> float:
    """Give the longest slot in s."""
    return max(c.periods) / SLOTS_PER_PERIOD


def sway_of(c: PlannerConstants) -> SwayConstants:
    """Give how the loads sway; raises ExportError where that is not known."""
    if c.sway is None:
        raise ExportError("The loads do not hang on ropes alone, so the block does not follow them.")
    return c.sway


def degrees(c: PlannerConstants) -> int:
    """Give the degrees of the sway's polynomials, and one."""
    return int(sway_of(c).exponents.max(initial=0)) + 1
