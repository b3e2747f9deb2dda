"""Collocation of a two-point boundary value problem on a mesh, and its Newton step.

On every interval the solution is a polynomial that meets ``z' = F(z)`` at the scheme's collocation points; at
the nodes it is accurate to about twice the polynomial's order. Gauss's points are the most accurate ones.
Radau's let what swings too fast for the mesh fade: states forward, and costates, whose method is the adjoint
one, backward. The stage values of an interval are eliminated first, all intervals in one batch; what is left
couples neighbouring nodes only and is a banded system. (Ascher, Mattheij & Russell, Numerical Solution of
Boundary Value Problems for ODEs, 1995, chapter 5 and 7; Hairer & Wanner, Solving Ordinary Differential
Equations II, 1996, section IV.5.)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import attrs
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import lapack

from gen_profile.motion.profile import Array
from gen_profile.support.one_thread import one_thread
from gen_profile.support.work import spend

STAGES = 4  # of the schemes for fine meshes
INTERVAL_WORK = 3e-10  # s of work for each interval and the cube of its unknowns

IntArray = NDArray[np.intp]


@attrs.frozen(kw_only=True, eq=False)
class Scheme:
    """Where and how to collocate, on [0, 1].

    Attributes
    ----------
    c, b : (stages,) arrays
        Collocation points, and weights for integrals.
    A, adjoint : (stages, stages) arrays
        Integrals from 0 to the points, for states and for costates.
    slopes : (stages, stages) array
        A⁻¹: slopes in terms of what the points are beyond the beginning.
    end : (stages,) array
        bᵀ A⁻¹: what is reached at 1 in terms of what is at the points.
    interpolation : (stages + 1, stages + 1) array
        From values at 0 and the points to coefficients of the polynomial through them, lowest power first.
    """

    c: Array
    b: Array
    A: Array
    adjoint: Array
    slopes: Array
    end: Array
    interpolation: Array

    @property
    def stages(self) -> int:
        """Collocation points on an interval, which is the polynomials' degree."""
        return len(self.c)


