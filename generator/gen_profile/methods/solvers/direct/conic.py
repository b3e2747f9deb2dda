"""Conic quadratic programs: a thin typed layer over the solver Clarabel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from itertools import count
from typing import Any

import attrs
import clarabel
import numpy as np
from scipy import sparse

from gen_profile.methods.solvers.collocation import IntArray
from gen_profile.motion.profile import Array
from gen_profile.support.interrupts import interrupts_collected
from gen_profile.support.work import spend

PROGRAM_TOLERANCE = 1e-10  # of gap and feasibility, relative; 1e-8 changes costs by up to 9e-8
PROGRAM_ITERATIONS = 60  # three times what most programs take; more only circle about what can be reached
PROGRAM, POSING = 4e-3, 8e-7  # s of work for a program, and for each entry of its constraints
ITERATION = 6e-8  # s of work for each entry, in each iteration


class ConicStatus(Enum):
    """How a program ended."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    FAILED = "failed"


_VERDICTS = {
    "Solved": ConicStatus.SOLVED,
    "AlmostSolved": ConicStatus.SOLVED,  # to about 1e-5 of the tolerance asked for, which is far beyond need
    "PrimalInfeasible": ConicStatus.INFEASIBLE,
    "AlmostPrimalInfeasible": ConicStatus.INFEASIBLE,
}

_DECIDED = {"Solved", "AlmostSolved", "PrimalInfeasible"}
# Settings of further tries, and whether an end asks for them. Where factors fail on very uneven intervals,
# pivots are raised ten times as much as usually (a hundred times leads to the same motions); steepest costs
# are better scaled by our units alone.
_RAISED: tuple[Callable[[str], bool], Mapping[str, Any]] = (
    lambda end: end in {"NumericalError", "InsufficientProgress"},
    {"static_regularization_constant": 1e-7},
)
_FURTHER_TRIES: Sequence[tuple[Callable[[str], bool], Mapping[str, Any]]] = (
    (
        lambda end: end not in _DECIDED,
        {"static_regularization_constant": 1e-8, "iterative_refinement_enable": True},
    ),
    (lambda end: end == "NumericalError", {"equilibrate_enable": False}),
)


@attrs.frozen(kw_only=True, eq=False)
class ConicSolution:
    """Outcome of a program.

    Attributes
    ----------
    verdict : ConicStatus
    exact : bool
        Whether it was solved as exactly as asked for.
    x : (variables,) array
    multipliers : list of (rows,) arrays
        One per constraint, in the order in which they were added.
    """

    verdict: ConicStatus
    exact: bool
    x: Array
    multipliers: list[Array]


@attrs.frozen(kw_only=True, eq=False)
class Entries:
    """Entries of a sparse matrix, in any order; those at the same place add up, zeros count for nothing.

    SciPy's constructors and products take longer than the programs themselves, so blocks are put into place
    by their indices.
    """

    rows: IntArray
    columns: IntArray
    values: Array

    def __add__(self, other: Entries) -> Entries:
        return joined([self, other])

    def __neg__(self) -> Entries:
        return -1.0 * self

    def __rmul__(self, factor: float) -> Entries:
        return Entries(rows=self.rows, columns=self.columns, values=factor * self.values)

    def below(self, rows: int) -> Entries:
        """Move them down by some rows."""
        return Entries(rows=self.rows + rows, columns=self.columns, values=self.values)

    def without_zeros(self, wanted: Any = True) -> Entries:
        """Leave out zeros, and what is not wanted."""
        kept = (self.values != 0.0) & wanted
        return Entries(rows=self.rows[kept], columns=self.columns[kept], values=self.values[kept])


def joined(parts: Sequence[Entries]) -> Entries:
    """Put entries of one matrix together."""
    return Entries(
        rows=np.concatenate([part.rows for part in parts]),
        columns=np.concatenate([part.columns for part in parts]),
        values=np.concatenate([part.values for part in parts]),
    )


