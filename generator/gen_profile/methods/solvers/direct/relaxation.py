"""By how much a problem's limits would have to be wider, or its move longer, for a motion to keep them.

One variable more widens some of the limits so many times; the least one is the optimum of convex programs
like those that find motions (see `solvers.direct`). There is one whether or not the problem can be solved,
and it falls smoothly with the duration: where it is 1, the limits can just be kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, cached_property

import attrs

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct.conic import ConicStatus
from gen_profile.methods.solvers.direct.refinement import bisected, switching
from gen_profile.methods.solvers.direct.set_up import Setup, set_up
from gen_profile.methods.solvers.direct.solver import (
    Goal,
    ProgramSequence,
    begun_at,
    conclude,
    sequence,
)
from gen_profile.methods.solvers.search import Search, least
from gen_profile.methods.solvers.solution import Solution
from gen_profile.spec.model import LimitsSpec
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork, budget, left, spend

# of the effort without limits: ever less sway would take ever more of it
PRICES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
ROUGH_START = 0.5  # step to which the motion without limits is found, at which programs begin
WIDENING_TOLERANCE = 5e-3  # by which the logarithm of how much wider limits must be may exceed 0
SHORT_OF_LIMITS = 2e-4  # by how much it must fall short of it in the shortest motion; ten times costs 0.2 %
RESTS = 0.985  # fraction of a load's limit, for the worst machine after the move; 0.95 to 0.999 give the same
NEARBY = math.log(1.2)  # to a duration's logarithm, from where a motion is a start for the next one
EVEN_SHARE = 0.6  # fraction of the work that is left, to find the shortest duration
BISECTED_SHARE = 0.3  # likewise, to find a shorter one on bisected intervals
WORTH_REFINING = 1e-3  # of the duration, by which it must fall for another round
FINEST = 1.0 / 320.0  # of the duration: intervals that are no longer are not bisected
TINY = 1e-6  # below which how little of the limits is taken does not matter

# what limits take falls with the duration's power of 1 to 4: accelerations with 2, more or less
LEAST_WIDENING = Search(
    precision=0.02, close=0.04, aim=-0.015, slope=1.8, believed=(1.0, 4.0), stride=math.log(2.0), tries=20
)
ROUGHLY = attrs.evolve(LEAST_WIDENING, downward=True)
SHORTEST_WITHIN = attrs.evolve(ROUGHLY, precision=3e-4, close=6e-4, aim=-3e-4)


@attrs.frozen(kw_only=True, eq=False)
class Relaxed:
    """The motion for which some limits must be widened least.

    Attributes
    ----------
    wider : float
        How many times as wide they must be.
    sequence_result : ProgramSequence
        By which the motion was found.
    """

    wider: float
    sequence_result: ProgramSequence

    @property
    def duration(self) -> float:
        """Of the motion, in s."""
        return self.sequence_result.setup.problem.duration

    def start(self, problem: Problem) -> ProgramSequence | None:
        """Give the motion, on its mesh, to begin at; nothing for a problem that is not about as long."""
        nearby = abs(math.log(problem.duration / self.duration)) < NEARBY
        return self.sequence_result if nearby else None

    def bisected(self) -> Relaxed | None:
        """Quarter the intervals where limits begin or cease to bind; None where they are short already."""
        sequence_result, goal = self.sequence_result, self.sequence_result.goal
        for _ in range(2):
            where = switching(goal.setup, sequence_result.iterate, goal.on_the_way, goal.widened, self.wider)
            where &= goal.setup.transcription.piece.length > FINEST
            if not where.any():
                break
            finer, iterate = bisected(goal.setup, sequence_result.iterate, where)
            goal = attrs.evolve(goal, setup=finer)
            sequence_result = attrs.evolve(sequence_result, goal=goal, iterate=iterate)
        if sequence_result is self.sequence_result:
            return None
        return attrs.evolve(self, sequence_result=sequence_result)

    @property
    def solution(self) -> Solution:
        """The motion as a solution, unless it swings too far."""
        return conclude(self.sequence_result, self.sequence_result.iterations)


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
        setup, _ = set_up(problem, self._tried)
        unbounded = attrs.evolve(setup, tried=())
        if not self._tried:
            setup = unbounded
        if self._near is not None and (near := self._near.start(problem)):
            alike, start = begun_at(setup, near)
            if start is near.iterate:
                return alike, near
        rest = setup.transcription.rest()
        free = attrs.evolve(unbounded, problem=attrs.evolve(setup.problem, limits=LimitsSpec()))
        return setup, sequence(rest, Goal(setup=free, sway_limit=None), ROUGH_START)

    def _least(self, widened: tuple[str, ...]) -> Relaxed | None:
        """Find how many times as wide limits must be, where those not widened stay as they are.

        Parameters
        ----------
        widened : tuple of str
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
            goal = Goal(
                setup=setup,
                sway_limit=setup.problem.nominal_sway,
                overshoot_limit=setup.problem.nominal_overshoot,
                effort_price=price / effort,
                worst=RESTS,
                widened=widened,
            )
            result = sequence(unlimited.iterate, goal)
            if result.verdict is ConicStatus.SOLVED:
                return Relaxed(wider=float(result.solutions[-1].x[-1]), sequence_result=result)
            if result.verdict is ConicStatus.INFEASIBLE or result.iterations == setup.options.max_iterations:
                break
        return None


