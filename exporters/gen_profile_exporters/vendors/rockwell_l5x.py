"""Studio 5000 (Logix): the motion as CAM arrays for MCCP and MATC, in an L5X import of a routine.

CAM elements are REAL, seconds and axis units; all segments are cubic. MCCP makes a spline of them that stands
still at both ends (start and end slope 0), which is what replay evaluates, on the numbers rounded to REAL.
Points are evenly spaced cycles, as many as the error allows; the error found, REAL's rounding included, is
stated in the tag's description.
"""

import re
from hashlib import sha256

import numpy as np
from lxml import etree

from gen_profile.motion.profile import Array, Profile, SampledProfile, grid_times
from gen_profile.support.errors import ExportError
from gen_profile.support.units import COUNTS, AxisScale
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.playback.structured_text import block_name
from gen_profile_exporters.setpoints import MAX_SAMPLES, axis_table, in_si, sampled
from gen_profile_exporters.templates import filled
from gen_profile_exporters.vendors.cam_points import play_spline, spline_cycles, spline_error
from gen_profile_exporters.vendors.xml_documents import attribute, child, parse_xml, write_xml

MOST_POINTS = 1000  # of an array that MCCP takes
POINT_ERROR = 1e-5  # m (or rad), REAL's rounding included
CUBIC = "1"
NAME_LENGTH = 40  # of a tag

_REAL = re.compile(r"[-+]?\d+\.\d+([eE][-+]?\d+)?", re.ASCII)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write a routine with its tags.

    Raises
    ------
    ExportError
        More points would be needed than the array holds, or REAL is too coarse for the positions.
    """
    motion = sampled(profile, target, target.cycle_time, "export.cycle_time")
    cycles = spline_cycles(motion, MOST_POINTS, POINT_ERROR, "rockwell-l5x, CAM", single=True)
    error = spline_error(motion, cycles, single=True)
    positions = axis_table(motion, target.axes).position[cycles]
    root = parse_xml(filled("vendors/rockwell_l5x.xml", routine=_routine(target)).encode("ascii"))
    tags = child(root, "Controller/Tags")
    for name, axis, column in zip(_tag_names(target), target.axes, positions.T, strict=True):
        _cam(
            tags, name, f"Axis {axis.name}: s, {axis.unit}; error {error:.2g} m", motion.times[cycles], column
        )
        _tag(tags, f"{name}_Profile", "CAM_PROFILE", len(cycles))
        _tag(tags, f"{name}_Control", "MOTION_INSTRUCTION")
        _switch(tags, f"{name}_Calculate")
    statements = filled("vendors/rockwell_l5x.st", names=_tag_names(target), points=len(cycles))
    content = child(root, "Controller/Programs/Program/Routines/Routine/STContent")
    for number, line in enumerate(statements.splitlines()):
        etree.SubElement(content, "Line", {"Number": str(number)}).text = etree.CDATA(line)
    return (File(f"{target.name}.L5X", write_xml(root)),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Evaluate the splines at the target's cycles.

    Raises
    ------
    ExportError
        The document is no such import, or its points are damaged.
    """
    root = parse_xml(content)
    columns = [_points(child(root, f"Controller/Tags/Tag[@Name='{name}']")) for name in _tag_names(target)]
    knots = columns[0][:, 0]
    for column in columns:
        if len(column) != len(knots) or (column[:, 0] != knots).any():
            raise ExportError("The axes' points are at different times; export the motion again.")
    if knots[0] != 0.0 or not (np.diff(knots) > 0.0).all():
        raise ExportError("The points' times must rise from 0; export the motion again.")
    cycles = round(knots[-1] / target.cycle_time)
    if not 1 <= cycles < MAX_SAMPLES or abs(cycles * target.cycle_time - knots[-1]) > 1e-6 * knots[-1]:
        raise ExportError(
            f"The points end at {knots[-1]:g} s, which is no multiple of export.cycle_time; "
            "export them again."
        )
    times = grid_times(cycles, target.cycle_time)
    played = play_spline(knots, np.column_stack([column[:, 1] for column in columns]), times, single=True)
    factor = np.array([axis.factor for axis in target.axes])
    return SampledProfile(
        cycle_time=target.cycle_time, position=in_si(played, factor), resolution=_spacing(played, target.axes)
    )


