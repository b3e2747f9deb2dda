"""Which solver for which problem."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.simulation import (
    greatest_overshoot,
)
from gen_profile.dynamics.problem.limits import Breach, breaches
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.overshoot import counted
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct import worst_case
from gen_profile.methods.solvers.direct.conic import ConicStatus
from gen_profile.methods.solvers.direct.impossibility import impossible
from gen_profile.methods.solvers.direct.relaxation import (
    SHORTEST_WITHIN,
    Relaxation,
    Relaxed,
    shortest,
    wideable,
)
from gen_profile.methods.solvers.direct.set_up import DirectOptions
from gen_profile.methods.solvers.direct.solver import ProgramSequence
from gen_profile.methods.solvers.direct.transient_sway import SLACK, sway_on_the_way
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.search import Search
from gen_profile.methods.solvers.solution import SIMPLER, WIDER, Solution, Status
from gen_profile.motion.actuator import lag_compensated
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.values import SolverName
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork, afford, budget, clock_left, left, spend

ANSWER = 8.4, 12.0  # s of work for all that a spec asks for or would do instead, and of the processor
SOLVING = 2.0  # s of work for a method
DIRECTLY = 6.0  # likewise for the direct one,
COMPARING = 3.0  # and for a second start
# times the limits that the motion of least violation may take on even intervals: where loads swing far, finer
# ones gained 0.2
MOST_VIOLATED = 1.25
KEPT_AS_WIDE = 1.0 - 1e-5  # likewise, where no finer mesh is needed to keep them
FINER_MESHES = 0.4  # of the work that is left, for finer meshes that keep the limits
STARTING = 0.85  # likewise, for what begins at rest
FOLLOWING = 0.7  # likewise, for the motion next to that of least violation that follows the equations
# likewise, for the least cost from two other starts, after which the motion of least violation will do
OTHER_STARTS = 0.4, 0.9
# where a mesh is bisected already, and the motion of least violation known that follows the equations
ON_FINE_MESHES = DirectOptions(max_bisections=0, step_tolerance=direct.FOLLOWED_STEP)
# of the processor's time that is left, for a cheaper motion than one that is found: the rest judges it
CHEAPER = 0.7
INEXACT = 1e-3  # share of a limit by which programs may break it for no other reason than their accuracy
# times that share less of the limits is asked for then, and how often
KEPT_FURTHER, KEPT_FURTHER_ROUNDS = 2.0, 2
SHORTEST_PERIODS = 1.5  # of the slowest mode, about as long as the shortest motions take
LEAST_PEAKS = {1: 1.0, 2: 4.0, 3: 32.0}  # derivative of a unit move from rest to rest in unit time, at least
BLEND = 4.0  # order of the norm by which these times and the period count together
RANGE = 2.0  # times the work for a whole range
# rad and iterations, from which on a motion may be one of several optimal ones; rad within limits
SWINGS_FAR, MANY_ITERATIONS, FAR_WITHIN_LIMITS = 0.15, 10, 0.35
BETTER = 1.0 - 1e-3  # times the cost of a motion, below which another one is given in its place


def attempt(
    problem: Problem, method: SolverName = "auto", *, coarse: bool = False, near: Relaxed | None = None
) -> Solution:
    """Solve a problem by the method that suits it, without finding out what would help where that fails.

    Parameters
    ----------
    problem : Problem
    method : str
        ``"indirect"`` knows no limits; ``"auto"`` takes it where none binds, and the direct method elsewhere.
    coarse : bool
        Where limits bind, on few intervals only; over a range, with whatever sway is left.
    near : Relaxed, optional
        A motion at which the direct method begins, in place of rest.
    """

    def in_time(solve: Callable[[], Solution], seconds: float) -> Solution:
        usual = 1.0 if problem.worst_case is None else RANGE
        return afford(solve, seconds * usual) or given_up(problem)

    if problem.worst_case is not None:
        return in_time(partial(_over_a_range, problem, coarse=coarse), DIRECTLY)
    directly = partial(_direct, problem, coarse=coarse, near=near)
    if method == "direct":
        solution = in_time(directly, DIRECTLY)
    else:
        # within limits the direct method finds most of what the simplified one does not
        simply = method == "auto" and bool(problem.limits.stated())
        solution = in_time(partial(indirect.solve, problem, simply=simply), SOLVING)
    if method == "auto" and not keeps_limits(solution):
        other = in_time(directly, DIRECTLY)
        if simply and solution.optimum is other.optimum is None and other.status is not Status.INFEASIBLE:
            solution = in_time(partial(indirect.solve, problem), SOLVING)
        unfound = other.optimum is solution.optimum is None and other.status is not Status.INFEASIBLE
        solution = solution if unfound or keeps_limits(solution) else other
    return solution if method == "indirect" or coarse or near is not None else _compared(problem, solution)


def _compared(problem: Problem, solution: Solution) -> Solution:
    """Where loads swing far, begin once more at another motion, and give the better one."""
    found = solution.optimum
    start: Callable[[Problem], ProgramSequence | None] = direct.mirrored
    if solution.other_costs is not None:  # it took two starts to find it
        return solution
    if found is None:
        several = solution.status in (Status.DIVERGED, Status.SWINGS_TOO_FAR) and not problem.limits.stated()
    elif problem.limits.stated():
        start, several = direct.without_limits, found.angle > FAR_WITHIN_LIMITS
    else:
        several = found.angle > SWINGS_FAR and solution.iterations >= MANY_ITERATIONS
    if not several:
        return solution
    settled = problem
    if found is not None:  # so that costs compare
        settled = attrs.evolve(problem, sway_weight=found.sway_weight, sway_scale=found.sway_scale)
    other = afford(partial(_begun, settled, start), min(COMPARING, OTHER_STARTS[-1] * left()))
    if other is None or other.optimum is None or not keeps_limits(other):
        return attrs.evolve(solution, other_costs=())
    if found is None or other.optimum.cost < BETTER * found.cost:
        return attrs.evolve(other, problem=problem, other_costs=() if found is None else (found.cost,))
    return attrs.evolve(solution, other_costs=(other.optimum.cost,))


def given_up(problem: Problem) -> Solution:
    """Tell that a problem takes too much work."""
    return Solution(status=Status.GIVEN_UP, method="none", problem=problem, advice=SIMPLER)


def _direct(problem: Problem, *, coarse: bool, near: Relaxed | None) -> Solution:
    """Begin near by, or at rest; where that misleads, at the motion of least violation."""
    cost, _ = direct.resolve_sway_cost(problem)  # once for all motions
    settled = attrs.evolve(problem, sway_weight=cost.beta, sway_scale=cost.gamma)
    begin = partial(_begun, settled, lambda _: None if near is None else near.start(problem), coarse=coarse)
    solution = afford(begin, STARTING * left()) or given_up(problem)
    if problem.limits.stated() and not keeps_limits(solution):
        if impossible(settled):
            return _too_narrow(problem, Status.INFEASIBLE)
        nearest = least_violation(settled)
        if nearest is not None and nearest.wider < MOST_VIOLATED:
            other = _from_nearest(settled, nearest, coarse=coarse)
            solution = solution if other.optimum is None else other
    return attrs.evolve(solution, problem=problem)


def _from_nearest(problem: Problem, nearest: Relaxed, *, coarse: bool) -> Solution:
    """Begin at the motion of least violation, else at the optimum without limits.

    Just above the shortest duration only meshes that are fine where limits begin to bind have a motion, and
    programs for the least cost may not settle on them, or take too much work: then the motion next to that of
    least violation that follows the equations is taken, if it keeps the limits.
    """
    near, options = nearest, None
    if not coarse:
        with suppress(OutOfWork), budget(FINER_MESHES * left()):
            while near.wider > KEPT_AS_WIDE and (finer := _refined(problem, near)) is not None:
                near, options = finer, ON_FINE_MESHES
        spend(0.0)
    start, kept = near.start(problem), None
    if start is not None and near.wider <= 1.0:
        following = afford(partial(direct.next_to, problem, start), FOLLOWING * left())
        if following is not None and following.verdict is ConicStatus.SOLVED:
            start, motion = following, direct.conclude(following, following.iterations)
            kept = attrs.evolve(motion, other_costs=()) if keeps_limits(motion) else None
    starts: Sequence[Callable[[Problem], ProgramSequence | None]] = (lambda _: start, direct.without_limits)
    for begin, share in zip(starts[:1] if coarse else starts, OTHER_STARTS, strict=False):
        fine = options is ON_FINE_MESHES
        clock = math.inf if kept is None else CHEAPER * clock_left()
        begun = partial(_begun, problem, begin, coarse=coarse, options=options)
        solution = afford(begun, (OTHER_STARTS[-1] if fine else share) * left(), clock) or given_up(problem)
        options = None
        if fine and solution.optimum is not None:  # which even finer ones may lower
            begun = partial(_begun, problem, begin)
            cheaper = afford(begun, OTHER_STARTS[-1] * left(), CHEAPER * clock_left()) or solution
            solution = min(solution, cheaper, key=_cost)
        if solution.optimum is not None:
            first = begin is not direct.without_limits
            return solution if first else attrs.evolve(solution, other_costs=())
    return solution if kept is None else kept


def _cost(solution: Solution) -> float:
    return math.inf if solution.optimum is None else solution.optimum.cost


def _begun(
    problem: Problem,
    start: Callable[[Problem], ProgramSequence | None],
    *,
    coarse: bool = False,
    options: DirectOptions | None = None,
) -> Solution:
    return _with_reserve(problem, start(problem), coarse=coarse, options=options)


def _refined(problem: Problem, nearest: Relaxed) -> Relaxed | None:
    """Bisect intervals where limits begin to bind, if that is worth it, and look for less violation."""
    finer = nearest.bisected()
    return None if finer is None else Relaxation(problem, (), finer).least(wideable(problem))


def _with_reserve(
    problem: Problem, near: ProgramSequence | None, *, coarse: bool, options: DirectOptions | None = None
) -> Solution:
    """Solve directly; where a limit is broken by as much as programs are inexact, ask for so much less."""
    solution = direct.solve(problem, near, coarse=coarse, options=options)
    for _ in range(KEPT_FURTHER_ROUNDS):
        excess = max((broken.excess for broken in _broken(solution)), default=0.0)
        if not 0.0 < excess < INEXACT:
            break
        other = direct.solve(
            problem.within(1.0 - KEPT_FURTHER * excess), near, coarse=coarse, options=options
        )
        if other.optimum is None:
            break
        solution, problem = attrs.evolve(other, problem=solution.problem), other.problem
    return solution


def _too_narrow(problem: Problem, status: Status) -> Solution:
    return Solution(status=status, method=direct.METHOD, problem=problem, advice=WIDER)


def least_violation(problem: Problem) -> Relaxed | None:
    """Find the motion for which all limits must be widened least; none without limits."""
    places = wideable(problem)
    return Relaxation(problem).least(places) if places else None


def _over_a_range(problem: Problem, *, coarse: bool) -> Solution:
    """Look for the least worst case only where the nominal machine's motion can keep the limits."""
    if impossible(problem):
        return _too_narrow(problem, Status.INFEASIBLE)
    nearest = least_violation(problem)
    if nearest is not None and nearest.wider > MOST_VIOLATED:
        return _too_narrow(problem, Status.DIVERGED)
    if nearest is None or not coarse:
        return worst_case.solve(problem)
    return attrs.evolve(nearest.solution, problem=problem)


