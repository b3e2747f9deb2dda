"""The playback block as PLCopen XML (TC6, version 2.01), as Beremiz and the OpenPLC Editor read it.

The same variables and statements as the Structured Text, each in its element. Replay puts the text together
again and reads that.
"""

from html import escape
from typing import Any

import attrs
from lxml import etree

from gen_profile.motion.profile import Profile
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import (
    BlockSource,
    BlockVariable,
    parse_function_block,
    place_of_own,
    with_blocks_within,
)
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.playback.structured_text import block_text, replays
from gen_profile_exporters.templates import filled
from gen_profile_exporters.vendors.xml_documents import attribute, child, parse_xml, write_xml

XHTML = "http://www.w3.org/1999/xhtml"
ELEMENTARY = ("BOOL", "INT", "DINT", "LREAL", "DWORD")
SECTIONS = {  # elements and their attributes
    "VAR_IN_OUT": ("inOutVars", {}),
    "VAR_INPUT": ("inputVars", {}),
    "VAR_OUTPUT": ("outputVars", {}),
    "VAR": ("localVars", {}),
    "VAR CONSTANT": ("localVars", {"constant": "true"}),
}
IGNORED = {"addData", "documentation"}  # elements; CODESYS adds its own to what it exports
ATTRIBUTES = {"name", "lower", "upper", "value"}  # of what a group holds


@attrs.frozen(kw_only=True)
class XmlDialect:
    """What readers of the format do not agree on.

    Attributes
    ----------
    namespace : str
        Of the version of TC6.
    text : str
        Name of the XHTML element that holds statements and comments, which the standard leaves open: Beremiz
        and OpenPLC's xml2st take the text of a ``p`` and of nothing else, CODESYS and what descends from it
        write ``xhtml``. The schema allows one element, so a document cannot have both.
    """

    namespace: str
    text: str

    def project(self, name: str, pous: list[etree._Element]) -> etree._Element:
        """Build a project of program organisation units, always of the same time."""
        values = {"namespace": self.namespace, "name": escape(name)}
        root = parse_xml(filled("vendors/plcopen.xml", **values).encode("utf-8"))
        child(root, "{*}types/{*}pous").extend(pous)
        return root

    def pou(self, source: BlockSource) -> etree._Element:
        """Build a function block."""
        element = etree.Element(self._tag("pou"), {"name": source.name, "pouType": "functionBlock"})
        interface = self._append(element, "interface")
        groups: dict[str, etree._Element] = {}
        for variable in source.variables:
            if variable.section not in groups:
                groups[variable.section] = self._append(interface, *SECTIONS[variable.section])
            self._variable(groups[variable.section], variable)
        self._formatted(self._append(self._append(element, "body"), "ST"), source.body)
        self._formatted(self._append(element, "documentation"), _uncommented(source.header))
        return element

    def initialise_structures(self, pou: etree._Element, name: str, elements: list[dict[str, str]]) -> None:
        """Give an array of structures its initial values, by member."""
        initial = etree.Element(self._tag("initialValue"))
        child(pou, f".//{{*}}variable[@name='{name}']/{{*}}type").addnext(initial)
        array = self._append(initial, "arrayValue")
        for members in elements:
            structure = self._append(self._append(array, "value"), "structValue")
            for member, text in members.items():
                value = self._append(structure, "value", {"member": member})
                self._append(value, "simpleValue", {"value": text})

    def _variable(self, group: etree._Element, variable: BlockVariable) -> None:
        element = self._append(group, "variable", {"name": variable.name})
        type_ = self._append(element, "type")
        if variable.array:
            lower, upper, type_name = variable.array
            array = self._append(type_, "array")
            self._append(array, "dimension", {"lower": lower, "upper": upper})
            self._type(self._append(array, "baseType"), type_name)
        else:
            self._type(type_, variable.type)
        if variable.initial:
            self._initial(self._append(element, "initialValue"), variable)
        if variable.comment:
            self._formatted(self._append(element, "documentation"), variable.comment)

    def _type(self, parent: etree._Element, name: str) -> None:
        if name in ELEMENTARY:
            self._append(parent, name)
        else:
            self._append(parent, "derived", {"name": name})

    def _initial(self, parent: etree._Element, variable: BlockVariable) -> None:
        if not variable.array:
            self._append(parent, "simpleValue", {"value": variable.initial})
            return
        values = self._append(parent, "arrayValue")
        for text in variable.elements:
            self._append(self._append(values, "value"), "simpleValue", {"value": text})

    def _formatted(self, parent: etree._Element, text: str) -> None:
        etree.SubElement(parent, f"{{{XHTML}}}{self.text}", nsmap=_default(XHTML)).text = text

    def _append(
        self, parent: etree._Element, name: str, attributes: dict[str, str] | None = None
    ) -> etree._Element:
        return etree.SubElement(parent, self._tag(name), attributes)

    def _tag(self, name: str) -> str:
        return f"{{{self.namespace}}}{name}"


