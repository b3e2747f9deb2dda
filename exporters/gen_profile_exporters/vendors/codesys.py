"""CODESYS: a PLCopen XML project with the playback block, a SoftMotion wrapper, and the motion as a cam.

The project is in the dialect that CODESYS writes itself, which is not that of the format ``plcopen-xml``.

The wrapper streams setpoints with ``SMC_FollowSetValues`` (SM3_Basic), which checks nothing: the limits are
the profile's. The cam is a table of ``SMC_CAMXYVA``, between whose points SoftMotion interpolates by
quintics.
"""

from lxml import etree

from gen_profile.motion.profile import Profile
from gen_profile_exporters.block_source import BlockSource, BlockVariable, parse_function_block
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.motion_libraries import CODESYS
from gen_profile_exporters.playback.axis_wrapper import axis_wrappers
from gen_profile_exporters.playback.structured_text import block_text, literal
from gen_profile_exporters.vendors import plcopen_xml
from gen_profile_exporters.vendors.cam_points import QuinticPoints, quintic_points
from gen_profile_exporters.vendors.xml_documents import write_xml

MEMBERS = ("dX", "dY", "dV", "dA")


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the project; the playback block is its first one.

    Raises
    ------
    ExportError
        As for Structured Text.
    """
    source = parse_function_block(block_text(profile, target))
    points = quintic_points(profile, target)
    return _project(source, target, [_cam(source.name, points, axis) for axis in range(len(target.axes))])


def wrap(source: BlockSource, target: Target) -> tuple[File, ...]:
    """Write the project with any block, and the wrapper of one that plays."""
    return _project(source, target, [])


unwrap, replay = plcopen_xml.unwrap, plcopen_xml.replay


def _project(source: BlockSource, target: Target, cams: list[etree._Element]) -> tuple[File, ...]:
    blocks = (*source.within, source, *axis_wrappers(source, len(target.axes), CODESYS))
    pous = [*map(plcopen_xml.CODESYS.pou, blocks), *cams]
    return (File(f"{target.name}.codesys.xml", write_xml(plcopen_xml.CODESYS.project(target.name, pous))),)


def _cam(block: str, points: QuinticPoints, axis: int) -> etree._Element:
    """Build a block that holds the table and makes a cam of it, as its address is known only at run time."""
    name = f"{block}_Cam{axis + 1 if points.position.shape[1] > 1 else ''}"
    last = len(points.time) - 1
    source = BlockSource(
        header=f"(* {name}: time cam over {literal(points.time[-1])} s; call it once, then give Cam to "
        "MC_CamTableSelect. *)\n",
        name=name,
        variables=(
            BlockVariable("VAR_OUTPUT", "Cam", "MC_CAM_REF"),
            BlockVariable("VAR", "aPoints", f"ARRAY [0..{last}] OF SMC_CAMXYVA"),
        ),
        body=f"Cam.byType := 3;\nCam.byVarType := 6;\nCam.nElements := {last + 1};\nCam.xStart := 0.0;\n"
        f"Cam.xEnd := {literal(points.time[-1])};\nCam.pce := ADR(aPoints);\n",
    )
    element = plcopen_xml.CODESYS.pou(source)
    rows = [dict(zip(MEMBERS, row, strict=True)) for row in points.literals(axis)]
    plcopen_xml.CODESYS.initialise_structures(element, "aPoints", rows)
    return element
