"""What came of the canonical equations: judged, and in SI units."""

import numpy as np

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.collocation import Trajectory
from gen_profile.methods.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.methods.solvers.indirect.refinement import defect
from gen_profile.methods.solvers.solution import Optimum, Solution, Status

METHOD = "indirect"
# defect, as a fraction of a state's size, of a mesh that does not follow the motion; so do 0.3 and 0.03 judge
UNRESOLVED = 0.1
TOLERATED_RESIDUAL = 1e-3  # of the greatest sway, by an end condition that the linear model implies


def judged(
    problem: Problem, weighted: BoundaryValueProblem, trajectory: Trajectory, iterations: int, residual: float
) -> Solution:
    """Accept a solution where it stands up to a look between the mesh's points."""
    if weighted.implied_residual(trajectory) > TOLERATED_RESIDUAL:
        advice = "Check the machine's equations and parameters."
        return failure(problem, Status.NOT_CONTROLLABLE, iterations, advice)
    optimum = _optimum(weighted, trajectory)
    if optimum.defect is not None and optimum.defect > UNRESOLVED:
        return too_steep(problem, iterations)
    return Solution(
        status=Status.CONVERGED,
        method=METHOD,
        problem=problem,
        optimum=optimum,
        iterations=iterations,
        residual=residual,
    )


def _optimum(canonical: BoundaryValueProblem, solution: Trajectory) -> Optimum:
    """Return to SI units."""
    system, data = canonical.system, canonical.data
    layout, n, m = system.layout, system.layout.size, system.layout.m
    loads = len(system.plant.loads)
    nodes = canonical.unknowns(solution.nodes)
    at_nodes, at_points = canonical.quantities(solution.nodes), canonical.quantities(solution.points)
    knots = data.duration * solution.mesh
    top = np.concatenate(
        [at_nodes[:-1, None, 2 : 2 + m], at_points[:, 2 : 2 + m].reshape(len(knots) - 1, -1, m)], axis=1
    )
    unit_time = np.einsum("pv,kva->kpa", solution.scheme.interpolation, top)
    hamiltonian = at_nodes[:, 0]
    return Optimum(
        knots=knots,
        states=data.offset + data.scale * nodes[:, :n],
        costates=data.cost_scale * data.duration / data.scale * nodes[:, n:],
        hamiltonian=hamiltonian,
        top_derivative=unit_time / np.diff(knots)[:, None, None] ** np.arange(unit_time.shape[1])[:, None],
        top_order=layout.orders,
        sway=at_points[:, 2 + m : 2 + m + loads],
        angle=float(np.abs(at_points[:, -loads:]).max()),
        cost=data.duration * (solution.integral(at_points[:, 1]) + data.beta),
        sway_weight=data.beta,
        sway_scale=data.gamma,
        defect=float(defect(canonical, solution).max()),
        hamiltonian_variation=float(np.ptp(hamiltonian) / np.abs(hamiltonian).max()),
    )


def too_steep(problem: Problem, iterations: int) -> Solution:
    """Blame a cost so steep that the motion changes faster than any mesh."""
    other = "." if problem.sway_scale is None else ', or set cost.sway_scale = "auto".'
    return failure(problem, Status.DIVERGED, iterations, f"Lower cost.sway_weight{other}")


def failure(problem: Problem, status: Status, iterations: int, advice: str) -> Solution:
    """Say that there is no solution, and what would help."""
    return Solution(status=status, method=METHOD, problem=problem, iterations=iterations, advice=advice)
