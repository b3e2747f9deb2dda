"""The indirect method for machines that swing far, or have modes too fast to follow.

1. With β = 0 the problem is nearly linear, and Newton's method converges from the linear model's optimum;
   where angles are large it is led there through shorter moves.
2. From there to the β asked for, at once where that converges, else through smaller ones.
3. All this on a coarse mesh, which smooths the way. What it gave is then refined: intervals on which the
   Hamiltonian drifts or the canonical equations are missed are split.
"""

from __future__ import annotations

import math

import attrs
import numpy as np

from gen_profile.problem.limits import rounded_up
from gen_profile.problem.problem import Problem
from gen_profile.solvers.collocation import GAUSS, RADAU, Scheme, Trajectory
from gen_profile.solvers.indirect.boundary_value_problem import BoundaryValueProblem, quintic, with_sway_cost
from gen_profile.solvers.indirect.continuation import advance
from gen_profile.solvers.indirect.extremal import failure, judged, too_steep
from gen_profile.solvers.indirect.newton import NewtonOutcome, solve_newton
from gen_profile.solvers.indirect.refinement import refine
from gen_profile.solvers.solution import Solution, Status

INTERVALS = 30
RADIANS_PER_INTERVAL = 1.0  # of the fastest mode that matters, to judge a solution by
COARSER = 2.5  # times as long are intervals to begin with
LEVELS = 3  # of coarse meshes, each with half the intervals' length
LONGER = 1.1 ** np.arange(1, 60)  # times the duration, to look for one that is long enough
MAX_INTERVALS = 480
BETA_DECADES = 8.0  # from share 0 to 1
HORIZONTAL = np.pi / 2.0
MODERATE_ANGLE = np.pi / 4.0  # up to which Newton's method hardly fails
SMALL_ANGLE = np.radians(50.0)  # of the linear model; from there on nonlinearity is blamed where Newton fails


def solve_by_homotopy(problem: Problem, quiet: BoundaryValueProblem) -> Solution:
    """Begin on a coarse mesh, which smooths the way; where it misleads, on finer ones."""
    fine = float(np.clip(quiet.phase / RADIANS_PER_INTERVAL, INTERVALS, MAX_INTERVALS))
    iterations = 0
    for level in range(LEVELS):
        intervals = min(MAX_INTERVALS, math.ceil(2**level * fine / COARSER))
        try:
            solution = _on_mesh(problem, quiet, intervals, math.ceil(fine))
        except np.linalg.LinAlgError:
            cure = "The end conditions contradict one another; allow more time."
            solution = failure(problem, Status.DIVERGED, 1, cure)
        iterations += solution.iterations
        if solution.status is not Status.DIVERGED:
            break
    return attrs.evolve(solution, iterations=iterations)


def _on_mesh(problem: Problem, quiet: BoundaryValueProblem, coarse: int, fine: int) -> Solution:
    """Follow the solution from the linear model's to that with the β asked for."""
    guess = quintic(quiet, np.linspace(0.0, 1.0, coarse + 1), _scheme(quiet))
    quiet, linear = quiet.rescaled(quiet.solve_linear(quiet.flow(guess.points), guess))
    approach = advance(quiet.towards, linear, linear.scaled(0.0))
    iterations = approach.iterations
    if approach.reached < 1.0 or quiet.greatest_angle(approach.solution) > HORIZONTAL:
        return _too_hard(problem, quiet, linear, iterations)
    still, guess = quiet.rescaled(approach.solution)
    measured, spent = _measured(problem, still, guess, fine)
    iterations += spent
    weighted = with_sway_cost(problem, still, measured)
    climb = advance(lambda share: _lighter(weighted, share), guess)
    iterations += climb.iterations
    if climb.reached < 1.0:
        return _too_heavy(problem, iterations, climb.reached)
    refined = refine(weighted, climb.solution, fine)
    iterations += refined.iterations
    if refined.solution is None and problem.sway_weight > 0.0:
        return too_steep(problem, iterations)
    if refined.solution is None:  # a finer mesh may do
        return attrs.evolve(_too_hard(problem, quiet, linear, iterations), status=Status.DIVERGED)
    if weighted.greatest_angle(refined.solution) > HORIZONTAL:
        return _too_hard(problem, quiet, linear, iterations)
    return judged(problem, weighted, refined.solution, iterations, refined.residual or climb.residual)


def _slower(quiet: BoundaryValueProblem, linear: Trajectory, factor: float) -> NewtonOutcome:
    """Solve for a longer duration, from the linear model's solution for that."""
    slower, rest = quiet.slower(factor), linear.scaled(0.0)
    return solve_newton(slower, slower.solve_linear(slower.flow(rest.points), rest))


def _scheme(canonical: BoundaryValueProblem) -> Scheme:
    """Let modes fade that are too fast for any mesh."""
    return GAUSS if canonical.resolved else RADAU


def _measured(
    problem: Problem, quiet: BoundaryValueProblem, coarse: Trajectory, fine: int
) -> tuple[Trajectory, int]:
    """Find the motion with β = 0 as exactly as what is measured by it needs; also count the iterations."""
    if problem.sway_weight == 0.0 or problem.sway_scale is not None:
        return coarse, 0
    refined = refine(quiet, coarse, fine)
    return refined.solution or coarse, refined.iterations


def _lighter(weighted: BoundaryValueProblem, share: float) -> BoundaryValueProblem:
    """Pose the same problem with a β that is smaller by decades."""
    beta = weighted.data.beta * 10.0 ** (BETA_DECADES * (share - 1.0))
    return attrs.evolve(weighted, data=attrs.evolve(weighted.data, beta=beta))


def _too_hard(problem: Problem, quiet: BoundaryValueProblem, linear: Trajectory, iterations: int) -> Solution:
    """Blame the swing where the linear model leaves the small angles, else the solver; name a duration."""
    small = quiet.greatest_angle(linear) < SMALL_ANGLE
    status = Status.DIVERGED if small else Status.SWINGS_TOO_FAR
    for factor in LONGER:
        found = _slower(quiet, linear, factor).solution
        if found is not None and quiet.slower(factor).greatest_angle(found) < MODERATE_ANGLE:
            enough = rounded_up(factor * problem.duration)
            cure = f"Allow about {enough} s (move.duration), or shorten the move."
            return failure(problem, status, iterations, cure)
    return failure(problem, status, iterations, "Allow more time: raise move.duration.")


def _too_heavy(problem: Problem, iterations: int, reached: float) -> Solution:
    """Blame the weight of the sway, and name one that works; there is none where nothing was reached."""
    share = 10.0 ** (BETA_DECADES * (reached - 1.0))
    named = f" (about {problem.sway_weight * share:.2g} works)" if reached > 0.0 else ""
    return too_steep(problem, iterations, named)
