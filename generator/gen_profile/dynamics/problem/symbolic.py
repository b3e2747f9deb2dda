"""The one module that loads CasADi: a thin typed layer over what the project uses of it.

Typing stops at `Symbol`; everything that comes out is a NumPy array or C text.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from math import prod
from typing import Any

import attrs
import casadi
import numpy as np

from gen_profile.motion.profile import Array

Symbol = Any  # casadi.SX

if hasattr(casadi.GlobalOptions, "setNumpyMode"):
    # plants call NumPy functions on symbols; -1 keeps the result symbolic, without a warning
    casadi.GlobalOptions.setNumpyMode(-1)


solve: Callable[[Symbol, Symbol], Symbol] = casadi.solve  # x of a x = b
jacobian: Callable[[Symbol, Symbol], Symbol] = casadi.jacobian  # ∂expression/∂variables
gradient: Callable[[Symbol, Symbol], Symbol] = casadi.gradient  # of a scalar, as a column
# change of an expression for a change of its variables, ∂expression/∂variables · change
directional: Callable[[Symbol, Symbol, Symbol], Symbol] = casadi.jtimes
substitute: Callable[[Symbol, Symbol, Symbol], Symbol] = casadi.substitute  # values for variables
exp: Callable[[Symbol], Symbol] = casadi.exp
sqrt: Callable[[Symbol], Symbol] = casadi.sqrt
dot: Callable[[Symbol, Symbol], Symbol] = casadi.dot


def symbols(name: str, count: int) -> Symbol:
    """Make a column of symbols."""
    return casadi.SX.sym(name, count)


def split(column: Symbol) -> list[Symbol]:
    """Entries of a column."""
    return list(casadi.vertsplit(column)) if column.shape[0] else []


def column(entries: Sequence[Any]) -> Symbol:
    """Stack scalars and columns."""
    return casadi.vertcat(*entries) if len(entries) else casadi.SX(0, 1)


def matrix(rows: Sequence[Sequence[Any]]) -> Symbol:
    """Make a matrix from nested rows of scalars."""
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))


def zeros(count: int, width: int) -> Symbol:
    """Make a matrix of zeros."""
    return casadi.SX(count, width)


def rows(matrix: Symbol) -> list[list[Symbol]]:
    """Entries of a matrix, row by row."""
    return [list(casadi.horzsplit(row)) for row in casadi.vertsplit(matrix)]


def depends(expression: Symbol, variables: Symbol) -> bool:
    """Tell whether any entry of an expression has any of some variables in it."""
    return bool(casadi.depends_on(casadi.simplify(expression), variables))


def at_zero(expression: Symbol, variables: Symbol) -> Symbol:
    """Let variables be zero in an expression."""
    return casadi.substitute(expression, variables, casadi.DM.zeros(variables.shape))


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


_MANY = 200  # points from which on NumPy is quicker, operation by operation, than CasADi point by point
_OPERATIONS: Mapping[str, Callable[..., Array]] = {
    "ADD": np.add,
    "SUB": np.subtract,
    "MUL": np.multiply,
    "DIV": np.divide,
    "NEG": np.negative,
    "INV": np.reciprocal,
    "SQ": np.square,
    "TWICE": lambda x: x + x,
    "POW": np.power,
    "CONSTPOW": np.power,
    "ATAN": np.arctan,
    "ATAN2": np.arctan2,
    "FABS": np.abs,
    **{
        name.upper(): getattr(np, name)
        for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "fmin", "fmax")
    },
}


@attrs.frozen(kw_only=True, slots=True)
class Instruction:
    """One scalar operation of a compiled expression.

    Attributes
    ----------
    operation : str
        Such as ``"ADD"`` or ``"SIN"``. ``"INPUT"`` reads a row of a column, ``"OUTPUT"`` writes an entry of a
        matrix, counted column by column; all else is in memory.
    arguments, results : tuple of int
        Numbers in memory that are read and written.
    constant : float
        What a ``"CONST"`` writes.
    """

    operation: str
    arguments: tuple[int, ...]
    results: tuple[int, ...]
    constant: float = 0.0


@cache
def _operation_names() -> dict[int, str]:
    codes = (name for name in dir(casadi) if name.startswith("OP_"))
    return {getattr(casadi, name): name.removeprefix("OP_") for name in codes}


class _Evaluators(threading.local):
    """Evaluators by the number of points: each has buffers of its own, and each thread its own evaluators."""

    def __init__(self) -> None:
        self.by_points: dict[int, Callable[[Sequence[Array]], Array]] = {}


class Function:
    """A compiled expression, evaluated at many points in one call; several threads may share it.

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
        self._evaluators = _Evaluators()

    @cached_property
    def _operations(self) -> list[_Operation]:
        return _operations(self.instructions())

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the first output."""
        return self._shape

    def instructions(self) -> tuple[Instruction, ...]:
        """List what is computed, one scalar operation after the other."""
        f, names = self._function, _operation_names()
        codes = [f.instruction_id(k) for k in range(f.n_instructions())]
        return tuple(
            Instruction(
                operation=names[code],
                arguments=tuple(f.instruction_input(k)),
                results=tuple(f.instruction_output(k)),
                constant=f.instruction_constant(k) if code == casadi.OP_CONST else 0.0,
            )
            for k, code in enumerate(codes)
        )

    def __call__(self, *arguments: Array) -> Array:
        """Evaluate.

        Parameters
        ----------
        *arguments : (…, rows) arrays
            One per input; their leading axes are broadcast, so what is alike along one need be given once.

        Returns
        -------
        (…, output rows, output columns) array
            In Fortran order within a point, so that a one-column output is contiguous.
        """
        shape = np.broadcast_shapes(*[argument.shape[:-1] for argument in arguments])
        points = prod(shape)
        if points >= _MANY and self._operations:
            return self._by_operations(shape, arguments)
        evaluators = self._evaluators.by_points
        if points not in evaluators:
            evaluators[points] = self._evaluator(points)
        if len(shape) > 1:
            whole = [np.broadcast_to(argument, (*shape, argument.shape[-1])) for argument in arguments]
            arguments = tuple(argument.reshape(points, -1) for argument in whole)
        return evaluators[points](arguments).reshape(*shape, *self._shape)

    def _by_operations(self, shape: tuple[int, ...], arguments: Sequence[Array]) -> Array:
        """Carry out every operation for all points; along an axis that no input of it has, once."""
        rows, width = self._shape
        result = np.zeros((*shape, width * rows))
        known: dict[int, Any] = {}
        with np.errstate(all="ignore"):
            for name, operation, places, place in self._operations:
                if operation is not None:
                    known[place] = operation(*[known[one] for one in places])
                elif name == "INPUT":
                    known[place] = np.ascontiguousarray(arguments[places[0]][..., places[1]])
                elif name == "OUTPUT":
                    result[..., place] = known[places[0]]
                else:
                    known[place] = places[0]
        return result.reshape(*shape, width, rows).swapaxes(-1, -2)

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


_Operation = tuple[str, "Callable[..., Array] | None", tuple[Any, ...], int]


def _operations(instructions: Sequence[Instruction]) -> list[_Operation]:
    """List operations of the first output, with the places read and written; none where NumPy lacks one."""
    operations: list[_Operation] = []
    for step in instructions:
        name, reads, operation = step.operation, step.arguments, _OPERATIONS.get(step.operation)
        if operation is None and name not in ("CONST", "INPUT", "OUTPUT"):
            return []
        if name != "OUTPUT" or step.results[0] == 0:
            operations.append(
                (name, operation, (step.constant,) if name == "CONST" else reads, step.results[-1])
            )
    return operations


def c_source(*functions: Function) -> str:
    """C99 text of functions for one point each, with CasADi's calling convention."""
    generator = casadi.CodeGenerator("equations", {"with_header": False, "verbose": False})
    for function in functions:
        generator.add(function._function)
    return str(generator.dump())
