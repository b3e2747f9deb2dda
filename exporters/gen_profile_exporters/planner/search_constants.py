"""How a planner block searches for a plan: constants of its interior-point method and its first guesses."""

from __future__ import annotations

ITERATIONS, MORE_ITERATIONS = 6, 5  # from rest; and more where these do not lead to a plan
WAY_ITERATIONS, SEARCH_ITERATIONS = 18, 13  # where the axis moves already: at most, and time for so many
CENTRE = 0.15  # of an iteration: the complementarity it aims at, relative to that of now
STEP = 0.93  # share of the way to the nearest bound that it goes
LACKS = 5e-5  # of a limit, by which a plan may miss it: less than plans leave of it
GAP = 0.01  # of the velocity, by which a stop may go farther than the least one
PATIENCE = 0.7  # by which what the bounds lack declines in an iteration, or there is no plan in so few slots
STALLED = 0.01  # of the full step: likewise
RAMP_SLOTS, ROBUST_RAMP_SLOTS = 2.0, 5.0  # that a plan to another velocity takes longer than the axis alone
RAMP_SHARE, ROBUST_RAMP_SHARE = 0.35, 0.6  # of the kernel's slots, that it takes at least
RAMP_GROWTH = 0.4  # by so much more for full speed
RAMP_BACK = 0.6  # of a stop's slots, that a plan takes longer which leads back
ACROSS = 0.2  # of the square of the slope that plans may leave: of the part that is mostly less
SLOPE_LEAST = 0.25  # of that slope, which they may leave where the past leaves no room
REFUSED = 0.25  # by which that declines with each plan that would leave too much
GIVES_UP = 4.0  # slow periods beyond the time to react, in which no motion is found for a command (3)


def whole() -> dict[str, int]:
    """Give the constants that count."""
    return {
        "cIterations": ITERATIONS,
        "cMoreIterations": MORE_ITERATIONS,
        "cWayIterations": WAY_ITERATIONS,
        "cSearchIterations": SEARCH_ITERATIONS,
    }


def real(*, robust: bool) -> dict[str, float]:
    """Give the others: plans may leave a slope, or are robust and leave none."""
    return {
        "cCentre": CENTRE,
        "cStep": STEP,
        "cLacks": LACKS,
        "cGap": GAP,
        "cPatience": PATIENCE,
        "cStalled": STALLED,
        "cRampSlots": ROBUST_RAMP_SLOTS if robust else RAMP_SLOTS,
        "cRampShare": ROBUST_RAMP_SHARE if robust else RAMP_SHARE,
        "cRampGrowth": RAMP_GROWTH,
        "cRampBack": RAMP_BACK,
        "cAcross": ACROSS,
        "cSlopeLeast": SLOPE_LEAST,
        "cRefused": REFUSED,
    }
