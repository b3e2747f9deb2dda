"""Indirect method: Pontryagin's conditions solved as a two-point boundary value problem.

1. With β = 0 the problem is nearly linear, and Newton's method converges from the linear model's optimum;
   where angles are large it is led there through shorter moves.
2. From there to the β asked for, at once where that converges, else through smaller ones.
3. Mesh intervals on which the Hamiltonian drifts or the canonical equations are missed are split.
"""

from __future__ import annotations

import attrs
import numpy as np
from numpy.polynomial import polynomial

from gen_profile.metrics import peak
from gen_profile.problem.pontryagin import optimality_system
from gen_profile.problem.problem import AUTO_EFFORT, AUTO_SWAY, Problem
from gen_profile.profile import Array
from gen_profile.solvers.canonical import Canonical, canonical_problem, independence
from gen_profile.solvers.collocation import GAUSS, INTERPOLATION, STAGES, Trajectory, stage_times
from gen_profile.solvers.continuation import Advance, advance
from gen_profile.solvers.newton import solve_newton
from gen_profile.solvers.refinement import defect, refine
from gen_profile.solvers.solution import Optimum, Solution, Status

METHOD = "indirect"
INTERVALS = 30
MAX_INTERVALS = 480
RADIANS_PER_INTERVAL = 1.0  # of the fastest mode that matters, to begin with
SWAY_SAMPLES = 1001
BETA_DECADES = 8.0  # from share 0 to 1
HORIZONTAL = np.pi / 2.0
UNRESOLVED = 0.1  # defect, as a share of a state's size, of a mesh that does not follow the motion
TOLERATED_MISS = 1e-3  # of the greatest sway, by an end condition that the linear model implies
MODERATE_ANGLE = np.pi / 4.0  # that a cure aims at
SMALL_ANGLE = np.radians(50.0)  # of the linear model; from there on nonlinearity is blamed where Newton fails


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
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    quiet = canonical_problem(problem, system)
    asked, redundant = independence(quiet)
    if redundant:
        kept = tuple(name for name in problem.desensitized if name not in redundant)
        solution = solve(attrs.evolve(problem, desensitized=kept), near)
        return attrs.evolve(solution, problem=problem, redundant=redundant)
    return _solve(problem, attrs.evolve(quiet, final=np.where(asked, quiet.final, np.nan)), near)


def _solve(problem: Problem, quiet: Canonical, near: Trajectory | None) -> Solution:
    """Follow the solution from the linear model's to that with the β asked for."""
    try:
        guess = _guess(quiet)
        quiet, guess = quiet.rescaled(quiet.solve_linear(quiet.flow(guess.points), guess))
    except np.linalg.LinAlgError:
        return _failure(
            problem, Status.DIVERGED, 1, "The end conditions contradict one another; allow more time."
        )
    linear_angle = quiet.greatest_angle(guess)
    approach = advance(quiet.towards, guess, guess.scaled(0.0))
    if approach.reached < 1.0 or quiet.greatest_angle(approach.solution) > HORIZONTAL:
        return _too_hard(problem, approach.iterations, linear_angle)
    quiet, guess = quiet.rescaled(approach.solution)
    weighted = _with_sway_cost(problem, quiet, guess)
    climb = _beside(weighted, guess, near) or _climb(weighted, guess)
    climb = attrs.evolve(climb, iterations=approach.iterations + climb.iterations)
    if climb.reached < 1.0 and linear_angle < SMALL_ANGLE:
        return _too_heavy(problem, climb.iterations, climb.reached)
    if climb.reached < 1.0:
        return _too_hard(problem, climb.iterations, linear_angle)
    return _resolved(problem, weighted, climb, linear_angle)


def _resolved(problem: Problem, weighted: Canonical, climb: Advance, linear_angle: float) -> Solution:
    """Refine the mesh, and accept the solution where it stands up to a look between the mesh's points."""
    refined = refine(weighted, climb.solution)
    best, iterations = refined.solution or climb.solution, climb.iterations + refined.iterations
    if weighted.greatest_angle(best) > HORIZONTAL:
        return _too_hard(problem, iterations, linear_angle)
    if weighted.missed(best) > TOLERATED_MISS:
        cure = "Check the machine's equations and parameters."
        return _failure(problem, Status.NOT_CONTROLLABLE, iterations, cure)
    optimum = _optimum(weighted, best)
    if optimum.defect is not None and optimum.defect > UNRESOLVED:
        return _unresolved(problem, iterations)
    return Solution(
        status=Status.CONVERGED,
        method=METHOD,
        problem=problem,
        optimum=optimum,
        iterations=iterations,
        residual=refined.residual or climb.residual,
        trajectory=weighted.dimensionless(best),
    )


def _climb(weighted: Canonical, guess: Trajectory) -> Advance:
    """Raise β to what is asked for; on a coarser mesh, which smooths the way, where a fine one fails."""
    fine = advance(lambda share: _lighter(weighted, share), guess)
    if fine.reached == 1.0 or len(guess.mesh) <= INTERVALS + 1:
        return fine
    coarse = advance(lambda share: _lighter(weighted, share), guess.on(np.linspace(0.0, 1.0, INTERVALS + 1)))
    better = max(fine, coarse, key=lambda climb: climb.reached)
    return attrs.evolve(better, iterations=fine.iterations + coarse.iterations)


def _beside(weighted: Canonical, guess: Trajectory, near: Trajectory | None) -> Advance | None:
    """Find the solution from that of a similar problem, if that lies near enough."""
    if near is None or near.size != guess.size or weighted.data.beta == 0.0:
        return None
    outcome = solve_newton(weighted, weighted.modal(near.on(guess.mesh)))
    if outcome.solution is None:
        return None
    return Advance(
        solution=outcome.solution, reached=1.0, iterations=outcome.iterations, residual=outcome.residual
    )


