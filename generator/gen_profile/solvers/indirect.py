"""Indirect method: Pontryagin's conditions solved as a two-point boundary value problem.

Most machines swing so little that one linear model leads to the solution, on few long intervals and within
milliseconds (`solvers.simplified_newton`). Where it does not, the solution is sought by homotopy, on meshes
as fine as it takes (`solvers.homotopy`).
"""

from __future__ import annotations

import math

import attrs
import numpy as np

from gen_profile.one_thread import one_thread
from gen_profile.problem.pontryagin import optimality_system
from gen_profile.problem.problem import Problem
from gen_profile.solvers.canonical import (
    Canonical,
    canonical_problem,
    independence,
    quintic,
    with_sway_cost,
)
from gen_profile.solvers.collocation import LONG_GAUSS, Trajectory, sampled
from gen_profile.solvers.extremal import METHOD, judged
from gen_profile.solvers.homotopy import MODERATE_ANGLE, solve_by_homotopy
from gen_profile.solvers.newton import NewtonOutcome
from gen_profile.solvers.refinement import refine
from gen_profile.solvers.simplified_newton import solve_simplified
from gen_profile.solvers.solution import Solution

__all__ = ["METHOD", "solve"]

LONG_INTERVALS = 10  # at least
RADIANS_PER_LONG_INTERVAL = 5.0  # of the fastest mode that matters


def solve(problem: Problem, near: Trajectory | None = None) -> Solution:
    """Find the motion that minimises eq. (26) and leaves neither sway nor sensitivity.

    Parameters
    ----------
    problem : Problem
    near : Trajectory, optional
        Of the solution of a similar problem, to begin at.

    Returns
    -------
    Solution
        Where there is none, the status says why.

    Raises
    ------
    InfeasibleProblem
        The machine does not hang at rest, so that it has no natural frequencies.
    """
    with one_thread():
        return _solve(problem, near)


def _solve(problem: Problem, near: Trajectory | None) -> Solution:
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    quiet = canonical_problem(problem, system)
    asked, redundant = independence(quiet)
    if redundant:
        kept = tuple(name for name in problem.desensitized if name not in redundant)
        solution = _solve(attrs.evolve(problem, desensitized=kept), near)
        return attrs.evolve(solution, problem=problem, redundant=redundant)
    quiet = attrs.evolve(quiet, final=np.where(asked, quiet.final, np.nan))
    useful = near is not None and near.size == 2 * len(quiet.final) and problem.sway_weight > 0.0
    near = near if useful else None
    for start in dict.fromkeys((near, None)):
        try:
            found = _solve_simply(problem, quiet, start)
        except np.linalg.LinAlgError:
            continue
        if found is not None:
            return found
    return solve_by_homotopy(problem, quiet, near)


def _solve_simply(problem: Problem, quiet: Canonical, near: Trajectory | None) -> Solution | None:
    """Solve with few long intervals and one linear model; there is none where the machine swings too far.

    Raises
    ------
    numpy.linalg.LinAlgError
        When it swings so far that equations overflow.
    """
    if not quiet.resolved:
        return None
    intervals = max(LONG_INTERVALS, math.ceil(quiet.phase / RADIANS_PER_LONG_INTERVAL))
    mesh = np.linspace(0.0, 1.0, intervals + 1)
    start = quintic(quiet, mesh, LONG_GAUSS)
    measured, weighted = NewtonOutcome(solution=start, iterations=0, residual=0.0), quiet
    if problem.sway_weight > 0.0:
        if problem.sway_scale is None:
            measured = solve_simplified(quiet, start)
        if measured.solution is None:
            return None
        weighted = with_sway_cost(problem, quiet, measured.solution)
    if near is not None:
        start = quiet.modal(sampled(near, LONG_GAUSS, mesh))
    found = solve_simplified(weighted, start)
    if found.solution is None:
        return None
    refined = refine(weighted, found.solution, solve=solve_simplified)
    if refined.solution is None:
        return None
    iterations = measured.iterations + found.iterations + refined.iterations
    solution = judged(problem, weighted, refined.solution, iterations, refined.residual or found.residual)
    return solution if solution.optimum is None or solution.optimum.angle < MODERATE_ANGLE else None
