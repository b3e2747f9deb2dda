"""C sources of a plant FMU: CasADi's equations, the variable table and the hand-written files."""

from __future__ import annotations

from pathlib import Path

from gen_profile.plants.plant import Plant
from gen_profile.problem import symbolic as sym
from gen_profile.problem.dynamics import Dynamics
from gen_profile.problem.symbolic import Symbol
from gen_profile_fmu.variables import Variable, VariableTable

HAND_WRITTEN = (
    "driven_plant.c",
    "driven_plant.h",
    "fmi2_cosimulation.c",
    "plant_equations.h",
)


def c_sources(plant: Plant, equations: Dynamics, table: VariableTable) -> dict[str, str]:
    """Collect the texts that make the FMU's binary, all but `identity_header`, by file name."""
    folder = Path(__file__).parent
    return {
        **{name: (folder / name).read_text(encoding="utf-8") for name in HAND_WRITTEN},
        "variables.h": _variables_header(plant, table),
        "plant_acceleration.c": _equation("plant_acceleration", equations, equations.ddq_u),
        "plant_jump.c": _equation("plant_jump", equations, equations.driven @ equations.ddq_a),
        "plant_outputs.c": _equation(
            "plant_outputs", equations, sym.column([equations.sway, equations.height, equations.angle])
        ),
    }


def identity_header(guid: str) -> str:
    """Write the header that ties the binary to its model description."""
    return f'#define MODEL_GUID "{guid}"\n'


def _equation(name: str, equations: Dynamics, output: Symbol) -> str:
    """Write a column of expressions as C, with the arguments that plant_equations.h declares."""
    inputs = {
        "q_u": equations.q_u,
        "dq_u": equations.dq_u,
        "q_a": equations.q_a,
        "dq_a": equations.dq_a,
        "input": equations.ddq_a,
        "parameters": equations.p,
    }
    # CasADi exports every function of its own on Windows unless it is told how to export
    return "#define CASADI_SYMBOL_EXPORT\n" + sym.Function(name, inputs, output).c_source


def _variables_header(plant: Plant, table: VariableTable) -> str:
    offsets = ",\n".join(f"    {block} = {table.offset(block)}" for block in table.blocks)
    rows = ",\n".join(_variable_row(variable) for variable in table.variables)
    return f"""\
/* The FMU's variables; a variable's value reference is its index. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include <float.h>

enum {{ N_U = {len(plant.unactuated)}, N_A = {len(plant.actuated)}, N_VALUES = {len(table.variables)} }};

/* First value reference of every block. */
enum {{
{offsets}
}};

typedef enum {{ FIXED_PARAMETER, TUNABLE_PARAMETER, INPUT, OUTPUT }} Kind;

typedef struct {{
    const char *name;
    Kind kind;
    double start, lower, upper;
}} Variable;

static const Variable VARIABLES[N_VALUES] = {{
{rows}
}};

#endif
"""


def _variable_row(variable: Variable) -> str:
    lower = "-DBL_MAX" if variable.lower is None else repr(float(variable.lower))
    upper = "DBL_MAX" if variable.upper is None else repr(float(variable.upper))
    return f'    {{"{variable.name}", {variable.kind.name}, {float(variable.start)!r}, {lower}, {upper}}}'
