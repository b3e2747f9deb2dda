"""By how much a problem's limits would have to be wider, or its move longer, for a motion to keep them.

One variable more, the share, widens some of the limits; the least one is the optimum of convex programs like
those that find motions (see `solvers.direct`). There is one whether or not the problem can be solved, and it
falls smoothly with the duration: where it is 1, the limits can just be kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.problem.problem import Problem
from gen_profile.problem.sway_cost import SwayCost
from gen_profile.solvers.direct import goals
from gen_profile.solvers.direct.condensing import IntervalMaps
from gen_profile.solvers.direct.conic import ConicProgram, ConicSolution, ConicStatus, Matrix
from gen_profile.solvers.direct.set_up import Setup, set_up
from gen_profile.solvers.direct.solver import (
    MAX_ITERATIONS,
    ROUGH,
    STEP_TOLERANCE,
    CostProgram,
    ProgramSequence,
    conclude,
    sequence,
)
from gen_profile.solvers.direct.transcription import Iterate
from gen_profile.solvers.solution import Solution
from gen_profile.spec.model import LimitsSpec

PRICES = (1e-5, 1e-3, 1e-1)  # of the effort without limits: ever less sway would take ever more of it
CHANGE = 1e-4  # of the share, relative, that is worth another program
ENOUGH = 5e-3  # by which the share's logarithm may exceed 0
CLOSE = 0.05  # by which it may fall short of 0: the duration found is then tried
POWER = 1.8  # with which shares fall over the duration, more or less
POWERS = (1.0, 4.0)  # between which what two durations tell of it is believed
STEPS = (math.log(1.1), math.log(2.0))  # of the duration's logarithm
KNOWN_STEPS = (1e-3, math.log(30.0))  # likewise where two durations tell the power
LITTLE = 0.01  # by which the share's logarithm must fall within the longer of them
ROUNDS = 12
CLOSER = 3  # rounds at most, once a duration is long enough
UNSETTLED = math.log(1e6)  # in place of the logarithm of a share that was not found
TINY = 1e-6  # share below which how small it is does not matter


@attrs.frozen(kw_only=True, eq=False)
class LeastShare:
    """Minimise how many times as wide some limits must be.

    Attributes
    ----------
    setup : Setup
    loosened : tuple of str
        Places of the limits that are widened; travel by so many times its width, less one, at either end.
    price : float
        Of a unit of effort.
    """

    setup: Setup
    loosened: tuple[str, ...]
    price: float

    @property
    def extra(self) -> int:
        """Number of variables of its own: the share."""
        return 1

    def pose(
        self, program: ConicProgram, iterate: Iterate, maps: Sequence[IntervalMaps]
    ) -> tuple[Matrix, Array]:
        """Add the limits to a program: P and q."""
        problem, transcription = self.setup.problem, self.setup.transcription
        goals.keep_limits(program, problem, transcription, self.loosened)
        if problem.nominal_sway is not None:
            loose = "limits.sway" in self.loosened
            goals.keep_sway(program, transcription, problem.nominal_sway, iterate, maps[0], loosened=loose)
        linear = np.zeros(program.variables)
        linear[-1] = 1.0
        program.at_most(-linear[None], np.zeros(1))
        return self.price * transcription.effort(self.setup.forms, program.variables), linear

    def step(self, solutions: Sequence[ConicSolution], start: Iterate) -> float:
        """Measure by how much the share changed last, in units of what would be noticed."""
        share, before = float(solutions[-1].x[-1]), float("inf")
        if len(solutions) > 1:
            before = float(solutions[-2].x[-1])
        return STEP_TOLERANCE * abs(share - before) / (CHANGE * max(abs(share), TINY))

    def approach(self, before: Iterate, after: Iterate) -> Iterate:
        """Go all the way: what it minimises is no expansion."""
        return after


@attrs.frozen(kw_only=True, eq=False)
class Relaxed:
    """The motion for which some limits must be widened least.

    Attributes
    ----------
    share : float
        How many times as wide they must be.
    found : ProgramSequence
        By which the motion was found.
    """

    share: float
    found: ProgramSequence

    @property
    def iterate(self) -> Iterate:
        """The motion, on its mesh."""
        return self.found.iterate

    @property
    def solution(self) -> Solution:
        """The motion as a solution, unless it swings too far."""
        return conclude(self.found, SwayCost(beta=0.0, gamma=1.0), self.found.iterations)


class Relaxation:
    """A problem whose limits may be widened.

    Parameters
    ----------
    problem : Problem
        With limits; where it has a `worst_case`, no residual sway is asked for.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.least = cache(self._least)

    @cached_property
    def _begun(self) -> tuple[Setup, ProgramSequence]:
        """Transcribe the problem, and find about what motion it would take without limits."""
        problem = self.problem
        setup, redundant = set_up(problem)
        if redundant:
            kept = tuple(name for name in problem.desensitized if name not in redundant)
            setup, _ = set_up(attrs.evolve(problem, desensitized=kept))
        setup = attrs.evolve(setup, tried=())
        free = CostProgram(
            setup=attrs.evolve(setup, problem=attrs.evolve(setup.problem, limits=LimitsSpec())),
            sway_cost=SwayCost(beta=0.0, gamma=1.0),
            sway_limit=None,
        )
        return setup, sequence(setup.transcription.rest(), free, ROUGH)

    def _least(self, loosened: tuple[str, ...]) -> Relaxed | None:
        """Find how many times as wide limits must be, where those not loosened stay as they are.

        Parameters
        ----------
        loosened : tuple of str
            Places of limits, such as ``limits.sway``.

        Returns
        -------
        Relaxed or None
            None where the other limits cannot be kept, or the programs do not settle.
        """
        setup, unlimited = self._begun
        if unlimited.verdict is not ConicStatus.SOLVED:
            return None
        effort = setup.effort(unlimited.iterate.local)
        for price in PRICES:
            goal = LeastShare(setup=setup, loosened=loosened, price=price / effort)
            found = sequence(unlimited.iterate, goal)
            if found.verdict is ConicStatus.SOLVED:
                return Relaxed(share=float(found.solutions[-1].x[-1]), found=found)
            if found.verdict is ConicStatus.INFEASIBLE or found.iterations == MAX_ITERATIONS:
                break
        return None


