"""Direct method: the motion's polynomials themselves as variables, found by a few conic programs.

A machine's equations are nearly linear in the motion, and everything else is convex: effort, sway, limits on
Bézier coefficients, and the amplitudes of the modes after the move. So the equations are linearised about the
last motion, and the convex program that results is solved to the end, until the motion stays (sequential
convex programming; Malyuta et al., 2022); where motions overshoot one another, the last few predict the next
(see `acceleration`). The first of these programs, linearised at rest, bounds from below what any
motion can do where angles are small.
"""

import math
from collections.abc import Sequence
from functools import partial

import attrs
import numpy as np

from gen_profile.dynamics.problem.cost import SwayCost, axis_reach
from gen_profile.dynamics.problem.problem import AUTO_EFFORT, AUTO_SWAY, Problem
from gen_profile.methods.solvers.direct import goals
from gen_profile.methods.solvers.direct.acceleration import accelerate
from gen_profile.methods.solvers.direct.bezier import power_basis
from gen_profile.methods.solvers.direct.condensing import IntervalMaps
from gen_profile.methods.solvers.direct.conic import (
    ConicProgram,
    ConicSolution,
    ConicStatus,
    Entries,
    Workspace,
    place,
)
from gen_profile.methods.solvers.direct.refinement import bisected, switching
from gen_profile.methods.solvers.direct.set_up import DirectOptions, Setup, on_mesh, set_up
from gen_profile.methods.solvers.direct.transcription import Iterate
from gen_profile.methods.solvers.direct.transient_sway import sway_on_the_way, within_sway
from gen_profile.methods.solvers.solution import HORIZONTAL, LATER, LONGER, WIDER, Optimum, Solution, Status
from gen_profile.motion.profile import Array
from gen_profile.support.one_thread import one_thread
from gen_profile.support.remembered import remembered
from gen_profile.support.work import OutOfWork, afford, left

METHOD = "direct"
COARSE_STEP = 1e-2  # step after which a motion on even intervals will do to be measured
# step after which a mesh is refined: what programs on coarse ones end at need not be exact, but programs on
# finer ones, which take longer, shall settle from there
ROUGH_STEP = 0.1
FOLLOWED_STEP = 1e-4  # likewise, after which a motion follows the equations, to about its square
# steps taken for the programs' own tolerance when they cease to shrink, usually and of programs that are not
# solved exactly; they cost their square, and ten times or a tenth of them give the same motions
STALLED, STALLED_INEXACT = 2e-4, 1e-2
BELIEVED = 0.03  # least quotient of steps that is taken for how they go on to shrink
SLOW_STEPS = 0.3  # fraction of the step before from which on steps are combined; 0.1 and 0.6 change nothing
BISECTING = 0.5  # fraction of the work that is left, after which a motion on the first mesh will do
# likewise, for one that is not quite of least cost on the last mesh, and for one that is on the first
NEXT_TO_IT, SETTLING = 0.6, 0.9
WORTHWHILE = 1e-3  # relative change of the worst case worth another program; 1e-4 changes costs by 4e-7
LEAST_FRACTION = 0.01  # of a load's limit, of which a change is still measured
CHANGE = 1e-4  # of how many times as wide limits are, relative, that is worth another program
FAR_FROM_ONE = 1e-2  # likewise of how far that is from 1
TINY = 1e-6  # below which how little it is does not matter
UNWEIGHTED = SwayCost(beta=0.0, gamma=1.0)


