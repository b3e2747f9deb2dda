"""Which variables an FMU's unknowns depend on, read off the sparsity of the equations' Jacobian.

FMI asks for two lists (2.0.4 section 2.2.8, 3.0 section 2.4.8): during the simulation, with states, inputs
and time known; and at its start, with parameters, inputs and what has a start value known.
"""

from collections.abc import Iterable, Mapping

import attrs

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import Dynamics
from gen_profile_fmu.model.variables import OBSERVED, Kind, VariableTable

Dependencies = dict[int, list[int]]


@attrs.frozen(kw_only=True)
class Structure:
    """Known variables by the unknowns they have an influence on, as value references.

    Attributes
    ----------
    running, starting : dict of int to list of int
        During the simulation, and at its start.
    """

    running: Dependencies
    starting: Dependencies


def plant_structure(equations: Dynamics, table: VariableTable, drives: Mapping[int, set[int]]) -> Structure:
    """Find the dependencies of an FMU with a plant.

    Parameters
    ----------
    equations : Dynamics
    table : VariableTable
    drives : mapping of int to set of int
        Per axis, by number, what its acceleration follows from: states, inputs, parameters and time.
    """
    states = table.states
    known: dict[int, set[int]] = {reference: {reference} for reference in states}
    known |= _rows(equations, equations.outputs, table.references(*OBSERVED), table, drives)
    known |= _derivatives(equations, table, drives)
    if "DISTANCE" in table.blocks:
        known |= _motion(table)
    start: dict[int, set[int]] = {reference: set() for reference in table.references("DQ_A")}
    start |= {place: {at} for place, at in zip(*map(table.references, ("Q_A", "START")), strict=True)}
    running = {*table.references_of(Kind.INPUT), *states, *table.references("TIME")}
    given = table.references_of(*(kind for kind in Kind if kind.has_start))
    starting = {*given, *table.references("TIME")}
    return Structure(running=_within(known, running), starting=_within(_substituted(known, start), starting))


def profile_structure(table: VariableTable) -> Structure:
    """Find the dependencies of an FMU with a motion alone: it depends on the time."""
    known = _motion(table)
    starting = {*table.references("START", "DISTANCE", "START_TIME", "WAIT", "TRIGGER", "TIME")}
    return Structure(running=_within(known, {*table.references("TIME")}), starting=_within(known, starting))


def _motion(table: VariableTable) -> dict[int, set[int]]:
    """Let a motion follow from the time, from what begins it, and from where it leads."""
    sources = {*table.references("START_TIME", "WAIT", "TRIGGER", "TIME")}
    start, distance = table.references("START"), table.references("DISTANCE")
    known = dict.fromkeys(table.references("MOVING", "DONE"), sources)
    for index, reference in enumerate(table.references("COMMAND")):
        order, axis = divmod(index, len(start))
        known[reference] = {*sources, distance[axis], *([start[axis]] if order == 0 else [])}
    return known


def _derivatives(
    equations: Dynamics, table: VariableTable, drives: Mapping[int, set[int]]
) -> dict[int, set[int]]:
    n_u, n_a = len(table.blocks["Q_U"]), len(table.blocks["Q_A"])
    der = table.derivatives
    rates = zip(der[:n_u], table.references("DQ_U"), strict=True)
    velocities = zip(der[2 * n_u : 2 * n_u + n_a], table.references("DQ_A"), strict=True)
    return {
        **{derivative: {rate} for derivative, rate in (*rates, *velocities)},
        **_rows(equations, equations.ddq_u, der[n_u : 2 * n_u], table, drives),
        **{derivative: drives[axis] for axis, derivative in enumerate(der[2 * n_u + n_a :])},
    }


def _rows(
    equations: Dynamics,
    expressions: sym.Symbol,
    unknowns: list[int],
    table: VariableTable,
    drives: Mapping[int, set[int]],
) -> dict[int, set[int]]:
    """Per expression, what it follows from; accelerations of axes are traced to what they follow from."""
    e = equations
    arguments = sym.column([e.q_u, e.dq_u, e.q_a, e.dq_a, e.p, e.ddq_a])
    plain = [{reference} for reference in table.references("Q_U", "DQ_U", "Q_A", "DQ_A", "P")]
    columns = [*plain, *(drives[axis] for axis in sorted(drives))]
    sources: dict[int, set[int]] = {unknown: set() for unknown in unknowns}
    for row, column in sym.entries(sym.jacobian(expressions, arguments)):
        sources[unknowns[row]] |= columns[column]
    return sources


def _substituted(known: Mapping[int, set[int]], start: Mapping[int, set[int]]) -> dict[int, set[int]]:
    """Replace states by what they follow from at the start."""

    def traced(references: Iterable[int]) -> set[int]:
        return set().union(*(start.get(reference, {reference}) for reference in references))

    return {unknown: traced(references) for unknown, references in known.items()}


def _within(known: Mapping[int, set[int]], allowed: set[int]) -> Dependencies:
    return {unknown: sorted(references & allowed) for unknown, references in known.items()}
