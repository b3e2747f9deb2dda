"""How a linearised machine answers: its states to forces and controls, its costates to loads.

The machine is linearised about a trajectory and collocated on its mesh, the slopes on every interval
eliminated. Where it is the same everywhere, as a crane that does not hoist, one interval stands for all. The
costates' equations are the transposed ones of the states: they belong to the discretised problem exactly.
"""

import attrs
import numpy as np

from gen_profile.methods.solvers.collocation import IntArray, Scheme
from gen_profile.motion.profile import Array

EQUAL_DIGITS = 12  # of interval lengths, relative to the whole, in which equal ones agree


@attrs.frozen(kw_only=True, eq=False)
class LinearResponse:
    """Solutions of ``δx' = A δx + f`` from ``δx(0) = 0``, and of its adjoint ``δλ' = −Aᵀ δλ − l``.

    Matrices are given for every interval, or for one that stands for all: where the machine is the same at
    all points.

    Attributes
    ----------
    scheme : Scheme
    lengths : (intervals, 1, 1) array
    A : (intervals, stages, n, n) array
        At the collocation points.
    slopes : (intervals, stages · n, stages · n) array
        Caused by forces at an interval's points.
    slopes_by_node : (intervals, stages · n, n) array
        Caused by the state at the interval's beginning.
    transition : (intervals, n, n) array
        From there to the state at its end.
    """

    scheme: Scheme
    lengths: Array
    A: Array
    slopes: Array
    slopes_by_node: Array
    transition: Array

    @property
    def weights(self) -> Array:
        """For integrals over all collocation points, (intervals, stages, 1)."""
        return self.lengths * self.scheme.b[:, None]

    def states(self, force: Array) -> tuple[Array, Array, Array]:
        """Answer to a force at the collocation points, (intervals, stages, n).

        Returns
        -------
        slopes, values : (intervals, stages, n) arrays
            Of the states at the collocation points.
        final : (n,) array
        """
        own = _times(self.slopes, force).reshape(force.shape)
        nodes = _propagated(self.transition, (self.weights * own).sum(axis=1), np.zeros(force.shape[2]))
        slopes = own + _times(self.slopes_by_node, nodes[:-1]).reshape(force.shape)
        return slopes, nodes[:-1, None] + self.lengths * (self.scheme.A @ slopes), nodes[-1]

    def costates(self, load: Array, final: Array) -> tuple[Array, Array]:
        """Answer to a load at the collocation points, (intervals, stages, n), and to the costate at the end.

        The load, and what is returned, are times the points' weights.

        Returns
        -------
        values, falls : (intervals, stages, n) arrays
            Costates at the collocation points, and minus their slopes.
        """
        back = self.slopes.transpose(0, 2, 1)
        own = _times(back, self.lengths * (self.scheme.A.T @ load)).reshape(load.shape)
        across = (self._transposed(own) + load).sum(axis=1)
        nodes = _propagated(self.transition.transpose(0, 2, 1)[::-1], across[::-1], final)[::-1]
        values = own + _times(back, self.weights * nodes[1:, None]).reshape(load.shape)
        return values, self._transposed(values) + load

    def gains(self, states: IntArray, outputs: Array) -> tuple[Array, Array]:
        """Answer to controls, each a force on one state.

        Parameters
        ----------
        states : (m,) array of int
            States that the controls drive.
        outputs : (intervals, stages, outputs, n) array
            What is seen of the states at every collocation point.

        Returns
        -------
        (points, outputs, points · m) array
            Outputs, by the controls of one point after the other.
        (n, points · m) array
            Final states.
        """
        intervals, stages, n = len(self.lengths), self.scheme.stages, self.A.shape[-1]
        columns = (n * np.arange(stages)[:, None] + states).ravel()
        causes = n + len(columns)  # the state at the interval's beginning, and its controls
        slopes = np.concatenate([self.slopes_by_node, self.slopes[:, :, columns]], axis=2)
        slopes = self.lengths[: len(slopes)] * slopes.reshape(len(slopes), stages, n * causes)
        values = (self.scheme.A @ slopes).reshape(-1, stages, n, causes)
        across = (self.scheme.b @ slopes).reshape(-1, n, causes)
        values[..., :n] += np.eye(n)
        across[..., :n] += np.eye(n)
        gains_within = outputs @ values
        gains_within = gains_within.reshape(len(gains_within), -1, causes)

        output_gains = np.zeros((intervals, gains_within.shape[1], intervals * len(columns)))
        final = np.zeros((n, intervals * len(columns)))
        for k in range(intervals):
            within, to_end = gains_within[k % len(gains_within)], across[k % len(across)]
            past, own = slice(0, k * len(columns)), slice(k * len(columns), (k + 1) * len(columns))
            output_gains[k, :, past] = within[:, :n] @ final[:, past]
            output_gains[k, :, own] = within[:, n:]
            final[:, past] = to_end[:, :n] @ final[:, past]
            final[:, own] = to_end[:, n:]
        return output_gains.reshape(-1, outputs.shape[2], intervals * len(columns)), final

    def _transposed(self, values: Array) -> Array:
        """Aᵀ λ at every point."""
        if len(self.A) < len(self.lengths):
            return np.asarray(values @ self.A[0, 0])
        return np.asarray((values[:, :, None] @ self.A)[:, :, 0])


def linear_response(A: Array, scheme: Scheme, lengths: Array) -> LinearResponse:
    """Collocate ``δx' = A δx``.

    Parameters
    ----------
    A : (intervals, stages, n, n) array
    scheme : Scheme
    lengths : (intervals,) array

    Raises
    ------
    numpy.linalg.LinAlgError
        When the equations of an interval are singular.
    """
    alike = each = np.arange(len(A))  # intervals that stand for all like them
    if (A[0, 0] == A).all():
        _, alike, each = np.unique(lengths.round(EQUAL_DIGITS), return_index=True, return_inverse=True)
        A = A[:1] if len(alike) == 1 else A
    lengths, (count, stages, n, _) = lengths[:, None, None], A.shape
    inner = -np.einsum("kij,kiab->kiajb", lengths[alike] * scheme.A, A[alike])
    inner = inner.reshape(len(alike), stages * n, -1)
    diagonal = np.arange(stages * n)
    inner[:, diagonal, diagonal] += 1.0
    slopes = np.linalg.inv(inner)[each[:count]]
    by_node = slopes @ A.reshape(count, stages * n, n)
    across = lengths[:count] * (scheme.b @ by_node.reshape(count, stages, n * n))[:, None]
    return LinearResponse(
        scheme=scheme,
        lengths=lengths,
        A=A,
        slopes=slopes,
        slopes_by_node=by_node,
        transition=across.reshape(count, n, n) + np.eye(n),
    )


def _times(matrices: Array, vectors: Array) -> Array:
    """Multiply the vector of every interval, whatever its shape, by the interval's matrix."""
    flat = vectors.reshape(len(vectors), -1)
    if len(matrices) == 1:
        return np.asarray(flat @ matrices[0].T)
    return np.asarray((matrices @ flat[..., None])[..., 0])


def _propagated(transition: Array, offset: Array, initial: Array) -> Array:
    """Nodes of ``x_{k+1} = transition_k x_k + offset_k``."""
    nodes = np.empty((len(offset) + 1, len(initial)))
    nodes[0] = initial
    for k, step in enumerate(offset):
        nodes[k + 1] = transition[k % len(transition)] @ nodes[k] + step
    return nodes
