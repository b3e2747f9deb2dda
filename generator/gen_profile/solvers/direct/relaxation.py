"""By how much a problem's limits would have to be wider, or its move longer, for a motion to keep them.

One variable more, the share, widens some of the limits; the least one is the optimum of convex programs like
those that find motions (see `solvers.direct`). There is one whether or not the problem can be solved, and it
falls smoothly with the duration: where it is 1, the limits can just be kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.problem.problem import Problem
from gen_profile.problem.sway_cost import SwayCost
from gen_profile.progress import Progress, untold
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
from gen_profile.work import OutOfWork, budget, left

PRICES = (1e-5, 1e-3, 1e-1)  # of the effort without limits: ever less sway would take ever more of it
CHANGE = 1e-4  # of the share, relative, that is worth another program
FAR = 1e-2  # likewise of how far the share is from 1
ENOUGH = 5e-3  # by which the share's logarithm may exceed 0
CLOSE = 0.05  # by which it may fall short of 0: the duration found is then tried
KEPT, CLOSEST = 2e-4, 1e-3  # likewise of the shortest duration: by how much it must, and may besides
RESTS = 0.985  # share of a load's limit that the worst machine may take after the move
POWER = 1.8  # with which shares fall over the duration, more or less
POWERS = (1.0, 4.0)  # between which what two durations tell of it is believed
STEPS = (math.log(1.1), math.log(2.0))  # of the duration's logarithm
KNOWN_STEPS = (1e-3, math.log(30.0))  # likewise where two durations tell the power
LITTLE = 0.01  # by which the share's logarithm must fall within the longer of them
ROUNDS = 12
CLOSER = 8  # rounds at most, once a duration is long enough
NEARBY = math.log(1.2)  # to a duration's logarithm, from where a motion is a start for the next one
SEARCHING = 0.6  # share of the work that is left, to find the shortest duration
UNSETTLED = math.log(1e6)  # in place of the logarithm of a share that was not found
TINY = 1e-6  # share below which how small it is does not matter


@attrs.frozen(kw_only=True, eq=False)
class LeastShare:
    """Minimise how many times as wide some limits must be.

    Attributes
    ----------
    setup : Setup
        Its machines tried keep their loads' limits after the move.
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
        """Number of variables of its own: the share is the last one."""
        return self.setup.extra + 1

    def pose(
        self, program: ConicProgram, iterate: Iterate, maps: Sequence[IntervalMaps]
    ) -> tuple[Matrix, Array]:
        """Add the limits to a program: P and q."""
        problem, transcription = self.setup.problem, self.setup.transcription
        goals.keep_limits(program, problem, transcription, self.loosened)
        if problem.nominal_sway is not None:
            loose = "limits.sway" in self.loosened
            goals.keep_sway(program, transcription, problem.nominal_sway, iterate, maps[0], loosened=loose)
        if self.setup.tried:
            goals.bound_worst(program, transcription, self.setup.tried, maps, most=RESTS)
        linear = np.zeros(program.variables)
        linear[-1] = 1.0
        program.at_most(-linear[None], np.zeros(1))
        return self.price * transcription.effort(self.setup.forms, program.variables), linear

    def step(self, solutions: Sequence[ConicSolution], start: Iterate) -> float:
        """Measure by how much the share changed last, in units of what would be noticed."""
        share, before = float(solutions[-1].x[-1]), float("inf")
        if len(solutions) > 1:
            before = float(solutions[-2].x[-1])
        noticed = max(CHANGE * abs(share), FAR * abs(share - 1.0), TINY)
        return STEP_TOLERANCE * abs(share - before) / noticed

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
    def duration(self) -> float:
        """Of the motion, in s."""
        return self.found.setup.problem.duration

    def start(self, problem: Problem) -> Iterate | None:
        """Give the motion, on its mesh, to begin at; nothing for a problem that is not about as long."""
        nearby = abs(math.log(problem.duration / self.duration)) < NEARBY
        return self.found.iterate if nearby else None

    @property
    def solution(self) -> Solution:
        """The motion as a solution, unless it swings too far."""
        return conclude(self.found, SwayCost(beta=0.0, gamma=1.0), self.found.iterations)


class Relaxation:
    """A problem whose limits may be widened.

    Parameters
    ----------
    problem : Problem
        With limits.
    tried : sequence of mapping of str to float
        Machines whose residual sway is bounded, where the problem has a `worst_case`; without any none is.
    near : Relaxed, optional
        A motion to begin at, in place of what the problem would take without limits.
    """

    def __init__(
        self, problem: Problem, tried: Sequence[Mapping[str, float]] = (), near: Relaxed | None = None
    ) -> None:
        self.problem = problem
        self.least = cache(self._least)
        self._tried, self._near = tried, near

    @cached_property
    def _begun(self) -> tuple[Setup, ProgramSequence]:
        """Transcribe the problem, and find about what motion it would take without limits."""
        problem = self.problem
        setup, redundant = set_up(problem, self._tried)
        if redundant:
            kept = tuple(name for name in problem.desensitized if name not in redundant)
            setup, _ = set_up(attrs.evolve(problem, desensitized=kept), self._tried)
        unbounded = attrs.evolve(setup, tried=())
        if not self._tried:
            setup = unbounded
        rest = setup.transcription.rest()
        if self._near is not None and (start := self._near.start(problem)) and start.like(rest):
            return setup, self._near.found
        free = CostProgram(
            setup=attrs.evolve(unbounded, problem=attrs.evolve(setup.problem, limits=LimitsSpec())),
            sway_cost=SwayCost(beta=0.0, gamma=1.0),
            sway_limit=None,
        )
        return setup, sequence(rest, free, ROUGH)

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


