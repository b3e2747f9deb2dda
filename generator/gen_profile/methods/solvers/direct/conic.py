"""Conic quadratic programs: a thin typed layer over the solver Clarabel."""

from enum import Enum
from itertools import count
from typing import Any

import attrs
import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gen_profile.motion.profile import Array
from gen_profile.support.interrupts import interrupts_collected
from gen_profile.support.work import spend

Matrix = Any  # scipy.sparse matrix or array
TOLERANCE = 1e-10  # of gap and feasibility, relative; 1e-8 changes costs by up to 9e-8
MAX_ITERATIONS = 60  # three times what most programs take; more only circle about what can be reached
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


class ConicProgram:
    """Minimise ``½ xᵀ P x + qᵀ x`` under constraints that are added one by one.

    Parameters
    ----------
    units : (variables,) array
        About how large each variable is; the solver works with their quotients.
    """

    def __init__(self, units: Array) -> None:
        self.variables = len(units)
        self._units = units
        self._rows: list[Matrix] = []
        self._sides: list[Array] = []
        self._cones: list[Any] = []

    def equal(self, matrix: Matrix, side: Array) -> None:
        """Require ``matrix x = side``."""
        self._add(matrix, side, clarabel.ZeroConeT(len(side)))

    def at_most(self, matrix: Matrix, side: Array, give: float = 0.0) -> None:
        """Require ``matrix x ≤ side``, or ``side + give (s − 1)`` with the last variable s."""
        self._add(*self._giving(matrix, side, np.full(len(side), give)), clarabel.NonnegativeConeT(len(side)))

    def within_cones(self, matrix: Matrix, sides: Array, give: float = 0.0) -> None:
        """Require that ``side − matrix x`` has a first entry no smaller than the length of the rest.

        The first entry is greater by ``give (s − 1)`` with the last variable s.

        Parameters
        ----------
        matrix : (cones * size, variables) sparse matrix
            Of all cones, below one another.
        sides : (cones, size) array
        give : float
        """
        gives = np.zeros_like(sides)
        gives[:, 0] = give
        cones = (clarabel.SecondOrderConeT(sides.shape[1]) for _ in sides)
        self._add(*self._giving(matrix, sides.ravel(), gives.ravel()), *cones)

    def solve(self, quadratic: Matrix, linear: Array) -> ConicSolution:
        """Solve for a cost, P given whole and symmetric; it should be of the order of 1 or more.

        What is much smaller is not minimised: programs end when the cost is right to the tolerance.
        """
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_iter = MAX_ITERATIONS
        settings.max_threads = 1  # the same bits whatever the machine
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        units, slope = self._units, self._units * linear
        scaled = _in_units(sparse.triu(quadratic, format="csc"), units)
        scaled.data *= units[scaled.indices]
        matrix = _in_units(sparse.vstack(self._rows, format="csr").tocsc(), units)
        settings.iterative_refinement_enable = False  # which takes a third of the time, mostly in vain
        solution = self._run(scaled, slope, matrix, settings)
        if str(solution.status) not in ("Solved", "AlmostSolved", "PrimalInfeasible"):
            settings.iterative_refinement_enable = True
            solution = self._run(scaled, slope, matrix, settings)
        if str(solution.status) == "NumericalError":  # steepest costs are better scaled by our units alone
            settings.equilibrate_enable = False
            solution = self._run(scaled, slope, matrix, settings)
        ends = np.cumsum([len(side) for side in self._sides])[:-1]
        return ConicSolution(
            verdict=_VERDICTS.get(str(solution.status), ConicStatus.FAILED),
            exact=str(solution.status) == "Solved",
            x=self._units * np.array(solution.x),
            multipliers=np.split(np.array(solution.z), ends),
        )

    def _run(self, quadratic: Matrix, linear: Array, matrix: Matrix, settings: Any) -> Any:
        """Run Clarabel, whose work counts, and which an interrupt ends."""
        spend(PROGRAM + POSING * matrix.nnz)
        solver = clarabel.DefaultSolver(
            quadratic, linear, matrix, np.concatenate(self._sides), self._cones, settings
        )
        calls = count()  # for Clarabel can circle without counting its iterations
        with interrupts_collected() as came:
            solver.set_termination_callback(lambda _: bool(came) or next(calls) > 2 * MAX_ITERATIONS)
            solution = solver.solve()
        spend(ITERATION * (matrix.nnz + quadratic.nnz) * solution.iterations)
        return solution

    def _giving(self, matrix: Matrix, side: Array, gives: Array) -> tuple[Matrix, Array]:
        """Let the last variable widen rows."""
        if not gives.any():
            return matrix, side
        column = sparse.csr_matrix(
            (gives, (np.arange(len(gives)), np.full(len(gives), self.variables - 1))),
            shape=(len(gives), self.variables),
        )
        return matrix - column, side - gives

    def _add(self, matrix: Matrix, side: Array, *cones: Any) -> None:
        self._rows.append(sparse.csr_matrix(matrix, shape=(len(side), self.variables)))
        self._sides.append(np.asarray(side, dtype=np.float64))
        self._cones.extend(cones)


def _in_units(matrix: Matrix, units: Array) -> Matrix:
    """Multiply the columns of a matrix that is stored by columns, in its place, without what is zero."""
    matrix.eliminate_zeros()
    matrix.data *= units.repeat(np.diff(matrix.indptr))
    return matrix


def place(blocks: Array, columns: NDArray[Any], width: int) -> Matrix:
    """Stack blocks below one another, each with its own first column.

    Parameters
    ----------
    blocks : (count, rows, columns) array
    columns : (count,) array of int
        Where each block begins.
    width : int
        Columns of the result.

    Returns
    -------
    (count * rows, width) sparse matrix
    """
    count, height, breadth = blocks.shape
    ends = np.arange(count * height + 1) * breadth
    across = (np.asarray(columns, dtype=np.intp)[:, None, None] + np.arange(breadth)).repeat(height, axis=1)
    return sparse.csr_matrix((blocks.ravel(), across.ravel(), ends), shape=(count * height, width))