def _guess(canonical: Canonical) -> Trajectory:
    """Move by a quintic, everything else at rest."""
    layout = canonical.system.layout
    quintic = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])

    def states(times: Array) -> Array:
        z = np.zeros((len(times), 2 * layout.size))
        for order in range(layout.orders):
            values = polynomial.polyval(times, polynomial.polyder(quintic, order))
            z[:, layout.axis(order)] = values[:, None] * canonical.final[layout.axis(0)]
        return z

    intervals = int(np.clip(np.ceil(canonical.phase / RADIANS_PER_INTERVAL), INTERVALS, MAX_INTERVALS))
    mesh = np.linspace(0.0, 1.0, intervals + 1)
    stages = states(stage_times(mesh)).reshape(intervals, STAGES, -1)
    return Trajectory(mesh=mesh, nodes=states(mesh), stages=stages)


def _with_sway_cost(problem: Problem, quiet: Canonical, solution: Trajectory) -> Canonical:
    beta, gamma = problem.sway_weight, problem.sway_scale
    if beta == 0.0:
        return quiet
    if gamma is None:
        between = quiet.quantities(solution(np.linspace(0.0, 1.0, SWAY_SAMPLES)))
        sway = between[:, 2 + quiet.system.layout.m :][:, problem.plant.end_load]
        largest = float(peak(np.linalg.norm(sway, axis=1, keepdims=True))[0])
        if largest == 0.0:  # a hoist alone swings nothing
            return quiet
        gamma = AUTO_SWAY / largest
        beta *= 2.0 * _integral(solution, quiet.quantities(solution.points)[:, 1]) / AUTO_EFFORT**2
    return attrs.evolve(quiet, data=attrs.evolve(quiet.data, beta=beta, gamma=gamma))


def _lighter(weighted: Canonical, share: float) -> Canonical:
    """Pose the same problem with a β that is smaller by decades."""
    beta = weighted.data.beta * 10.0 ** (BETA_DECADES * (share - 1.0))
    return attrs.evolve(weighted, data=attrs.evolve(weighted.data, beta=beta))


def _integral(solution: Trajectory, values: Array) -> float:
    """∫ over dimensionless time of values at the collocation points, shape (points,)."""
    weights = np.diff(solution.mesh)[:, None] * GAUSS.b
    return float(weights.ravel() @ values)


def _optimum(canonical: Canonical, solution: Trajectory) -> Optimum:
    """Return to SI units."""
    system, data = canonical.system, canonical.data
    layout, n, m = system.layout, system.layout.size, system.layout.m
    loads = len(system.plant.loads)
    nodes = canonical.unknowns(solution.nodes)
    at_nodes, at_points = canonical.quantities(solution.nodes), canonical.quantities(solution.points)
    knots = data.duration * solution.mesh
    top = np.concatenate(
        [at_nodes[:-1, None, 2 : 2 + m], at_points[:, 2 : 2 + m].reshape(-1, STAGES, m)], axis=1
    )
    unit_time = np.einsum("pv,kva->kpa", INTERPOLATION, top)
    hamiltonian = at_nodes[:, 0]
    return Optimum(
        knots=knots,
        states=data.offset + data.scale * nodes[:, :n],
        costates=data.cost_scale * data.duration / data.scale * nodes[:, n:],
        hamiltonian=hamiltonian,
        top_derivative=unit_time / np.diff(knots)[:, None, None] ** np.arange(STAGES + 1)[:, None],
        top_order=layout.orders,
        sway=at_points[:, 2 + m : 2 + m + loads],
        angle=canonical.greatest_angle(solution),
        cost=data.duration * (_integral(solution, at_points[:, 1]) + data.beta),
        sway_weight=data.beta,
        sway_scale=data.gamma,
        defect=float(defect(canonical, solution).max()),
        hamiltonian_variation=float(np.ptp(hamiltonian) / np.abs(hamiltonian).max()),
    )


def _too_hard(problem: Problem, iterations: int, linear_angle: float) -> Solution:
    """Blame the swing where the linear model leaves the small angles, else the solver."""
    if linear_angle < SMALL_ANGLE:
        return _failure(problem, Status.DIVERGED, iterations, "Allow more time: raise move.duration.")
    enough = problem.duration * max(1.1, np.sqrt(linear_angle / MODERATE_ANGLE))
    cure = f"Allow about {enough:.2g} s (move.duration), or shorten the move."
    return _failure(problem, Status.SWINGS_TOO_FAR, iterations, cure)


def _too_heavy(problem: Problem, iterations: int, reached: float) -> Solution:
    """Blame the weight of the sway, and name one that works."""
    share = 10.0 ** (BETA_DECADES * (reached - 1.0))
    cure = f"Lower cost.sway_weight (about {problem.sway_weight * share:.2g} works)"
    cure += "." if problem.sway_scale is None else ', or set cost.sway_scale = "auto".'
    return _failure(problem, Status.DIVERGED, iterations, cure)


def _unresolved(problem: Problem, iterations: int) -> Solution:
    """Blame a cost so steep that the motion changes faster than any mesh."""
    cure = "Lower cost.sway_weight"
    cure += "." if problem.sway_scale is None else ', or set cost.sway_scale = "auto".'
    return _failure(problem, Status.DIVERGED, iterations, cure)


def _failure(problem: Problem, status: Status, iterations: int, cure: str) -> Solution:
    return Solution(
        status=status,
        method=METHOD,
        problem=problem,
        optimum=None,
        iterations=iterations,
        residual=float("inf"),
        cure=cure,
    )
