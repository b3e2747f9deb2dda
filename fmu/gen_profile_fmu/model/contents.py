"""What goes into an FMU, whatever FMI's version: variables, their structure, C sources and words."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import attrs

from gen_profile.dynamics.problem.dynamics import Dynamics, dynamics
from gen_profile.motion.profile import Profile
from gen_profile.plants.plant import Coordinate
from gen_profile_exporters.planner.c_source import c_name
from gen_profile_fmu.model.c_sources import equations_source, model_sources, motion_table, variables_header
from gen_profile_fmu.model.dependencies import Structure, plant_structure, profile_structure
from gen_profile_fmu.model.documentation import motion_page, plant_page, system_page
from gen_profile_fmu.model.plant_variables import (
    InputKind,
    PlantInstance,
    plant_variables,
    profile_variables,
    system_variables,
)
from gen_profile_fmu.model.variables import VariableTable

INPUT_ORDER = 3  # of the time derivatives that a step takes of an input: N_SLOPES in model.h
PLANT_FILES = ("driven_plant.h", "driven_plant.c", "equations.h")
MOTION_FILES = ("motion.h", "motion.c")
AUTHOR = "gen-profile"  # where no other is named
OUTPUT_ORDER = 3  # of the time derivatives that a motion's outputs have
PLAIN = {"N_SLOPED_INPUTS": "0", "SLOPED_INPUTS": "0", "OUTPUT_ORDERS": "0"}


@attrs.frozen(kw_only=True, eq=False)
class Model:
    """An FMU's content.

    Attributes
    ----------
    name, summary : str
    variables : VariableTable
    structure : Structure
    interpolates_inputs : bool
        Whether inputs may vary within a step: by time derivatives in FMI 2, by intermediate updates in FMI 3.
    output_order : int
        Up to which order outputs have time derivatives; 0 for none.
    code : mapping of str to str
        C files by name, all but those of FMI itself.
    order : tuple of str
        The C files to be compiled, as one translation unit, in this order.
    page : () → str
        Writes HTML for people, which takes a simulation.
    stop_time, step : float
        A sensible experiment, in s.
    author : str
        Who made the model.
    """

    name: str
    summary: str
    variables: VariableTable
    structure: Structure
    interpolates_inputs: bool = False
    output_order: int = 0
    code: Mapping[str, str]
    order: tuple[str, ...]
    page: Callable[[], str]
    stop_time: float
    step: float = 0.001
    author: str = AUTHOR

    @property
    def identifier(self) -> str:
        """The name as C takes it: that of the binary."""
        return c_name(self.name)


def plant_model(machine: PlantInstance, kind: InputKind, name: str | None = None) -> Model:
    """Make the FMU's content of a plant with inputs.

    Parameters
    ----------
    machine : PlantInstance
    kind : InputKind
        What its drives are asked for.
    name : str, optional
        The plant's type, if not given.

    Raises
    ------
    CosimulationError
        The plant's names cannot be those of an FMU's variables.
    """
    plant, table = machine.plant, plant_variables(machine, kind)
    equations = dynamics(plant)
    name = name or plant.type
    return Model(
        name=name,
        summary=plant.summary,
        variables=table,
        structure=plant_structure(equations, table, _drives(table, kind)),
        interpolates_inputs=kind is not InputKind.SETPOINT,
        code=plant_code(equations, table, _constants(kind, len(plant.actuated)), "plant_model.c"),
        order=("equations.c", "driven_plant.c", "plant_model.c"),
        page=partial(plant_page, name, machine, table, kind),
        stop_time=10.0,
    )


def plant_code(
    equations: Dynamics, table: VariableTable, constants: Mapping[str, str], *files: str
) -> dict[str, str]:
    """List the sources of a content with a plant: hand-written files, and what is written for the machine."""
    axes, swings = equations.q_a.shape[0], equations.q_u.shape[0]
    return {
        **model_sources(*PLANT_FILES, *files),
        "variables.h": variables_header(table, axes, swings, constants),
        "equations.c": equations_source(equations),
    }


def _drives(table: VariableTable, kind: InputKind) -> dict[int, set[int]]:
    """Find what each axis' acceleration follows from, during the simulation."""
    tau, velocity, inputs = (table.references(block) for block in ("TAU", "DQ_A", "INPUTS"))
    sloped, lagging = kind is not InputKind.SETPOINT, kind is not InputKind.ACCELERATION
    return {
        axis: {*inputs[axis : axis + sloped], *velocity[axis : axis + lagging], *tau}
        for axis in range(len(inputs))
    }


def _constants(kind: InputKind, axes: int) -> dict[str, str]:
    """List the macros of plant_model.c."""
    orders = {
        InputKind.ACCELERATION: INPUT_ORDER + 2,
        InputKind.VELOCITY: INPUT_ORDER + 1,
        InputKind.SETPOINT: 1,
    }[kind]
    return PLAIN | {
        "INPUT_KIND": f"{kind.name}_INPUT",
        "N_ORDERS": str(orders),
        "N_SLOPED_INPUTS": str(axes if kind is not InputKind.SETPOINT else 0),
        "SLOPED_INPUTS": "INPUTS",
    }


def profile_model(name: str, axes: Sequence[Coordinate], profile: Profile) -> Model:
    """Make the FMU's content of a motion; parameters and errors as `plant_model`."""
    table = profile_variables(axes, profile)
    constants = PLAIN | {"OUTPUT_ORDERS": str(OUTPUT_ORDER)}
    return Model(
        name=name,
        summary="motion of the axes",
        variables=table,
        structure=profile_structure(table),
        output_order=OUTPUT_ORDER,
        code={
            **model_sources(*MOTION_FILES, "profile_model.c"),
            "variables.h": variables_header(table, len(axes), 0, constants),
            "motion_table.h": motion_table(profile),
        },
        order=("motion.c", "profile_model.c"),
        page=partial(motion_page, name, axes, profile, table),
        stop_time=profile.duration + 1.0,
    )


def system_model(name: str, machine: PlantInstance, command: Profile) -> Model:
    """Make the FMU's content of a plant whose drives follow a motion.

    Parameters
    ----------
    name : str
    machine : PlantInstance
    command : Profile
        What the drives are asked for.

    Raises
    ------
    CosimulationError
        The plant's names cannot be those of an FMU's variables.
    """
    plant, table = machine.plant, system_variables(machine, command)
    equations = dynamics(plant)
    tau, velocity, time = (table.references(block) for block in ("TAU", "DQ_A", "TIME"))
    trigger, distance = table.references("START_TIME", "WAIT", "TRIGGER"), table.references("DISTANCE")
    axes = range(len(plant.actuated))
    drives = {axis: {velocity[axis], *tau, *time, *trigger, distance[axis]} for axis in axes}
    constants = {"N_ORDERS": "N_POWERS - 1", **PLAIN}
    return Model(
        name=name,
        summary=f"{plant.summary}, following a motion",
        variables=table,
        structure=plant_structure(equations, table, drives),
        code={
            **plant_code(equations, table, constants, *MOTION_FILES, "system_model.c"),
            "motion_table.h": motion_table(command),
        },
        order=("equations.c", "motion.c", "driven_plant.c", "system_model.c"),
        page=partial(system_page, name, machine, command, table),
        stop_time=command.duration + 4.0,
    )
