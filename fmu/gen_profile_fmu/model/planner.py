"""An FMU's content of a planner block, alone or with the plant that it drives: the block's own text in C."""

import re
from collections.abc import Mapping, Sequence
from functools import cached_property, partial

import attrs

from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.planner.axis_declarations import GIVEN, PLACE, TAKEN
from gen_profile_exporters.planner.sensor_constants import INPUTS, OUTPUTS
from gen_profile_exporters.st_to_c import Translation, translate
from gen_profile_exporters.st_variables import StVariable
from gen_profile_exporters.templates import filled, indented
from gen_profile_fmu.model.c_sources import TEMPLATES, model_sources, variables_header
from gen_profile_fmu.model.contents import PLAIN, Model, plant_code
from gen_profile_fmu.model.dependencies import Structure, plant_structure
from gen_profile_fmu.model.documentation import block_page, planned_system_page
from gen_profile_fmu.model.plant_variables import PlantInstance, listed, planned_system_variables
from gen_profile_fmu.model.variables import FmuVariable, Kind, Type, VariableTable, require_good_names

# with which comments of declarations begin, beside those of live parameters
UNITS = ("m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "s")
TYPES = {"LREAL": Type.REAL, "BOOL": Type.BOOLEAN, "DINT": Type.INTEGER}
CYCLE = "fCycleTime"  # of the task: fixed, where others are inputs
MOVES = "fActVelocity"
OWN = (*TAKEN, *GIVEN)  # inputs and outputs of each axis
SENSED = (*INPUTS, *OUTPUTS)  # likewise of each of several
SETPOINTS = {
    "fPosition": "setpoint",
    "fVelocity": "setpoint_velocity",
    "fAcceleration": "setpoint_acceleration",
}


@attrs.frozen(kw_only=True, eq=False)
class _PlacedBlock:
    """A block, as it is among an FMU's variables.

    Attributes
    ----------
    text : str
        Its own.
    axes : mapping of str to str
        Names of those that it plans, by what its inputs and outputs end in.
    live : tuple of str
    inside : tuple of str
        Inputs of the block that are none of the FMU's.
    """

    text: str
    axes: Mapping[str, str]
    live: tuple[str, ...]
    inside: tuple[str, ...]

    @cached_property
    def source(self) -> BlockSource:
        """Its parts."""
        return parse_function_block(self.text)

    @property
    def code(self) -> Translation:
        """The same in C."""
        return translate(self.text)

    @property
    def given(self) -> list[StVariable]:
        """Inputs of the FMU."""
        return [v for v in self.code.inputs if v.name not in self.inside]

    @property
    def cycle(self) -> float:
        """Of the task, in s."""
        return next(v.start for v in self.code.inputs if v.name == CYCLE)

    @property
    def files(self) -> dict[str, str]:
        """C files of the block alone."""
        return {
            f"{self.code.name}.h": self.code.header,
            f"{self.code.name}.c": self.code.source,
            "planner_block.h": filled(TEMPLATES / "planner_block.h", block=self.code.name),
        }


def planner_model(name: str, text: str, axes: Mapping[str, str], live: tuple[str, ...]) -> Model:
    """Make the FMU's content of a planner block.

    Parameters
    ----------
    name : str
    text : str
        The block.
    axes : mapping of str to str
        Names of the axes that it plans, by what the names of its inputs and outputs end in.
    live : tuple of str
        Names of the live parameters.

    Raises
    ------
    ExportError
        The text is no function block.
    """
    block = _PlacedBlock(text=text, axes=axes, live=live, inside=(CYCLE,))
    orders, issued = _orders(block), _issued(block)
    table = VariableTable(blocks={**orders, **issued, "TIME": listed("time")})
    require_good_names("Planner", [*axes.values(), *live], table)
    at = _references(block, table)
    return Model(
        name=name,
        summary=f"planner of motions of {' and '.join(axes.values())} that leave no sway",
        variables=table,
        structure=_structure(block, table, at),
        code={
            **model_sources("planner_model.c"),
            "variables.h": variables_header(table, 1, 0, PLAIN | _constants(block)),
            **block.files,
            "planner_block.c": _block_source(block, at),
        },
        order=("planner_block.c", "planner_model.c"),
        page=partial(block_page, name, _words(block), table),
        stop_time=30.0,
        step=block.cycle,
    )


def planned_system_model(
    name: str, text: str, machine: PlantInstance, axes: Mapping[str, str], live: tuple[str, ...]
) -> Model:
    """Make the FMU's content of a planner block and the plant that it drives.

    Parameters
    ----------
    name, text, axes, live
        As of `planner_model`; axes of the machine.
    machine : PlantInstance

    Raises
    ------
    ExportError
        The text is no function block.
    CosimulationError
        The plant's names cannot be those of an FMU's variables.
    """
    plant, equations = machine.plant, dynamics(machine.plant)
    stands = tuple(f"{PLACE}{suffix}" for suffix in axes)
    moves = tuple(f"{MOVES}{suffix}" for suffix in axes)
    # the axes stand where they were led to
    block = _PlacedBlock(text=text, axes=axes, live=live, inside=(CYCLE, *stands, *moves))
    names = [axis.name for axis in plant.actuated]
    planned = [names.index(axis) for axis in axes.values()]
    table = planned_system_variables(machine, planned, _orders(block), _issued(block))
    led = table.references("COMMAND")[: len(axes)]
    at = _references(block, table) | dict(zip(stands, led, strict=True))
    tau, velocity, start = (table.references(of) for of in ("TAU", "DQ_A", "START"))
    drives = {axis: {rate, *tau} for axis, rate in enumerate(velocity)}
    of_plant = plant_structure(equations, table, drives)
    start_values = dict(zip(stands, (start[number] for number in planned), strict=True))
    of_block = _structure(block, table, at | start_values)
    asked = [led[planned.index(k)] if k in planned else None for k in range(len(names))]
    others = iter(table.references("OTHERS"))
    places = [next(others) if place is None else place for place in asked]
    constants = PLAIN | {"N_ORDERS": "1", "N_LED": str(len(planned))} | _constants(block)
    return Model(
        name=name,
        summary=f"{plant.summary}, following a planner",
        variables=table,
        structure=Structure(
            running=of_plant.running | of_block.running, starting=of_plant.starting | of_block.starting
        ),
        code={
            **plant_code(equations, table, constants, "planned_system_model.c"),
            **block.files,
            "planner_block.c": _block_source(block, at) + _axes_source(planned, places),
        },
        order=("equations.c", "driven_plant.c", "planner_block.c", "planned_system_model.c"),
        page=partial(planned_system_page, name, machine, _words(block), table),
        stop_time=30.0,
        step=block.cycle,
    )


def _axes_source(planned: Sequence[int], places: Sequence[int]) -> str:
    """Tell which axes the block plans, and where among the values each axis finds its setpoint."""
    led, asked = (", ".join(map(str, numbers)) for numbers in (planned, places))
    return f"""
static const int LED[N_LED] = {{{led}}};
static const int ASKED[N_A] = {{{asked}}};
"""


def _constants(block: _PlacedBlock) -> dict[str, str]:
    return {"HAS_BLOCK": "1", "CYCLE": repr(block.cycle)}


def _words(block: _PlacedBlock) -> str:
    return block.source.header.strip("(*) \n")


def _orders(block: _PlacedBlock) -> dict[str, tuple[FmuVariable, ...]]:
    """List the FMU's inputs."""
    return {
        "ORDERS": tuple(
            _variable(v, block, Kind.INPUT if v.type == "LREAL" else Kind.DISCRETE_INPUT) for v in block.given
        )
    }


def _issued(block: _PlacedBlock) -> dict[str, tuple[FmuVariable, ...]]:
    """List the outputs, setpoints apart."""
    outputs = {v.name: _variable(v, block, Kind.DISCRETE_OUTPUT) for v in _outputs(block)}
    return {
        "COMMAND": tuple(made for name, made in outputs.items() if _rank(name, block) < len(SETPOINTS)),
        "TOLD": tuple(made for name, made in outputs.items() if _rank(name, block) == len(SETPOINTS)),
    }


def _variable(v: StVariable, block: _PlacedBlock, kind: Kind) -> FmuVariable:
    comments = {known.name: known.comment for known in block.source.variables}
    unit, description = _explained(comments[v.name.partition("[")[0]], is_live=_is_live(v, block.live))
    return FmuVariable(
        name=_name(v, block),
        description=description or f"{v.name} of the block",
        unit=unit if v.type == "LREAL" else "",
        kind=kind,
        type=TYPES[v.type],
        start=v.start if kind.has_start else 0.0,
    )


def _name(variable: StVariable, block: _PlacedBlock) -> str:
    """Name a variable in FMI's manner: as plants name an axis's setpoint, else in snake case."""
    stem, axis = _of_axis(variable.name, block.axes)
    if variable.section == "VAR_OUTPUT" and stem in SETPOINTS:
        return f"{axis}.{SETPOINTS[stem]}"
    if _is_live(variable, block.live):
        return f"live.{variable.name[1:]}"
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", stem[1:]).lower()
    words = f"{words}_number" if variable.type == "DINT" and not words.endswith("_id") else words
    return f"{axis}.{words}" if stem != variable.name else words


def _of_axis(name: str, axes: Mapping[str, str]) -> tuple[str, str]:
    """Part a variable's name from its ending, and tell whose axis that is."""
    for suffix, axis in axes.items():
        if name.endswith(suffix) and name.removesuffix(suffix) in (OWN + SENSED if suffix else OWN):
            return name.removesuffix(suffix), axis
    return name, ""


def _is_live(variable: StVariable, live: tuple[str, ...]) -> bool:
    return variable.section == "VAR_INPUT" and variable.name[1:] in live


def _explained(comment: str, *, is_live: bool) -> tuple[str, str]:
    """Take the unit from the beginning of a declaration's comment."""
    first, _, rest = re.sub(r"([,;]|$)", "\0", comment, count=1).partition("\0")
    unit = re.sub(r"(?<=s)(?=[23]$)", "^", first.strip())
    return (unit, rest.strip(",; ")) if is_live or unit in UNITS else ("", comment)


def _outputs(block: _PlacedBlock) -> list[StVariable]:
    """List the outputs in the order of their value references: all positions, other setpoints, the rest."""
    return sorted(block.code.outputs, key=lambda v: _rank(v.name, block))


def _rank(name: str, block: _PlacedBlock) -> int:
    """Place an output among the setpoints, or behind them."""
    stem, _ = _of_axis(name, block.axes)
    return list(SETPOINTS).index(stem) if stem in SETPOINTS else len(SETPOINTS)


def _taken_over(block: Translation, at: Mapping[str, int]) -> dict[str, str]:
    """Tell which outputs show an input until the block is called: where the axis is, and its velocity."""
    actual = {v.name: f"{v.name[0]}Act{v.name[1:]}" for v in block.outputs}
    return {output: given for output, given in actual.items() if given in at}


def _references(block: _PlacedBlock, table: VariableTable) -> dict[str, int]:
    """Value references by the block's own names."""
    names = [v.name for v in (*block.given, *_outputs(block))]
    return dict(zip(names, table.references("ORDERS", "COMMAND", "TOLD"), strict=True))


def _structure(block: _PlacedBlock, table: VariableTable, at: Mapping[str, int]) -> Structure:
    """Let outputs follow from the time and all inputs, and at the start from where the axis stands."""
    outputs = table.references("COMMAND", "TOLD")
    running = table.references("ORDERS", "TIME")
    starting: dict[int, list[int]] = {output: [] for output in outputs}
    starting |= {at[output]: [at[given]] for output, given in _taken_over(block.code, at).items()}
    return Structure(running=dict.fromkeys(outputs, running), starting=starting)


def _block_source(block: _PlacedBlock, at: Mapping[str, int]) -> str:
    code, taken = block.code, _taken_over(block.code, at)
    given = [
        f"block->{v.name} = values[{at[v.name]}]{' != 0.0' if v.type == 'BOOL' else ''};"
        for v in code.inputs
        if v.name in at
    ]
    shown = [f"values[{at[v.name]}] = block->{v.name};" for v in code.outputs]
    stands = [f"block->{output} = values[{at[given]}];" for output, given in taken.items()]
    changes = [f"tangent[{at[output]}] = tangent[{at[given]}];" for output, given in taken.items()]
    return filled(
        TEMPLATES / "planner_block.c",
        block=code.name,
        stands=indented(stands),
        changes=indented(changes),
        given=indented(given),
        shown=indented(shown),
    )
