"""The shortest duration in which a problem can be solved within its limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import attrs

from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import Problem
from gen_profile.solvers.solution import Solution
from gen_profile.work import OutOfWork, budget, left

PRECISION = 1e-3  # relative, of the duration; what is returned is the feasible end
LONGEST = 1e3  # slowest periods, after which the search gives up
STRIDE = 1.5
BISECTING = 0.6  # share of the work that is left
LONGER = 8.0  # from stride to stride away from a duration that is too short


def shortest_duration(
    problem: Problem, solve: Callable[[Problem], Solution], beyond: float | None = None
) -> float | None:
    """Bisect the duration.

    Parameters
    ----------
    problem : Problem
        Whose duration does not matter.
    solve : Problem → Solution
        A solver that keeps limits.
    beyond : float, optional
        A duration in s than which none is shorter.

    Returns
    -------
    float or None
        s; None where no duration was found to do.
    """

    def feasible(duration: float) -> bool:
        return solve(attrs.evolve(problem, duration=duration, sway_weight=0.0)).optimum is not None

    slowest = linearize(problem.plant, problem.parameters, problem.target).frequencies[0]
    period = 2.0 * math.pi / float(slowest)
    if beyond is not None:
        return least_beyond(feasible, beyond, LONGEST * period)
    return least(feasible, period, LONGEST * period)


def least(
    feasible: Callable[[float], bool],
    guess: float,
    most: float,
    precision: float = PRECISION,
) -> float | None:
    """Bisect for the least value that will do, where every greater one does.

    Parameters
    ----------
    feasible : float → bool
    guess : float
        Roughly.
    most : float
        Where to give up.
    precision : float
        Relative.

    Returns
    -------
    float or None
        None where none up to `most` was found to do.
    """
    if feasible(guess):
        enough, short = guess, guess / STRIDE
        with suppress(OutOfWork):
            while feasible(short):
                enough, short = short, short / STRIDE
    else:
        enough, short = STRIDE * guess, guess
        while not feasible(enough):
            enough, short = STRIDE * enough, enough
            if enough > most:
                return None
    return _between(feasible, short, enough, precision)


def least_beyond(feasible: Callable[[float], bool], short: float, most: float) -> float | None:
    """Find the least duration that will do beyond one that will not, which is often next to it.

    Parameters
    ----------
    feasible : float → bool
    short : float
        Too short, in s.
    most : float
        Where to give up, in s.

    Returns
    -------
    float or None
        s; None where none up to `most` was found to do.
    """
    start, stride = short, PRECISION
    while not feasible(enough := (1.0 + stride) * start):
        if enough > most:
            return None
        short, stride = enough, LONGER * stride
    return _between(feasible, short, enough, PRECISION)


def _between(feasible: Callable[[float], bool], short: float, enough: float, precision: float) -> float:
    """Bisect as far as a share of the work that is left allows, and return the feasible end."""
    with suppress(OutOfWork), budget(BISECTING * left()):
        while enough - short > precision * enough:
            middle = (enough + short) / 2.0
            enough, short = (middle, short) if feasible(middle) else (enough, middle)
    return enough
