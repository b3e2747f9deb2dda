"""The playback block as PLCopen XML (TC6, version 2.01), which CODESYS, Beremiz and others import.

The same variables and statements as the Structured Text, each in its element. Replay puts the text together
again and reads that.
"""

from __future__ import annotations

from typing import Any

from lxml import etree

from gen_profile.errors import ExportError
from gen_profile.profile import Profile, SampledProfile
from gen_profile_exporters.block_source import BlockSource, Variable, take_apart
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.structured_text import block_text, read_block
from gen_profile_exporters.xml_documents import attribute, child, parse_xml, write_xml

NAMESPACE = "http://www.plcopen.org/xml/tc6_0201"
XHTML = "http://www.w3.org/1999/xhtml"
NAMES = {"p": NAMESPACE, "x": XHTML}
EPOCH = "1970-01-01T00:00:00"  # the schema asks for a time, and equal motions give equal bytes
SECTIONS = {
    "VAR_IN_OUT": "inOutVars",
    "VAR_INPUT": "inputVars",
    "VAR_OUTPUT": "outputVars",
    "VAR": "localVars",
    "VAR CONSTANT": "localVars",
}


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write a project with the block in it.

    Raises
    ------
    ExportError
        As for Structured Text.
    """
    source = take_apart(block_text(profile, target))
    return (File(filename=f"{target.name}.xml", content=write_xml(project(target.name, [pou(source)]))),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Work out what the project's first function block issues.

    Raises
    ------
    ExportError
        The document is no such project, or its block was altered.
    """
    root = parse_xml(content)
    if root.tag != f"{{{NAMESPACE}}}project":
        raise ExportError("The document is no PLCopen project of TC6 version 2.01; export it again.")
    found = child(root, "p:types/p:pous/p:pou", NAMES)
    return read_block(_source(found).text(), target)


def project(name: str, pous: list[etree._Element]) -> etree._Element:
    """Build a project of program organisation units."""
    root = etree.Element(_tag("project"), nsmap=_default(NAMESPACE))
    header = {
        "companyName": "",
        "productName": "gen-profile",
        "productVersion": "1",
        "creationDateTime": EPOCH,
    }
    etree.SubElement(root, _tag("fileHeader"), header)
    content = etree.SubElement(root, _tag("contentHeader"), {"name": name})
    coordinates = etree.SubElement(content, _tag("coordinateInfo"))
    for language in ("fbd", "ld", "sfc"):
        etree.SubElement(etree.SubElement(coordinates, _tag(language)), _tag("scaling"), {"x": "1", "y": "1"})
    types = etree.SubElement(root, _tag("types"))
    etree.SubElement(types, _tag("dataTypes"))
    etree.SubElement(types, _tag("pous")).extend(pous)
    etree.SubElement(etree.SubElement(root, _tag("instances")), _tag("configurations"))
    return root


def pou(source: BlockSource) -> etree._Element:
    """Build a function block."""
    element = etree.Element(_tag("pou"), {"name": source.name, "pouType": "functionBlock"})
    interface = etree.SubElement(element, _tag("interface"))
    groups: dict[str, etree._Element] = {}
    for variable in source.variables:
        if variable.section not in groups:
            group = etree.SubElement(interface, _tag(SECTIONS[variable.section]))
            groups[variable.section] = group
            if variable.section == "VAR CONSTANT":
                group.set("constant", "true")
        groups[variable.section].append(_variable(variable))
    body = etree.SubElement(etree.SubElement(element, _tag("body")), _tag("ST"))
    _formatted(body, source.body)
    _formatted(etree.SubElement(element, _tag("documentation")), source.header.strip("(*) \n"))
    return element


