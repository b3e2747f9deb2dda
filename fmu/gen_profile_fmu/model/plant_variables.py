"""The variables of FMUs that hold a plant, a motion, or both."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import attrs

from gen_profile.motion.profile import Profile
from gen_profile.plants.plant import Coordinate, Plant
from gen_profile_fmu.model.variables import (
    DERIVATIVES,
    FmuVariable,
    Kind,
    Type,
    VariableTable,
    require_good_names,
    variable_name,
)

TAU = "tau"
MAX_STEP = "max_step"
PERIOD = "interpolation_period"
_STANDING_TOLERANCE = 1e-9  # m or rad, less than which a motion leads nowhere
_VARIABLES = tomllib.loads(Path(__file__).with_name("variables.toml").read_text("utf-8"))
Blocks = dict[str, tuple[FmuVariable, ...]]


class InputKind(Enum):
    """What a plant's drives are asked for."""

    ACCELERATION = "acceleration"
    VELOCITY = "velocity"
    SETPOINT = "setpoint"


@attrs.frozen(kw_only=True)
class PlantInstance:
    """A plant with the values it starts from.

    Attributes
    ----------
    plant : Plant
    parameters : mapping of str to float
        Value of every parameter.
    tau : float
        Lag of the drives in s; 0 for ideal ones.
    period : float
        Cycle of the setpoints in s.
    position : sequence of float
        Where the axes rest at the start, in m or rad; zeros if not given.
    initial : mapping of str to float
        What swings at the start: unactuated coordinates by name, their rates as ``NAME.rate``.
    nominal : mapping of str to float
        Size of the states by their variables' names; 1 for those not given.
    """

    plant: Plant
    parameters: Mapping[str, float]
    tau: float = 0.0
    period: float = 0.004
    position: Sequence[float] = attrs.field()
    initial: Mapping[str, float] = attrs.field(factory=dict)
    nominal: Mapping[str, float] = attrs.field(factory=dict)

    @position.default
    def _origin(self) -> Sequence[float]:
        return [0.0] * len(self.plant.actuated)


def plant_variables(machine: PlantInstance, kind: InputKind) -> VariableTable:
    """List the variables of a plant with inputs.

    Raises
    ------
    CosimulationError
        When two variables would share a name, or a name is none that importers take.
    """
    given = {
        "START": _start(machine),
        "INPUTS": _inputs(machine, kind),
        "PERIOD": _period(machine.period, kind),
    }
    return _with_plant(machine, kind, given)


def profile_variables(axes: Sequence[Coordinate], motion: Profile) -> VariableTable:
    """List the variables of a motion alone; raises as `plant_variables` does."""
    table = VariableTable(
        blocks={**_way(axes, motion), **_trigger(), **_command(axes), "TIME": listed("time")}
    )
    require_good_names("Profile", [axis.name for axis in axes], table)
    return table


def system_variables(machine: PlantInstance, motion: Profile) -> VariableTable:
    """List the variables of a plant that follows a motion; raises as `plant_variables` does."""
    axes = machine.plant.actuated
    given = {**_way(axes, motion), **_trigger()}
    return _with_plant(machine, InputKind.SETPOINT, given, _command(axes))


def planned_system_variables(
    machine: PlantInstance, planned: Sequence[int], orders: Blocks, issued: Blocks
) -> VariableTable:
    """List the variables of a plant that follows a planner; raises as `plant_variables` does.

    Parameters
    ----------
    machine : PlantInstance
    planned : sequence of int
        Axes that the block plans.
    orders, issued : dict of str to tuple of FmuVariable
        Inputs and outputs of the block.
    """
    axes = machine.plant.actuated
    words = "position to reach in a cycle, of an axis that the block does not plan"
    left = [number for number in range(len(axes)) if number not in planned]
    places = [machine.position[number] for number in left]
    others = _each([axes[number] for number in left], "{}.setpoint", words, 0, Kind.INPUT, start=places)
    given = {"START": _start(machine), **orders, "OTHERS": others}
    return _with_plant(machine, InputKind.SETPOINT, given, issued)


