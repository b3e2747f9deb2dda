"""Robustness over a whole range: the least residual sway of the worst machine.

Zero sway of the nominal machine is let go of, as extra-insensitive shapers do (Singhose et al., 1994), unless
it is asked for. The machines tried are the nominal one and the corners and ends of the ranges; where the
worst machine lies between them it is added, until none is worse. Among the motions that are nearly as good as
the best, the one of least cost is taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import attrs
import numpy as np

from gen_profile.evaluation.simulation import PlantSimulation
from gen_profile.motion.metrics import greatest, peak
from gen_profile.motion.profile import Array, Profile
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import Problem, WorstCase
from gen_profile.solvers.direct import solver as direct
from gen_profile.solvers.direct.conic import ConicStatus
from gen_profile.solvers.direct.set_up import Setup, set_up
from gen_profile.solvers.direct.solver import (
    CostProgram,
    LeastWorst,
    ProgramSequence,
    conclude,
    resolve_sway_cost,
    sequence,
)
from gen_profile.solvers.direct.transient_sway import within_sway
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution, Status

TRACES = (1e-8, 1e-6, 1e-4)  # of effort, in the least worst case
MARGIN = 0.002  # share of a load's limit, with which the least cost need not balance on a knife edge
SLACK = 1.003  # what the least cost may give away of the least worst case
GOOD_ENOUGH = 0.01  # share of a load's limit below which nobody need seek less
ROUNDS = 8
CORNERS = 6  # parameters up to which all corners are tried
GRID = 9  # machines along each range
DRAWS = 64  # machines within the ranges
WORSE = 1.01  # how much worse a machine must be than those tried to be added
WATCH_SAMPLES = 1001

Parameters = Mapping[str, float]


def solve(problem: Problem) -> Solution:
    """Minimise the worst residual sway, each load in shares of its limit, then the cost.

    Parameters
    ----------
    problem : Problem
        With a `worst_case`.

    Returns
    -------
    Solution
        Its `worst_case_bound` is what no motion on the same intervals goes below where angles are small.
    """

    def attempt(sway_limit: float | None) -> Solution:
        return _bounded(attrs.evolve(problem, limits=attrs.evolve(problem.limits, sway=sway_limit)))

    return attrs.evolve(within_sway(problem.limits.sway, attempt), problem=problem)


def _bounded(problem: Problem) -> Solution:
    """Solve a problem, with a limit of the effort where it needs one."""
    bounded = _limits_effort(problem)
    solution = _solve(problem, TRACES if bounded else TRACES[:1])
    if solution.optimum is not None or bounded:
        return solution
    return _solve(_held_back(problem) or problem, TRACES)


def _limits_effort(problem: Problem) -> bool:
    """Whether limits bound how much effort less sway may take: on every axis its acceleration or jerk."""
    limits = [problem.limits.of(axis) for axis in range(len(problem.target))]
    return all(own.acceleration is not None or own.jerk is not None for own in limits)


def _held_back(problem: Problem) -> Problem | None:
    """Allow no more acceleration than the motion takes that is exact and insensitive.

    Without such a limit, ever less sway would ask for ever more acceleration.
    """
    names = tuple(problem.worst_case.uncertain) if problem.worst_case is not None else ()
    exact = direct.solve(attrs.evolve(problem, worst_case=None, desensitized=names, sway_weight=0.0))
    if exact.optimum is None:
        return None
    motion = optimal_profile(exact)
    acceleration = max(greatest(motion, 2, axis) for axis in range(motion.axes))
    return attrs.evolve(problem, limits=attrs.evolve(problem.limits, acceleration=acceleration))


def solve_within_limits(problem: Problem) -> Solution:
    """Find any motion whose worst residual sway keeps every load's limit; the cost chooses among them.

    Returns
    -------
    Solution
        Infeasible where there is none.
    """
    worst_case, problem = _taken_apart(problem)
    sway_cost, iterations = resolve_sway_cost(problem)
    tried, everywhere = ends(problem, worst_case), candidates(problem, worst_case)
    for _ in range(ROUNDS):
        setup, _ = set_up(problem, tried)
        goal = CostProgram(
            setup=setup, sway_cost=sway_cost, sway_limit=problem.limits.sway, worst=1.0 - MARGIN
        )
        found = sequence(setup.transcription.rest(), goal)
        iterations += found.iterations
        solution = conclude(found, sway_cost, iterations)
        if solution.optimum is None:
            return solution
        shares = residual_shares(problem, worst_case, optimal_profile(solution), everywhere)
        if shares.max() <= 1.0:
            return solution
        tried = [*tried, everywhere[int(shares.argmax())]]
    return attrs.evolve(solution, status=Status.INFEASIBLE, optimum=None)


def _solve(problem: Problem, traces: Sequence[float]) -> Solution:
    worst_case, problem = _taken_apart(problem)
    sway_cost, iterations = resolve_sway_cost(problem)
    tried, everywhere = ends(problem, worst_case), candidates(problem, worst_case)
    for _ in range(ROUNDS):
        setup, _ = set_up(problem, tried)
        goal = CostProgram(
            setup=setup, sway_cost=sway_cost, sway_limit=problem.limits.sway, worst=GOOD_ENOUGH
        )
        bound, found = 0.0, sequence(setup.transcription.rest(), goal)
        if found.verdict is not ConicStatus.SOLVED:
            best = _least_worst(setup, traces)
            iterations += best.iterations
            bound = float(best.solutions[0].x[-1])
            if best.verdict is not ConicStatus.SOLVED:
                return conclude(best, sway_cost, iterations)
            goal = attrs.evolve(goal, worst=SLACK * float(best.solutions[-1].x[-1]) + MARGIN)
            found = sequence(best.iterate, goal)
        iterations += found.iterations
        solution = conclude(found, sway_cost, iterations)
        if solution.optimum is None:
            return solution
        shares = residual_shares(problem, worst_case, optimal_profile(solution), everywhere)
        if goal.worst is not None and shares.max() <= WORSE * goal.worst:
            break
        tried = [*tried, everywhere[int(shares.argmax())]]
    return attrs.evolve(solution, worst_case_bound=bound * worst_case.load_limits[-1])


def _least_worst(setup: Setup, traces: Sequence[float]) -> ProgramSequence:
    """Minimise the worst share, for as little effort besides as the programs can tell from none."""
    for trace in traces:
        best = sequence(setup.transcription.rest(), LeastWorst(setup=setup, trace=trace))
        if best.verdict is not ConicStatus.FAILED:
            break
    return best


def _taken_apart(problem: Problem) -> tuple[WorstCase, Problem]:
    if problem.worst_case is None:
        raise ValueError("the problem has no worst case")
    return problem.worst_case, attrs.evolve(problem, desensitized=())


def ends(problem: Problem, worst_case: WorstCase) -> list[Parameters]:
    """List the corners of the box of parameters, few enough of them, and the ends of every range."""
    uncertain = worst_case.uncertain
    corners = product((-1.0, 1.0), repeat=len(uncertain)) if len(uncertain) <= CORNERS else ()
    units = [tuple(np.eye(len(uncertain))[k] * sign) for k in range(len(uncertain)) for sign in (-1.0, 1.0)]
    places = dict.fromkeys([*corners, *units])
    return [_machine(problem, worst_case, place) for place in places]


def candidates(problem: Problem, worst_case: WorstCase) -> list[Parameters]:
    """List machines all over the box: its ends, a grid along every range, and a Latin hypercube."""
    count = len(worst_case.uncertain)
    grid = [np.eye(count)[k] * share for k in range(count) for share in np.linspace(-1.0, 1.0, GRID)]
    random = np.random.default_rng(0)
    strata = np.array([random.permutation(DRAWS) for _ in range(count)]).T
    draws = 2.0 * (strata + random.random((DRAWS, count))) / DRAWS - 1.0
    return ends(problem, worst_case) + [_machine(problem, worst_case, place) for place in (*grid, *draws)]


def residual_shares(
    problem: Problem, worst_case: WorstCase, motion: Profile, machines: Sequence[Parameters]
) -> Array:
    """Find the greatest share of a load's limit that every machine sways by, shape (machines,)."""
    slowest = min(linearize(problem.plant, p, problem.target).frequencies[0] for p in machines)
    watch = 2.0 * 2.0 * np.pi / slowest
    swing = PlantSimulation(problem.plant, motion, machines, motion.duration + watch, problem.initial)
    after = swing.at(motion.duration + np.linspace(0.0, watch, WATCH_SAMPLES))
    limits = np.array(worst_case.load_limits)
    return np.array([(peak(response.sway) / limits).max() for response in after])


def _machine(problem: Problem, worst_case: WorstCase, place: Sequence[float] | Array) -> Parameters:
    """Give every uncertain parameter its place within its range, from −1 to 1."""
    shifted = {
        name: problem.parameters[name] * (1.0 + share * float(at))
        for (name, share), at in zip(worst_case.uncertain.items(), place, strict=True)
    }
    return {**problem.parameters, **shifted}
