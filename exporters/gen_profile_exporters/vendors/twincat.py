"""TwinCAT 3: the playback block as a .TcPOU, a wrapper for an NC axis, and the motion as cam points.

The wrapper streams setpoints with ``MC_ExtSetPointGenEnable`` and ``MC_ExtSetPointGenFeed`` (Tc2_MC2). The
global variable list holds ``MC_MotionFunctionPoint`` (TF5050), the quintic between two points being
``MOTIONFUNCTYPE_POLYNOM5_MM``, for playing the motion as a cam over the time in s.
"""

from uuid import NAMESPACE_URL, uuid5

from lxml import etree

from gen_profile.motion.profile import Profile
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.motion_libraries import TWINCAT
from gen_profile_exporters.playback.axis_wrapper import axis_wrappers
from gen_profile_exporters.playback.structured_text import block_name, block_text, replays
from gen_profile_exporters.vendors.cam_points import QuinticPoints, quintic_points
from gen_profile_exporters.vendors.xml_documents import child, parse_xml, write_xml


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the block, its wrapper and the points.

    Raises
    ------
    ExportError
        As for Structured Text.
    """
    files = wrap(parse_function_block(block_text(profile, target)), target)
    if any(axis.modulo for axis in target.axes):
        return files  # a cam's positions are those of one turn
    name = f"GVL_{block_name(target.name).removeprefix('FB_')}"
    return (*files, _variable_list(name, quintic_points(profile, target)))


def wrap(source: BlockSource, target: Target) -> tuple[File, ...]:
    """Write any block, and the wrapper of one that plays."""
    return (*map(_pou, (source, *source.within, *axis_wrappers(source, len(target.axes), TWINCAT))),)


def unwrap(content: bytes, target: Target) -> BlockSource:
    """Read a block; those within it are in files of their own.

    Raises
    ------
    ExportError
        The document is none.
    """
    root = parse_xml(content)
    if root.tag != "TcPlcObject":
        raise ExportError("The document is no TcPlcObject; export it again.")
    pou = child(root, "POU")
    declaration, body = child(pou, "Declaration").text, child(pou, "Implementation/ST").text
    return parse_function_block(f"{declaration or ''}\n{body or ''}END_FUNCTION_BLOCK\n")


replay = replays(unwrap)


def _pou(source: BlockSource) -> File:
    root, pou = _object("POU", source.name)
    pou.set("SpecialFunc", "None")
    etree.SubElement(pou, "Declaration").text = etree.CDATA(source.header + source.declaration())
    implementation = etree.SubElement(pou, "Implementation")
    etree.SubElement(implementation, "ST").text = etree.CDATA(source.body)
    return File(f"{source.name}.TcPOU", write_xml(root))


def _variable_list(name: str, points: QuinticPoints) -> File:
    axes = range(points.position.shape[1])
    arrays = [_points(f"aCam{number + 1 if len(axes) > 1 else ''}", points, number) for number in axes]
    text = "\n".join(["{attribute 'qualified_only'}", "VAR_GLOBAL CONSTANT", *arrays, "END_VAR", ""])
    root, element = _object("GVL", name)
    etree.SubElement(element, "Declaration").text = etree.CDATA(text)
    return File(f"{name}.TcGVL", write_xml(root))


def _points(name: str, points: QuinticPoints, axis: int) -> str:
    last = len(points.time)
    body = ",\n".join(
        f"        (PointIndex := {index}, FunctionType := MOTIONFUNCTYPE_POLYNOM5_MM, "
        f"PointType := MOTIONPOINTTYPE_MOTION, RelIndexNextPoint := {int(index < last)}, "
        f"MasterPos := {time}, SlavePos := {position}, SlaveVelo := {velocity}, SlaveAcc := {acceleration})"
        for index, (time, position, velocity, acceleration) in enumerate(points.literals(axis), 1)
    )
    return f"    {name} : ARRAY [1..{last}] OF MC_MotionFunctionPoint := [\n{body}\n    ];"


def _object(kind: str, name: str) -> tuple[etree._Element, etree._Element]:
    """Begin a document; the identifier follows from the name, so that exporting again replaces the object."""
    root = etree.Element("TcPlcObject", {"Version": "1.1.0.1", "ProductVersion": "3.1.4024.0"})
    identifier = uuid5(NAMESPACE_URL, f"gen-profile:{kind}:{name}")
    return root, etree.SubElement(root, kind, {"Name": name, "Id": f"{{{identifier}}}"})