def _with_plant(
    machine: PlantInstance, kind: InputKind, given: Blocks, issued: Blocks | None = None
) -> VariableTable:
    """Put a plant's own variables around those that it is given and those that are issued beside it."""
    plant, own = machine.plant, _parameters(machine, kind)
    seen = _states_and_outputs(machine)
    table = VariableTable(blocks={**own, **given, **seen, **(issued or {}), "TIME": listed("time")})
    coordinates = (q.name for q in (*plant.actuated, *plant.unactuated))
    names = [*(p.name for p in plant.parameters), *coordinates, *plant.loads, *plant.bodies]
    require_good_names(f"Plant {plant.type}", names, table)
    return table


def _parameters(machine: PlantInstance, kind: InputKind) -> Blocks:
    parameters = tuple(
        FmuVariable(
            name=parameter.name,
            description=parameter.description,
            unit=parameter.unit,
            kind=Kind.TUNABLE_PARAMETER,
            start=machine.parameters[parameter.name],
            lower=parameter.lower if math.isfinite(parameter.lower) else None,
            upper=parameter.upper if math.isfinite(parameter.upper) else None,
        )
        for parameter in machine.plant.parameters
    )
    lag = () if kind is InputKind.ACCELERATION else listed(TAU, start=machine.tau)
    return {"P": parameters, "TAU": lag, "MAX_STEP": listed(MAX_STEP)}


def listed(name: str, **values: Any) -> tuple[FmuVariable, ...]:
    """List one of the variables that ``variables.toml`` describes."""
    row = {"name": name, "type": "REAL", **_VARIABLES[name], **values}
    return (FmuVariable(**{**row, "kind": Kind[row["kind"]], "type": Type[row["type"]]}),)


def _period(period: float, kind: InputKind) -> tuple[FmuVariable, ...]:
    words = {
        InputKind.SETPOINT: "in which drives go on to a setpoint",
        InputKind.VELOCITY: "for which ideal drives hold a velocity",
    }
    if kind not in words:
        return ()
    words_of_kind = f"time {words[kind]}, in model exchange; in co-simulation, the step"
    return listed(PERIOD, description=words_of_kind, start=period)


def _way(axes: Sequence[Coordinate], motion: Profile) -> Blocks:
    """List the parameters that shift and scale a motion; an axis that comes back to its start only shifts."""
    start = motion.coefficients[0, 0].tolist()
    distances = _each(axes, "{}.distance", "how far the motion leads, scaled", 0, Kind.FIXED_PARAMETER)
    return {
        "START": _each(axes, "{}.start", "where the motion begins", 0, Kind.FIXED_PARAMETER, start=start),
        "DISTANCE": tuple(
            attrs.evolve(variable, start=float(distance))
            if abs(distance) > _STANDING_TOLERANCE
            else attrs.evolve(variable, lower=0.0, upper=0.0)
            for variable, distance in zip(distances, motion.target - start, strict=True)
        ),
    }


def _each(
    coordinates: Sequence[Coordinate],
    pattern: str,
    description: str,
    order: int,
    kind: Kind,
    *,
    start: Sequence[float] | None = None,
) -> tuple[FmuVariable, ...]:
    """List a quantity of every coordinate; `order` is that of the time derivative, `start` 0 if not given."""
    return tuple(
        FmuVariable(
            name=pattern.format(q.name),
            description=description,
            unit=q.unit + ("", "/s", "/s^2", "/s^3")[order],
            kind=kind,
            start=float(value),
        )
        for q, value in zip(coordinates, [0.0] * len(coordinates) if start is None else start, strict=True)
    )


def _start(machine: PlantInstance) -> tuple[FmuVariable, ...]:
    words = "position at rest at the start"
    return _each(machine.plant.actuated, "{}.start", words, 0, Kind.FIXED_PARAMETER, start=machine.position)