@attrs.frozen(kw_only=True, eq=False)
class Goal:
    """What programs shall achieve, and keep within bounds.

    Attributes
    ----------
    setup : Setup
        Its machines tried keep their loads' limits after the move.
    sway_limit : float or None
        m, on the way, of the nominal machine at the collocation points.
    overshoot_limit : float or None
        m, by which its end load may pass its target there.
    sway_cost : SwayCost
        Of eq. (26), which is minimised.
    effort_price : float or None
        Minimise the last variable instead, and so many times the effort, which makes the motion unique: how
        many times as wide the widened limits are, or the worst fraction of a load's limit.
    worst : float or None
        Bound of the worst fraction of a load's limit after the move.
    widened : tuple of str
        Places of limits that the last variable widens; travel by so many times its width, less one, at either
        end.
    nearest : Iterate, optional
        Depart from this motion as little as possible, in place of minimising the cost.
    """

    setup: Setup
    sway_limit: float | None
    overshoot_limit: float | None = None
    sway_cost: SwayCost = UNWEIGHTED
    effort_price: float | None = None
    worst: float | None = None
    widened: tuple[str, ...] = ()
    nearest: Iterate | None = None

    @property
    def on_the_way(self) -> tuple[float | None, float | None]:
        """Limits of the sway at the collocation points, and of how far the load passes its target."""
        return self.sway_limit, self.overshoot_limit

    @property
    def extra(self) -> int:
        """Number of variables of its own, the program's last."""
        return self.setup.extra + bool(self.widened)

    def pose(
        self, program: ConicProgram, iterate: Iterate, maps: Sequence[IntervalMaps]
    ) -> tuple[Entries, Array]:
        """Add the bounds to a program and expand the cost: P and q."""
        setup, transcription = self.setup, self.setup.transcription
        goals.keep_limits(program, setup.problem, transcription, self.widened)
        if self.sway_limit is not None:
            wide = "limits.sway" in self.widened
            goals.keep_sway(program, transcription, self.sway_limit, iterate, maps[0], widened=wide)
        if self.overshoot_limit is not None:
            wide, most = "limits.overshoot" in self.widened, self.overshoot_limit
            ahead = setup.problem.targets
            goals.keep_behind(program, ahead, transcription, iterate, maps[0], limit=most, widened=wide)
        if setup.tried:
            goals.bound_worst(program, transcription, setup.tried, maps, self.worst)
        linear = np.zeros(program.variables)
        if self.effort_price is not None:
            linear[-1] = 1.0
            if self.widened:
                program.at_most(place(-linear[None, None], np.zeros(1, dtype=np.intp)), np.zeros(1))
            quadratic = self.effort_price * setup.effort_form
        elif self.nearest is not None:
            quadratic = setup.effort_form
            pulls = quadratic.values * self.nearest.local.ravel()[quadratic.columns]
            linear -= np.bincount(quadratic.rows, pulls, program.variables)
        else:
            scaled = attrs.evolve(self.sway_cost, beta=self.sway_cost.beta / setup.cost_scale)
            expanded, slope = goals.cost(transcription, setup.effort_form, scaled, iterate, maps[0])
            quadratic, linear[: len(slope)] = expanded, slope
        return quadratic, linear

    def step(self, solutions: Sequence[ConicSolution], start: Iterate) -> float:
        """Measure by how much what counts changed last.

        That is the motion, by the effort of its change relative to its own, or the last variable in units of
        what would be noticed.
        """
        after = solutions[-1].x
        if self.effort_price is not None:
            last = float(after[-1])
            before = float(solutions[-2].x[-1]) if len(solutions) > 1 else math.inf
            noticed = WORTHWHILE * max(abs(last), LEAST_FRACTION)
            if self.widened:
                noticed = max(CHANGE * abs(last), FAR_FROM_ONE * abs(last - 1.0), TINY)
            return self.setup.options.step_tolerance * abs(last - before) / noticed
        columns, effort = slice(0, start.local.size), self.setup.effort
        moved = solutions[-2].x[columns] if len(solutions) > 1 else start.local.ravel()
        return float(np.sqrt(effort(after[columns] - moved) / effort(after[columns])))

    def approach(self, before: Iterate, after: Iterate) -> Iterate:
        """Go from one iterate towards the next, as far as the sway's cost resembles its expansion.

        It is exponential: from far below, a quadratic model leads to where it is steep beyond all measure.
        """
        if self.sway_cost.beta == 0.0:
            return after

        def exponent(iterate: Iterate) -> float:
            return float(self.sway_cost.exponents(self.setup.transcription.end_sway_found(iterate)).max())

        most, way = exponent(before) + self.setup.options.steeper, after.flat() - before.flat()
        while exponent(after) > most:
            way = 0.5 * way
            after = before.of_flat(before.flat() + way)
        return after


@attrs.frozen(kw_only=True, eq=False)
class ProgramSequence:
    """Where a sequence of programs for a goal ended."""

    goal: Goal
    verdict: ConicStatus
    iterate: Iterate
    solutions: tuple[ConicSolution, ...]
    step: float

    @property
    def setup(self) -> Setup:
        """The problem, transcribed, on its last mesh."""
        return self.goal.setup

    @property
    def iterations(self) -> int:
        """Number of programs."""
        return len(self.solutions)


