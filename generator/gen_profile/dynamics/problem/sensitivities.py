"""Sensitivities of a state to parameters, eq. (13)–(14) with both terms, to first or second order.

With S = ∂x/∂δ, where δ is the relative change of a parameter μ (so ∂/∂δ = μ ∂/∂μ):

    Ṡ = (∂f/∂x) S + μ ∂f/∂μ,   S(t0) = 0

Second-order sensitivities are the sensitivities of S: the same rule, applied to the equations of x and S
together. Where S is zero they are second derivatives, whatever the parametrisation.
"""

from collections.abc import Mapping, Sequence

import attrs

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import Dynamics
from gen_profile.dynamics.problem.symbolic import Symbol
from gen_profile.plants.plant import Plant


@attrs.frozen(kw_only=True, eq=False)
class Sensitivities:
    """Sensitivity states to one parameter (or to a pair), those that are zero by structure left out.

    Attributes
    ----------
    parameters : tuple of str
        One parameter; for second order two, the same one twice for its own second derivative.
    states : column
        Symbols of the rows that can move.
    rates : column
        Their time derivatives.
    rows : tuple of int
        Which states of the plant they belong to.
    """

    parameters: tuple[str, ...]
    states: Symbol
    rates: Symbol
    rows: tuple[int, ...]


def sensitivities(
    f: Symbol, x: Symbol, parameters: Mapping[str, Symbol], names: Sequence[str], order: int = 1
) -> tuple[Sensitivities, ...]:
    """Derive the sensitivity equations of ``ẋ = f(x, …)``.

    Parameters
    ----------
    f, x : (n,) columns
    parameters : mapping of str to scalar symbol
    names : sequence of str
        Parameters to derive by.
    order : int
        1, or 2 for second derivatives, mixed ones included, beside the first.
    """
    first = [_derived((name,), f, x, parameters[name], []) for name in names]
    if order == 1:
        return tuple(first)
    second = [
        _derived(
            (one.parameters[0], other.parameters[0]), f, x, parameters[other.parameters[0]], [one, other]
        )
        for index, one in enumerate(first)
        for other in first[: index + 1]
    ]
    return (*first, *second)


def swing_equations(
    plant: Plant, d: Dynamics, names: Sequence[str], order: int
) -> tuple[Symbol, Symbol, tuple[Sensitivities, ...]]:
    """Give (q_u, q̇_u) of a plant, its rates, and its sensitivities to parameters."""
    swing, rate = sym.column([d.q_u, d.dq_u]), sym.column([d.dq_u, d.ddq_u])
    by_name = dict(zip((q.name for q in plant.parameters), sym.split(d.p), strict=True))
    return swing, rate, sensitivities(rate, swing, by_name, names, order)


def _derived(
    names: tuple[str, ...], f: Symbol, x: Symbol, parameter: Symbol, of: Sequence[Sensitivities]
) -> Sensitivities:
    """Derive f, or the rates of the first of two sensitivities, along a parameter.

    ``of`` holds nothing, or the sensitivities that are derived and those along the parameter.
    """
    n = x.shape[0]
    jacobian = sym.jacobian(f, x)
    if of:
        one, along = of
        rates = _full(one, one.rates, n)
        forcing = parameter * sym.jacobian(rates, parameter) + sym.jacobian(rates, x) @ _full(
            along, along.states, n
        )
    else:
        forcing = parameter * sym.jacobian(f, parameter)
    rows = _moving_rows(jacobian, forcing)
    states = sym.symbols("S_" + "_".join(names), len(rows))
    sensitivities = Sensitivities(parameters=names, states=states, rates=states, rows=rows)
    rates = jacobian @ _full(sensitivities, states, n) + forcing
    return attrs.evolve(sensitivities, rates=sym.column([rates[row] for row in rows]))


def _full(sensitivities: Sensitivities, column: Symbol, n: int) -> Symbol:
    """Put the rows of a column back to where they belong among n."""
    entries = [sym.zeros(1, 1)] * n
    for row, entry in zip(sensitivities.rows, sym.split(column), strict=True):
        entries[row] = entry
    return sym.column(entries)


def _moving_rows(jacobian: Symbol, forcing: Symbol) -> tuple[int, ...]:
    """Rows that the parameter reaches, directly or through other rows."""
    reached = {row for row, _ in sym.entries(forcing)}
    couplings = sym.entries(jacobian)
    while more := {row for row, by in couplings if by in reached} - reached:
        reached |= more
    return tuple(sorted(reached))
