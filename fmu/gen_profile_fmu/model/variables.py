"""The one table of an FMU's variables, from which its XML, its C code and its users take their facts.

A variable's value reference is its index in the table, and in the C code's array of values. Blocks of like
variables lie side by side there, so that the equations can read and write them in place.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from enum import Enum
from functools import cached_property

import attrs

from gen_profile.support.errors import CosimulationError

DERIVATIVES = "DERIVATIVES"
# blocks of the continuous states, in the order of their derivatives
STATES = ("Q_U", "DQ_U", "Q_A", "DQ_A")
# blocks of what is seen of a plant, in the order in which the equations give it
OBSERVED = ("SWAY", "HEIGHT", "ANGLE", "PLACE", "ENERGY")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
# units of which people think rather than of the unit that values have
_DISPLAY_UNITS = {"rad": "deg", "rad/s": "deg/s", "rad/s^2": "deg/s^2", "rad/s^3": "deg/s^3"}


class Type(Enum):
    """What values a variable has, as FMI 3 calls it; FMI 2 and SSP have names of their own."""

    REAL = ("Float64", "Real")
    BOOLEAN = ("Boolean", "Boolean")
    INTEGER = ("Int32", "Integer")

    def __init__(self, name_of_fmi3: str, name_of_fmi2: str) -> None:
        self.name_of_fmi3 = name_of_fmi3
        self.name_of_fmi2 = name_of_fmi2


class Kind(Enum):
    """What an importer may do with a variable, as FMI's causality, variability and initial."""

    FIXED_PARAMETER = ("parameter", "fixed", "exact")
    TUNABLE_PARAMETER = ("parameter", "tunable", "exact")
    INPUT = ("input", "continuous", None)
    DISCRETE_INPUT = ("input", "discrete", None)
    STATE = ("output", "continuous", "exact")
    OUTPUT = ("output", "continuous", "calculated")
    DISCRETE_OUTPUT = ("output", "discrete", "calculated")
    DERIVATIVE = ("local", "continuous", "calculated")
    INDEPENDENT = ("independent", "continuous", None)

    def __init__(self, causality: str, variability: str, initial: str | None) -> None:
        self.causality = causality
        self.variability = variability
        self.initial = initial

    @property
    def has_start(self) -> bool:
        """Whether a variable has a value that an importer may set before the start."""
        return self.initial == "exact" or self.causality == "input"


def variable_name(name: str) -> str:
    """Make a structured name (FMI 3.0, section 2.4.7.5.1) of a plant's, which may have hyphens."""
    return name.replace("-", "_")


@attrs.frozen(kw_only=True)
class FmuVariable:
    """A scalar variable.

    Attributes
    ----------
    name, description, unit : str
        `unit` is empty for booleans and integers.
    display_unit : str
        In which tools show values; that of the angle for angles, else `unit`, by default.
    kind : Kind
    type : Type
    start : float
        Value before anything is set; for outputs, which are calculated, that of the C code's memory.
    lower, upper : float or None
        Allowed values, both ends included.
    nominal : float
        Size of its values, by which integrators weigh errors of states.
    """

    name: str = attrs.field(converter=variable_name)
    description: str
    unit: str
    kind: Kind
    type: Type = Type.REAL
    start: float = 0.0
    lower: float | None = None
    upper: float | None = None
    nominal: float = 1.0
    display_unit: str = attrs.field()

    @display_unit.default
    def _usual(self) -> str:
        return _DISPLAY_UNITS.get(self.unit, self.unit)


@attrs.frozen(kw_only=True)
class VariableTable:
    """Variables in blocks; the order of blocks is that of the value references.

    Attributes
    ----------
    blocks : dict of str to tuple of FmuVariable
        By the block's name in the C code (``P``, ``Q_U`` …); a block may be empty.
    """

    blocks: dict[str, tuple[FmuVariable, ...]]

    @property
    def variables(self) -> tuple[FmuVariable, ...]:
        """All variables, a variable's index being its value reference."""
        return tuple(variable for block in self.blocks.values() for variable in block)

    def offset(self, block: str) -> int:
        """Value reference of a block's first variable."""
        names = list(self.blocks)
        return sum(len(self.blocks[name]) for name in names[: names.index(block)])

    def references(self, *blocks: str) -> list[int]:
        """Value references of blocks, in the order asked for."""
        return [self.offset(block) + index for block in blocks for index in range(len(self.blocks[block]))]

    @cached_property
    def _by_name(self) -> dict[str, int]:
        return {variable.name: reference for reference, variable in enumerate(self.variables)}

    def named(self, names: Collection[str]) -> list[int]:
        """Value references of variables by name.

        Raises
        ------
        CosimulationError
            There is no such variable.
        """
        known = self._by_name
        for name in names:
            if variable_name(name) not in known:
                raise CosimulationError(f"The FMU has no variable {name!r}.")
        return [known[variable_name(name)] for name in names]

    def references_of(self, *kinds: Kind) -> list[int]:
        """Value references of all variables of some kinds, rising."""
        return [reference for reference, variable in enumerate(self.variables) if variable.kind in kinds]

    @property
    def states(self) -> list[int]:
        """Value references of the continuous states."""
        return self.references(*(block for block in STATES if block in self.blocks))

    @property
    def derivatives(self) -> list[int]:
        """Value references of the states' derivatives, in the states' order."""
        return self.references(DERIVATIVES) if DERIVATIVES in self.blocks else []


def require_good_names(owner: str, names: Sequence[str], table: VariableTable) -> None:
    """Refuse names that importers do not take.

    Parameters
    ----------
    owner : str
        Whose names they are, for the sentence.
    names : sequence of str
        Parts of the variables' names.
    table : VariableTable

    Raises
    ------
    CosimulationError
        When two variables would share a name, or a name is none that importers take.
    """
    for name in names:
        if not _NAME.fullmatch(name):
            raise CosimulationError(
                f"{owner}: {name!r} cannot name a variable of an FMU. "
                "Use letters, digits, hyphens and underscores, and a letter first."
            )
    counts = Counter(variable.name for variable in table.variables)
    for name, count in counts.items():
        if count > 1:
            raise CosimulationError(
                f"{owner}: its FMU would have {count} variables named {name!r}. "
                "Rename the plant's parameter or coordinate (the FMU has variables of its own, too)."
            )
