"""The one table of a plant FMU's variables, from which its XML, its C code and its users take their facts.

A variable's value reference is its index in the table, and in the C code's array of values. Blocks of like
variables lie side by side there, so that the equations can read and write them in place.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from enum import Enum

import attrs

from gen_profile.errors import CosimulationError
from gen_profile.plants.plant import Plant

TAU = "tau"
MAX_STEP = "max_step"
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


class Kind(Enum):
    """What an importer may do with a variable, as FMI's causality and variability."""

    FIXED_PARAMETER = ("parameter", "fixed")
    TUNABLE_PARAMETER = ("parameter", "tunable")
    INPUT = ("input", "continuous")
    OUTPUT = ("output", "continuous")

    @property
    def causality(self) -> str:
        """FMI's attribute of that name."""
        return self.value[0]

    @property
    def variability(self) -> str:
        """FMI's attribute of that name."""
        return self.value[1]


@attrs.frozen(kw_only=True)
class Variable:
    """A real variable.

    Attributes
    ----------
    name, description, unit : str
    kind : Kind
    start : float
        Value before anything is set; for outputs, which are calculated, that of the C code's memory.
    lower, upper : float or None
        Allowed values, both ends included.
    """

    name: str
    description: str
    unit: str
    kind: Kind
    start: float = 0.0
    lower: float | None = None
    upper: float | None = None


@attrs.frozen(kw_only=True)
class VariableTable:
    """Variables in blocks; the order of blocks is that of the value references.

    Attributes
    ----------
    blocks : dict of str to tuple of Variable
        By the block's name in the C code (``P``, ``SETPOINT``, ``Q_U`` …).
    """

    blocks: dict[str, tuple[Variable, ...]]

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables, a variable's index being its value reference."""
        return tuple(variable for block in self.blocks.values() for variable in block)

    def offset(self, block: str) -> int:
        """Value reference of a block's first variable."""
        names = list(self.blocks)
        return sum(len(self.blocks[name]) for name in names[: names.index(block)])

    def references(self, block: str) -> range:
        """Value references of a block."""
        return range(self.offset(block), self.offset(block) + len(self.blocks[block]))


def plant_variables(plant: Plant) -> VariableTable:
    """List the variables of a plant's FMU.

    Raises
    ------
    CosimulationError
        When two variables would share a name, or a name is none that importers take.
    """
    table = VariableTable(
        blocks={
            "P": _plant_parameters(plant),
            "TAU": (_lag(),),
            "MAX_STEP": (_longest_step(),),
            "START": _axis_variables(
                plant, "start", "position at rest before the first step", Kind.FIXED_PARAMETER
            ),
            "SETPOINT": _axis_variables(
                plant, "setpoint", "position to reach at the end of the step", Kind.INPUT
            ),
            "Q_U": _unactuated(plant, rate=False),
            "DQ_U": _unactuated(plant, rate=True),
            "Q_A": _axis_variables(plant, "position", "position", Kind.OUTPUT),
            "DQ_A": _axis_variables(plant, "velocity", "velocity", Kind.OUTPUT, rate=True),
            "SWAY": _load_outputs(plant, "sway", "m", "horizontal distance from the place at rest"),
            "HEIGHT": _load_outputs(plant, "height", "m", "height above the suspension point"),
            "ANGLE": _load_outputs(plant, "angle", "rad", "angle of the rope from the vertical"),
        }
    )
    _require_good_names(plant, table)
    return table


def _plant_parameters(plant: Plant) -> tuple[Variable, ...]:
    return tuple(
        Variable(
            name=parameter.name,
            description=parameter.description,
            unit=parameter.unit,
            kind=Kind.TUNABLE_PARAMETER,
            start=parameter.nominal,
            lower=_bound(parameter.lower),
            upper=_bound(parameter.upper),
        )
        for parameter in plant.parameters
    )


def _bound(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _lag() -> Variable:
    # fixed: position + tau * velocity is the interpolated setpoint only while tau stays as it is
    return Variable(
        name=TAU,
        description="time constant of the drives' first-order lag; 0: ideal drives",
        unit="s",
        kind=Kind.FIXED_PARAMETER,
        lower=0.0,
    )


def _longest_step() -> Variable:
    return Variable(
        name=MAX_STEP,
        description="longest integration step",
        unit="s",
        kind=Kind.TUNABLE_PARAMETER,
        start=1e-3,
        lower=1e-6,
        upper=1.0,
    )


def _axis_variables(
    plant: Plant, suffix: str, description: str, kind: Kind, *, rate: bool = False
) -> tuple[Variable, ...]:
    return tuple(
        Variable(
            name=f"{axis.name}.{suffix}",
            description=description,
            unit=f"{axis.unit}/s" if rate else axis.unit,
            kind=kind,
        )
        for axis in plant.actuated
    )


def _unactuated(plant: Plant, *, rate: bool) -> tuple[Variable, ...]:
    return tuple(
        Variable(
            name=f"der({coordinate.name})" if rate else coordinate.name,
            description="rate of an unactuated coordinate" if rate else "unactuated coordinate",
            unit=f"{coordinate.unit}/s" if rate else coordinate.unit,
            kind=Kind.OUTPUT,
        )
        for coordinate in plant.unactuated
    )


def _load_outputs(plant: Plant, quantity: str, unit: str, description: str) -> tuple[Variable, ...]:
    return tuple(
        Variable(name=f"{quantity}.{load}", description=description, unit=unit, kind=Kind.OUTPUT)
        for load in plant.loads
    )


def _require_good_names(plant: Plant, table: VariableTable) -> None:
    coordinates = (q.name for q in (*plant.actuated, *plant.unactuated))
    for name in (*(p.name for p in plant.parameters), *coordinates, *plant.loads):
        if not _NAME.fullmatch(name):
            raise CosimulationError(
                f"Plant {plant.type}: {name!r} cannot name a variable of an FMU. "
                "Use letters, digits, hyphens and underscores, and a letter first."
            )
    counts = Counter(variable.name for variable in table.variables)
    for name, count in counts.items():
        if count > 1:
            raise CosimulationError(
                f"Plant {plant.type}: its FMU would have {count} variables named {name!r}. "
                f"Rename the plant's parameter or coordinate ({TAU!r} and {MAX_STEP!r} are the drive's)."
            )
