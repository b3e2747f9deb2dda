"""The one module that loads CasADi: a thin typed layer over what the project uses of it.

Typing stops at `Symbol`; everything that comes out is a NumPy array or C text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Symbol = Any  # casadi.SX

if hasattr(casadi.GlobalOptions, "setNumpyMode"):
    # plants call NumPy functions on symbols; -1 keeps the result symbolic, without a warning
    casadi.GlobalOptions.setNumpyMode(-1)


def symbols(name: str, count: int) -> Symbol:
    """Make a column of symbols."""
    return casadi.SX.sym(name, count)


def split(column: Symbol) -> list[Symbol]:
    """Entries of a column."""
    return list(casadi.vertsplit(column)) if column.shape[0] else []


def column(entries: Sequence[Any]) -> Symbol:
    """Stack scalars and columns."""
    return casadi.vertcat(*entries) if len(entries) else casadi.SX(0, 1)


def zero() -> Symbol:
    """Make a zero that is none by its form."""
    return casadi.SX(1, 1)


def matrix(rows: Sequence[Sequence[Any]]) -> Symbol:
    """Make a matrix from nested rows of scalars."""
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))


def zeros(count: int, width: int) -> Symbol:
    """Make a matrix of zeros."""
    return casadi.SX(count, width)


def rows(matrix: Symbol) -> list[list[Symbol]]:
    """Entries of a matrix, row by row."""
    return [list(casadi.horzsplit(row)) for row in casadi.vertsplit(matrix)]


def solve(a: Symbol, b: Symbol) -> Symbol:
    """Solve ``a x = b`` symbolically."""
    return casadi.solve(a, b)


def jacobian(expression: Symbol, variables: Symbol) -> Symbol:
    """∂expression/∂variables."""
    return casadi.jacobian(expression, variables)


def directional(expression: Symbol, variables: Symbol, change: Symbol) -> Symbol:
    """Change of an expression for a change of its variables, ∂expression/∂variables · change."""
    return casadi.jtimes(expression, variables, change)


def gradient(expression: Symbol, variables: Symbol) -> Symbol:
    """Gradient of a scalar, as a column."""
    return casadi.gradient(expression, variables)


def substitute(expression: Symbol, variables: Symbol, values: Symbol) -> Symbol:
    """Replace variables in an expression."""
    return casadi.substitute(expression, variables, values)


def exp(expression: Symbol) -> Symbol:
    """Raise e to the expression."""
    return casadi.exp(expression)


def sqrt(expression: Symbol) -> Symbol:
    """Take the square root of every entry."""
    return casadi.sqrt(expression)


def dot(a: Symbol, b: Symbol) -> Symbol:
    """Inner product of two columns."""
    return casadi.dot(a, b)


def symmetric(matrix: Symbol) -> Symbol:
    """Take a matrix that is symmetric by its values from its lower triangle alone."""
    return casadi.tril2symm(casadi.tril(matrix))


def beside(left: Symbol, right: Symbol) -> Symbol:
    """Join two matrices side by side."""
    return casadi.horzcat(left, right)


def entries(expression: Symbol) -> set[tuple[int, int]]:
    """Row and column of every entry of a matrix that is not zero by its form."""
    rows, columns = casadi.sparsify(casadi.simplify(expression)).sparsity().get_triplet()
    return set(zip(rows, columns, strict=True))


class Function:
    """A compiled expression, evaluated at many points in one call.

    Parameters
    ----------
    name : str
    inputs : mapping of str to Symbol
        Columns; an evaluation takes each as an array (rows, points).
    *outputs : Symbol
        Matrices of any shape; made dense. An evaluation gives the first one, C code has all.
    """

    def __init__(self, name: str, inputs: Mapping[str, Symbol], *outputs: Symbol) -> None:
        self._function = casadi.Function(
            name,
            list(inputs.values()),
            [casadi.densify(output) for output in outputs],
            list(inputs),
            [f"output{number}" for number in range(len(outputs))],
            {"cse": True},
        )
        self._shape: tuple[int, int] = outputs[0].shape
        self._evaluators: dict[int, Callable[[Sequence[Array]], Array]] = {}

    def __call__(self, *arguments: Array) -> Array:
        """Evaluate.

        Parameters
        ----------
        *arguments : (points, rows) arrays
            One per input; an input with one point is used for all.

        Returns
        -------
        (points, output rows, output columns) array
            In Fortran order within a point, so that a one-column output is contiguous.
        """
        points = max(len(argument) for argument in arguments)
        if points not in self._evaluators:
            self._evaluators[points] = self._evaluator(points)
        return self._evaluators[points](arguments)

    def _evaluator(self, points: int) -> Callable[[Sequence[Array]], Array]:
        """Bind a mapped function to fixed buffers: CasADi's own conversions cost more than its evaluation."""
        mapped = self._function.map(points) if points > 1 else self._function
        buffer, trigger = mapped.buffer()
        rows, columns = self._shape
        inputs = [np.zeros((points, mapped.size1_in(i))) for i in range(mapped.n_in())]
        result = np.zeros((points, columns, rows))
        for i, array in enumerate(inputs):
            buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type, call-arg]
        buffer.set_res(0, memoryview(result))  # type: ignore[arg-type, call-arg]

        def evaluate(arguments: Sequence[Array], keep: object = (mapped, buffer)) -> Array:
            del keep  # the trigger holds raw pointers into both
            for fixed, argument in zip(inputs, arguments, strict=True):
                fixed[...] = argument
            trigger()
            return result.transpose(0, 2, 1).copy()

        return evaluate


def c_source(*functions: Function) -> str:
    """C99 text of functions for one point each, with CasADi's calling convention."""
    generator = casadi.CodeGenerator("equations", {"with_header": False, "verbose": False})
    for function in functions:
        generator.add(function._function)
    return str(generator.dump())
