"""An FMU's content of a planner block: the block's own text in C, as a sampled controller."""

from __future__ import annotations

import re
from functools import partial

from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.st_to_c import StVariable, Translation, translate
from gen_profile_fmu.model.c_sources import hand_written, variables_header
from gen_profile_fmu.model.contents import PLAIN, Model, identifier_of
from gen_profile_fmu.model.dependencies import Structure
from gen_profile_fmu.model.documentation import block_page
from gen_profile_fmu.model.plant_variables import time_variable
from gen_profile_fmu.model.variables import FmuVariable, Kind, Type, VariableTable, require_good_names

UNITS = (
    "m",
    "m/s",
    "m/s^2",
    "s",
)  # with which comments of declarations begin, beside those of live parameters
TYPES = {"LREAL": Type.REAL, "BOOL": Type.BOOLEAN, "DINT": Type.INTEGER}
CYCLE = "fCycleTime"  # of the task: fixed, where others are inputs
SETPOINTS = {
    "fPosition": "setpoint",
    "fVelocity": "setpoint_velocity",
    "fAcceleration": "setpoint_acceleration",
}


def planner_model(name: str, text: str, axis: str, live: tuple[str, ...]) -> Model:
    """Make the FMU's content of a planner block.

    Parameters
    ----------
    name : str
    text : str
        The block.
    axis : str
        Name of the axis that it plans.
    live : tuple of str
        Names of the live parameters.

    Raises
    ------
    ExportError
        The text is no function block.
    """
    source, block = parse_function_block(text), translate(text)
    table = _variables(source, block, axis, live)
    cycle = next(v.start for v in block.inputs if v.name == CYCLE)
    constants = PLAIN | {"HAS_BLOCK": "1", "CYCLE": repr(cycle)}
    return Model(
        name=name,
        identifier=identifier_of(name),
        summary=f"planner of motions of {axis} that leave no sway",
        variables=table,
        structure=_structure(block, table),
        interpolates_inputs=False,
        code={
            **hand_written("planner_model.c"),
            "variables.h": variables_header(table, 1, 0, constants),
            f"{block.name}.h": block.header,
            f"{block.name}.c": block.source,
            "planner_block.h": _block_header(block),
            "planner_block.c": _block_source(block, table),
        },
        order=("planner_block.c", "planner_model.c"),
        page=partial(block_page, name, source.header.strip("(*) \n"), table),
        stop_time=30.0,
        step=cycle,
    )


def _variables(source: BlockSource, block: Translation, axis: str, live: tuple[str, ...]) -> VariableTable:
    comments = {v.name: v.comment for v in source.variables}

    def variable(v: StVariable, kind: Kind) -> FmuVariable:
        unit, description = _explained(comments[v.name], is_live=_is_live(v, live))
        return FmuVariable(
            name=_name(v, axis, live),
            description=description or f"{v.name} of the block",
            unit=unit if v.type == "LREAL" else "",
            kind=kind,
            type=TYPES[v.type],
            start=v.start if kind.has_start else 0.0,
        )

    inputs = [
        variable(v, Kind.INPUT if v.type == "LREAL" else Kind.DISCRETE_INPUT)
        for v in block.inputs
        if v.name != CYCLE
    ]
    outputs = {v.name: variable(v, Kind.DISCRETE_OUTPUT) for v in _outputs(block)}
    table = VariableTable(
        blocks={
            "ORDERS": tuple(inputs),
            "COMMAND": tuple(made for name, made in outputs.items() if name in SETPOINTS),
            "TOLD": tuple(made for name, made in outputs.items() if name not in SETPOINTS),
            "TIME": (time_variable(),),
        }
    )
    require_good_names("Planner", [axis, *live], table)
    return table