def least_duration(relaxation: Relaxation) -> float | None:
    """Find the duration in s, no shorter than the problem's, in which all limits can just be kept.

    Returns
    -------
    float or None
        None where the limits cannot be kept however long the move is. The problem's own where no programs
        settle, so that nothing is known.
    """
    problem = relaxation.problem
    places, asked = tuple(problem.limits.stated()), math.log(problem.duration)

    @cache
    def excess(log_duration: float) -> float:
        lasting = attrs.evolve(problem, duration=math.exp(log_duration))
        found = (relaxation if log_duration == asked else Relaxation(lasting)).least(places)
        return UNSETTLED if found is None else math.log(max(found.share, TINY)) - ENOUGH

    short = asked
    if not places or excess(short) <= 0.0:
        return problem.duration
    lowest, power, steps = short, POWER, STEPS
    for _ in range(ROUNDS):
        enough = short + float(np.clip((excess(short) + CLOSE / 2.0) / power, *steps))
        if -CLOSE < excess(enough) <= 0.0:
            return math.exp(enough)
        if excess(enough) <= 0.0:
            return math.exp(_close_to_zero(excess, short, enough))
        if excess(enough) >= UNSETTLED > excess(lowest):
            return math.exp(enough)  # by all that is known
        if excess(enough) < excess(lowest) - LITTLE:
            lowest = enough
        elif excess(enough) < UNSETTLED and enough - lowest > STEPS[1]:
            return None
        known = (excess(short) - excess(enough)) / (enough - short)
        settled = excess(short) < UNSETTLED and POWERS[0] < known < POWERS[1]
        power, steps = (known, KNOWN_STEPS) if settled else (POWER, STEPS)
        short = enough
    return problem.duration


def _close_to_zero(excess: Callable[[float], float], short: float, enough: float) -> float:
    """Interpolate between two values, until the excess of the greater one falls little short of 0."""
    for _ in range(CLOSER):
        if excess(enough) > -CLOSE or excess(short) >= UNSETTLED:
            break
        slope = (excess(enough) - excess(short)) / (enough - short)
        middle = enough - (excess(enough) + CLOSE / 2.0) / slope
        short, enough = (short, middle) if excess(middle) <= 0.0 else (middle, enough)
    return enough
