"""Robustness over a whole range: the least residual sway of the worst machine.

Zero sway of the nominal machine is let go of, as extra-insensitive shapers do (Singhose et al., 1994), unless
it is asked for. The machines tried are the nominal one and the corners and ends of the ranges; the worst ones
that a search finds between them are added until it finds none that is worse (an exchange method; R. Hettich
and K. O. Kortanek, Semi-infinite programming, SIAM Rev. 35, 1993). Among the motions that are nearly as good
as the best, the one of least cost is taken.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.residual_sway import modal_amplitudes
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.dynamics.problem.parameter_box import CORNERS, FEW, box_of, start, worst_places
from gen_profile.dynamics.problem.problem import Problem, WorstCase
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct.conic import ConicStatus
from gen_profile.methods.solvers.direct.relaxation import Relaxed, shortest
from gen_profile.methods.solvers.direct.set_up import DirectOptions, Setup, set_up
from gen_profile.methods.solvers.direct.solver import (
    COARSE_STEP,
    ROUGH_STEP,
    Goal,
    ProgramSequence,
    conclude,
    resolve_sway_cost,
    sequence,
)
from gen_profile.methods.solvers.direct.transcription import Iterate
from gen_profile.methods.solvers.direct.transient_sway import to_be_asked
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.search import Search, least
from gen_profile.methods.solvers.solution import Solution
from gen_profile.motion.metrics import greatest
from gen_profile.motion.profile import Array, Profile
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork, budget, left, spend

# where programs for the least worst case fail; a better one takes ever more effort
BISECTION = Search(precision=0.35, close=0.0, stride=math.log(1.5), growth=1.0, downward=True)
CASE_BISECTING = 0.6  # fraction of the work that is left for it
HOPELESS_CASE = 1e3  # times a load's limit, above which the least worst case is not looked for
EXCHANGING = 0.8  # fraction of the work that is left, after which the last motion is taken


@attrs.frozen(kw_only=True)
class RangeOptions:
    """How well a range is searched and its worst machine calmed; see docs/solvers.md for the evidence.

    Attributes
    ----------
    direct : DirectOptions, optional
        Of the programs.
    held_back : float
        Times the acceleration of the motion that is exact and insensitive, which an axis may take that no
        limit of acceleration or jerk binds: less and less sway would ask for more and more of it.
    margin, slack : float
        What the least cost may use beyond the least worst case: a fraction of a load's limit, and times that
        case.
    good_enough : float
        Fraction of a load's limit below which less is not worth an effort.
    traces : tuple of float
        Of effort, in the least worst case; the first one whose programs do not fail.
    rounds, added : int
        Of adding worse machines, and how many at once, at most.
    worse : float
        Times the worst of the machines considered, from which on another one is added.
    accuracy : float
        Of their integration, relative.
    """

    direct: DirectOptions | None = None
    held_back: float = 1.5
    margin: float = 0.002
    slack: float = 1.003
    good_enough: float = 0.01
    traces: tuple[float, ...] = (1e-8, 1e-6, 1e-4)
    rounds: int = 8
    added: int = 3
    worse: float = 1.01
    accuracy: float = 1e-6


USUAL = RangeOptions()

Parameters = Mapping[str, float]


def solve(problem: Problem, options: RangeOptions = USUAL) -> Solution:
    """Minimise the worst residual sway, each load in fractions of its limit, then the cost.

    Rounds go as far as work and programs allow; the last motion is the best.

    Parameters
    ----------
    problem : Problem
        With a `worst_case`.
    options : RangeOptions, optional

    Returns
    -------
    Solution
        Its `worst_case_bound` is what no motion on the same intervals goes below where angles are small.
    """
    limits = map(problem.limits.of, range(len(problem.target)))
    # of these no limit bounds how much effort less sway may take
    free = [axis for axis, own in enumerate(limits) if own.acceleration is None and own.jerk is None]
    bounded = _held_back(problem, free, options) if free else problem
    solutions: list[Solution] = []
    try:
        with budget(EXCHANGING * left()):
            solutions.extend(_rounds(bounded or problem, options))
    except OutOfWork:
        spend(0.0)
        if not solutions:
            raise
    motions = [solution for solution in solutions if solution.optimum is not None]
    return attrs.evolve((motions or solutions)[-1], problem=problem)


def _held_back(problem: Problem, free: Sequence[int], options: RangeOptions) -> Problem | None:
    """Allow some axes little more acceleration than they take in the motion that is exact and insensitive.

    Without such a limit, less and less sway would ask for more and more acceleration.
    """
    names = tuple(problem.worst_case.uncertain) if problem.worst_case is not None else ()
    unweighted = attrs.evolve(problem, worst_case=None, desensitized=names, sway_weight=0.0)
    exact = direct.solve(unweighted, coarse=True, options=options.direct)
    if exact.optimum is None:
        return None
    motion, limits = optimal_profile(exact), problem.limits
    own = {f"axis{axis}": limits.of(axis) for axis in range(len(problem.target))}
    for axis in free:
        most = options.held_back * greatest(motion, 2, axis)
        own[f"axis{axis}"] = attrs.evolve(limits.of(axis), acceleration=most or None)
    return attrs.evolve(problem, limits=attrs.evolve(limits, axis=own))


def shortest_motion(
    problem: Problem, guess: float | Relaxed, progress: Progress = no_progress
) -> Relaxed | None:
    """Find the shortest motion that keeps all limits, and after which no machine breaks its loads' ones.

    Parameters
    ----------
    problem : Problem
        With a `worst_case`; its duration does not matter.
    guess : float or Relaxed
        About how long it takes in s, or a motion that is about as long.
    progress : Progress
    """
    worst_case, problem = _taken_apart(problem)
    tried, shortest_known = ends(problem, worst_case), guess
    for _ in range(USUAL.rounds):
        shortest_yet = shortest(problem, shortest_known, tried, progress)
        if shortest_yet is None or shortest_yet.solution.optimum is None:
            return shortest_yet
        shortest_known = shortest_yet
        worse = worse_machines(problem, worst_case, optimal_profile(shortest_known.solution), 1.0)
        if not worse:
            return shortest_known
        tried = [*tried, *worse]
    return None


def _rounds(problem: Problem, options: RangeOptions) -> Iterator[Solution]:
    """Solve for a few machines, about, search for worse ones, and solve again with them.

    Where there are none, and none that sway too much between collocation points, solve exactly.
    """
    worst_case, problem = _taken_apart(problem)
    sway_cost, iterations = resolve_sway_cost(problem)
    tried, bound, result, precision = ends(problem, worst_case), 0.0, None, COARSE_STEP
    swaying = problem.nominal_sway
    for _ in range(options.rounds):
        setup, _ = set_up(problem, tried, options.direct)
        goal = Goal(
            setup=setup,
            sway_cost=sway_cost,
            sway_limit=swaying,
            overshoot_limit=problem.nominal_overshoot,
            worst=options.good_enough,
        )
        start = _begun(setup, result)
        # the bound only rises with more machines: what was not good enough before is not now
        result = sequence(start, goal, precision) if bound <= options.good_enough else None
        if result is None or result.verdict is not ConicStatus.SOLVED:
            best = _least_worst(goal, options.traces)
            iterations += best.iterations
            bound = float(best.solutions[0].x[-1])
            upper = options.slack * float(best.solutions[-1].x[-1]) + options.margin
            if best.verdict is ConicStatus.FAILED and (bisected := _bisected(start, goal)) is not None:
                bound, upper = bisected / math.exp(BISECTION.precision), bisected
            elif best.verdict is not ConicStatus.SOLVED:
                yield conclude(best, iterations)
                return
            goal = attrs.evolve(goal, worst=upper)
            result = sequence(best.iterate if best.verdict is ConicStatus.SOLVED else start, goal, precision)
        iterations += result.iterations
        solution = conclude(result, iterations)
        yield attrs.evolve(solution, worst_case_bound=bound * worst_case.load_limits[-1])
        if solution.optimum is None:
            return
        upper = options.worse * float(goal.worst or 0.0)
        worse = worse_machines(problem, worst_case, optimal_profile(solution), upper, options)
        asked, swaying = swaying, to_be_asked(problem, solution, swaying)
        if not worse and asked == swaying:
            if precision < COARSE_STEP:
                return
            precision = setup.options.step_tolerance
        tried = [*tried, *worse]


def _least_worst(goal: Goal, traces: Sequence[float]) -> ProgramSequence:
    """Minimise the worst fraction, for as little effort besides as the programs can tell from none."""
    for price in traces:
        least_worst = attrs.evolve(goal, effort_price=price, worst=None)
        best = sequence(goal.setup.transcription.rest(), least_worst)
        if best.verdict is not ConicStatus.FAILED:
            break
    return best


def _bisected(start: Iterate, goal: Goal) -> float | None:
    """Find about the least worst fraction that motions of least cost keep to, whose programs do not fail."""

    def excess(worst: float) -> float:
        result = sequence(start, attrs.evolve(goal, worst=worst), ROUGH_STEP)
        return -math.inf if result.verdict is ConicStatus.SOLVED else math.inf

    with budget(CASE_BISECTING * left()):
        return least(excess, 1.0, BISECTION, HOPELESS_CASE)


def _begun(setup: Setup, result: ProgramSequence | None) -> Iterate:
    """Begin at a motion found for fewer machines, new ones swinging as the nominal one does; or at rest."""
    rest = setup.transcription.rest()
    if result is None or result.verdict is not ConicStatus.SOLVED:
        return rest
    known = result.iterate.stages
    new = tuple(known[0][:, :, : stages.shape[2]] for stages in rest.stages[len(known) :])
    return Iterate(local=result.iterate.local, stages=(*known, *new))


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


def worse_machines(
    problem: Problem,
    worst_case: WorstCase,
    motion: Profile,
    fraction: float,
    options: RangeOptions = USUAL,
) -> list[Parameters]:
    """Search the ranges for machines whose loads a motion leaves more than a fraction of their limits."""
    low, high = (_machine(problem, worst_case, (end,) * len(worst_case.uncertain)) for end in (-1.0, 1.0))
    box = box_of(problem, {name: (low[name], high[name]) for name in worst_case.uncertain})
    if box is None:
        return []

    def fractions(places: Array) -> Array:
        machines = box.parameters(places)
        return residual_fractions(problem, worst_case, motion, machines, options.accuracy)[:, None]

    places, _ = worst_places(fractions, start(box.phases, len(box.ranges), FEW), options.added)
    return [*box.parameters(places[fractions(places)[:, 0] > fraction])]


def residual_fractions(
    problem: Problem,
    worst_case: WorstCase,
    motion: Profile,
    machines: Sequence[Parameters],
    accuracy: float = USUAL.accuracy,
) -> Array:
    """Find what fraction of its limit every machine's load swings by where its modes meet, (machines,)."""
    end, limits = np.array([motion.duration]), np.array(worst_case.load_limits)
    swing = PlantSimulation(
        problem.plant, motion, machines, motion.duration, problem.initial, accuracy=accuracy
    )
    responses = zip(machines, swing.at(end), strict=True)
    return np.array([(modal_amplitudes(problem.plant, p, at) / limits).max() for p, at in responses])


def _machine(problem: Problem, worst_case: WorstCase, place: Sequence[float] | Array) -> Parameters:
    """Give every uncertain parameter its place within its range, from −1 to 1."""
    shifted = {
        name: problem.parameters[name] * (1.0 + fraction * float(at))
        for (name, fraction), at in zip(worst_case.uncertain.items(), place, strict=True)
    }
    return {**problem.parameters, **shifted}
