"""A machine's equations without accelerations, and their derivatives, evaluated on balls.

Setpoints that are interpolated linearly have accelerations that are impulses. With D = −M_uu⁻¹ M_auᵀ, which
depends on coordinates only, and v = q̇_a, the variable w = q̇_u − D v does not jump when v does:

    q̇_u = w + D v
    ẇ    = free(q_u, q̇_u, q_a, v) − (∂D/∂q_u q̇_u + ∂D/∂q_a v) v

which is ẋ = f(x, q_a, v, p) for x = (q_u, w): the same motion as eq. (3)'s, and the FMU's, whose rates jump
by D Δv at a setpoint.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic import affine, balls
from gen_profile.assurance.certificate.arithmetic.affine import Affine, AffineOperand, constant
from gen_profile.assurance.certificate.arithmetic.balls import Ball, ball
from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.symbolic import Function, Instruction
from gen_profile.plants.plant import Plant
from gen_profile.support.errors import CertificateError


def _power(x: Any, exponent: Any) -> Any:
    constant = np.ndim(exponent.mid) == 0 and np.ndim(exponent.rad) == 0 and float(exponent.rad) == 0.0
    if not constant:
        return OPERATIONS["EXP"](exponent * OPERATIONS["LOG"](x))
    whole = float(exponent.mid) == int(exponent.mid) and abs(exponent.mid) <= balls.MOST_FACTORS
    return (
        balls.power(x, float(exponent.mid))
        if whole
        else _on(lambda one: balls.power(one, float(exponent.mid)))(x)
    )


def _on(
    function: Callable[[Ball], Ball], closely: Callable[[Affine], Affine] | None = None
) -> Callable[[Any], Any]:
    """Evaluate a function of balls on what is no ball, too: closely, or as one."""

    def evaluated(x: Ball | Affine) -> Ball | Affine:
        if isinstance(x, Ball):
            return function(x)
        return closely(x) if closely else affine.constant(function(x.ball), x.reach)

    return evaluated


OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "ASSIGN": lambda x: x,
    "ADD": lambda x, y: x + y,
    "SUB": lambda x, y: x - y,
    "MUL": lambda x, y: x * y,
    "DIV": lambda x, y: x / y,
    "NEG": lambda x: -x,
    "SQ": lambda x: x * x,
    "TWICE": lambda x: 2.0 * x,
    "INV": lambda x: 1.0 / x,
    "SIN": _on(balls.sin, affine.sine_like(np.sin, np.cos)),
    "COS": _on(balls.cos, affine.sine_like(np.cos, lambda x: -np.sin(x))),
    "TAN": _on(balls.tan),
    "SINH": _on(balls.sinh, affine.sine_like(np.sinh, np.cosh)),
    "COSH": _on(balls.cosh, affine.sine_like(np.cosh, np.sinh)),
    "TANH": _on(balls.tanh),
    "EXP": _on(balls.exp, affine.sine_like(np.exp, np.exp)),
    "LOG": _on(balls.log),
    "SQRT": _on(balls.sqrt),
    "FABS": _on(balls.absolute),
    "SIGN": _on(balls.sign),
    "POW": _power,
    "CONSTPOW": _power,
}


def over_sinh(numerator: Any, x: Any) -> Any:
    """Divide by sinh x so that little is left where x is large, however wide it is."""
    small = OPERATIONS["EXP"](-x)
    return 2.0 * numerator * small / (1.0 - small * small)


def _applied(operation: str, arguments: Sequence[Any], angle: Any) -> Any:
    """Apply an operation; the last argument may be the hyperbolic sine of an angle."""
    if angle is not None and operation in {"DIV", "INV"}:
        return over_sinh(arguments[0] if operation == "DIV" else 1.0, angle)
    return OPERATIONS[operation](*arguments)


class Enclosed:
    """An expression that is evaluated on balls.

    Parameters
    ----------
    function : Function
    what : str
        For errors.

    Raises
    ------
    CertificateError
        It has operations that are not analytic, or not known here.
    """

    def __init__(self, function: Function, what: str) -> None:
        self._instructions: tuple[Instruction, ...] = function.instructions()
        known = {*OPERATIONS, "INPUT", "OUTPUT", "CONST"}
        unknown = sorted(
            {step.operation.lower() for step in self._instructions if step.operation not in known}
        )
        if unknown:
            raise CertificateError(
                f"The equations of {what} use {', '.join(unknown)}, for which no proof is written; "
                "a certificate needs equations of smooth functions (sin, cos, exp, sqrt, tanh and alike)."
            )
        self.rows, self._columns = function.shape

    def __call__(self, *inputs: Sequence[AffineOperand]) -> list[list[Ball]]:
        """Evaluate on columns of balls, or of what knows its parameters; the result is nested rows."""
        rows = self.evaluated(*inputs)
        return [[one if isinstance(one, Ball) else one.ball for one in row] for row in rows]

    def evaluated(self, *inputs: Sequence[AffineOperand]) -> list[list[Any]]:
        """Evaluate likewise, to what still knows its parameters where an input does."""
        reach = next((x.reach for column in inputs for x in column if isinstance(x, Affine)), None)
        memory: dict[int, Any] = {}
        angles: dict[int, Any] = {}  # of places that hold a hyperbolic sine
        results: dict[int, Any] = {}

        def taken(value: AffineOperand) -> Ball | Affine:
            if isinstance(value, Affine):
                return value
            return ball(value) if reach is None else constant(value, reach)

        for step in self._instructions:
            if step.operation == "OUTPUT":
                results[step.results[1]] = memory[step.arguments[0]]
                continue
            angle = None
            if step.operation == "INPUT":
                column, row = step.arguments
                value = taken(inputs[column][row])
            elif step.operation == "CONST":
                value = taken(step.constant)
            else:
                arguments = [memory[place] for place in step.arguments]
                value = _applied(step.operation, arguments, angles[step.arguments[-1]])
                angle = arguments[0] if step.operation == "SINH" else None
            memory[step.results[0]], angles[step.results[0]] = value, angle
        entries = [one for _, one in sorted(results.items())]
        return [entries[row :: self.rows] for row in range(self.rows)]


@attrs.frozen(kw_only=True, eq=False)
class EnclosedEquations:
    """f and what bounds need of it, of columns (x, q_a, v, p) unless told otherwise.

    Attributes
    ----------
    rate : 2 n_u × 1
        f.
    jacobian : 2 n_u × 2 n_u
        J = ∂f/∂x.
    jacobian_change : 2 n_u × 2 n_u
        Change of J, of (x, q_a, v, p) and a change of x.
    lift : 2 n_u × m
        G = ∂f/∂v.
    lift_change : 2 n_u × m
        Change of G, of (x, q_a, v, p) and a change of x.
    by_position : 2 n_u × m
        ∂f/∂q_a.
    curvature : 2 n_u × (2 m)²
        Second derivatives of f by (q_a, v).
    pull : 2 n_u × m
        P = J G + ∂f/∂q_a − dG/dt along the smooth motion, of (x, q_a, v, p, q̈_a).
    pull_change : 2 n_u × m
        dP/dt, of (x, q_a, v, p, q̈_a), ẋ and the jerk of the axes.
    sway : loads × 1, and perhaps 3 more of every body
        Sways, and places in m, of (q_u, q_a, p).
    sway_slopes : as many × n_u
        Its derivatives by q_u.
    sway_by_position : as many × m
        Its derivatives by q_a.
    jump : n_u × m
        D, of (q_u, q_a, p).
    """

    rate: Enclosed
    jacobian: Enclosed
    jacobian_change: Enclosed
    lift: Enclosed
    lift_change: Enclosed
    by_position: Enclosed
    curvature: Enclosed
    pull: Enclosed
    pull_change: Enclosed
    sway: Enclosed
    sway_slopes: Enclosed
    sway_by_position: Enclosed
    jump: Function


@cache
def enclosed_equations(plant: Plant, places: bool = False) -> EnclosedEquations:
    """Derive a machine's equations for balls, with the places of its bodies behind the sways if wanted.

    Raises
    ------
    CertificateError
        They cannot be enclosed.
    """
    d = dynamics(plant)
    if sym.depends(d.input_matrix, sym.column([d.dq_u, d.dq_a])):
        raise CertificateError(
            f"The inertia of {plant.type} depends on velocities, for which no proof is written."
        )
    n_u, m = len(plant.unactuated), len(plant.actuated)
    q_a, v, ddq_a, jerk = d.q_a, d.dq_a, d.ddq_a, sym.symbols("jerk", m)
    x = sym.column([d.q_u, sym.symbols("w", n_u)])
    rates = x[n_u:] + d.input_matrix @ v
    along = sym.directional(d.input_matrix @ v, sym.column([d.q_u, q_a]), sym.column([d.dq_u, v]))
    f = sym.column([rates, sym.substitute(d.drift - along, d.dq_u, rates)])
    slopes, lift, by_position = sym.jacobian(f, x), sym.jacobian(f, v), sym.jacobian(f, q_a)
    state = {"x": x, "q_a": q_a, "v": v, "p": d.p}
    smooth = {**state, "ddq_a": ddq_a}
    arguments = {"q_u": d.q_u, "q_a": q_a, "p": d.p}
    seen = sym.column([d.sway, d.place]) if places else d.sway
    d_x = sym.symbols("d_x", 2 * n_u)
    motion = sym.column([x, q_a, v, ddq_a])

    def change(expression: sym.Symbol, variables: sym.Symbol, by: sym.Symbol) -> sym.Symbol:
        columns = [sym.directional(expression[:, k], variables, by) for k in range(expression.shape[1])]
        return sym.matrix([columns])

    axes = sym.column([q_a, v])
    by_axes = sym.jacobian(f, axes)
    pull = slopes @ lift + by_position - change(lift, motion[: 2 * n_u + 2 * m], sym.column([f, v, ddq_a]))
    curvature = sym.matrix([[sym.jacobian(by_axes[:, k], axes) for k in range(2 * m)]])
    pull_change = change(pull, motion, sym.column([d_x, v, ddq_a, jerk]))
    expressions = {
        "rate": (f, state),
        "jacobian": (slopes, state),
        "jacobian_change": (change(slopes, x, d_x), {**state, "d_x": d_x}),
        "lift": (lift, state),
        "lift_change": (change(lift, x, d_x), {**state, "d_x": d_x}),
        "by_position": (by_position, state),
        "curvature": (curvature, state),
        "pull": (pull, smooth),
        "pull_change": (pull_change, {**smooth, "d_x": d_x, "jerk": jerk}),
        "sway": (seen, arguments),
        "sway_slopes": (sym.jacobian(seen, d.q_u), arguments),
        "sway_by_position": (sym.jacobian(seen, q_a), arguments),
    }
    functions = {name: Function(name, inputs, one) for name, (one, inputs) in expressions.items()}
    return EnclosedEquations(
        jump=Function("jump", arguments, d.input_matrix),
        **{name: Enclosed(function, plant.type) for name, function in functions.items()},
    )
