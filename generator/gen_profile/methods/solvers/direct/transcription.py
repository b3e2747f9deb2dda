"""A problem as conic programs over piecewise polynomial motions and the machines' states at the nodes.

With l the local coordinates of all axes on interval k (`bezier.Piece`: its initial derivatives, then the
control's coefficients) and y the nominal machine's state at a node, both dimensionless, the constraints are::

    lₖ₊₁ begins with the derivatives with which lₖ ends            continuity of the axes
    l of the last interval ends with (target, final velocity, 0 …)
    yₖ₊₁ = Φₖ yₖ + Γₖ lₖ + oₖ                                      Gauss collocation, linearised
    C y at the end = 0                                             rest of the load and its sensitivities
    lower ≤ Bézier coefficients of lₖ ≤ upper                      limits, at every instant

The collocation points are eliminated from each interval, which gives Φ, Γ and o (`condensing`; Bock and
Plitt, A multiple shooting algorithm for direct solution of optimal control problems, 1984). What couples,
couples neighbours only: the matrices are banded, and the work grows with the number of intervals. Of other
machines only the state at the end counts, so their nodes are eliminated, too: y(end) = M (l₁, l₂, …) + offset
(`end_state`). `solver.sequence` solves the program, linearises about its solution and repeats (sequential
convex programming).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import attrs
import numpy as np

from gen_profile.dynamics.problem.motion_equations import MotionEquations
from gen_profile.methods.solvers.collocation import GAUSS, STAGES, IntArray
from gen_profile.methods.solvers.direct.bezier import Piece
from gen_profile.methods.solvers.direct.condensing import AxesMap, IntervalMaps, interval_maps
from gen_profile.methods.solvers.direct.conic import ConicProgram, Entries, Workspace, place, squares
from gen_profile.motion.profile import Array

QUINTIC_PEAKS = np.array([1.0, 1.9, 5.8, 60.0])  # of position, velocity, acceleration and jerk


@attrs.frozen(kw_only=True, eq=False)
class TranscribedMachine:
    """A machine that follows the motion.

    Attributes
    ----------
    equations : MotionEquations
    parameters : (1, parameters) array
    scale : (n,) array
        Size of its states y, to measure them by.
    start : (n,) array
        Its dimensionless states at the start.
    end : (conditions, n) array
        What of its dimensionless states must be zero at the end.
    """

    equations: MotionEquations
    parameters: Array
    scale: Array
    start: Array
    end: Array


@attrs.frozen(kw_only=True, eq=False)
class Iterate:
    """A motion, and every machine's states at the collocation points under it.

    Attributes
    ----------
    local : (intervals, m · size) array
        Dimensionless coordinates of the axes.
    stages : tuple of (intervals, STAGES, n) arrays
        In SI units.
    """

    local: Array
    stages: tuple[Array, ...]

    def like(self, other: Iterate) -> bool:
        """Whether another one has as many intervals and machines."""
        shapes = [[each.shape for each in (one.local, *one.stages)] for one in (self, other)]
        return shapes[0] == shapes[1]

    def flat(self) -> Array:
        """Put everything into one row."""
        return np.concatenate([self.local.ravel(), *(stages.ravel() for stages in self.stages)])

    def of_flat(self, values: Array) -> Iterate:
        """Give such a row the shapes of this iterate."""
        blocks = (self.local, *self.stages)
        parts = np.split(values, np.cumsum([block.size for block in blocks])[:-1])
        local, *stages = (part.reshape(block.shape) for part, block in zip(parts, blocks, strict=True))
        return Iterate(local=local, stages=tuple(stages))


@attrs.frozen(kw_only=True, eq=False)
class Transcription:
    """The parts of a problem that do not change from one linearisation to the next.

    Attributes
    ----------
    piece : Piece
        Of every axis on every interval, in time from 0 to 1.
    axes : AxesMap
    duration : float
        s.
    target, final_velocity : (m,) arrays
        Dimensionless positions and velocities at the end.
    machines : tuple of TranscribedMachine
        The nominal one first.
    """

    piece: Piece
    axes: AxesMap
    duration: float
    target: Array
    final_velocity: Array
    machines: tuple[TranscribedMachine, ...]

    @property
    def intervals(self) -> int:
        """Number of intervals."""
        return len(self.piece.length)

    @cached_property
    def breadth(self) -> int:
        """Local coordinates of all axes on one interval."""
        return len(self.target) * self.piece.size

    @cached_property
    def variables(self) -> int:
        """Number of variables without those of a goal."""
        return int(self.node_columns[-1]) + len(self.machines[0].scale)

    @cached_property
    def units(self) -> Array:
        """About how large each variable is: as a quintic's, the snap as if jerk changed in an interval."""
        quintic = np.broadcast_to(QUINTIC_PEAKS, (self.intervals, len(QUINTIC_PEAKS)))
        sizes = np.column_stack([quintic, QUINTIC_PEAKS[-1] / self.piece.length])
        orders = np.minimum(np.arange(self.piece.size), self.piece.order)
        local = np.tile(sizes[:, orders], len(self.target)).ravel()
        return np.concatenate([local, np.ones(self.variables - len(local))])

    @cached_property
    def importance(self) -> Array:
        """How much every number of an iterate counts for its size: the axes' motion, which determines all."""
        axes = self.intervals * self.breadth
        states = sum(len(machine.scale) for machine in self.machines) * self.intervals * STAGES
        return np.concatenate([1.0 / self.units[:axes], np.zeros(states)])

    @cached_property
    def local_columns(self) -> IntArray:
        """First column of every interval's axis coordinates."""
        return np.arange(self.intervals) * self.breadth

    @cached_property
    def node_columns(self) -> IntArray:
        """First column of the nominal machine's state at every node."""
        return self.intervals * self.breadth + np.arange(self.intervals + 1) * len(self.machines[0].scale)

    def rest(self) -> Iterate:
        """Stand still at the start."""
        return Iterate(
            local=np.zeros((self.intervals, self.breadth)),
            stages=tuple(np.zeros((self.intervals, STAGES, len(m.scale))) for m in self.machines),
        )

    def maps(self, iterate: Iterate) -> tuple[IntervalMaps, ...]:
        """Linearise every machine about a motion; states in units of the machine's scale."""
        lengths = self.duration * self.piece.length
        return tuple(
            interval_maps(
                machine.equations,
                machine.parameters,
                self.axes,
                stages=stages,
                local=iterate.local,
                lengths=lengths,
            ).scaled(machine.scale)
            for machine, stages in zip(self.machines, iterate.stages, strict=True)
        )

    def program(
        self, maps: Sequence[IntervalMaps], extra: int = 0, workspace: Workspace | None = None
    ) -> ConicProgram:
        """Pose the motion: continuous, from rest to its target, and the nominal machine moved by it.

        The constraints, in the order of their multipliers: continuity of the axes, their end, then the
        machine's states (the costates at the nodes, negative) and its end.
        """
        program = ConicProgram(np.concatenate([self.units, np.ones(extra)]), workspace)
        columns, (joints, end) = self.local_columns, self._joints
        program.equal(joints, np.zeros(self.intervals * len(self.target) * self.piece.order))
        reached = np.zeros((len(self.target), self.piece.order))
        reached[:, 0], reached[:, 1] = self.target, self.final_velocity
        program.equal(end, reached.ravel())
        machine, linear, nodes = self.machines[0], maps[0], self.node_columns
        n = len(machine.scale)
        moved = place(-linear.transition, nodes[:-1]) + place(-linear.drive, columns)
        program.equal(
            _repeated(np.eye(n), nodes) + moved.below(n),
            np.concatenate([machine.start, linear.offset.ravel()]),
        )
        program.equal(place(machine.end[None], nodes[-1:]), np.zeros(len(machine.end)))
        return program

    @cached_property
    def _joints(self) -> tuple[Entries, Entries]:
        """From the variables to leaps of the axes' motion and derivatives at nodes, and these at the end."""
        orders, columns = self.piece.order, self.local_columns
        first = self._per_axis(np.eye(self.piece.size)[:orders])
        ends = [self.piece.derivative(order)[:, -1] for order in range(orders)]
        last = self._per_axis(np.stack(ends, axis=1))
        before = place(-last[:-1], columns[:-1]).below(len(first))
        return _repeated(first, columns) + before, place(last[-1:], columns[-1:])

    def bound(
        self, program: ConicProgram, rows: Array, bounds: tuple[float, float], axis: int, give: float = 0.0
    ) -> None:
        """Keep Bézier coefficients of one axis between bounds, on every interval.

        Parameters
        ----------
        rows : (intervals, coefficients, size) array
        bounds : (float, float)
            Lower and upper one.
        give : float
            By how much either bound is wider for every 1 by which the program's last variable exceeds 1.
        """
        wide = np.zeros((*rows.shape[:2], len(self.target), self.piece.size))
        wide[:, :, axis] = rows
        matrix = place(wide.reshape(*rows.shape[:2], -1), self.local_columns)
        lower, upper = (np.full(rows.shape[0] * rows.shape[1], bound) for bound in bounds)
        program.at_most(matrix, upper, give)
        program.at_most(-matrix, -lower, give)

    def effort(self, blocks: Sequence[Array]) -> Entries:
        """Join quadratic forms per axis, of every interval's local coordinates, into one of all variables."""
        whole = np.zeros((self.intervals, *(len(self.target), self.piece.size) * 2))
        for axis, block in enumerate(blocks):
            whole[:, axis, :, axis] = block
        places = self.local_columns[:, None] + np.arange(self.breadth)
        return squares(whole.reshape(self.intervals, self.breadth, -1), places)

    @cached_property
    def coupled(self) -> IntArray:
        """Columns of every interval's axis coordinates, then of the state at its beginning."""
        n = len(self.machines[0].scale)
        local = self.local_columns[:, None] + np.arange(self.breadth)
        return np.concatenate([local, self.node_columns[:-1, None] + np.arange(n)], axis=1)

    def end_sway(self, iterate: Iterate, maps: IntervalMaps) -> tuple[Array, Array, Array]:
        """Linearise the end load's sway of the nominal machine at the collocation points.

        Returns
        -------
        sway : (points, directions) array
            At the iterate, in m.
        blocks : (intervals, STAGES * directions, columns) array
            Of the variables at the places `coupled`.
        offset : (points * directions,) array
            The sway is ``blocks x + offset``, the directions of a point side by side.
        """
        machine, stages = self.machines[0], iterate.stages[0]
        n, axis_inputs = len(machine.scale), self.axes(iterate.local)
        points = self.intervals * STAGES
        values = machine.equations.end_sway(*self.nominal_points(iterate))
        values = values.reshape(self.intervals, STAGES, -1, values.shape[2])
        sway, by_state, by_axes = values[..., 0], values[..., 1 : 1 + n], values[..., 1 + n :]
        by_local = by_axes @ self.axes.matrix + by_state @ maps.stage_drive
        by_node = by_state @ maps.stage_transition
        directions = sway.shape[2]
        blocks = np.concatenate([by_local, by_node], axis=-1)
        offset = (
            sway
            + np.einsum("ksda,ksa->ksd", by_state, maps.stage_offset - stages)
            + np.einsum("ksda,ksa->ksd", by_axes, self.axes.offset - axis_inputs)
        )
        shape = (self.intervals, STAGES * directions, -1)
        return sway.reshape(points, directions), blocks.reshape(shape), offset.ravel()

    def of_coupled(self, blocks: Array) -> Entries:
        """Stack blocks of every interval's rows below one another, by the places `coupled`."""
        local, node = np.split(blocks, [self.breadth], axis=-1)
        return place(local, self.local_columns) + place(node, self.node_columns[:-1])

    def end_sway_found(self, iterate: Iterate) -> Array:
        """Evaluate the end load's sway of the nominal machine in m, shape (points, directions)."""
        return self.machines[0].equations.end_sway(*self.nominal_points(iterate))[:, :, 0]

    def nominal_points(self, iterate: Iterate) -> tuple[Array, Array, Array]:
        """Give the nominal machine's states, what it feels of the axes, and its parameters, at all points."""
        stages = iterate.stages[0]
        points = stages.reshape(-1, stages.shape[2])
        return points, self.axes(iterate.local).reshape(len(points), -1), self.machines[0].parameters

    def iterate(self, x: Array, maps: Sequence[IntervalMaps]) -> Iterate:
        """Read a motion and the machines' states off a program's solution."""
        local = x[: self.intervals * self.breadth].reshape(self.intervals, -1)
        return Iterate(
            local=local,
            stages=tuple(
                linear.stages((self.followed(machine, linear, local) if index else self.nodes(x))[:-1], local)
                for index, (machine, linear) in enumerate(zip(self.machines, maps, strict=True))
            ),
        )

    def nodes(self, x: Array) -> Array:
        """Read the nominal machine's dimensionless states at the nodes off a program's solution."""
        first, n = self.node_columns[0], len(self.machines[0].scale)
        return x[first : first + n * (self.intervals + 1)].reshape(-1, n)

    def followed(self, machine: TranscribedMachine, linear: IntervalMaps, local: Array) -> Array:
        """Carry a machine's dimensionless states from node to node of a motion."""
        states = [machine.start]
        inputs = np.einsum("kal,kl->ka", linear.drive, local) + linear.offset
        for transition, added in zip(linear.transition, inputs, strict=True):
            states.append(transition @ states[-1] + added)
        return np.array(states)

    def end_state(self, index: int, maps: Sequence[IntervalMaps]) -> tuple[Array, IntArray, Array]:
        """Give a machine's dimensionless state at the end as ``block x + offset``, x from some column on."""
        machine, linear = self.machines[index], maps[index]
        n = len(machine.scale)
        if index == 0:
            return np.eye(n), self.node_columns[-1:], np.zeros(n)
        onwards, matrix, offset = np.eye(n), np.zeros((n, self.intervals, self.breadth)), np.zeros(n)
        for k in reversed(range(self.intervals)):
            matrix[:, k] = onwards @ linear.drive[k]
            offset += onwards @ linear.offset[k]
            onwards = onwards @ linear.transition[k]
        return matrix.reshape(n, -1), np.zeros(1, dtype=np.intp), offset + onwards @ machine.start

    def quadrature(self) -> Array:
        """Weights of the collocation points for integrals over dimensionless time, shape (points,)."""
        return np.outer(self.piece.length, GAUSS.b).ravel()

    def _per_axis(self, rows: Array) -> Array:
        axes, (count, size) = len(self.target), rows.shape[-2:]
        whole = np.einsum("ab,...rs->...arbs", np.eye(axes), rows)
        return np.asarray(whole.reshape(*rows.shape[:-2], axes * count, axes * size))


def _repeated(block: Array, columns: IntArray) -> Entries:
    return place(np.broadcast_to(block, (len(columns), *block.shape)), columns)