def eased_by_time(problem: Problem) -> tuple[str, ...]:
    """Name the limits of which a longer move asks for less: all but travel, where others are stated.

    A move that begins at an end of its travel asks for all of it, however long it takes.
    """
    places = tuple(problem.limits.stated())
    return tuple(place for place in places if not place.endswith(".travel")) or places


def least_duration(relaxation: Relaxation) -> float | None:
    """Find the duration in s, no shorter than the problem's, in which all limits can just be kept.

    Returns
    -------
    float or None
        None where the limits cannot be kept however long the move is. The problem's own where no programs
        settle, so that nothing is known.
    """
    problem = relaxation.problem
    places, asked, kept = eased_by_time(problem), math.log(problem.duration), list[float]()

    @cache
    def excess(log_duration: float) -> float:
        lasting = attrs.evolve(problem, duration=math.exp(log_duration))
        found = (relaxation if log_duration == asked else Relaxation(lasting)).least(places)
        exceeds = UNSETTLED if found is None else math.log(max(found.share, TINY)) - ENOUGH
        kept.extend([log_duration] if exceeds <= 0.0 else [])
        return exceeds

    if not places or excess(asked) <= 0.0:
        return problem.duration
    try:
        with budget(SEARCHING * left()):
            found = _least_above(excess, asked, CLOSE)
    except OutOfWork:
        if not kept:
            raise
        found = min(kept)
    return None if found is None else math.exp(found)


def shortest(
    problem: Problem,
    guess: float | Relaxed,
    tried: Sequence[Mapping[str, float]] = (),
    progress: Progress = untold,
    *,
    roughly: bool = False,
) -> Relaxed | None:
    """Find the shortest motion that keeps all limits.

    Parameters
    ----------
    problem : Problem
        With limits; its duration does not matter.
    guess : float or Relaxed
        About how long it takes in s, or a motion that is about as long.
    tried : sequence of mapping of str to float
        Machines whose residual sway is bounded.
    progress : Progress
    roughly : bool
        Whether a duration that exceeds the shortest by a few hundredths will do.

    Returns
    -------
    Relaxed or None
        None where no duration was found to do.
    """
    places, kept = eased_by_time(problem), list[Relaxed]()
    last, begun = (guess, guess.duration) if isinstance(guess, Relaxed) else (None, guess)

    @cache
    def excess(log_duration: float) -> float:
        nonlocal last
        lasting = attrs.evolve(problem, duration=math.exp(log_duration))
        progress("looking for the shortest duration", remark=f"trying {lasting.duration:.3g} s")
        last = Relaxation(lasting, tried, last).least(places)
        if last is None:
            return UNSETTLED
        if last.share <= 1.0 - KEPT:
            kept.append(last)
        return math.log(max(last.share, TINY)) - math.log(1.0 - KEPT)

    try:
        with budget(SEARCHING * left()):
            short = enough = math.log(begun)
            close, steps = CLOSE if roughly else CLOSEST, (KNOWN_STEPS[0], STEPS[1])
            while excess(short) <= 0.0:
                enough, short = short, short - float(np.clip((close - excess(short)) / POWER, *steps))
            if enough > short:
                _close_to_zero(excess, short, enough, close)
            else:
                _least_above(excess, short, close, steps)
    except OutOfWork:
        if not kept:
            raise
    return min(kept, key=lambda relaxed: relaxed.duration, default=None)


def _least_above(
    excess: Callable[[float], float], asked: float, close: float, steps: tuple[float, ...] = STEPS
) -> float | None:
    """Find where an excess that falls comes close to 0 from a place on where it is positive.

    Parameters
    ----------
    excess : float → float
    asked : float
    close : float
        How little it may fall short of 0.
    steps : tuple of float
        Least and greatest first step.

    Returns
    -------
    float or None
        None where it falls no more; where nothing is known of it, the place itself.
    """
    short = lowest = asked
    power = POWER
    for _ in range(ROUNDS):
        enough = short + float(np.clip((excess(short) + close / 2.0) / power, steps[0], steps[-1]))
        if excess(enough) <= 0.0:
            return _close_to_zero(excess, short, enough, close)
        unsettled = excess(enough) >= UNSETTLED > excess(lowest)
        if unsettled and excess(short) >= UNSETTLED:
            return short  # by all that is known
        if excess(enough) < excess(lowest) - LITTLE:
            lowest = enough
        elif excess(enough) < UNSETTLED and enough - lowest > STEPS[1]:
            return None
        known = (excess(short) - excess(enough)) / (enough - short)
        settled = excess(short) < UNSETTLED and POWERS[0] < known < POWERS[1]
        power, steps = (known, KNOWN_STEPS) if settled else (POWER, STEPS[: 2 - unsettled])
        short = enough
    return asked


def _close_to_zero(excess: Callable[[float], float], short: float, enough: float, close: float) -> float:
    """Interpolate between two values, until the excess of the greater one falls little short of 0."""
    tried = [short, enough]
    for _ in range(CLOSER):
        if excess(enough) > -close or enough - short < close / POWER:
            break
        nearest, near = sorted(tried, key=lambda place: abs(excess(place)))[:2]
        slope = (excess(nearest) - excess(near)) / (nearest - near)
        middle = nearest - (excess(nearest) + close / 2.0) / slope if slope < 0.0 else math.inf
        if not short < middle < enough or excess(short) >= UNSETTLED:
            middle = (short + enough) / 2.0
        tried.append(middle)
        short, enough = (short, middle) if excess(middle) <= 0.0 else (middle, enough)
    return enough
