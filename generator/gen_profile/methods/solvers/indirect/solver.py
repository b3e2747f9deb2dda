"""Indirect method: Pontryagin's conditions solved as a two-point boundary value problem.

Most machines swing so little that one linear model leads to the solution, on few long intervals and within
milliseconds (`solvers.simplified_newton`). Where it does not, as for machines that swing far or have very
fast modes, the full Newton's method takes over:

1. With β = 0 the problem is nearly linear, and Newton's method converges from the linear model's optimum.
2. From there it converges to the β asked for.
3. All this on a coarse mesh, which smooths the way. What it gave is then refined: intervals on which the
   Hamiltonian drifts or the canonical equations are missed are split.
"""

import math
from contextlib import suppress

import attrs
import numpy as np

from gen_profile.dynamics.problem.pontryagin import optimality_system
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.collocation import GAUSS, LONG_GAUSS, RADAU, Trajectory
from gen_profile.methods.solvers.indirect.boundary_value_problem import (
    USUAL,
    BoundaryValueProblem,
    IndirectOptions,
    canonical_problem,
    independence,
    quintic,
    with_sway_cost,
    without,
)
from gen_profile.methods.solvers.indirect.extremal import failure, judged, too_steep
from gen_profile.methods.solvers.indirect.newton import NewtonOutcome, solve_newton
from gen_profile.methods.solvers.indirect.refinement import refine
from gen_profile.methods.solvers.indirect.simplified_newton import solve_simplified
from gen_profile.methods.solvers.solution import HORIZONTAL, LATER, LONGER, Solution, Status
from gen_profile.support.one_thread import one_thread
from gen_profile.support.remembered import remembered

INTERVALS = 30  # at least
RADIANS_PER_INTERVAL = 1.0  # of the fastest mode that matters, to judge a solution by
COARSER = 2.5  # times as long are intervals to begin with
SMALL_ANGLE = np.radians(50.0)  # of the linear model; from there on nonlinearity is blamed where Newton fails
MODERATE_ANGLE = np.pi / 4.0  # up to which Newton's method hardly fails


def solve_fully(problem: Problem, unweighted: BoundaryValueProblem) -> Solution:
    """Follow the solution from the linear model's to that with the β asked for.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the end conditions contradict one another.
    """
    options, phase = unweighted.options, unweighted.phase
    least = max(INTERVALS, options.intervals)
    fine = float(np.clip(phase / RADIANS_PER_INTERVAL, least, options.max_intervals))
    scheme = GAUSS if unweighted.resolved else RADAU  # lets modes fade that are too fast for any mesh
    guess = quintic(unweighted, np.linspace(0.0, 1.0, math.ceil(fine / COARSER) + 1), scheme)
    unweighted, linear = unweighted.rescaled(unweighted.solve_linear(unweighted.flow(guess.points), guess))
    small = unweighted.greatest_angle(linear) < SMALL_ANGLE
    blamed = Status.DIVERGED if small else Status.SWINGS_TOO_FAR
    still = solve_newton(unweighted, linear)
    if still.solution is None or unweighted.greatest_angle(still.solution) > HORIZONTAL:
        return failure(problem, blamed, still.iterations, LONGER)
    unweighted, coarse = unweighted.rescaled(still.solution)
    measured, iterations = coarse, still.iterations
    if problem.sway_weight > 0.0 and problem.sway_scale is None:  # the scale is measured on this motion
        refined = refine(unweighted, coarse, solve_newton, math.ceil(fine))
        measured, iterations = refined.solution or coarse, iterations + refined.iterations
    weighted = with_sway_cost(problem, unweighted, measured)
    costed = solve_newton(weighted, coarse)
    iterations += costed.iterations
    if costed.solution is None:
        return too_steep(problem, iterations)
    refined = refine(weighted, costed.solution, solve_newton, math.ceil(fine))
    iterations += refined.iterations
    if refined.solution is None and problem.sway_weight > 0.0:
        return too_steep(problem, iterations)
    if refined.solution is None or weighted.greatest_angle(refined.solution) > HORIZONTAL:
        return failure(problem, blamed, iterations, LONGER)
    return judged(problem, weighted, refined.solution, iterations, refined.residual or costed.residual)


def solve(problem: Problem, options: IndirectOptions = USUAL, *, simply: bool = False) -> Solution:
    """Find the motion that minimises eq. (26) and leaves neither sway nor sensitivity.

    Parameters
    ----------
    problem : Problem
    options : IndirectOptions
    simply : bool
        By the simplified Newton's method only.

    Returns
    -------
    Solution
        Where there is none, the status says why.

    Raises
    ------
    InfeasibleProblem
        The machine does not hang at rest, so that it has no natural frequencies.
    """
    return attrs.evolve(_solved(problem.without_limits(), options, simply=simply), problem=problem)


@remembered(lambda problem, options, *, simply: (problem, options, simply))
@one_thread
def _solved(problem: Problem, options: IndirectOptions, *, simply: bool) -> Solution:
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    unweighted = canonical_problem(problem, system)
    asked, redundant = independence(unweighted)
    if redundant:
        return attrs.evolve(_solved(without(problem, redundant), options, simply=simply), redundant=redundant)
    final = np.where(asked, unweighted.final, np.nan)
    unweighted = attrs.evolve(unweighted, final=final, options=options)
    with suppress(np.linalg.LinAlgError):
        simple = _solve_simply(problem, unweighted)
        if simple is not None:
            return simple
    if simply:
        return failure(problem, Status.DIVERGED, 1, LATER)
    try:
        return solve_fully(problem, unweighted)
    except np.linalg.LinAlgError:
        advice = "The end conditions contradict one another; allow more time."
        return failure(problem, Status.DIVERGED, 1, advice)


def _solve_simply(problem: Problem, unweighted: BoundaryValueProblem) -> Solution | None:
    """Solve with few long intervals and one linear model; there is none where the machine swings too far.

    Raises
    ------
    numpy.linalg.LinAlgError
        When it swings so far that equations overflow.
    """
    if not unweighted.resolved:
        return None
    options = unweighted.options
    intervals = max(options.intervals, math.ceil(unweighted.phase / options.radians_per_interval))
    start, iterations = quintic(unweighted, np.linspace(0.0, 1.0, intervals + 1), LONG_GAUSS), 0
    if problem.sway_weight > 0.0 and problem.sway_scale is None:  # the scale is measured on this motion
        measured = _unweighted(problem, unweighted, start)
        if measured.solution is None:
            return None
        start, iterations = measured.solution, measured.iterations
    weighted = with_sway_cost(problem, unweighted, start)
    result = _refined(weighted, start)
    if result.solution is None:
        return None
    solution = judged(problem, weighted, result.solution, iterations + result.iterations, result.residual)
    return solution if solution.optimum is None or solution.optimum.angle < MODERATE_ANGLE else None


@remembered(lambda problem, unweighted, start: (attrs.evolve(problem, sway_weight=0.0), unweighted.options))
def _unweighted(problem: Problem, unweighted: BoundaryValueProblem, start: Trajectory) -> NewtonOutcome:
    """Solve a problem without its cost of the sway, whatever that is."""
    return _refined(unweighted, start)


def _refined(problem: BoundaryValueProblem, start: Trajectory) -> NewtonOutcome:
    """Solve on the start's mesh, then on finer ones as needed."""
    result = solve_simplified(problem, start)
    if result.solution is None:
        return result
    refined = refine(problem, result.solution, solve_simplified)
    return attrs.evolve(
        refined,
        iterations=result.iterations + refined.iterations,
        residual=refined.residual or result.residual,
    )