@attrs.frozen(kw_only=True, eq=False)
class Sparsity:
    """Where entries stand in a matrix by columns, found once for all programs that have them there."""

    entries: Entries
    order: IntArray
    starts: IntArray
    indices: IntArray
    ends: IntArray

    @classmethod
    def of(cls, entries: Entries, variables: int) -> Sparsity:
        """Sort entries by columns and rows."""
        order = np.lexsort((entries.rows, entries.columns))
        rows, columns = entries.rows[order], entries.columns[order]
        new = np.append(True, (np.diff(rows) != 0) | (np.diff(columns) != 0))[: len(rows)]
        starts = np.flatnonzero(new)
        ends = np.searchsorted(columns[starts], np.arange(variables + 1))
        return cls(entries=entries, order=order, starts=starts, indices=rows[starts], ends=ends)

    def fits(self, entries: Entries) -> bool:
        """Whether others stand at the same places, in the same order."""
        own = self.entries
        return np.array_equal(own.rows, entries.rows) and np.array_equal(own.columns, entries.columns)

    def data(self, entries: Entries) -> Array:
        """Put their values in order."""
        return (
            np.add.reduceat(entries.values[self.order], self.starts) if len(self.starts) else entries.values
        )

    def matrix(self, entries: Entries, rows: int) -> Any:
        """Give the matrix of such entries as Clarabel takes it."""
        shape = (rows, len(self.ends) - 1)
        return sparse.csc_matrix((self.data(entries), self.indices, self.ends), shape=shape)


@attrs.frozen(kw_only=True, eq=False)
class _Posed:
    """A program that Clarabel holds, with its factors' structure."""

    solver: Any
    quadratic: Sparsity
    matrix: Sparsity
    cones: tuple[tuple[str, int], ...]

    def fits(self, quadratic: Entries, matrix: Entries, cones: tuple[tuple[str, int], ...]) -> bool:
        """Whether another one differs by its numbers only."""
        return self.cones == cones and self.matrix.fits(matrix) and self.quadratic.fits(quadratic)


@attrs.define(eq=False)
class Workspace:
    """The last of some programs, whose structure the next one takes over if it has the same."""

    posed: _Posed | None = None