def time_dependent_limits(problem: Problem) -> tuple[str, ...]:
    """Name the limits of which a longer move asks for less: all but travel, where others are stated.

    A move that begins at an end of its travel asks for all of it, however long it takes.
    """
    places = wideable(problem)
    return tuple(place for place in places if not place.endswith(".travel")) or places


def wideable(problem: Problem) -> tuple[str, ...]:
    """Name the limits of which less than all may suffice; where there are none, the one that is stated.

    All of ``limits.overshoot`` is taken by a load that may not pass its target, for it ends there.
    """
    places = tuple(problem.limits.stated())
    return tuple(place for place in places if place != "limits.overshoot") or places


def least_duration(relaxation: Relaxation) -> float | None:
    """Find the duration in s, no shorter than the problem's, in which all limits can just be kept.

    Returns
    -------
    float or None
        None where the limits cannot be kept however long the move is. Where programs do not settle, so that
        nothing more is known, the duration that was come to.
    """
    problem = relaxation.problem
    places, settled, unsettled = time_dependent_limits(problem), [0.0], list[float]()

    def excess(duration: float) -> float:
        asked = duration == problem.duration
        lasting = relaxation if asked else Relaxation(attrs.evolve(problem, duration=duration))
        relaxed = lasting.least(places)
        if relaxed is not None:
            settled.append(duration)
            return math.log(max(relaxed.wider, TINY)) - WIDENING_TOLERANCE
        unsettled.append(duration)
        return -math.inf if unsettled[0] < duration > max(settled) else math.inf

    if not places:
        return problem.duration
    with budget(EVEN_SHARE * left()):
        duration = least(excess, problem.duration, LEAST_WIDENING)
    return unsettled[0] if duration in unsettled else duration


def shortest(
    problem: Problem,
    guess: float | Relaxed,
    tried: Sequence[Mapping[str, float]] = (),
    progress: Progress = no_progress,
    search: Search = SHORTEST_WITHIN,
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
    search : Search

    Returns
    -------
    Relaxed or None
        None where no duration was found to do.
    """
    by_duration, places = dict[float, Relaxed](), time_dependent_limits(problem)
    last, start = (guess, guess.duration) if isinstance(guess, Relaxed) else (None, guess)

    def excess(duration: float) -> float:
        nonlocal last
        progress("looking for the shortest duration", remark=f"trying {duration:.3g} s")
        last = Relaxation(attrs.evolve(problem, duration=duration), tried, last).least(places)
        if last is None:
            return math.inf
        by_duration[duration] = last
        return math.log(max(last.wider, TINY)) - math.log(1.0 - SHORT_OF_LIMITS)

    with budget(EVEN_SHARE * left()):
        duration = least(excess, start, search)
    return None if duration is None else by_duration[duration]


def refined(problem: Problem, relaxed: Relaxed, progress: Progress = no_progress) -> Relaxed:
    """Find a shorter motion on intervals that are bisected where limits begin or cease to bind.

    Programs with the snap, or with limits of the sway, hardly find any, so they are not asked.

    Parameters
    ----------
    problem : Problem
    relaxed : Relaxed
        The shortest motion on its mesh, of the nominal machine only.
    progress : Progress
    """
    if problem.worst_case is not None or problem.effort == "snap" or problem.limits.sway is not None:
        return relaxed
    longer = math.inf
    with suppress(OutOfWork), budget(BISECTED_SHARE * left()):
        while (
            relaxed.duration < (1.0 - WORTH_REFINING) * longer and (finer := relaxed.bisected()) is not None
        ):
            longer, relaxed = relaxed.duration, shortest(problem, finer, progress=progress) or relaxed
    spend(0.0)
    return relaxed
