"""Mesh refinement: split the intervals on which a collocated solution is not accurate enough."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gen_profile.profile import Array
from gen_profile.solvers.canonical import Canonical
from gen_profile.solvers.collocation import GAUSS, STAGES, Trajectory
from gen_profile.solvers.newton import NewtonOutcome, solve_newton

MAX_INTERVALS = 480
DRIFT_TOLERANCE = 1e-7  # of the Hamiltonian over an interval, relative to its size
DEFECT_TOLERANCE = 3e-3  # see `defect`; what it costs in sway is of its square


def refine(canonical: Canonical, solution: Trajectory) -> NewtonOutcome:
    """Split intervals until the Hamiltonian is constant and the equations are met.

    Where the mesh would grow beyond `MAX_INTERVALS`, the intervals that need it least are left alone.
    """
    iterations, residual = 0, 0.0
    while (parts := _parts(canonical, solution)).max() > 1:
        outcome = solve_newton(canonical, solution.on(_split(solution.mesh, parts)))
        iterations += outcome.iterations
        if outcome.solution is None:
            break
        solution, residual = outcome.solution, outcome.residual
    return NewtonOutcome(solution=solution, iterations=iterations, residual=residual)


def _parts(canonical: Canonical, solution: Trajectory) -> NDArray[np.intp]:
    """Tell into how many parts to divide every interval."""
    wanted = np.maximum(
        (_drift(canonical, solution) / DRIFT_TOLERANCE) ** (1.0 / (2 * STAGES)),
        (defect(canonical, solution) / DEFECT_TOLERANCE) ** (1.0 / STAGES),
    )
    while (parts := np.clip(np.ceil(wanted), 1, 4).astype(np.intp)).sum() > max(MAX_INTERVALS, len(parts)):
        wanted *= 0.9
    return parts


def _drift(canonical: Canonical, solution: Trajectory) -> Array:
    """Change of H over each interval, relative to its size; none for the exact solution."""
    hamiltonian = canonical.quantities(solution.nodes)[:, 0]
    return np.asarray(np.abs(np.diff(hamiltonian)) / np.abs(hamiltonian).max())


def _split(mesh: Array, parts: NDArray[np.intp]) -> Array:
    """Divide every interval into equal parts."""
    pieces = [
        np.linspace(a, b, n, endpoint=False) for a, b, n in zip(mesh[:-1], mesh[1:], parts, strict=True)
    ]
    return np.concatenate([*pieces, mesh[-1:]])


def defect(canonical: Canonical, solution: Trajectory) -> Array:
    """Greatest miss of the state equations between collocation points, on each interval.

    Per interval, as a share of each state's size. (What is missed of the costates' shows in the Hamiltonian.)
    """
    local = np.convolve(np.concatenate([[0.0], GAUSS.c, [1.0]]), [0.5, 0.5], "valid")[:, None]
    powers, coefficients = np.arange(STAGES + 1), solution.coefficients()
    values = np.einsum("tp,kps->kts", local**powers, coefficients)
    slopes = np.einsum("tp,kps->kts", powers[1:] * local ** powers[:-1], coefficients[:, 1:])
    flow = canonical.slopes(values.reshape(-1, solution.size))
    flow = np.diff(solution.mesh)[:, None, None] * flow.reshape(values.shape)
    weights = canonical.weights(solution)
    return np.asarray((np.abs(slopes - flow)[:, :, : len(weights)] * weights).max(axis=(1, 2)))
