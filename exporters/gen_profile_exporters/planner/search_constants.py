"""How a planner block searches for a plan: constants of its interior-point method and its first guesses."""

import math

from gen_profile_exporters.planner.axis_declarations import ZONES

ZONED_WORK = 7 * ZONES  # operations for a place that is held against them
SEARCH_ITERATIONS = 13  # for which there is time where the axis moves already
GIVES_UP = 4.0  # slow periods beyond the time to react, in which no motion is found for a command (3)


def zoned(left: int, future: int, axes: int, slot: int) -> dict[str, int]:
    """Count intervals, and slots of the committed future that are held against them in one cycle.

    Parameters
    ----------
    left : int
        Operations that a cycle may spend on it.
    future : int
        Slots of a committed future.
    axes : int
    slot : int
        Cycles of the shortest slot.
    """
    chunk = max(1, min(future, (left - 8 * future - 40) // (9 + ZONED_WORK)))
    cycles = math.ceil(future / chunk)
    if 2 * axes * cycles > slot:  # rather too much in one cycle than never
        chunk, cycles = future, 1
    return {"cZones": ZONES, "cZoneChunk": chunk, "cZoneCycles": cycles}


def whole_constants() -> dict[str, int]:
    """Give the constants that count."""
    return {
        "cIterations": 6,  # from rest
        "cMoreIterations": 5,  # and more where these do not lead to a plan
        "cWayIterations": 18,  # where the axis moves already, at most
        "cSearchIterations": SEARCH_ITERATIONS,
    }


def real_constants(*, robust: bool) -> dict[str, float]:
    """Give the others: plans may leave a slope, or are robust and leave none."""
    return {
        "cCentre": 0.15,  # of an iteration: the complementarity it aims at, relative to that of now
        "cStep": 0.93,  # share of the way to the nearest bound that it goes
        "cLacks": 5e-5,  # of a limit, by which a plan may miss it: less than plans leave of it
        "cGap": 0.01,  # of the velocity, by which a stop may go farther than the least one
        # by which what the bounds lack declines in an iteration, or there is no plan in so few slots
        "cPatience": 0.7,
        "cStalled": 0.01,  # of the full step: likewise
        # slots that a plan to another velocity takes longer than the axis alone
        "cRampSlots": 5.0 if robust else 2.0,
        "cRampShare": 0.6 if robust else 0.37,  # of the kernel's slots, with which the search begins
        "cRampGrowth": 0.4,  # by so much more for full speed
        "cRampBack": 0.6,  # of a stop's slots, that a plan takes longer which leads back
        "cAcross": 0.3,  # of the square of the slope that plans may leave: of the part that is mostly less
        "cSlopeLeast": 0.25,  # of that slope, which they may leave where the past leaves no room
        "cRefused": 0.6,  # by which that declines with each plan that would leave too much
    }
