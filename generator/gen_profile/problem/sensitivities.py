"""First-order sensitivities of a state to parameters, eq. (13)–(14) with both terms.

With S = ∂x/∂δ, where δ is the relative change of a parameter μ (so ∂/∂δ = μ ∂/∂μ):

    Ṡ = (∂f/∂x) S + μ ∂f/∂μ,   S(t0) = 0
"""

from __future__ import annotations

import attrs

from gen_profile.problem import symbolic as sym
from gen_profile.problem.symbolic import Symbol


@attrs.frozen(kw_only=True, eq=False)
class Sensitivities:
    """Sensitivity states of one parameter, those that are zero by structure left out.

    Attributes
    ----------
    states : column
        Symbols of the rows that can move.
    rates : column
        Their time derivatives.
    rows : tuple of int
        Which states of the plant they belong to.
    """

    states: Symbol
    rates: Symbol
    rows: tuple[int, ...]


def sensitivities(name: str, f: Symbol, x: Symbol, parameter: Symbol) -> Sensitivities:
    """Derive the sensitivity equations of ``ẋ = f(x, …)`` to one parameter.

    Parameters
    ----------
    name : str
        Of the parameter, for the symbols.
    f, x : (n,) columns
    parameter : scalar symbol
    """
    jacobian = sym.jacobian(f, x)
    forcing = parameter * sym.jacobian(f, parameter)
    rows = _moving_rows(jacobian, forcing)
    states = sym.symbols(f"S_{name}", len(rows))
    full = [0.0] * x.shape[0]
    for row, state in zip(rows, sym.split(states), strict=True):
        full[row] = state
    rates = jacobian @ sym.column(full) + forcing
    return Sensitivities(states=states, rates=sym.column([rates[row] for row in rows]), rows=rows)


def _moving_rows(jacobian: Symbol, forcing: Symbol) -> tuple[int, ...]:
    """Rows that the parameter reaches, directly or through other rows."""
    reached = {row for row, _ in sym.entries(forcing)}
    couplings = sym.entries(jacobian)
    while more := {row for row, by in couplings if by in reached} - reached:
        reached |= more
    return tuple(sorted(reached))
