"""modelDescription.xml of FMI 2.0 (2.0.4, sections 2.2, 3.3 and 4.3)."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from gen_profile_fmu.description.common import (
    add_common,
    initial_unknowns_of,
    outputs_of,
    root_element,
    to_bytes,
    value_attributes,
    variable_attributes,
)
from gen_profile_fmu.model.contents import Model
from gen_profile_fmu.model.dependencies import Dependencies
from gen_profile_fmu.model.variables import VariableTable


def model_description(model: Model, guid: str, source_file: str) -> bytes:
    """Write the XML text.

    Parameters
    ----------
    model : Model
    guid : str
        Ties the text to its binary.
    source_file : str
        What to compile.
    """
    root = root_element(model, "2.0", guid=guid)
    root.set("numberOfEventIndicators", "0")
    _add_interfaces(root, model, source_file)
    add_common(root, model)
    _add_variables(root, model.variables)
    _add_structure(root, model)
    return to_bytes(root)


def _add_interfaces(root: ElementTree.Element, model: Model, source_file: str) -> None:
    common = {
        "modelIdentifier": model.identifier,
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    cosimulation = {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": str(model.interpolates_inputs).lower(),
        "maxOutputDerivativeOrder": str(model.output_order),
    }
    for name, attributes in (("ModelExchange", common), ("CoSimulation", common | cosimulation)):
        interface = ElementTree.SubElement(root, name, attributes)
        files = ElementTree.SubElement(interface, "SourceFiles")
        ElementTree.SubElement(files, "File", name=source_file)


def _add_variables(root: ElementTree.Element, table: VariableTable) -> None:
    variables = ElementTree.SubElement(root, "ModelVariables")
    state_of = dict(zip(table.derivatives, table.states, strict=True))
    for reference, variable in enumerate(table.variables):
        scalar = ElementTree.SubElement(variables, "ScalarVariable", variable_attributes(reference, variable))
        value = ElementTree.SubElement(scalar, variable.type.name_of_fmi2, value_attributes(variable))
        if reference in state_of:
            value.set("derivative", str(state_of[reference] + 1))


def _add_structure(root: ElementTree.Element, model: Model) -> None:
    table, structure = model.variables, model.structure
    element = ElementTree.SubElement(root, "ModelStructure")
    _add_unknowns(element, "Outputs", outputs_of(table), structure.running)
    if table.derivatives:
        _add_unknowns(element, "Derivatives", table.derivatives, structure.running)
    _add_unknowns(element, "InitialUnknowns", initial_unknowns_of(table), structure.starting)


def _add_unknowns(
    structure: ElementTree.Element, title: str, unknowns: Iterable[int], known: Dependencies
) -> None:
    """List unknowns by index, which is the value reference counted from 1."""
    element = ElementTree.SubElement(structure, title)
    for unknown in unknowns:
        dependencies = " ".join(str(reference + 1) for reference in known[unknown])
        ElementTree.SubElement(element, "Unknown", index=str(unknown + 1), dependencies=dependencies)
