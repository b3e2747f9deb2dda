"""The indirect method by the full Newton's method, for machines that swing far or have very fast modes.

1. With β = 0 the problem is nearly linear, and Newton's method converges from the linear model's optimum.
2. From there it converges to the β asked for.
3. All this on a coarse mesh, which smooths the way. What it gave is then refined: intervals on which the
   Hamiltonian drifts or the canonical equations are missed are split.
"""

from __future__ import annotations

import math

import numpy as np

from gen_profile.problem.problem import Problem
from gen_profile.solvers.collocation import GAUSS, RADAU
from gen_profile.solvers.indirect.boundary_value_problem import BoundaryValueProblem, quintic, with_sway_cost
from gen_profile.solvers.indirect.extremal import failure, judged, too_steep
from gen_profile.solvers.indirect.newton import solve_newton
from gen_profile.solvers.indirect.refinement import refine
from gen_profile.solvers.solution import HORIZONTAL, LONGER, Solution, Status

INTERVALS = 30  # at least
RADIANS_PER_INTERVAL = 1.0  # of the fastest mode that matters, to judge a solution by
COARSER = 2.5  # times as long are intervals to begin with
SMALL_ANGLE = np.radians(50.0)  # of the linear model; from there on nonlinearity is blamed where Newton fails


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
