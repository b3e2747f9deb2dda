"""A machine's equations with its axes' motion as input, and their derivatives."""

from functools import lru_cache

import attrs

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.sensitivities import swing_equations
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.plants.plant import Plant


@attrs.frozen(kw_only=True, eq=False)
class MotionEquations:
    """ẏ = f(y, axes, p) with y = (q_u, q̇_u, sensitivities) and axes = (q_a, q̇_a, q̈_a), all in SI units.

    Attributes
    ----------
    size : int
        Of y.
    rate : Function
        (y, axes, p) → (points, size, 1 + size + 3 m): f, ∂f/∂y, ∂f/∂axes.
    end_sway : Function
        The same → (points, directions, 1 + size + 3 m): the end load's sway and its derivatives.
    angle : Function
        The same → (points, loads, 1): rope angles.
    sway : Function
        The same → (points, loads, 1): sway of every load.
    """

    size: int
    rate: Function
    end_sway: Function
    angle: Function
    sway: Function


@lru_cache(maxsize=8)
def motion_equations(plant: Plant, desensitized: tuple[str, ...], order: int = 1) -> MotionEquations:
    """Derive a machine's equations, sensitivities to some of its parameters included, to an order."""
    d = dynamics(plant)
    swing, rate, reached = swing_equations(plant, d, desensitized, order)
    y = sym.column([swing, *(s.states for s in reached)])
    f = sym.column([rate, *(s.rates for s in reached)])
    axes = sym.column([d.q_a, d.dq_a, d.ddq_a])
    inputs, arguments = {"y": y, "axes": axes, "p": d.p}, sym.column([y, axes])

    def with_derivatives(name: str, expression: sym.Symbol) -> Function:
        return Function(name, inputs, sym.beside(expression, sym.jacobian(expression, arguments)))

    return MotionEquations(
        size=y.shape[0],
        rate=with_derivatives("rate", f),
        end_sway=with_derivatives("end_sway", d.sway[plant.end_load]),
        angle=Function("angle", inputs, d.angle),
        sway=Function("sway", inputs, d.sway),
    )
