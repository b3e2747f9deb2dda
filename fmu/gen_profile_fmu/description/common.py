"""What the model descriptions of FMI 2 and 3 have in common."""

from __future__ import annotations

import math
from collections import defaultdict
from importlib.metadata import version
from xml.etree import ElementTree

from gen_profile_fmu.description.base_units import BASE_UNITS
from gen_profile_fmu.model.contents import Model
from gen_profile_fmu.model.variables import FmuVariable, Kind, Type, VariableTable

_PER_UNIT = {"deg": math.degrees(1.0), "mm": 1e3}  # of an SI unit, whatever it is divided by
LOG_CATEGORIES = {
    "logEvents": "life cycle of an instance",
    "logStatusWarning": "warnings",
    "logStatusError": "errors and discarded steps",
}


def root_element(model: Model, fmi_version: str, **identity: str) -> ElementTree.Element:
    """Begin a model description; `identity` is what ties it to its binary."""
    tool = version("gen-profile")
    attributes = {
        "fmiVersion": fmi_version,
        "modelName": model.name,
        **identity,
        "description": model.summary,
        "author": model.author,
        "version": tool,
        "generationTool": f"gen-profile {tool}",
        "license": "Apache-2.0",
        "variableNamingConvention": "structured",
    }
    return ElementTree.Element("fmiModelDescription", attributes)


def add_common(root: ElementTree.Element, model: Model) -> None:
    """Add what comes between the interfaces and the variables."""
    _add_units(root, model.variables)
    _add_log_categories(root)
    _add_experiment(root, model)


def _add_units(root: ElementTree.Element, table: VariableTable) -> None:
    """List the units in use, with their base units where these are known."""
    definitions = ElementTree.SubElement(root, "UnitDefinitions")
    shown_in: defaultdict[str, dict[str, float]] = defaultdict(dict)
    for variable in table.variables:
        if variable.display_unit != variable.unit:
            factor = _PER_UNIT[variable.display_unit.partition("/")[0]]
            shown_in[variable.unit][variable.display_unit] = factor
    for name in sorted({variable.unit for variable in table.variables} - {""}):
        unit = ElementTree.SubElement(definitions, "Unit", name=name)
        if name in BASE_UNITS:
            exponents = {base: str(exponent) for base, exponent in BASE_UNITS[name].items()}
            ElementTree.SubElement(unit, "BaseUnit", exponents)
        for shown, factor in sorted(shown_in[name].items()):
            ElementTree.SubElement(unit, "DisplayUnit", name=shown, factor=repr(factor))


def _add_log_categories(root: ElementTree.Element) -> None:
    """List the log categories."""
    categories = ElementTree.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ElementTree.SubElement(categories, "Category", name=name, description=description)


def _add_experiment(root: ElementTree.Element, model: Model) -> None:
    """State a sensible simulation."""
    ElementTree.SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(model.stop_time),
        tolerance="1e-06",
        stepSize=repr(model.step),
    )


def variable_attributes(reference: int, variable: FmuVariable) -> dict[str, str]:
    """Say which variable it is, and what an importer may do with it."""
    kind = variable.kind
    return {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": kind.causality,
        "variability": kind.variability,
        **({"initial": kind.initial} if kind.initial is not None else {}),
    }


def value_attributes(variable: FmuVariable) -> dict[str, str]:
    """Give unit, bounds and start value."""
    bounds = {"min": variable.lower, "max": variable.upper}
    unit = {"unit": variable.unit} if variable.unit else {}
    if variable.display_unit != variable.unit:
        unit["displayUnit"] = variable.display_unit
    return {
        **unit,
        **{name: repr(float(bound)) for name, bound in bounds.items() if bound is not None},
        **({"nominal": repr(variable.nominal)} if variable.nominal != 1.0 else {}),
        **({"start": text_of(variable.start, variable.type)} if variable.kind.has_start else {}),
    }


def text_of(value: float, type_: Type) -> str:
    """Write a value as XML has it."""
    match type_:
        case Type.REAL:
            return repr(float(value))
        case Type.BOOLEAN:
            return str(bool(value)).lower()
        case Type.INTEGER:
            return str(int(value))


def outputs_of(table: VariableTable) -> list[int]:
    """Value references of all outputs, rising."""
    return table.references_of(Kind.STATE, Kind.OUTPUT, Kind.DISCRETE_OUTPUT)


def initial_unknowns_of(table: VariableTable) -> list[int]:
    """Value references of what is calculated at the start, rising."""
    return table.references_of(Kind.OUTPUT, Kind.DISCRETE_OUTPUT, Kind.DERIVATIVE)


def to_bytes(root: ElementTree.Element) -> bytes:
    """Write XML in UTF-8 with line feeds."""
    ElementTree.indent(root)
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
