"""modelDescription.xml of a plant FMU (FMI 2.0.4, sections 2.2 and 4.3)."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from gen_profile.plants.plant import Plant
from gen_profile.problem import symbolic as sym
from gen_profile.problem.dynamics import Dynamics
from gen_profile_fmu.variables import Kind, VariableTable

# exponents of the SI base units; FMI also counts the radian as one
BASE_UNITS: dict[str, dict[str, int]] = {
    "kg": {"kg": 1},
    "kg m^2": {"kg": 1, "m": 2},
    "kg/m^3": {"kg": 1, "m": -3},
    "Pa s": {"kg": 1, "m": -1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N s/m": {"kg": 1, "s": -1},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N m s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
}
LOG_CATEGORIES = {
    "logEvents": "life cycle of an instance",
    "logStatusWarning": "warnings",
    "logStatusError": "errors and discarded steps",
}
_STRUCTURED = re.compile(r"\w+(\.\w+)*|der\(\w+\)", re.ASCII)


def model_identifier(plant: Plant) -> str:
    """Name of the FMU's binary: the plant's type as a C identifier."""
    return re.sub(r"\W|^(?=\d)", "_", plant.type, flags=re.ASCII)


def model_description(plant: Plant, equations: Dynamics, table: VariableTable, guid: str) -> bytes:
    """Write the XML text, in UTF-8.

    Parameters
    ----------
    plant : Plant
    equations : Dynamics
        Of the plant; they tell which start values an output depends on.
    table : VariableTable
    guid : str
        Ties the text to its binary.
    """
    structured = all(_STRUCTURED.fullmatch(variable.name) for variable in table.variables)
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=plant.type,
        guid=guid,
        description=plant.summary,
        generationTool="gen-profile",
        variableNamingConvention="structured" if structured else "flat",
        numberOfEventIndicators="0",
    )
    ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model_identifier(plant),
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    _add_units(root, table)
    categories = ElementTree.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ElementTree.SubElement(categories, "Category", name=name, description=description)
    ElementTree.SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime="10.0", tolerance="1e-06", stepSize="0.001"
    )
    _add_variables(root, table)
    _add_structure(root, table, _start_dependencies(equations, table))
    ElementTree.indent(root)
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _add_units(root: ElementTree.Element, table: VariableTable) -> None:
    definitions = ElementTree.SubElement(root, "UnitDefinitions")
    for name in sorted({variable.unit for variable in table.variables}):
        unit = ElementTree.SubElement(definitions, "Unit", name=name)
        if name in BASE_UNITS:
            exponents = {base: str(exponent) for base, exponent in BASE_UNITS[name].items()}
            ElementTree.SubElement(unit, "BaseUnit", exponents)


def _add_variables(root: ElementTree.Element, table: VariableTable) -> None:
    variables = ElementTree.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(table.variables):
        scalar = ElementTree.SubElement(
            variables,
            "ScalarVariable",
            name=variable.name,
            valueReference=str(reference),
            description=variable.description,
            causality=variable.kind.causality,
            variability=variable.kind.variability,
        )
        real = ElementTree.SubElement(scalar, "Real", unit=variable.unit)
        if variable.lower is not None:
            real.set("min", repr(float(variable.lower)))
        if variable.upper is not None:
            real.set("max", repr(float(variable.upper)))
        if variable.kind is Kind.OUTPUT:
            scalar.set("initial", "calculated")
        else:
            real.set("start", repr(float(variable.start)))


def _add_structure(
    root: ElementTree.Element, table: VariableTable, dependencies: dict[int, list[int]]
) -> None:
    """List the outputs; between steps none of them follows an input, at the start some follow parameters."""
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = ElementTree.SubElement(structure, "Outputs")
    unknowns = ElementTree.SubElement(structure, "InitialUnknowns")
    for reference, variable in enumerate(table.variables):
        if variable.kind is Kind.OUTPUT:
            index = str(reference + 1)
            known = " ".join(str(parameter + 1) for parameter in dependencies.get(reference, []))
            ElementTree.SubElement(outputs, "Unknown", index=index, dependencies="")
            ElementTree.SubElement(unknowns, "Unknown", index=index, dependencies=known)


def _start_dependencies(equations: Dynamics, table: VariableTable) -> dict[int, list[int]]:
    """List the parameters that an output's start value depends on; all by their value references."""
    starts, positions = table.references("START"), table.references("Q_A")
    dependencies = {position: [start] for position, start in zip(positions, starts, strict=True)}
    knowns = [*table.references("P"), *starts]
    observed = sym.column([equations.sway, equations.height, equations.angle])
    occurring = sym.entries(sym.jacobian(observed, sym.column([equations.p, equations.q_a])))
    outputs = [reference for block in ("SWAY", "HEIGHT", "ANGLE") for reference in table.references(block)]
    for row, output in enumerate(outputs):
        dependencies[output] = [known for column, known in enumerate(knowns) if (row, column) in occurring]
    return dependencies
