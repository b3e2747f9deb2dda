"""modelDescription.xml of FMI 2.0 (2.0.4, sections 2.2, 3.3, 4.3) and 3.0 (section 2.4), and build files."""

import math
from collections import defaultdict
from importlib.metadata import version
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from gen_profile_fmu.description.base_units import BASE_UNITS
from gen_profile_fmu.model.contents import Model
from gen_profile_fmu.model.variables import FmuVariable, Kind, Type, VariableTable

# what the versions of FMI call alike things
IDENTITY = {"2": "guid", "3": "instantiationToken"}
ABILITIES = {
    "2": ("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"),
    "3": (
        *("canGetAndSetFMUState", "canSerializeFMUState"),
        *("providesDirectionalDerivatives", "providesAdjointDerivatives"),
    ),
}
INTERPOLATES = {"2": "canInterpolateInputs", "3": "providesIntermediateUpdate"}
DERIVATIVE = {"2": "Derivative", "3": "ContinuousStateDerivative"}
FIRST = {"2": 1, "3": 0}  # number of the first variable
_PER_UNIT = {"deg": math.degrees(1.0), "mm": 1e3}  # of an SI unit, whatever it is divided by
LOG_CATEGORIES = {
    "logEvents": "life cycle of an instance",
    "logStatusWarning": "warnings",
    "logStatusError": "errors and discarded steps",
}


def model_description(model: Model, fmi: str, identity: str, source_file: str) -> bytes:
    """Write the XML text.

    Parameters
    ----------
    model : Model
    fmi : str
        ``"2"`` or ``"3"``.
    identity : str
        Ties the text to its binary.
    source_file : str
        What to compile; of FMI 3, `build_description` says so.
    """
    root = _root(model, fmi, identity)
    for name in ("ModelExchange", "CoSimulation"):
        interface = SubElement(root, name, _abilities(model, fmi, name))
        if fmi == "2":
            files = SubElement(interface, "SourceFiles")
            SubElement(files, "File", name=source_file)
    _add_units(root, model.variables)
    _add_log_categories(root)
    _add_experiment(root, model)
    _add_variables(root, model, fmi)
    _add_structure(root, model, fmi)
    return to_bytes(root)


def build_description(model: Model, source_file: str) -> bytes:
    """Say how to compile the sources: buildDescription.xml of FMI 3.0 (section 2.5.1)."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=model.identifier)
    files = SubElement(configuration, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name=source_file)
    return to_bytes(root)


def _root(model: Model, fmi: str, identity: str) -> Element:
    """Begin a model description."""
    tool = version("gen-profile")
    attributes = {
        "fmiVersion": f"{fmi}.0",
        "modelName": model.name,
        IDENTITY[fmi]: identity,
        "description": model.summary,
        "author": model.author,
        "version": tool,
        "generationTool": f"gen-profile {tool}",
        "license": "Apache-2.0",
        "variableNamingConvention": "structured",
    }
    if fmi == "2":
        attributes["numberOfEventIndicators"] = "0"
    return Element("fmiModelDescription", attributes)


def _abilities(model: Model, fmi: str, interface: str) -> dict[str, str]:
    """Say what an importer may ask of an interface."""
    abilities = {"modelIdentifier": model.identifier, **dict.fromkeys(ABILITIES[fmi], "true")}
    if interface == "ModelExchange":
        return abilities
    return abilities | {
        "canHandleVariableCommunicationStepSize": "true",
        INTERPOLATES[fmi]: str(model.interpolates_inputs).lower(),
        "maxOutputDerivativeOrder": str(model.output_order),
    }


def _add_units(root: Element, table: VariableTable) -> None:
    """List the units in use, with their base units where these are known."""
    definitions = SubElement(root, "UnitDefinitions")
    shown_in: defaultdict[str, dict[str, float]] = defaultdict(dict)
    for variable in table.variables:
        if variable.display_unit != variable.unit:
            factor = _PER_UNIT[variable.display_unit.partition("/")[0]]
            shown_in[variable.unit][variable.display_unit] = factor
    for name in sorted({variable.unit for variable in table.variables} - {""}):
        unit = SubElement(definitions, "Unit", name=name)
        if name in BASE_UNITS:
            exponents = {base: str(exponent) for base, exponent in BASE_UNITS[name].items()}
            SubElement(unit, "BaseUnit", exponents)
        for shown, factor in sorted(shown_in[name].items()):
            SubElement(unit, "DisplayUnit", name=shown, factor=repr(factor))


def _add_log_categories(root: Element) -> None:
    """List the log categories."""
    categories = SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)


def _add_experiment(root: Element, model: Model) -> None:
    """State a sensible simulation."""
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(model.stop_time),
        tolerance="1e-06",
        stepSize=repr(model.step),
    )


def _add_variables(root: Element, model: Model, fmi: str) -> None:
    table = model.variables
    variables = SubElement(root, "ModelVariables")
    state_of = dict(zip(table.derivatives, table.states, strict=True))
    for reference, variable in enumerate(table.variables):
        attributes, value = _variable_attributes(reference, variable), _value_attributes(variable)
        if fmi == "2":
            scalar = SubElement(variables, "ScalarVariable", attributes)
            element = SubElement(scalar, variable.type.name_of_fmi2, value)
        else:
            element = SubElement(variables, variable.type.name_of_fmi3, attributes | value)
            if model.interpolates_inputs and variable.kind.causality in {"input", "output"}:
                element.set("intermediateUpdate", "true")
        if reference in state_of:
            element.set("derivative", str(state_of[reference] + FIRST[fmi]))


def _add_structure(root: Element, model: Model, fmi: str) -> None:
    """List unknowns with what they depend on: by index in FMI 2, by value reference in FMI 3."""
    table, structure, first = model.variables, model.structure, FIRST[fmi]
    element = SubElement(root, "ModelStructure")
    begun = table.references_of(Kind.OUTPUT, Kind.DISCRETE_OUTPUT, Kind.DERIVATIVE)
    for title, unknowns, known in (
        ("Output", table.references_of(Kind.STATE, Kind.OUTPUT, Kind.DISCRETE_OUTPUT), structure.running),
        (DERIVATIVE[fmi], table.derivatives, structure.running),
        ("InitialUnknown", begun, structure.starting),
    ):
        listed, name, number = element, title, "valueReference"
        if fmi == "2":
            if title == DERIVATIVE[fmi] and not unknowns:
                continue
            listed, name, number = SubElement(element, f"{title}s"), "Unknown", "index"
        for unknown in unknowns:
            dependencies = " ".join(str(reference + first) for reference in known[unknown])
            attributes = {number: str(unknown + first), "dependencies": dependencies}
            SubElement(listed, name, attributes)


def _variable_attributes(reference: int, variable: FmuVariable) -> dict[str, str]:
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


def _value_attributes(variable: FmuVariable) -> dict[str, str]:
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


def to_bytes(root: Element) -> bytes:
    """Write XML in UTF-8 with line feeds."""
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
