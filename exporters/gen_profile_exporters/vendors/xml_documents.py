"""XML in and out: nothing fetched, no entities, one form of bytes."""

from lxml import etree

from gen_profile.support.errors import ExportError


def parse_xml(content: bytes) -> etree._Element:
    """Read a document.

    Raises
    ------
    ExportError
        It is not well formed.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=True)
    try:
        return etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ExportError(f"Not well-formed XML ({reason}); export it again.") from error


def write_xml(root: etree._Element) -> bytes:
    """Serialise, UTF-8, indented."""
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"


def child(parent: etree._Element, path: str) -> etree._Element:
    """Find an element that must be there; ``{*}`` in its path stands for any namespace.

    Raises
    ------
    ExportError
        It is not.
    """
    element = parent.find(path)
    if element is None:
        raise ExportError(f"line {parent.sourceline}: {path.replace('{*}', '')} is missing; export it again.")
    return element


def attribute(element: etree._Element, name: str) -> str:
    """Read an attribute that must be there.

    Raises
    ------
    ExportError
        It is not.
    """
    value = element.get(name)
    if value is None:
        raise ExportError(f"line {element.sourceline}: {name} is missing; export it again.")
    return str(value)