TC6 = XmlDialect(namespace="http://www.plcopen.org/xml/tc6_0201", text="p")
CODESYS = XmlDialect(namespace="http://www.plcopen.org/xml/tc6_0200", text="xhtml")


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write a project with the block in it.

    Raises
    ------
    ExportError
        As for Structured Text.
    """
    return wrap(parse_function_block(block_text(profile, target)), target)


def wrap(source: BlockSource, target: Target) -> tuple[File, ...]:
    """Write a project with any block in it."""
    project = TC6.project(target.name, [*map(TC6.pou, (*source.within, source))])
    return (File(f"{target.name}.xml", write_xml(project)),)


def unwrap(content: bytes, target: Target) -> BlockSource:
    """Read a project's first function block, whichever the dialect; a planner block with those within it.

    Raises
    ------
    ExportError
        The document is no such project.
    """
    root = parse_xml(content)
    if root.tag not in [f"{{{dialect.namespace}}}project" for dialect in (TC6, CODESYS)]:
        raise ExportError("The document is no PLCopen project of TC6 version 2; export it again.")
    child(root, "{*}types/{*}pous/{*}pou")  # one at least
    pous = child(root, "{*}types/{*}pous").findall("{*}pou")
    place = place_of_own(one.get("name", "") for one in pous)
    return with_blocks_within([*map(_source, pous[: place + 1])])


replay = replays(unwrap)


def _default(namespace: str) -> dict[str, str]:
    """Name a default namespace; lxml's stubs do not know that its prefix is None."""
    prefixes: dict[Any, str] = {None: namespace}
    return prefixes


def _uncommented(comment: str) -> str:
    return comment.strip().removeprefix("(*").removesuffix("*)").strip()


def _source(element: etree._Element) -> BlockSource:
    """Read a function block back."""
    variables: list[BlockVariable] = []
    for group in _children(child(element, "{*}interface")):
        section = _section(group)
        variables += [_read_variable(section, item) for item in group.findall("{*}variable")]
    body = child(element, "{*}body/{*}ST/*")
    return BlockSource(
        header=f"(*\n    {_text(element)}\n*)\n",
        name=attribute(element, "name"),
        variables=tuple(variables),
        body=body.text or "",
    )


def _children(element: etree._Element) -> list[etree._Element]:
    """Give all elements in one but those that mean nothing to a controller."""
    return [one for one in element.iterchildren("{*}*") if etree.QName(one).localname not in IGNORED]


def _section(group: etree._Element) -> str:
    """Tell which section a group of variables is; refuse what changes them, such as ``retain``."""
    name = etree.QName(group).localname
    marks = {str(key): value for key, value in group.items() if value != "false"}
    section = next((key for key, kind in SECTIONS.items() if kind == (name, marks)), None)
    inner = _children(group)
    for item in inner:  # this grows, by all that is below
        inner += _children(item)
    others = [(item, key) for item in inner for key, _ in item.items() if key not in ATTRIBUTES]
    if section is None:
        others = [(group, " ".join((name, *marks)))]
    if others:
        where, word = others[0]
        raise ExportError(
            f"line {where.sourceline}: {word!r} stands beside the declarations; export the block again."
        )
    return str(section)


def _read_variable(section: str, element: etree._Element) -> BlockVariable:
    array = element.find("{*}type/{*}array")
    if array is None:
        type_ = _read_type(child(element, "{*}type"))
    else:
        dimension = child(array, "{*}dimension")
        bounds = f"{attribute(dimension, 'lower')}..{attribute(dimension, 'upper')}"
        type_ = f"ARRAY [{bounds}] OF {_read_type(child(array, '{*}baseType'))}"
    values = [attribute(item, "value") for item in element.iterfind("{*}initialValue//{*}simpleValue")]
    initial = ", ".join(values)
    if array is not None and values:
        initial = f"[{initial}]"
    return BlockVariable(section, attribute(element, "name"), type_, initial=initial, comment=_text(element))


def _text(element: etree._Element) -> str:
    """Read what documents an element; it cannot end the comment that it becomes."""
    return element.findtext("{*}documentation/*", "").replace("*)", "").replace("(*", "")


def _read_type(element: etree._Element) -> str:
    if not len(element):
        raise ExportError(f"line {element.sourceline}: a type is missing; export it again.")
    name = str(etree.QName(element[0]).localname)
    return attribute(element[0], "name") if name == "derived" else name
