"""Mesh refinement: split the intervals on which a collocated solution is not accurate enough."""

from collections.abc import Callable
from functools import lru_cache

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.methods.solvers.collocation import Trajectory, sampled
from gen_profile.methods.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.methods.solvers.indirect.newton import NewtonOutcome
from gen_profile.motion.profile import Array

MOST_PARTS = 4  # of an interval at once; with more, refined motions start farther from their solution
MAX_ROUNDS = 6  # where a fast mode is not resolved, what is split in one place shows in another


def refine(
    canonical: BoundaryValueProblem,
    coarse: Trajectory,
    solve: Callable[[BoundaryValueProblem, Trajectory], NewtonOutcome],
    least: int = 0,
) -> NewtonOutcome:
    """Split intervals until the equations are met and the Hamiltonian is constant.

    Where the mesh would grow beyond `max_intervals`, the intervals that need it least are left alone. No
    solution comes of it where Newton's method fails on finer meshes.

    Parameters
    ----------
    canonical : BoundaryValueProblem
    coarse : Trajectory
        Its solution on a mesh that may be too coarse to judge it by.
    solve : callable
        From a problem and a start to the solution on the same mesh.
    least : int
        Intervals to begin with.
    """
    mesh = np.linspace(0.0, 1.0, least + 1) if least >= len(coarse.mesh) else None
    solution, iterations, residual = coarse, 0, 0.0
    for _ in range(MAX_ROUNDS):
        if mesh is None:
            parts = _parts(canonical, solution)
            if parts.max() == 1:
                break
            mesh = _split(solution.mesh, parts)
        outcome = solve(canonical, sampled(solution, solution.scheme, mesh))
        iterations += outcome.iterations
        if outcome.solution is None:
            return attrs.evolve(outcome, iterations=iterations)
        solution, residual, mesh = outcome.solution, outcome.residual, None
    return NewtonOutcome(solution=solution, iterations=iterations, residual=residual)


def _parts(canonical: BoundaryValueProblem, solution: Trajectory) -> NDArray[np.intp]:
    """Tell into how many parts to divide every interval."""
    options, stages = canonical.options, solution.scheme.stages
    wanted = (defect(canonical, solution) / options.defect_tolerance) ** (1.0 / stages)
    if canonical.resolved:
        drift = _drift(canonical, solution) / options.drift_tolerance
        wanted = np.maximum(wanted, drift ** (1.0 / (2 * stages)))
    most = max(options.max_intervals, len(wanted))
    while (parts := np.clip(np.ceil(wanted), 1, MOST_PARTS).astype(np.intp)).sum() > most:
        wanted *= 0.9
    return parts


def _drift(canonical: BoundaryValueProblem, solution: Trajectory) -> Array:
    """Change of H over each interval, relative to its size; none for the exact solution."""
    hamiltonian = canonical.quantities(solution.nodes)[:, 0]
    return np.asarray(np.abs(np.diff(hamiltonian)) / np.abs(hamiltonian).max())


def _split(mesh: Array, parts: NDArray[np.intp]) -> Array:
    """Divide every interval into equal parts."""
    pieces = [
        np.linspace(a, b, n, endpoint=False) for a, b, n in zip(mesh[:-1], mesh[1:], parts, strict=True)
    ]
    return np.concatenate([*pieces, mesh[-1:]])


@lru_cache(maxsize=1)  # after refinement, the last one is asked for again
def defect(canonical: BoundaryValueProblem, solution: Trajectory) -> Array:
    """Greatest miss of the state equations between collocation points, on each interval.

    It is a fraction of each state's size. What is missed of the costates' shows in the Hamiltonian. What fast
    modes make of a small displacement is filtered as stiff solvers do (Hairer and Wanner, Solving Ordinary
    Differential Equations II, eq. IV.8.20).
    """
    scheme, n, lengths = solution.scheme, len(canonical.final), np.diff(solution.mesh)[:, None, None]
    local = np.convolve(np.concatenate([[0.0], scheme.c, [1.0]]), [0.5, 0.5], "valid")[:, None]
    powers, coefficients = np.arange(scheme.stages + 1), solution.coefficients()
    values = local**powers @ coefficients
    slopes = (powers[1:] * local ** powers[:-1]) @ coefficients[:, 1:, :n]
    asked = canonical.slopes(values.reshape(-1, solution.size))[0].reshape(values.shape)
    by_state = canonical.linear(solution.nodes[:-1])[0][:, :, :n]
    fading = np.eye(n) - lengths / scheme.stages * by_state
    residual = np.linalg.solve(fading, (slopes - lengths * asked[:, :, :n]).swapaxes(1, 2))
    return np.asarray((np.abs(residual) * canonical.weights(solution)[:, None]).max(axis=(1, 2)))
