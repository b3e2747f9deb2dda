"""A plant and what leads it, as a system of FMUs: System Structure and Parameterization (SSP) 1.0.

Importers look for the names of XML elements with the prefixes that the standard writes them with.
"""

from collections.abc import Callable, Iterable
from importlib.metadata import version
from xml.etree.ElementTree import Element, SubElement

import attrs

from gen_profile_fmu.description.base_units import BASE_UNITS
from gen_profile_fmu.description.fmu_files import archive
from gen_profile_fmu.description.model_description import text_of, to_bytes
from gen_profile_fmu.model.contents import Model
from gen_profile_fmu.model.variables import FmuVariable

STRUCTURE = "SystemStructure.ssd"
PARAMETER_SET = "initialValues"  # as others call it, and as Ecos is asked to take
_OSP = "com.opensimulationplatform"  # whose annotation states a step, for which SSP 1.0 has no words
_NAMESPACES = {
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
_WIDTH, _HEIGHT, _GAP = 60.0, 40.0, 40.0


@attrs.frozen(kw_only=True)
class Component:
    """An FMU of a system.

    Attributes
    ----------
    name : str
        Within the system.
    model : Model
    """

    name: str
    model: Model

    @property
    def fmu(self) -> str:
        """Path of the FMU in the archive."""
        return f"resources/{self.model.identifier}.fmu"

    @property
    def parameters(self) -> str:
        """Path of the FMU's parameters in the archive."""
        return f"resources/{self.model.identifier}.ssv"

    def variables(self, *causalities: str) -> list[FmuVariable]:
        """List the variables of some causalities."""
        return [v for v in self.model.variables.variables if v.kind.causality in causalities]


def ssp(
    name: str, leader: Component, plant: Component, step: float, build: Callable[[Model], bytes]
) -> bytes:
    """Write a system in which a plant follows a profile or a planner.

    Parameters
    ----------
    name : str
        Of the system.
    leader, plant : Component
        Each output of the leader goes to the plant's input of the same name, where there is one; other inputs
        are for the master to set.
    step : float
        In which a master shall go on, in s.
    build : Model → bytes
        Makes an FMU.

    Returns
    -------
    bytes
        The archive: the same for the same models, step and FMUs.
    """
    components = leader, plant
    return archive(
        {
            STRUCTURE: _structure(name, *components, step),
            **{one.parameters: _parameters(one) for one in components if one.variables("parameter")},
            **{component.fmu: build(component.model) for component in components},
        }
    )


def _root(tag: str, name: str, others: Iterable[str]) -> Element:
    own, _, _ = tag.partition(":")
    spaces = {f"xmlns:{space}": _NAMESPACES[space] for space in (own, *others)}
    tool = f"gen-profile {version('gen-profile')}"
    return Element(tag, {**spaces, "version": "1.0", "name": name, "generationTool": tool})


def _structure(name: str, leader: Component, plant: Component, step: float) -> bytes:
    root = _root("ssd:SystemStructureDescription", name, ("ssc", "osp"))
    system = SubElement(root, "ssd:System", name=name)
    elements = SubElement(system, "ssd:Elements")
    for place, component in enumerate((leader, plant)):
        _add_component(elements, component, place * (_WIDTH + _GAP))
    connections = SubElement(system, "ssd:Connections")
    given = {variable.name for variable in leader.variables("output")}
    for variable in plant.variables("input"):
        if variable.name in given:
            SubElement(
                connections,
                "ssd:Connection",
                startElement=leader.name,
                startConnector=variable.name,
                endElement=plant.name,
                endConnector=variable.name,
            )
    connectors = [*_connectors(leader), *_connectors(plant)]
    _add_units(SubElement(root, "ssd:Units"), connectors)
    _add_experiment(root, max(leader.model.stop_time, plant.model.stop_time), step)
    return to_bytes(root)


def _connectors(component: Component) -> list[FmuVariable]:
    """List what can be connected, but for the trigger: an input that nothing feeds stops some importers."""
    return [v for v in component.variables("input", "output") if v.name != "trigger"]


def _add_component(elements: Element, component: Component, left: float) -> None:
    kind = "application/x-fmu-sharedlibrary"
    element = SubElement(elements, "ssd:Component", name=component.name, type=kind, source=component.fmu)
    connectors = SubElement(element, "ssd:Connectors")
    for variable in _connectors(component):
        connector = SubElement(connectors, "ssd:Connector", name=variable.name, kind=variable.kind.causality)
        SubElement(connector, f"ssc:{variable.type.name_of_fmi2}", _unit(variable))
    SubElement(
        element, "ssd:ElementGeometry", x1=repr(left), y1="0.0", x2=repr(left + _WIDTH), y2=repr(_HEIGHT)
    )
    if component.variables("parameter"):
        bindings = SubElement(element, "ssd:ParameterBindings")
        SubElement(bindings, "ssd:ParameterBinding", source=component.parameters)


def _add_experiment(root: Element, stop_time: float, step: float) -> None:
    experiment = SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(stop_time))
    annotations = SubElement(experiment, "ssd:Annotations")
    annotation = SubElement(annotations, "ssc:Annotation", type=_OSP)
    algorithm = SubElement(annotation, "osp:Algorithm")
    SubElement(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(step))


def _parameters(component: Component) -> bytes:
    """Write a component's parameters with the values that they have in its FMU."""
    root = _root("ssv:ParameterSet", PARAMETER_SET, ("ssc",))
    parameters = SubElement(root, "ssv:Parameters")
    variables = component.variables("parameter")
    for variable in variables:
        parameter = SubElement(parameters, "ssv:Parameter", name=variable.name)
        value = {"value": text_of(variable.start, variable.type), **_unit(variable)}
        SubElement(parameter, f"ssv:{variable.type.name_of_fmi2}", value)
    _add_units(SubElement(root, "ssv:Units"), variables)
    return to_bytes(root)


def _unit(variable: FmuVariable) -> dict[str, str]:
    """Name a variable's unit, where its base units are known: without them, SSP takes none."""
    return {"unit": variable.unit} if variable.unit in BASE_UNITS else {}


def _add_units(units: Element, variables: Iterable[FmuVariable]) -> None:
    for name in sorted({unit for variable in variables for unit in _unit(variable).values()}):
        unit = SubElement(units, "ssc:Unit", name=name)
        exponents = {base: str(exponent) for base, exponent in BASE_UNITS[name].items()}
        SubElement(unit, "ssc:BaseUnit", exponents)
