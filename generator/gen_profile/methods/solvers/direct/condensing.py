"""A machine's linearised response on every interval of a mesh, its collocation stages eliminated."""

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.dynamics.problem.motion_equations import MotionEquations
from gen_profile.methods.solvers.collocation import GAUSS, STAGES
from gen_profile.methods.solvers.direct.bezier import Piece
from gen_profile.motion.profile import Array
from gen_profile.support.one_thread import one_thread


@attrs.frozen(kw_only=True, eq=False)
class AxesMap:
    """From the local coordinates of all axes on an interval to what a machine feels at the Gauss points.

    Attributes
    ----------
    matrix : (intervals, STAGES, 3 m, m · size) array
        To position, velocity and acceleration of the axes in SI units.
    offset : (STAGES, 3 m) array
        Their values where all local coordinates are zero.
    """

    matrix: Array
    offset: Array

    def __call__(self, local: Array) -> Array:
        """Evaluate for (intervals, m · size) coordinates: (intervals, STAGES, 3 m)."""
        return np.asarray(np.einsum("ksal,kl->ksa", self.matrix, local) + self.offset)


def axes_map(piece: Piece, start: Array, reach: Array, duration: float) -> AxesMap:
    """Measure axes by `reach` from `start`, and time by `duration`."""
    m = len(start)
    matrix = np.zeros((len(piece.length), STAGES, 3, m, m, piece.size))
    for order in range(3):
        values = piece.at(order, GAUSS.c)
        for axis in range(m):
            matrix[:, :, order, axis, axis] = values * reach[axis] / duration**order
    offset = np.zeros((STAGES, 3, m))
    offset[:, 0] = start
    return AxesMap(
        matrix=matrix.reshape(-1, STAGES, 3 * m, m * piece.size), offset=offset.reshape(STAGES, 3 * m)
    )


@attrs.frozen(kw_only=True, eq=False)
class IntervalMaps:
    """On every interval ``y_{k+1} = transition y_k + drive ξ_k + offset``, and likewise the stages' values.

    Attributes
    ----------
    transition, drive, offset : (intervals, n, n), (intervals, n, local) and (intervals, n) arrays
    stage_transition, stage_drive, stage_offset : the same with (intervals, STAGES, n, …)
    """

    transition: Array
    drive: Array
    offset: Array
    stage_transition: Array
    stage_drive: Array
    stage_offset: Array

    def scaled(self, scale: Array) -> IntervalMaps:
        """Measure the states at the nodes in units of their own."""
        return attrs.evolve(
            self,
            transition=self.transition * scale / scale[:, None],
            drive=self.drive / scale[:, None],
            offset=self.offset / scale,
            stage_transition=self.stage_transition * scale,
        )

    def stages(self, nodes: Array, local: Array) -> Array:
        """Values at the stages for (intervals, n) initial values and (intervals, local) coordinates."""
        return np.asarray(
            np.einsum("ksab,kb->ksa", self.stage_transition, nodes)
            + np.einsum("ksal,kl->ksa", self.stage_drive, local)
            + self.stage_offset
        )


def interval_maps(
    equations: MotionEquations,
    parameters: Array,
    axes: AxesMap,
    *,
    stages: Array,
    local: Array,
    lengths: Array,
) -> IntervalMaps:
    """Linearise the collocation equations of every interval about given stages.

    Parameters
    ----------
    equations : MotionEquations
    parameters : (1, parameters) array
    axes : AxesMap
    stages : (intervals, STAGES, n) array
    local : (intervals, m · size) array
        Axis coordinates that belong to them.
    lengths : (intervals,) array
        In s.

    Raises
    ------
    numpy.linalg.LinAlgError
        The linearised equations are singular or not finite.
    """
    intervals, _, n = stages.shape
    axis_inputs = axes(local)
    values = equations.rate(stages.reshape(-1, n), axis_inputs.reshape(intervals * STAGES, -1), parameters)
    if not np.isfinite(values).all():
        raise np.linalg.LinAlgError("the equations of motion overflow")
    values = values.reshape(intervals, STAGES, n, -1)  # the rates, and their derivatives
    by_state, by_axes = values[..., 1 : 1 + n], values[..., 1 + n :]
    constant = (
        values[..., 0]
        - np.einsum("ksab,ksb->ksa", by_state, stages)
        + np.einsum("ksab,ksb->ksa", by_axes, axes.offset - axis_inputs)
    )
    return _eliminated(constant, by_state, by_axes @ axes.matrix, lengths[:, None, None] * GAUSS.A)


def _eliminated(constant: Array, by_state: Array, by_input: Array, integration: Array) -> IntervalMaps:
    """Solve ``Y = y_k + h A (constant + by_state Y + driven ξ)`` for the stages Y of every interval."""
    intervals, _, n = constant.shape
    inner = np.einsum("kij,kjab->kiajb", -integration, by_state).reshape(intervals, STAGES * n, -1)
    diagonal = np.arange(STAGES * n)
    inner[:, diagonal, diagonal] += 1.0
    right = np.concatenate(
        [
            np.einsum("kij,kja->kia", integration, constant)[..., None],
            np.broadcast_to(np.eye(n), (intervals, STAGES, n, n)),
            np.einsum("kij,kjal->kial", integration, by_input),
        ],
        axis=-1,
    )
    with one_thread:
        solved = np.linalg.solve(inner, right.reshape(intervals, STAGES * n, -1)).reshape(right.shape)
    across = np.einsum("i,kial->kal", GAUSS.end, solved)
    across[:, :, 1 : 1 + n] += (1.0 - GAUSS.end.sum()) * np.eye(n)
    return IntervalMaps(
        transition=across[:, :, 1 : 1 + n],
        drive=across[:, :, 1 + n :],
        offset=across[:, :, 0],
        stage_transition=solved[..., 1 : 1 + n],
        stage_drive=solved[..., 1 + n :],
        stage_offset=solved[..., 0],
    )
