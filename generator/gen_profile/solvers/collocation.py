"""Gauss collocation of a two-point boundary value problem on a mesh, and its Newton step.

On every interval the solution is a polynomial of degree `STAGES` that meets ``z' = F(z)`` at the Gauss
points; at the nodes it is accurate to order 2 · `STAGES`. The stage values of an interval are eliminated
first, all intervals in one batch; what is left couples neighbouring nodes only and is a banded system.
(Ascher, Mattheij & Russell, Numerical Solution of Boundary Value Problems for ODEs, 1995, chapter 5 and 7.)
"""

from __future__ import annotations

from functools import lru_cache

import attrs
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import lapack
from threadpoolctl import ThreadpoolController

from gen_profile.profile import Array

STAGES = 4

# Matrices of a hundred rows are too small to share: threads that wait for a busy machine's other core cost up
# to a hundredfold, and how they share the work would show in the last bits.
BLAS = ThreadpoolController()

IntArray = NDArray[np.intp]


@attrs.frozen(eq=False)
class _Tableau:
    """Gauss's method on [0, 1]: abscissae, integration matrix, weights, and bᵀ A⁻¹."""

    c: Array
    A: Array
    b: Array
    end: Array


def _gauss(stages: int) -> _Tableau:
    c = (legendre.leggauss(stages)[0] + 1.0) / 2.0
    powers = np.arange(1, stages + 1)
    vandermonde = c[:, None] ** (powers - 1)
    A = (c[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
    b = (1.0 / powers) @ np.linalg.inv(vandermonde)
    return _Tableau(c, A, b, b @ np.linalg.inv(A))


GAUSS = _gauss(STAGES)

# values at 0 and the Gauss points → coefficients of the polynomial through them, lowest power first
INTERPOLATION = np.linalg.inv(np.concatenate([[0.0], GAUSS.c])[:, None] ** np.arange(STAGES + 1))


@attrs.frozen(kw_only=True, eq=False)
class Trajectory:
    """A collocation polynomial.

    Attributes
    ----------
    mesh : (intervals + 1,) array
        From 0 to 1.
    nodes : (intervals + 1, size) array
        Values on the mesh.
    stages : (intervals, STAGES, size) array
        Values at the Gauss points.
    """

    mesh: Array
    nodes: Array
    stages: Array

    def coefficients(self) -> Array:
        """Write each interval's polynomial in its own time from 0 to 1, lowest power first.

        Shape (intervals, STAGES + 1, size).
        """
        values = np.concatenate([self.nodes[:-1, None], self.stages], axis=1)
        return np.asarray(np.einsum("pv,kvs->kps", INTERPOLATION, values))

    def __call__(self, times: Array) -> Array:
        """Evaluate, shape (times, size)."""
        interval = np.clip(np.searchsorted(self.mesh, times, side="right") - 1, 0, len(self.mesh) - 2)
        local = (times - self.mesh[interval]) / np.diff(self.mesh)[interval]
        powers = local[:, None] ** np.arange(STAGES + 1)
        return np.asarray(np.einsum("tp,tps->ts", powers, self.coefficients()[interval]))

    def on(self, mesh: Array) -> Trajectory:
        """Interpolate to another mesh."""
        return Trajectory(
            mesh=mesh, nodes=self(mesh), stages=self(stage_times(mesh)).reshape(-1, STAGES, self.size)
        )

    def blend(self, other: Trajectory, weight: float) -> Trajectory:
        """``self + weight · (other − self)`` on the same mesh."""
        return Trajectory(
            mesh=self.mesh,
            nodes=self.nodes + weight * (other.nodes - self.nodes),
            stages=self.stages + weight * (other.stages - self.stages),
        )

    def scaled(self, factors: Array | float) -> Trajectory:
        """Multiply every unknown by its factor."""
        return Trajectory(mesh=self.mesh, nodes=self.nodes * factors, stages=self.stages * factors)

    def transformed(self, matrix: Array) -> Trajectory:
        """Multiply the unknowns by a matrix."""
        return Trajectory(mesh=self.mesh, nodes=self.nodes @ matrix.T, stages=self.stages @ matrix.T)

    @property
    def size(self) -> int:
        """Number of unknown functions."""
        return int(self.nodes.shape[1])

    @property
    def points(self) -> Array:
        """Stage values in a row: (intervals · STAGES, size)."""
        return self.stages.reshape(-1, self.size)


def stage_times(mesh: Array) -> Array:
    """Place the Gauss points of all intervals, in a row."""
    return np.asarray((mesh[:-1, None] + np.diff(mesh)[:, None] * GAUSS.c).ravel())


def newton_iterate(flow: Array, current: Trajectory, initial: Array, final: Array) -> Trajectory:
    """Solve the collocation equations linearised about a trajectory.

    Parameters
    ----------
    flow : (points, size, 1 + size) array
        F, and beside it ∂F/∂z, at the trajectory's collocation points.
    current : Trajectory
    initial, final : (size / 2,) arrays
        Boundary values of the first half of the unknowns (the states) at both ends; entries of `final` that
        are NaN are free, and the matching costate is zero instead.

    Returns
    -------
    Trajectory
        The full Newton iterate.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the linearised equations are singular.
    """
    intervals, _, size = current.stages.shape
    integration = np.diff(current.mesh)[:, None, None] * GAUSS.A
    values = flow.reshape(intervals, STAGES, size, 1 + size)
    slope, jacobian = values[..., 0], values[..., 1:]

    # (1 − h A ⊗ J) Z = z_k + h A (F − J Z₀), for the part of Z that does not depend on z_k and the part that
    # does
    inner = np.einsum("kij,kjab->kiajb", -integration, jacobian)
    inner = inner.reshape(intervals, STAGES * size, STAGES * size)
    diagonal = np.arange(STAGES * size)
    inner[:, diagonal, diagonal] += 1.0
    constant = slope - np.einsum("kiab,kib->kia", jacobian, current.stages)
    right = np.empty((intervals, STAGES, size, 1 + size))
    right[..., 0] = integration @ constant
    right[..., 1:] = np.eye(size)
    with BLAS.limit(limits=1, user_api="blas"):
        response = np.linalg.solve(inner, right.reshape(intervals, STAGES * size, 1 + size))
    response = response.reshape(intervals, STAGES, size, 1 + size)

    # z_{k+1} = (1 − Σ w) z_k + Σ w_i Z_i
    across = np.einsum("i,kiab->kab", GAUSS.end, response)
    across[:, :, 1:] += (1.0 - GAUSS.end.sum()) * np.eye(size)
    nodes = _solve_nodes(np.ascontiguousarray(across[:, :, 1:]), across[:, :, 0], initial, final)
    stages = response[..., 0] + np.einsum("kiab,kb->kia", response[..., 1:], nodes[:-1])
    return Trajectory(mesh=current.mesh, nodes=nodes, stages=stages)


def _solve_nodes(transition: Array, offset: Array, initial: Array, final: Array) -> Array:
    """Solve ``z_{k+1} = transition_k z_k + offset_k``, states given at both ends: (intervals + 1, size)."""
    intervals, size, _ = transition.shape
    n = size // 2
    band = n + size - 1  # as many diagonals below as above the main one
    rows, columns, fixed = _band_pattern(intervals, size)
    matrix = np.zeros((3 * band + 1, (intervals + 1) * size))
    free = np.isnan(final)
    end = intervals * size + np.arange(n) + np.where(free, n, 0)
    data = np.concatenate([-transition.ravel(), np.ones(fixed), np.ones(n)])
    columns = np.concatenate([columns, end])
    matrix[2 * band + rows - columns, columns] = data
    right = np.concatenate([initial, offset.ravel(), np.where(free, 0.0, final)])
    *_, solution, info = lapack.dgbsv(band, band, matrix, right, overwrite_ab=True, overwrite_b=True)
    if info != 0 or not np.isfinite(solution).all():
        raise np.linalg.LinAlgError("the boundary conditions do not determine the solution")
    return np.asarray(solution).reshape(intervals + 1, size)


@lru_cache(maxsize=4)
def _band_pattern(intervals: int, size: int) -> tuple[IntArray, IntArray, int]:
    """Rows of all entries, columns of all but the end's, and the number of unit entries before those."""
    n = size // 2
    node, i, j = np.indices((intervals, size, size)).reshape(3, -1)
    following = np.arange(intervals * size)
    rows = np.concatenate(
        [n + node * size + i, np.arange(n), n + following, n + intervals * size + np.arange(n)]
    )
    columns = np.concatenate([node * size + j, np.arange(n), size + following])
    return rows, columns, n + len(following)