def _inputs(machine: PlantInstance, kind: InputKind) -> tuple[FmuVariable, ...]:
    axes = machine.plant.actuated
    match kind:
        case InputKind.ACCELERATION:
            return _each(axes, "{}.setpoint_acceleration", "acceleration of the axis", 2, Kind.INPUT)
        case InputKind.VELOCITY:
            return _each(axes, "{}.setpoint_velocity", "velocity that the drive follows", 1, Kind.INPUT)
        case InputKind.SETPOINT:
            words = "position to reach at the end of the step"
            return _each(axes, "{}.setpoint", words, 0, Kind.INPUT, start=machine.position)


def _states_and_outputs(machine: PlantInstance) -> Blocks:
    plant, axes = machine.plant, machine.plant.actuated
    rate, swings = "rate of an unactuated coordinate", plant.unactuated
    states: Blocks = {
        "Q_U": _each(swings, "{}", "unactuated coordinate", 0, Kind.STATE),
        "DQ_U": _each(swings, "{}.rate", rate, 1, Kind.STATE),
        "Q_A": _each(axes, "{}.position", "position of the axis", 0, Kind.OUTPUT),
        "DQ_A": _each(axes, "{}.velocity", "velocity of the axis", 1, Kind.OUTPUT),
    }
    begun = {variable_name(name): value for name, value in machine.initial.items()}
    return {
        **{
            block: tuple(
                attrs.evolve(one, start=begun.get(one.name, 0.0), nominal=machine.nominal.get(one.name, 1.0))
                for one in of
            )
            for block, of in states.items()
        },
        DERIVATIVES: (
            *_each(swings, "der({})", rate, 1, Kind.DERIVATIVE),
            *_each(swings, "der({}.rate)", "its acceleration", 2, Kind.DERIVATIVE),
            *_each(axes, "der({}.position)", "velocity of the axis", 1, Kind.DERIVATIVE),
            *_each(axes, "der({}.velocity)", "acceleration of the axis", 2, Kind.DERIVATIVE),
        ),
        "SWAY": _of_loads(plant, "sway", "m", "horizontal distance from the place at rest", "mm"),
        "HEIGHT": _of_loads(plant, "height", "m", "height above the suspension point", "m"),
        "ANGLE": _of_loads(plant, "angle", "rad", "angle of the rope from the vertical", "deg"),
        **_of_bodies(plant),
    }


def _of_loads(
    plant: Plant, quantity: str, unit: str, description: str, display_unit: str
) -> tuple[FmuVariable, ...]:
    words: dict[str, Any] = {"description": description, "unit": unit, "display_unit": display_unit}
    return tuple(FmuVariable(name=f"{quantity}.{load}", kind=Kind.OUTPUT, **words) for load in plant.loads)


def _of_bodies(plant: Plant) -> Blocks:
    places = tuple(
        FmuVariable(name=f"position.{body}.{direction}", description=words, unit="m", kind=Kind.OUTPUT)
        for body in plant.bodies
        for direction, words in (
            ("x", "where the load is, horizontally"),
            ("y", "where the load is, horizontally across"),
            ("z", "where the load is, above the suspension point"),
        )
    )
    return {"PLACE": places, "ENERGY": listed("energy") if plant.bodies else ()}


def _trigger() -> Blocks:
    names = {"WAIT": "wait_for_trigger", "TRIGGER": "trigger", "MOVING": "moving", "DONE": "done"}
    return {"START_TIME": listed("start_time"), **{block: listed(name) for block, name in names.items()}}


def _command(axes: Sequence[Coordinate]) -> Blocks:
    suffixes = ("setpoint", "setpoint_velocity", "setpoint_acceleration", "setpoint_jerk")
    return {
        "COMMAND": tuple(
            variable
            for order, suffix in enumerate(suffixes)
            for variable in _each(axes, f"{{}}.{suffix}", "of the motion", order, Kind.OUTPUT)
        )
    }