def _name(variable: StVariable, axis: str, live: tuple[str, ...]) -> str:
    """Name a variable in FMI's manner: as plants name an axis's setpoint, else in snake case."""
    name = variable.name
    if variable.section == "VAR_OUTPUT" and name in SETPOINTS:
        return f"{axis}.{SETPOINTS[name]}"
    if _is_live(variable, live):
        return f"live.{name[1:]}"
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name[1:]).lower()
    return f"{words}_number" if variable.type == "DINT" and not words.endswith("_id") else words


def _is_live(variable: StVariable, live: tuple[str, ...]) -> bool:
    return variable.section == "VAR_INPUT" and variable.name[1:] in live


def _explained(comment: str, *, is_live: bool) -> tuple[str, str]:
    """Take the unit from the beginning of a declaration's comment."""
    first, _, rest = re.sub(r"([,;]|$)", "\0", comment, count=1).partition("\0")
    unit = re.sub(r"(?<=s)(?=[23]$)", "^", first.strip())
    return (unit, rest.strip(",; ")) if is_live or unit in UNITS else ("", comment)


def _outputs(block: Translation) -> list[StVariable]:
    """List the outputs in the order of their value references: setpoints first."""
    return sorted(block.outputs, key=lambda v: v.name not in SETPOINTS)


def _taken_over(block: Translation) -> dict[str, str]:
    """Tell which outputs show an input until the block is called: where the axis stands."""
    inputs = {v.name for v in block.inputs}
    actual = {v.name: f"{v.name[0]}Act{v.name[1:]}" for v in block.outputs}
    return {output: given for output, given in actual.items() if given in inputs}


def _references(block: Translation, table: VariableTable) -> dict[str, int]:
    """Value references by the block's own names."""
    inputs = [v.name for v in block.inputs if v.name != CYCLE]
    names = [*inputs, *(v.name for v in _outputs(block))]
    return dict(zip(names, table.references("ORDERS", "COMMAND", "TOLD"), strict=True))


def _structure(block: Translation, table: VariableTable) -> Structure:
    """Let outputs follow from the time and all inputs, and at the start from where the axis stands."""
    at = _references(block, table)
    outputs = table.references("COMMAND", "TOLD")
    running = table.references("ORDERS", "TIME")
    starting: dict[int, list[int]] = {output: [] for output in outputs}
    starting |= {at[output]: [at[given]] for output, given in _taken_over(block).items()}
    return Structure(running=dict.fromkeys(outputs, running), starting=starting)


def _block_header(block: Translation) -> str:
    return f"""\
/* The planner block that planner_model.c calls. */
#ifndef PLANNER_BLOCK_H
#define PLANNER_BLOCK_H

#define CHECKED
#include "{block.name}.h"

typedef {block.name} PlannerBlock;

#endif
"""


def _block_source(block: Translation, table: VariableTable) -> str:
    at, taken = _references(block, table), _taken_over(block)
    given = [
        f"block->{v.name} = values[{at[v.name]}]{' != 0.0' if v.type == 'BOOL' else ''};"
        for v in block.inputs
        if v.name != CYCLE
    ]
    shown = [f"values[{at[v.name]}] = block->{v.name};" for v in block.outputs]
    stands = [f"block->{output} = values[{at[given]}];" for output, given in taken.items()]
    changes = [f"tangent[{at[output]}] = tangent[{at[given]}];" for output, given in taken.items()]
    return f"""\
/* The planner block, and its inputs and outputs among the FMU's variables. */
#include "{block.name}.c"

static void block_begin(PlannerBlock *block, const double values[]) {{
    {block.name}_init(block);
    {_statements(stands)}
}}

static void block_begin_tangent(double tangent[]) {{
    {_statements(changes)}
}}

static void block_call(PlannerBlock *block, const double values[]) {{
    {_statements(given)}
    {block.name}_step(block);
}}

static void block_show(const PlannerBlock *block, double values[]) {{
    {_statements(shown)}
}}
"""


def _statements(lines: list[str]) -> str:
    return "\n    ".join(lines)