def solve(
    problem: Problem,
    near: ProgramSequence | None = None,
    *,
    coarse: bool = False,
    options: DirectOptions | None = None,
) -> Solution:
    """Find the motion that minimises eq. (26) within the limits and leaves neither sway nor sensitivity.

    Parameters
    ----------
    problem : Problem
    near : ProgramSequence, optional
        A motion to begin at, on its mesh, in place of standing still.
    coarse : bool
        On the first mesh only, which tells as well whether there is a motion.
    options : DirectOptions, optional

    Returns
    -------
    Solution
        Never raises for a problem that has none: the status says why.
    """
    setup, redundant = set_up(problem, options=options)
    sway_cost, iterations = resolve_sway_cost(setup.problem)
    setup, start = begun_at(setup, near)

    def attempt(sway_limit: float | None) -> Solution:
        nonlocal setup, iterations, start
        behind = problem.nominal_overshoot
        goal = Goal(setup=setup, sway_cost=sway_cost, sway_limit=sway_limit, overshoot_limit=behind)
        if problem.limits.stated() and not coarse and setup.options.max_bisections:
            result = refined(start, goal)
        else:
            result = sequence(start, goal, COARSE_STEP if coarse else None)
            if result.verdict is ConicStatus.FAILED and not coarse:
                result = settled(result)
        setup, start, iterations = result.setup, result.iterate, iterations + result.iterations
        return conclude(result, iterations)

    return attrs.evolve(within_sway(problem, attempt), problem=problem, redundant=redundant)


def mirrored(problem: Problem) -> ProgramSequence:
    """Find where to begin in place of rest: the optimum of the linear model, to the other side.

    From rest the programs come to motions that swing little, if there are any; where swings are so great that
    their periods grow, others that swing farther may cost less, and these are found from there.
    """
    setup, _ = set_up(problem.without_limits())
    goal = Goal(setup=setup, sway_limit=None)
    linear = sequence(setup.transcription.rest(), goal, np.inf)
    return attrs.evolve(linear, iterate=linear.iterate.of_flat(-linear.iterate.flat()))


def without_limits(problem: Problem) -> ProgramSequence | None:
    """Find the better of the optima without limits that rest and `mirrored` lead to, if there is one."""
    (cost, _), begun = resolve_sway_cost(problem), mirrored(problem)
    goal = attrs.evolve(begun.goal, sway_cost=cost)
    ends = [sequence(start, goal) for start in (begun.setup.transcription.rest(), begun.iterate)]
    solved = [end for end in ends if end.verdict is ConicStatus.SOLVED]
    return min(solved, key=lambda end: end.setup.cost(end.iterate, cost), default=None)


def begun_at(setup: Setup, near: ProgramSequence | None) -> tuple[Setup, Iterate]:
    """Take over a motion with its mesh, if it is one of as many machines; else stand still."""
    if near is not None:
        alike = on_mesh(setup, near.setup.transcription.piece.length)
        if near.iterate.like(alike.transcription.rest()):
            return alike, near.iterate
    return setup, setup.transcription.rest()


def resolve_sway_cost(problem: Problem) -> tuple[SwayCost, int]:
    """Give β and γ their values, and count the iterations that it took."""
    if problem.sway_weight == 0.0 or problem.sway_scale is not None:
        return SwayCost(beta=problem.sway_weight, gamma=problem.sway_scale or 1.0), 0
    sway, effort, iterations = _unweighted(problem.of_least_effort())
    if not 0.0 < sway < np.inf:  # a hoist alone swings nothing
        return UNWEIGHTED, iterations
    beta = problem.sway_weight * 2.0 * effort / AUTO_EFFORT**2
    return SwayCost(beta=beta, gamma=AUTO_SWAY / sway), iterations


@remembered(lambda problem: problem)
def _unweighted(problem: Problem) -> tuple[float, float, int]:
    """Find the sway in m of a motion of least effort, its mean effort, and the iterations that it took."""
    solution = solve(problem)
    if (found := solution.optimum) is None:
        return 0.0, 0.0, solution.iterations
    return sway_on_the_way(solution), found.cost / problem.duration, solution.iterations