def minimum_time(
    problem: Problem,
    progress: Progress = no_progress,
    near: Relaxed | None = None,
    search: Search = SHORTEST_WITHIN,
) -> Relaxed | None:
    """Find the shortest motion for a problem's limits and robustness; None where none was found.

    Parameters
    ----------
    problem : Problem
        Whose duration does not matter.
    progress : Progress
    near : Relaxed, optional
        A motion that is about as long.
    search : Search
        How exactly, unless over a range.
    """
    guess = near or usual_duration(problem)
    if problem.worst_case is None:
        return shortest(problem, guess, progress=progress, search=search)
    return worst_case.shortest_motion(problem, guess, progress)


def usual_duration(problem: Problem) -> float:
    """About how long in s the shortest motion takes, which no axis does in less time than by itself."""
    slowest = float(linearize(problem.plant, problem.parameters, problem.target).frequencies[0])
    times = [SHORTEST_PERIODS * 2.0 * math.pi / slowest]
    if problem.limits.sway is not None:  # a pendulum's, under a constant acceleration
        times.append(
            math.sqrt(LEAST_PEAKS[2] * max(map(abs, problem.distance)) / problem.limits.sway) / slowest
        )
    for axis, way in enumerate(problem.distance):
        limits = problem.limits.of(axis)
        for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
            times += [] if limit is None else [(LEAST_PEAKS[order] * abs(way) / limit) ** (1.0 / order)]
    return float(np.linalg.norm(times, BLEND))


def keeps_limits(solution: Solution) -> bool:
    """Tell whether a solution is one and keeps its problem's limits."""
    return solution.optimum is not None and not _broken(solution)


def _broken(solution: Solution) -> tuple[Breach, ...]:
    """List the limits that the motion of a solution, if it is one, breaks."""
    problem = solution.problem
    if solution.optimum is None or problem.limits == LimitsSpec():
        return ()
    sway = 0.0 if problem.limits.sway is None else sway_on_the_way(solution)
    sway = max(sway, problem.sway_spread * sway / SLACK)
    command = lag_compensated(optimal_profile(solution), problem.tau)
    over = -math.inf
    if problem.targets:
        over = float(greatest_overshoot(problem, optimal_profile(solution), [problem.parameters])[0])
    return breaches(problem.limits, command, sway, counted(problem.targets, over))