def initialise_structures(pou: etree._Element, name: str, elements: list[dict[str, str]]) -> None:
    """Give an array of structures its initial values, by member."""
    variable = child(pou, f".//p:variable[@name='{name}']", NAMES)
    initial = etree.Element(_tag("initialValue"))
    child(variable, "p:type", NAMES).addnext(initial)
    array = etree.SubElement(initial, _tag("arrayValue"))
    for members in elements:
        structure = etree.SubElement(etree.SubElement(array, _tag("value")), _tag("structValue"))
        for member, text in members.items():
            value = etree.SubElement(structure, _tag("value"), {"member": member})
            etree.SubElement(value, _tag("simpleValue"), {"value": text})


def _variable(variable: Variable) -> etree._Element:
    element = etree.Element(_tag("variable"), {"name": variable.name})
    type_ = etree.SubElement(element, _tag("type"))
    if variable.array:
        lower, upper, type_name = variable.array
        array = etree.SubElement(type_, _tag("array"))
        etree.SubElement(array, _tag("dimension"), {"lower": lower, "upper": upper})
        _type(etree.SubElement(array, _tag("baseType")), type_name)
    else:
        _type(type_, variable.type)
    if variable.initial:
        _initial(etree.SubElement(element, _tag("initialValue")), variable)
    if variable.comment:
        _formatted(etree.SubElement(element, _tag("documentation")), variable.comment)
    return element


def _type(parent: etree._Element, name: str) -> None:
    elementary = name in ("BOOL", "INT", "DINT", "LREAL", "DWORD")
    if elementary:
        etree.SubElement(parent, _tag(name))
    else:
        etree.SubElement(parent, _tag("derived"), {"name": name})


def _initial(parent: etree._Element, variable: Variable) -> None:
    if not variable.array:
        etree.SubElement(parent, _tag("simpleValue"), {"value": variable.initial})
        return
    values = etree.SubElement(parent, _tag("arrayValue"))
    for text in variable.elements:
        value = etree.SubElement(values, _tag("value"))
        etree.SubElement(value, _tag("simpleValue"), {"value": text})


def _formatted(parent: etree._Element, text: str) -> None:
    etree.SubElement(parent, f"{{{XHTML}}}xhtml", nsmap=_default(XHTML)).text = text


def _default(namespace: str) -> dict[str, str]:
    """Name a default namespace; lxml's stubs do not know that its prefix is None."""
    prefixes: dict[Any, str] = {None: namespace}
    return prefixes


def _tag(name: str) -> str:
    return f"{{{NAMESPACE}}}{name}"


def _source(element: etree._Element) -> BlockSource:
    """Read a function block back."""
    variables: list[Variable] = []
    for section, group_name in SECTIONS.items():
        for group in element.findall(f"p:interface/p:{group_name}", NAMES):
            constant = group.get("constant") == "true"
            if group_name != "localVars" or constant == (section == "VAR CONSTANT"):
                variables += [_read_variable(section, item) for item in group.findall("p:variable", NAMES)]
    body = child(element, "p:body/p:ST/x:xhtml", NAMES)
    return BlockSource(
        header="", name=attribute(element, "name"), variables=tuple(variables), body=body.text or ""
    )


def _read_variable(section: str, element: etree._Element) -> Variable:
    array = element.find("p:type/p:array", NAMES)
    if array is None:
        type_ = _read_type(child(element, "p:type", NAMES))
    else:
        dimension = child(array, "p:dimension", NAMES)
        bounds = f"{attribute(dimension, 'lower')}..{attribute(dimension, 'upper')}"
        type_ = f"ARRAY [{bounds}] OF {_read_type(child(array, 'p:baseType', NAMES))}"
    values = [attribute(item, "value") for item in element.iterfind("p:initialValue//p:simpleValue", NAMES)]
    initial = ", ".join(values)
    if array is not None and values:
        initial = f"[{initial}]"
    return Variable(section=section, name=attribute(element, "name"), type=type_, initial=initial)


def _read_type(element: etree._Element) -> str:
    if not len(element):
        raise ExportError(f"line {element.sourceline}: a type is missing; export it again.")
    return str(etree.QName(element[0]).localname)