def _spacing(values: Array, axes: tuple[AxisScale, ...]) -> Array:
    """Distance in m between the REALs around the greatest position, or between whole counts."""
    counts = [float(axis.unit == COUNTS) for axis in axes]
    spacing = np.maximum(np.spacing(np.float32(np.abs(values).max(axis=0))), counts)
    return np.asarray(spacing / np.abs([axis.factor for axis in axes]), dtype=np.float64)


def _cam(tags: etree._Element, name: str, description: str, times: Array, values: Array) -> None:
    tag = _tag(tags, name, "CAM", len(times))
    etree.SubElement(tag, "Description").text = etree.CDATA(description)
    data = etree.SubElement(tag, "Data", {"Format": "Decorated"})
    array = etree.SubElement(data, "Array", {"DataType": "CAM", "Dimensions": str(len(times))})
    for index, (time, value) in enumerate(zip(times, values, strict=True)):
        element = etree.SubElement(array, "Element", {"Index": f"[{index}]"})
        structure = etree.SubElement(element, "Structure", {"DataType": "CAM"})
        _member(structure, "Master", "REAL", "Float", _real(time))
        _member(structure, "Slave", "REAL", "Float", _real(value))
        _member(structure, "SegmentType", "DINT", "Decimal", CUBIC)


def _tag(tags: etree._Element, name: str, type_: str, dimension: int | None = None) -> etree._Element:
    attributes = {"Name": name, "TagType": "Base", "DataType": type_}
    if dimension is not None:
        attributes["Dimensions"] = str(dimension)
    attributes |= {"Constant": "false", "ExternalAccess": "Read/Write"}
    return etree.SubElement(tags, "Tag", attributes)


def _switch(tags: etree._Element, name: str) -> None:
    """Add a bit that an import sets."""
    tag = _tag(tags, name, "BOOL")
    tag.set("Radix", "Decimal")
    data = etree.SubElement(tag, "Data", {"Format": "Decorated"})
    etree.SubElement(data, "DataValue", {"DataType": "BOOL", "Radix": "Decimal", "Value": "1"})


def _member(parent: etree._Element, name: str, type_: str, radix: str, value: str) -> None:
    etree.SubElement(
        parent, "DataValueMember", {"Name": name, "DataType": type_, "Radix": radix, "Value": value}
    )


def _points(tag: etree._Element) -> Array:
    """Read times and positions, shape (points, 2)."""
    array = child(tag, "Data/Array")
    structures = array.findall("Element/Structure")
    if len(structures) < 2 or attribute(array, "Dimensions") != str(len(structures)):
        raise ExportError(
            f"line {array.sourceline}: {len(structures)} points of {attribute(array, 'Dimensions')[:20]}; "
            "export them again."
        )
    for structure in structures:
        if attribute(child(structure, "DataValueMember[@Name='SegmentType']"), "Value") != CUBIC:
            raise ExportError(f"line {structure.sourceline}: the segment is not cubic; export it again.")
    return np.array([[_number(structure, name) for name in ("Master", "Slave")] for structure in structures])


def _number(structure: etree._Element, name: str) -> float:
    text = attribute(child(structure, f"DataValueMember[@Name='{name}']"), "Value")
    number = float(text) if _REAL.fullmatch(text) else float("nan")
    if not abs(number) < float(np.finfo(np.float32).max):
        raise ExportError(
            f"line {structure.sourceline}: {name} holds {text[:40]!r}, which is no REAL; export it again."
        )
    return number


def _real(value: float) -> str:
    """Shortest text that reads back to the same single-precision number."""
    return np.format_float_scientific(np.float32(value) + np.float32(0.0), trim="0", exp_digits=1)


def _tag_names(target: Target) -> list[str]:
    stem = _short(target.name, NAME_LENGTH - 16)
    several = len(target.axes) > 1
    return [f"Cam_{stem}{f'_{number}' if several else ''}" for number in range(1, len(target.axes) + 1)]


def _routine(target: Target) -> str:
    return f"Play_{_short(target.name, NAME_LENGTH - len('Play_'))}"


def _short(name: str, most: int) -> str:
    """Name tags after the motion; a part of its hash keeps those of long names apart."""
    whole = block_name(name).removeprefix("FB_")
    if len(whole) <= most:
        return whole
    digest = sha256(name.encode("ascii")).hexdigest()[:6]
    return f"{whole[: most - 7].rstrip('_')}_{digest}"