def _scheme(c: Array) -> Scheme:
    powers = np.arange(1, len(c) + 1)
    vandermonde = c[:, None] ** (powers - 1)
    A = (c[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
    b = (1.0 / powers) @ np.linalg.inv(vandermonde)
    return Scheme(
        c=c,
        b=b,
        A=A,
        # the costates that belong to discretised states (Hager, Numerische Mathematik 87, 2000)
        adjoint=b - b * A.T / b[:, None],
        slopes=np.linalg.inv(A),
        end=b @ np.linalg.inv(A),
        interpolation=np.linalg.inv(np.append(0.0, c)[:, None] ** np.append(0, powers)),
    )


def _gauss(stages: int) -> Scheme:
    return _scheme((legendre.leggauss(stages)[0] + 1.0) / 2.0)


def _radau(stages: int) -> Scheme:
    """Collocate at the zeros of two neighbouring Legendre polynomials' difference, the last of which is 1."""
    zeros = legendre.legroots([0.0] * (stages - 1) + [1.0, -1.0])
    return _scheme(np.append((zeros[:-1] + 1.0) / 2.0, 1.0))


GAUSS = _gauss(STAGES)
LONG_GAUSS = _gauss(9)
RADAU = _radau(STAGES)


@attrs.frozen(kw_only=True, eq=False)
class Trajectory:
    """A collocation polynomial.

    Attributes
    ----------
    scheme : Scheme
    mesh : (intervals + 1,) array
        From 0 to 1.
    nodes : (intervals + 1, size) array
        Values on the mesh.
    stages : (intervals, stages, size) array
        Values at the collocation points.
    """

    scheme: Scheme
    mesh: Array
    nodes: Array
    stages: Array

    def coefficients(self) -> Array:
        """Write each interval's polynomial in its own time from 0 to 1, lowest power first.

        Shape (intervals, stages + 1, size).
        """
        values = np.concatenate([self.nodes[:-1, None], self.stages], axis=1)
        return np.asarray(np.einsum("pv,kvs->kps", self.scheme.interpolation, values))

    def __call__(self, times: Array) -> Array:
        """Evaluate, shape (times, size)."""
        interval = np.clip(np.searchsorted(self.mesh, times, side="right") - 1, 0, len(self.mesh) - 2)
        local = (times - self.mesh[interval]) / np.diff(self.mesh)[interval]
        powers = local[:, None] ** np.arange(self.scheme.stages + 1)
        return np.asarray(np.einsum("tp,tps->ts", powers, self.coefficients()[interval]))

    def blend(self, other: Trajectory, weight: float) -> Trajectory:
        """``self + weight · (other − self)`` on the same mesh."""
        return attrs.evolve(
            self,
            nodes=self.nodes + weight * (other.nodes - self.nodes),
            stages=self.stages + weight * (other.stages - self.stages),
        )

    def scaled(self, factors: Array | float) -> Trajectory:
        """Multiply every unknown by its factor."""
        return attrs.evolve(self, nodes=self.nodes * factors, stages=self.stages * factors)

    def integral(self, values: Array) -> float:
        """∫ over time of values at the collocation points, shape (points,)."""
        weights = np.diff(self.mesh)[:, None] * self.scheme.b
        return float(weights.ravel() @ values)

    @property
    def size(self) -> int:
        """Number of unknown functions."""
        return int(self.nodes.shape[1])

    @property
    def points(self) -> Array:
        """Stage values in a row: (intervals · stages, size)."""
        return self.stages.reshape(-1, self.size)


def sampled(function: Callable[[Array], Array], scheme: Scheme, mesh: Array) -> Trajectory:
    """Interpolate a function, times → (times, size) array, on a mesh."""
    points = (mesh[:-1, None] + np.diff(mesh)[:, None] * scheme.c).ravel()
    values = function(np.concatenate([mesh, points]))
    nodes, stages = np.split(values, [len(mesh)])
    return Trajectory(
        scheme=scheme, mesh=mesh, nodes=nodes, stages=stages.reshape(-1, scheme.stages, values.shape[1])
    )


def newton_step(flow: Array, current: Trajectory, initial: Array, final: Array) -> Trajectory:
    """Solve the collocation equations linearised about a trajectory: a full Newton step.

    Stages are eliminated first. Corrections are solved for, not trajectories: their rounding errors are as
    small as they are themselves.

    Parameters
    ----------
    flow : (points, size, 1 + size) array
        F, and beside it ∂F/∂z, at the trajectory's collocation points.
    current : Trajectory
    initial, final : (size / 2,) arrays
        Of the first half of the unknowns (the states); entries of `final` that are NaN are free, and the
        matching costate is zero instead.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the equations of an interval are singular, or the boundary values do not determine the solution.
    """
    nodes, stages, scheme = current.nodes, current.stages, current.scheme
    intervals, count, size = stages.shape
    spend(INTERVAL_WORK * intervals * (count * size) ** 3)
    lengths = np.diff(current.mesh)[:, None, None]
    values = flow.reshape(intervals, count, size, 1 + size)
    states, costates = slice(0, size // 2), slice(size // 2, size)

    # (1 − h A ⊗ J) ΔZ = δ_k + z_k + h A F − Z, for the part of ΔZ that does not depend on δ_k and the part
    # that does
    inner = np.empty((intervals, count, size, count, size))
    right = np.empty((intervals, count, size, 1 + size))
    for half, A in ((states, scheme.A), (costates, scheme.adjoint)):
        inner[:, :, half] = np.einsum("kij,kjab->kiajb", -lengths * A, values[:, :, half, 1:])
        right[:, :, half, 0] = lengths * A @ values[:, :, half, 0] + (nodes[:-1, None] - stages)[:, :, half]
    matrices = inner.reshape(intervals, count * size, count * size)
    diagonal = np.arange(count * size)
    matrices[:, diagonal, diagonal] += 1.0
    right[..., 1:] = np.eye(size)
    with one_thread:
        response = np.asarray(np.linalg.solve(matrices, right.reshape(intervals, count * size, 1 + size)))
    response = response.reshape(intervals, count, size, 1 + size)

    across = _across(lengths, current, values, response)
    n, free = len(initial), np.isnan(final)
    ends = np.where(free, np.arange(n) + n, np.arange(n))
    residual = np.where(free, 0.0, final) - nodes[-1, ends]
    offset = across[:, :, 0] - np.diff(nodes, axis=0)
    transition = np.ascontiguousarray(across[:, :, 1:])
    correction = _solve_nodes(transition, offset, initial - nodes[0, :n], residual, ends)
    answer = response[..., 0] + np.einsum("kiab,kb->kia", response[..., 1:], correction[:-1])
    return attrs.evolve(current, nodes=nodes + correction, stages=stages + answer)


def _across(lengths: Array, current: Trajectory, values: Array, response: Array) -> Array:
    """Write what is reached at an interval's end, less z_k, as an affine function of δ_k: constant first.

    States reach ``z_k + Σ w_i (Z_i − z_k)``, and costates, whose integration matrix may be singular,
    ``z_k + h Σ b_i F_i``.
    """
    scheme, beyond = current.scheme, current.stages - current.nodes[:-1, None]
    size = current.size
    states, costates = slice(0, size // 2), slice(size // 2, size)
    across = np.empty((len(lengths), size, 1 + size))
    across[:, states] = np.einsum("i,kiab->kab", scheme.end, response[:, :, states])
    across[:, states, 1:] += (1.0 - scheme.end.sum()) * np.eye(size)[states]
    across[:, states, 0] += np.einsum("i,kia->ka", scheme.end, beyond[:, :, states])
    change = lengths[..., None] * scheme.b[:, None, None] * values[:, :, costates]
    across[:, costates] = np.einsum("kiab,kibc->kac", change[..., 1:], response)
    across[:, costates, 0] += change[..., 0].sum(axis=1)
    across[:, costates, 1:] += np.eye(size)[costates]
    return across


def _solve_nodes(transition: Array, offset: Array, initial: Array, final: Array, ends: IntArray) -> Array:
    """Solve ``δ_{k+1} = transition_k δ_k + offset_k``: shape (intervals + 1, size).

    Given are the states at the start, and the entries `ends` at the end.
    """
    intervals, size, _ = transition.shape
    n = size // 2
    band = n + size - 1  # as many diagonals below as above the main one
    rows, columns, fixed = _band_pattern(intervals, size)
    matrix = np.zeros((3 * band + 1, (intervals + 1) * size))
    data = np.concatenate([-transition.ravel(), np.ones(fixed), np.ones(n)])
    columns = np.concatenate([columns, intervals * size + ends])
    matrix[2 * band + rows - columns, columns] = data
    right = np.concatenate([initial, offset.ravel(), final])
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
