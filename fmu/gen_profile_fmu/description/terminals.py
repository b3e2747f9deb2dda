"""terminalsAndIcons.xml of FMI 3.0 (section 2.4.9): what belongs together, for connections by one click.

A terminal is an axis, with its setpoints and its motion, or the place of a body. Those of a profile's FMU and
of a plant's have the same names and members.
"""

from collections import defaultdict
from xml.etree.ElementTree import Element, SubElement

from gen_profile_fmu.description.model_description import to_bytes
from gen_profile_fmu.model.variables import VariableTable

BLOCKS = ("INPUTS", "COMMAND", "Q_A", "DQ_A", "PLACE")
_SQUARE = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}


def terminals_and_icons(table: VariableTable) -> bytes:
    """Write the XML text: the last part of a variable's name is its name within the terminal."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    SubElement(graphics, "CoordinateSystem", _SQUARE, suggestedScalingFactorTo_mm="0.1")
    SubElement(graphics, "Icon", _SQUARE)
    members = defaultdict(list)
    for variable in (variable for block in BLOCKS for variable in table.blocks.get(block, ())):
        terminal, _, member = variable.name.rpartition(".")
        members[terminal].append((variable.name, member))
    terminals = SubElement(root, "Terminals")
    for terminal, named in members.items():
        # "bus": members of the same name are connected, whatever else the other side has
        element = SubElement(terminals, "Terminal", name=terminal, matchingRule="bus")
        for name, member in named:
            SubElement(
                element, "TerminalMemberVariable", variableName=name, memberName=member, variableKind="signal"
            )
    return to_bytes(root)
