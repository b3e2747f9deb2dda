"""modelDescription.xml and buildDescription.xml of FMI 3.0 (sections 2.4 and 2.5.1)."""

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


def model_description(model: Model, token: str) -> bytes:
    """Write the XML text; `token` ties it to its binary."""
    root = root_element(model, "3.0", instantiationToken=token)
    _add_interfaces(root, model)
    add_common(root, model)
    _add_variables(root, model)
    _add_structure(root, model)
    return to_bytes(root)


def build_description(model: Model, source_file: str) -> bytes:
    """Say how to compile the sources."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=model.identifier)
    files = ElementTree.SubElement(configuration, "SourceFileSet", language="C99")
    ElementTree.SubElement(files, "SourceFile", name=source_file)
    return to_bytes(root)


def _add_interfaces(root: ElementTree.Element, model: Model) -> None:
    common = {
        "modelIdentifier": model.identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    ElementTree.SubElement(root, "ModelExchange", common)
    cosimulation = {
        "canHandleVariableCommunicationStepSize": "true",
        "providesIntermediateUpdate": str(model.interpolates_inputs).lower(),
        "maxOutputDerivativeOrder": str(model.output_order),
    }
    ElementTree.SubElement(root, "CoSimulation", common | cosimulation)


def _add_variables(root: ElementTree.Element, model: Model) -> None:
    table = model.variables
    variables = ElementTree.SubElement(root, "ModelVariables")
    state_of = dict(zip(table.derivatives, table.states, strict=True))
    for reference, variable in enumerate(table.variables):
        attributes = variable_attributes(reference, variable) | value_attributes(variable)
        element = ElementTree.SubElement(variables, variable.type.name_of_fmi3, attributes)
        if model.interpolates_inputs and variable.kind.causality in {"input", "output"}:
            element.set("intermediateUpdate", "true")
        if reference in state_of:
            element.set("derivative", str(state_of[reference]))


def _add_structure(root: ElementTree.Element, model: Model) -> None:
    table, structure = model.variables, model.structure
    element = ElementTree.SubElement(root, "ModelStructure")
    _add_unknowns(element, "Output", outputs_of(table), structure.running)
    _add_unknowns(element, "ContinuousStateDerivative", table.derivatives, structure.running)
    _add_unknowns(element, "InitialUnknown", initial_unknowns_of(table), structure.starting)


def _add_unknowns(
    structure: ElementTree.Element, title: str, unknowns: Iterable[int], known: Dependencies
) -> None:
    for unknown in unknowns:
        dependencies = " ".join(map(str, known[unknown]))
        ElementTree.SubElement(structure, title, valueReference=str(unknown), dependencies=dependencies)