class ConicProgram:
    """Minimise ``½ xᵀ P x + qᵀ x`` under constraints that are added one by one.

    Parameters
    ----------
    units : (variables,) array
        About how large each variable is; the solver works with their quotients.
    workspace : Workspace, optional
        Of the programs before.
    """

    def __init__(self, units: Array, workspace: Workspace | None = None) -> None:
        self.variables = len(units)
        self._units = units
        self._workspace = workspace or Workspace()
        self._rows: list[Entries] = []
        self._sides: list[Array] = []
        self._cones: list[tuple[str, int]] = []

    def equal(self, matrix: Entries, side: Array) -> None:
        """Require ``matrix x = side``."""
        self._add(matrix, side, ("ZeroConeT", len(side)))

    def at_most(self, matrix: Entries, side: Array, give: float = 0.0) -> None:
        """Require ``matrix x ≤ side``, or ``side + give (s − 1)`` with the last variable s."""
        self._add(*self._giving(matrix, side, np.full(len(side), give)), ("NonnegativeConeT", len(side)))

    def within_cones(self, matrix: Entries, sides: Array, give: float = 0.0) -> None:
        """Require that ``side − matrix x`` has a first entry no smaller than the length of the rest.

        The first entry is greater by ``give (s − 1)`` with the last variable s.

        Parameters
        ----------
        matrix : Entries
            Of all cones, below one another.
        sides : (cones, size) array
        give : float
        """
        gives = np.zeros_like(sides)
        gives[:, 0] = give
        cones = len(sides) * [("SecondOrderConeT", sides.shape[1])]
        self._add(*self._giving(matrix, sides.ravel(), gives.ravel()), *cones)

    def solve(
        self, quadratic: Entries, linear: Array, *, sharp: bool = True, scaled: bool = True
    ) -> ConicSolution:
        """Solve for a cost, P given whole and symmetric; it should be of the order of 1 or more.

        What is much smaller is not minimised: programs end when the cost is right to the tolerance.

        Parameters
        ----------
        quadratic : Entries
        linear : (variables,) array
        sharp : bool
            Whether the cost hardly curves: raised pivots would let such a program circle about its solution.
        scaled : bool
            Whether rows and variables are scaled first; some programs that are scaled well get stuck then.
        """
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_iter = PROGRAM_ITERATIONS
        settings.max_threads = 1  # the same bits whatever the machine
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = PROGRAM_TOLERANCE
        # refinement takes a third of the time, mostly without effect; equations alone need no more than it
        settings.iterative_refinement_enable = {kind for kind, _ in self._cones} == {"ZeroConeT"}
        settings.equilibrate_enable = scaled
        settings.presolve_enable = False  # which would forbid to take over its structure
        solution = self._solved(quadratic, linear, settings, self._workspace)
        for asked, changes in _FURTHER_TRIES if sharp else (_RAISED, *_FURTHER_TRIES):
            if asked(str(solution.status)):
                for name, value in changes.items():
                    setattr(settings, name, value)
                solution = self._solved(quadratic, linear, settings, Workspace())
        ends = np.cumsum([len(side) for side in self._sides])[:-1]
        return ConicSolution(
            verdict=_VERDICTS.get(str(solution.status), ConicStatus.FAILED),
            exact=str(solution.status) == "Solved",
            x=self._units * np.array(solution.x),
            multipliers=np.split(np.array(solution.z), ends),
        )

    def _solved(self, quadratic: Entries, linear: Array, settings: Any, workspace: Workspace) -> Any:
        """Run Clarabel, whose work counts, and which an interrupt ends."""
        units, sides, cones = self._units, np.concatenate(self._sides), tuple(self._cones)
        matrix = joined(self._rows)
        matrix = attrs.evolve(matrix, values=matrix.values * units[matrix.columns]).without_zeros()
        quadratic = quadratic.without_zeros(quadratic.rows <= quadratic.columns)
        scaled = quadratic.values * units[quadratic.rows] * units[quadratic.columns]
        quadratic = attrs.evolve(quadratic, values=scaled)
        spend(PROGRAM + POSING * len(matrix.values))
        posed = workspace.posed
        if posed is not None and posed.fits(quadratic, matrix, cones):
            costs, coefficients = posed.quadratic.data(quadratic), posed.matrix.data(matrix)
            posed.solver.update(P=costs, q=units * linear, A=coefficients, b=sides)
        else:
            by_column = Sparsity.of(quadratic, self.variables), Sparsity.of(matrix, self.variables)
            solver = clarabel.DefaultSolver(
                by_column[0].matrix(quadratic, self.variables),
                units * linear,
                by_column[1].matrix(matrix, len(sides)),
                sides,
                [getattr(clarabel, kind)(size) for kind, size in cones],
                settings,
            )
            posed = _Posed(solver=solver, quadratic=by_column[0], matrix=by_column[1], cones=cones)
            workspace.posed = posed
        calls = count()  # for Clarabel can circle without counting its iterations
        with interrupts_collected() as came:
            posed.solver.set_termination_callback(
                lambda _: bool(came) or next(calls) > 2 * PROGRAM_ITERATIONS
            )
            solution = posed.solver.solve()
        spend(ITERATION * (len(matrix.values) + len(quadratic.values)) * solution.iterations)
        return solution

    def _giving(self, matrix: Entries, side: Array, gives: Array) -> tuple[Entries, Array]:
        """Let the last variable widen rows."""
        if not gives.any():
            return matrix, side
        last = np.full(len(gives), self.variables - 1)
        return matrix + Entries(rows=np.arange(len(gives)), columns=last, values=-gives), side - gives

    def _add(self, matrix: Entries, side: Array, *cones: tuple[str, int]) -> None:
        self._rows.append(matrix.below(sum(map(len, self._sides))))
        self._sides.append(np.asarray(side, dtype=np.float64))
        self._cones.extend(cones)


def place(blocks: Array, columns: IntArray) -> Entries:
    """Stack blocks below one another, each with its own first column.

    Parameters
    ----------
    blocks : (count, rows, columns) array
    columns : (count,) array of int
        Where each block begins.
    """
    count, height, breadth = blocks.shape
    across = (columns[:, None, None] + np.arange(breadth)).repeat(height, axis=1)
    return Entries(
        rows=np.arange(count * height).repeat(breadth), columns=across.ravel(), values=blocks.ravel()
    )


def squares(blocks: Array, places: IntArray) -> Entries:
    """Put square blocks on the diagonal: each couples the variables at its places, shape (count, size)."""
    return Entries(
        rows=np.broadcast_to(places[:, :, None], blocks.shape).ravel(),
        columns=np.broadcast_to(places[:, None, :], blocks.shape).ravel(),
        values=blocks.ravel(),
    )
