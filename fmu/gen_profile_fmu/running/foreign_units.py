"""Units of an external FMU's variables, which need not be SI's.

An FMU defines its units by exponents of SI's base units, a factor and an offset (FMI 2.0.4, section 2.2.2;
3.0, section 2.4.3; UnitDefinitions): value in base units = factor · value + offset.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NoReturn

import attrs

from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.description.base_units import BASE_UNITS

SAME_VALUE = (
    0.01  # relative, by which the start value of a parameter may differ from the spec's without a word
)
OTHER_UNIT = (
    10.0  # times the spec's value, beyond which a start value in an undeclared unit is hardly in SI's
)
PARAMETERS = {"parameter", "calculatedParameter"}


@attrs.frozen
class Conversion:
    """A unit in terms of the SI unit of the same quantity."""

    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, value: Any) -> Any:
        """Convert a number or an array from the FMU's unit."""
        return self.factor * value + self.offset

    def from_si(self, value: float) -> float:
        """Convert into the FMU's unit."""
        return (value - self.offset) / self.factor


class ForeignUnits:
    """What the variables of one FMU are measured in.

    Parameters
    ----------
    archive : str
        Its name, for messages.
    description
        FMPy's model description.
    stated : mapping of str to float
        By variable, how many SI units the unit makes that the spec states; holds in place of the FMU's own.
    """

    def __init__(self, archive: str, description: Any, stated: Mapping[str, float]) -> None:
        self._archive, self._stated = archive, stated
        self._bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions}

    def conversion(self, variable: Any, si: str) -> Conversion:
        """Convert between a variable's unit and an SI unit.

        Raises
        ------
        CosimulationError
            The unit measures something else, or is not defined.
        """
        if variable.name in self._stated:
            return Conversion(self._stated[variable.name])
        unit = _declared(variable)
        base = self._bases.get(unit)
        if not unit or (base is None and _plain(unit) == _plain(si)):
            return Conversion()
        cure = f"state its unit, such as check.units = {{ {variable.name!r} = {si!r} }}"
        if base is None:
            self._refuse(f"{variable.name!r} is in {unit!r}, which the FMU does not define; {cure}.")
        if not _measures(base, si):
            self._refuse(
                f"{variable.name!r} is in {unit!r}, which measures something else than {si!r}, which "
                "is asked for; name another variable in the spec's [check]."
            )
        if not (math.isfinite(base.factor) and base.factor != 0.0 and math.isfinite(base.offset)):
            self._refuse(f"the unit {unit!r} of {variable.name!r} is not defined by finite numbers; {cure}.")
        return Conversion(base.factor, base.offset)

    def undeclared(self, variables: Sequence[tuple[Any, str]]) -> Iterator[str]:
        """Say which of some variables, each with the SI unit that it is taken in, have no unit anywhere."""
        without = {one.name: si for one, si in variables if not self._is_known(one) and si != "1"}
        if without:
            listed = ", ".join(f"{name} in {si}" for name, si in without.items())
            yield f"{self._archive} declares no unit of some variables, which are taken as in SI: {listed}."

    def differences(
        self, variables: Sequence[Any], parameters: Mapping[str, tuple[float, str, str | None]]
    ) -> Iterator[str]:
        """Compare the start values of parameters with the spec's.

        Parameters
        ----------
        variables
            All real scalars of the FMU.
        parameters : mapping
            Value, SI unit and the FMU's variable, if one is named, of each parameter of the spec.

        Raises
        ------
        CosimulationError
            A start value shows that a variable without a unit is in none of SI's.
        """
        for name, (value, si, mapped) in parameters.items():
            for variable in variables:
                start = _start(variable)
                if start is None:
                    continue
                if variable.name == mapped:
                    self._refuse_other_unit(variable, start, name, value, si)
                elif mapped is None and _means(variable, name):
                    yield from self._difference(variable, start, name, value, si)

    def _refuse_other_unit(self, variable: Any, start: float, name: str, value: float, si: str) -> None:
        if self._is_known(variable) or not value or not start:
            return
        if not 1.0 / OTHER_UNIT < start / value < OTHER_UNIT:
            self._refuse(
                f"{variable.name!r} starts as {start:g} and declares no unit, where the spec has {name} = "
                f"{value:g} {si}; state its unit, such as check.units = {{ {variable.name!r} = {si!r} }}."
            )

    def _difference(self, variable: Any, start: float, name: str, value: float, si: str) -> Iterator[str]:
        found = self.conversion(variable, si).to_si(start)
        if not math.isclose(found, value, rel_tol=SAME_VALUE):
            yield (
                f"{self._archive} judges with {variable.name} = {found:g} {si}, where the spec has {name} = "
                f"{value:g}; name the variable in check.parameters to set it."
            )

    def _is_known(self, variable: Any) -> bool:
        return variable.name in self._stated or bool(_declared(variable))

    def _refuse(self, problem: str) -> NoReturn:
        raise CosimulationError(f"{self._archive}: {problem}")


def _declared(variable: Any) -> str | None:
    """Name a variable's unit, its own or its type's."""
    unit: str | None = variable.unit or (variable.declaredType and variable.declaredType.unit)
    return unit


def _plain(unit: str) -> str:
    """Spell m/s2, m/s^2 and N.m, N m alike."""
    return unit.translate(str.maketrans("", "", "^. *"))


def _measures(base: Any, si: str) -> bool:
    """Whether a unit measures what an SI unit does.

    Of angles and their rates the radian counts, as a hertz is no rad/s; elsewhere, as in N m/rad, many tools
    leave it out.
    """
    if si not in BASE_UNITS:
        return False
    ours, theirs = BASE_UNITS[si], attrs.asdict(base)
    counted = ("kg", "m", "s", "A", "K", "mol", "cd") + (() if ours.get("kg") else ("rad",))
    return all(ours.get(one, 0) == theirs[one] for one in counted)


def _means(variable: Any, parameter: str) -> bool:
    """Whether a variable is called like a parameter, alone or within a component: ``crane.rope.L1``."""
    return variable.causality in PARAMETERS and variable.name.rpartition(".")[2] == parameter


def _start(variable: Any) -> float | None:
    """Read a start value; none where there is none, or no number."""
    try:
        start = float(variable.start)
    except (TypeError, ValueError):
        return None
    return start if math.isfinite(start) else None