def refined(start: Iterate, goal: Goal) -> ProgramSequence:
    """Solve programs on a mesh that is bisected as long as that pays and the work reaches.

    Where it does not reach, or the programs do not settle, the cheaper one is taken of the motion of least
    cost on the first mesh and the one next to the last, which is not quite of least cost.
    """
    begun: list[tuple[Iterate, Goal]] = []
    result = afford(lambda: _refined(start, goal, begun), BISECTING * left())
    if result is not None and (result.verdict is not ConicStatus.FAILED or not begun):
        return result
    if not begun:
        raise OutOfWork
    # where the finest mesh takes too much work, one of half as many bisections may do
    near = None
    for mesh in dict.fromkeys([len(begun) - 1, len(begun) // 2]):
        near = near or afford(partial(near_by, *begun[mesh]), NEXT_TO_IT * left())
    first = afford(lambda: sequence(*begun[0]), SETTLING * left())
    ends = [end for end in (near, first, result) if end is not None]
    if not ends:
        raise OutOfWork

    def rank(end: ProgramSequence) -> tuple[bool, float]:
        return end.verdict is not ConicStatus.SOLVED, end.setup.cost(end.iterate, goal.sway_cost)

    return min(ends, key=rank)


def near_by(start: Iterate, goal: Goal, tolerance: float | None = None) -> ProgramSequence:
    """Find the motion next to one that does not quite follow the equations yet.

    Programs for the least cost settle slowly, or not at all, where equations bend much and limits bind. Those
    for the least departure do so in a few steps, and cost hardly more if the motion was nearly the cheapest.
    """
    return sequence(start, attrs.evolve(goal, nearest=start), tolerance)


def next_to(problem: Problem, near: ProgramSequence) -> ProgramSequence:
    """Find the motion next to one near by, on its mesh, that follows the equations and keeps the limits."""
    sway_cost, _ = resolve_sway_cost(problem)
    setup, start = begun_at(set_up(problem)[0], near)
    limits = problem.nominal_sway, problem.nominal_overshoot
    goal = Goal(setup=setup, sway_cost=sway_cost, sway_limit=limits[0], overshoot_limit=limits[1])
    return near_by(start, goal, FOLLOWED_STEP)


def settled(result: ProgramSequence) -> ProgramSequence:
    """Begin again at the motion next to one at which programs did not settle."""
    near = near_by(result.iterate, result.goal)
    if near.verdict is not ConicStatus.SOLVED:
        return result
    again = sequence(near.iterate, result.goal)
    return attrs.evolve(again, solutions=result.solutions + near.solutions + again.solutions)


def _refined(start: Iterate, goal: Goal, begun: list[tuple[Iterate, Goal]]) -> ProgramSequence:
    """Bisect a mesh where limits begin or cease to bind, and list what was begun on which mesh."""
    solutions: tuple[ConicSolution, ...] = ()
    cost = float("inf")
    for _ in range(goal.setup.options.max_bisections):
        result = sequence(start, goal, ROUGH_STEP)
        solutions += result.solutions
        if result.verdict is not ConicStatus.SOLVED:
            break
        start, before, cost = result.iterate, cost, goal.setup.cost(result.iterate, goal.sway_cost)
        begun.append((start, goal))
        where = switching(goal.setup, start, goal.on_the_way)
        if abs(before - cost) < goal.setup.options.worth_bisecting * cost or not where.any():
            break
        finer, start = bisected(goal.setup, start, where)
        goal = attrs.evolve(goal, setup=finer)
    else:
        begun.append((start, goal))
    for start, goal in reversed(begun):  # where programs on the finest mesh fail, a coarser one does
        result = sequence(start, goal)
        solutions += result.solutions
        if result.verdict is ConicStatus.SOLVED:
            break
    return attrs.evolve(result, solutions=solutions)


@one_thread
def sequence(start: Iterate, goal: Goal, tolerance: float | None = None) -> ProgramSequence:
    """Solve programs linearised about one another's motion until what counts changes by little enough."""
    transcription, iterate, options = goal.setup.transcription, start, goal.setup.options
    tolerance = tolerance or options.step_tolerance
    solutions: list[ConicSolution] = []
    points: list[Array] = []
    images: list[Array] = []
    step, verdict, workspace = float("inf"), ConicStatus.FAILED, Workspace()
    while verdict is ConicStatus.FAILED and len(solutions) < options.max_iterations:
        maps = transcription.maps(iterate)
        program = transcription.program(maps, goal.extra, workspace)
        cost = goal.pose(program, iterate, maps)
        if not goal.setup.sees_all:
            cost = goals.held(*cost, transcription, iterate)
        solutions.append(program.solve(*cost, sharp=goal.effort_price is not None))
        if solutions[-1].verdict is not ConicStatus.SOLVED:
            verdict = solutions[-1].verdict
            break
        before, step = step, goal.step(solutions, start)
        points.append(iterate.flat())
        iterate = transcription.iterate(solutions[-1].x, maps)
        images.append(iterate.flat())
        off = step
        if goal.effort_price is None and not goal.setup.tried and step < SLOW_STEPS * before < math.inf:
            off *= max(step / before, BELIEVED)  # as steps go on to shrink
        if off < tolerance or _stalled(step, before, exact=solutions[-1].exact):
            verdict = ConicStatus.SOLVED
        else:
            if step > SLOW_STEPS * before:
                iterate = iterate.of_flat(accelerate(points, images, transcription.importance))
            iterate = goal.approach(iterate.of_flat(points[-1]), iterate)
    return ProgramSequence(goal=goal, verdict=verdict, iterate=iterate, solutions=tuple(solutions), step=step)


def _stalled(step: float, before: float, *, exact: bool) -> bool:
    shrinks = step < 0.5 * before
    return (step < STALLED and not (shrinks and exact)) or (step < STALLED_INEXACT and not (shrinks or exact))


def conclude(result: ProgramSequence, iterations: int) -> Solution:
    """Turn the outcome of programs into a solution."""
    problem = result.setup.problem
    status, advice = Status.CONVERGED, ""
    if result.verdict is ConicStatus.INFEASIBLE:  # on this mesh, about this motion
        status, advice = Status.DIVERGED, WIDER
    elif result.verdict is not ConicStatus.SOLVED:
        status, advice = Status.DIVERGED, LATER
    elif greatest_angle(result) > HORIZONTAL:
        status, advice = Status.SWINGS_TOO_FAR, LONGER
    return Solution(
        status=status,
        method=METHOD,
        problem=problem,
        optimum=_optimum(result) if status is Status.CONVERGED else None,
        iterations=iterations,
        residual=result.step,
        advice=advice,
    )


def _optimum(result: ProgramSequence) -> Optimum:
    """Return to SI units."""
    problem, transcription = result.setup.problem, result.setup.transcription
    piece, reach, duration = transcription.piece, axis_reach(problem), problem.duration
    intervals, axes = transcription.intervals, len(reach)
    local = result.iterate.local.reshape(intervals, axes, piece.size)
    lengths = duration * piece.length
    instants = np.append(0.0, np.cumsum(piece.length))
    knots = duration * (instants / instants[-1])  # the last one is the duration, to the last bit
    control = np.einsum("pb,kab->kpa", power_basis(3), local[:, :, piece.order :])
    equations, points = transcription.machines[0].equations, transcription.nominal_points(result.iterate)
    states, costates = _nodes(result)
    return Optimum(
        knots=knots,
        states=states,
        costates=costates,
        hamiltonian=None,
        top_derivative=control
        * (reach / duration**piece.order)
        / lengths[:, None, None] ** np.arange(control.shape[1])[:, None],
        top_order=piece.order,
        sway=equations.sway(*points)[:, :, 0],
        angle=greatest_angle(result),
        cost=result.setup.cost(result.iterate, result.goal.sway_cost),
        sway_weight=result.goal.sway_cost.beta,
        sway_scale=result.goal.sway_cost.gamma,
        defect=None,
        hamiltonian_variation=None,
    )


def _nodes(result: ProgramSequence) -> tuple[Array, Array]:
    """Read the nominal machine's states and costates at the nodes off a program, in SI units.

    A costate is what the cost would lose if its state were displaced there, which is the multiplier of the
    constraint that carries the state to the node.
    """
    problem, transcription = result.setup.problem, result.setup.transcription
    piece, reach, duration = transcription.piece, axis_reach(problem), problem.duration
    axes, orders, intervals = len(reach), piece.order, transcription.intervals
    x, multipliers, scale = (
        result.solutions[-1].x,
        result.solutions[-1].multipliers,
        transcription.machines[0].scale,
    )
    local = x[: intervals * transcription.breadth].reshape(intervals, axes, piece.size)
    last = np.stack([piece.derivative(order)[-1, -1] for order in range(orders)])
    moved = np.concatenate([local[:, :, :orders], (local[-1:] @ last.T)])
    moved_costates = np.concatenate([-multipliers[0], multipliers[1]]).reshape(intervals + 1, axes, orders)
    units = reach[:, None] / duration ** np.arange(orders)
    swung, swung_costates = transcription.nodes(x), -multipliers[2].reshape(intervals + 1, -1)
    half = 2 * len(problem.plant.unactuated)

    def in_order(pendulum: Array, chain: Array) -> Array:
        by_order = chain.transpose(0, 2, 1).reshape(intervals + 1, -1)
        return np.concatenate([pendulum[:, :half], by_order, pendulum[:, half:]], axis=1)

    start = np.zeros((axes, orders))
    start[:, 0] = problem.start
    return (
        in_order(swung * scale, moved * units + start),
        result.setup.cost_scale * duration * in_order(swung_costates / scale, moved_costates / units),
    )


def greatest_angle(result: ProgramSequence) -> float:
    """Greatest rope angle of the nominal machine at the collocation points, in rad."""
    transcription = result.setup.transcription
    angles = transcription.machines[0].equations.angle(*transcription.nominal_points(result.iterate))
    return float(np.abs(angles).max())
