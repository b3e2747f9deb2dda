"""TIA Portal: the playback block as an external source in SCL, a wrapper, and the motion as points of a cam.

SCL differs from the portable text: names of the block's own are marked by ``#``, arrays cannot be constants
and so stand among the static variables. Replay undoes that and reads the rest.
The wrapper calls ``MC_MOTIONINPOSITION`` of the S7-1500T; the one in a file of its own has velocity setpoints
for converters, which any S7-1500 gives. The data block holds an array of ``TO_Cam_Struct_PointData`` per
axis, to be copied into a TO_Cam (up to 1000 points) or TO_Cam_10k, whose spline through points at a regular
distance keeps within the error stated.
"""

import re

import attrs
import numpy as np

from gen_profile.motion.profile import Profile, sample
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import (
    BlockSource,
    BlockVariable,
    is_planner,
    ordered,
    parse_function_block,
    place_of_own,
    with_blocks_within,
)
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.motion_libraries import SIEMENS, VELOCITY
from gen_profile_exporters.playback.axis_wrapper import axis_wrappers, turns_of
from gen_profile_exporters.playback.block import BlockShape, layout_of, variable_names
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE, is_buffered
from gen_profile_exporters.playback.structured_text import block_text, literal, replays
from gen_profile_exporters.setpoints import axis_table
from gen_profile_exporters.vendors.cam_points import spline_cycles, spline_error

# of an optimised block in an S7-1500; a standard block holds 64 kB (Siemens, Programming Guideline for
# S7-1200/1500, entry 81318674, section 2.6)
MOST_BYTES = 16_000_000
MOST_POINTS = 10_000  # TO_Cam_10k
POINT_ERROR = 1e-6  # m (or rad)
BYTES = {"LREAL": 8, "DINT": 4}

_WITHIN = r"((?:(?!FUNCTION_BLOCK).)*?)"
_BLOCK = re.compile(
    r"((?:\(\*(?:[^*(]++|\*(?!\))|\((?!\*))*\*\)\s*+)?)FUNCTION_BLOCK\s++\"(\w++)\"\s*+\{[^{}]*+\}\s*+VERSION\s*+:\s*+[\d.]++"
    rf"{_WITHIN}\bBEGIN\b{_WITHIN}END_FUNCTION_BLOCK",
    re.DOTALL,
)
_WORD = re.compile(r"[()]|(?<![.#\w])[A-Za-z]\w*(\s*:=)?")


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the source with block and wrapper, and the one with the points.

    Raises
    ------
    ExportError
        As for Structured Text; the table is larger than a data block, or the cam needs too many points.
    """
    source = parse_function_block(block_text(profile, target))
    blocks = wrap(source, target)
    if any(axis.modulo for axis in target.axes):
        return blocks  # a cam's positions are those of one turn
    cams = _cams(source.name, profile, target)
    return (*blocks, File(f"{target.name}_cam.scl", cams.encode("ascii")))


def wrap(source: BlockSource, target: Target) -> tuple[File, ...]:
    """Write the source with any block, and the wrapper of one that plays.

    Raises
    ------
    ExportError
        Its numbers are larger than a data block.
    """
    sizes: dict[str, int] = {}
    for block in (*source.within, source):
        sizes[block.name] = sum(sizes.get(v.type, _bytes(v)) for v in block.variables)
    size = sizes[source.name]
    if size > MOST_BYTES:
        cure = 'export.plc_layout = "segments", a longer export.cycle_time, or fewer motions in a library'
        if is_planner(source.text()):
            cure = (
                "another form, or ask less of the planner: no robustness.uncertain, fewer planner.live, no "
                "planner.zones and planner.events, fewer axes"
            )
        elif is_buffered(source):
            cure = 'export.plc_tables = "constants"'
        raise ExportError(
            f"siemens-scl: the block's numbers take {size / 1e6:.2f} MB, an optimised data block "
            f"of an S7-1500 holds {MOST_BYTES / 1e6:g} MB; take {cure}."
        )
    axes, others = len(target.axes), []
    libraries = (VELOCITY,) if turns_of(source, axes) else (SIEMENS, VELOCITY)
    wrappers = {one: axis_wrappers(source, axes, one) for one in libraries}
    if is_buffered(source):
        wrappers = {one: tuple(_wired(wrapper, source) for wrapper in own) for one, own in wrappers.items()}
        others = [_mailbox(source)]
    on_axes = wrappers.get(SIEMENS, ())
    text = "\n".join([*map(_scl, (*source.within, source, *on_axes)), *others])
    converters = (
        File(f"{target.name}_velocity.scl", _scl(one).encode("ascii")) for one in wrappers[VELOCITY]
    )
    return (File(f"{target.name}.scl", text.encode("ascii")), *converters)


def unwrap(content: bytes, target: Target) -> BlockSource:
    """Read the first block, or a planner block with those within it, and turn it back into portable text.

    Raises
    ------
    ExportError
        There is none.
    """
    text = content.decode("latin-1")
    blocks = [*_BLOCK.finditer(text)]
    if not blocks:
        raise ExportError("There is no SCL block of this export; export it again.")
    place = place_of_own(match[2] for match in blocks)
    return with_blocks_within([_portable(match, text, target) for match in blocks[: place + 1]])


def _portable(match: re.Match[str], text: str, target: Target) -> BlockSource:
    header, name, declarations, body = match.groups()
    portable = body.replace("#", "")
    declarations = re.sub(r'"(FB_\w+)";', r"\1;", declarations.lstrip())
    source = parse_function_block(
        f"{header}FUNCTION_BLOCK {name}\n{declarations}\n{portable.lstrip()}END_FUNCTION_BLOCK\n"
    )
    tables = [variable for variable in source.variables if _is_table(variable)]
    others = [variable for variable in source.variables if not _is_table(variable)]
    # of arrays, which SCL has no constants of; what an axis is, is no number that a buffer holds
    sections = dict.fromkeys(("cModulo", "cModuloLow"), "VAR CONSTANT")
    section = "VAR" if is_buffered(source) else "VAR CONSTANT"
    constants = [attrs.evolve(v, section=sections.get(v.name, section)) for v in tables]
    back = attrs.evolve(source, variables=(*others, *constants))
    has_modulo = any(variable.name == "cModulo" for variable in source.variables)
    names = variable_names(BlockShape(layout_of(text), len(target.axes), has_modulo=has_modulo))
    plays = {name.lower() for name in names} <= {variable.name.lower() for variable in others + tables}
    return ordered(back, names) if plays else back


replay = replays(unwrap)


def mailbox_name(block: str) -> str:
    """Name the data block of a playback block's arrays."""
    return block.replace("FB_", "DB_", 1) + "_Mailbox"


def _wires(source: BlockSource) -> str:
    """Lead a block's arrays to the data block, in a call."""
    name = mailbox_name(source.name)
    arrows = {REQUEST: ":=", REPLY: "=>", STATE: "=>"}
    return ",\n    ".join(f'{key} {arrow} "{name}".{key}' for key, arrow in arrows.items())


def _wired(wrapper: BlockSource, source: BlockSource) -> BlockSource:
    """Do so in a wrapper's call of the block."""
    return attrs.evolve(
        wrapper, body=wrapper.body.replace("fbMotion(", f"fbMotion(\n    {_wires(source)},", 1)
    )


def _mailbox(source: BlockSource) -> str:
    """Write the data block with a playback block's three arrays, at addresses that S7 reaches.

    It is not optimised: ``aRequest`` stands at byte 0, ``aReply`` at 2048, ``aState`` at 4096.
    """
    arrays = [one for name in (REQUEST, REPLY, STATE) for one in source.variables if one.name == name]
    lines = "\n".join(f"    {one.name} : {one.type.replace('ARRAY ', 'Array')};" for one in arrays)
    return (
        f"(* Of gen-profile deploy by S7, with this block's number as --db. Call {source.name} with\n"
        f"    {_wires(source)}\n   as the blocks around it do. Permit PUT/GET in the controller. *)\n"
        f"DATA_BLOCK \"{mailbox_name(source.name)}\"\n{{ S7_Optimized_Access := 'FALSE' }}\nVERSION : 0.1\n"
        f"NON_RETAIN\nSTRUCT\n{lines}\nEND_STRUCT;\nBEGIN\nEND_DATA_BLOCK\n"
    )


def _scl(source: BlockSource) -> str:
    """Turn portable text into SCL."""
    variables = tuple(
        attrs.evolve(variable, section="VAR") if _is_table(variable) else variable
        for variable in source.variables
    )
    declaration = attrs.evolve(source, variables=variables, name=f'"{source.name}"').declaration()
    first, rest = declaration.split("\n", 1)
    quoted = re.sub(r": (FB_\w+);", r': "\1";', rest)  # names of other blocks used as types
    body = _marked(source.body, {variable.name for variable in source.variables})
    return (
        f"{source.header}{first}\n{{ S7_Optimized_Access := 'TRUE' }}\nVERSION : 0.1\n"
        f"{quoted}\nBEGIN\n{body}END_FUNCTION_BLOCK\n"
    )


def _marked(body: str, own: set[str]) -> str:
    """Mark the block's own names; before ``:=`` in a call they are those of the called block's parameters."""
    depth = 0

    def mark(word: re.Match[str]) -> str:
        nonlocal depth
        depth += {"(": 1, ")": -1}.get(word[0], 0)
        name = word[0].split(":")[0].strip()
        return f"#{word[0]}" if name in own and not (word[1] and depth) else word[0]

    return _WORD.sub(mark, body)


def _is_table(variable: BlockVariable) -> bool:
    return variable.array is not None and variable.name.startswith("c")


def _bytes(variable: BlockVariable) -> int:
    if variable.array is None:
        return BYTES.get(variable.type, 2)
    lower, upper, type_ = variable.array
    return (int(upper) - int(lower) + 1) * BYTES.get(type_, 2)


def _cams(block: str, profile: Profile, target: Target) -> str:
    motion = sample(profile, target.cycle_time)
    cycles = spline_cycles(motion, MOST_POINTS, POINT_ERROR, "siemens-scl, TO_Cam", single=False)
    positions = axis_table(motion, target.axes).position[cycles]
    names = [f"Point{number + 1 if len(target.axes) > 1 else ''}" for number in range(len(target.axes))]
    arrays = "\n".join(f"    {name} : Array[1..{len(cycles)}] of TO_Cam_Struct_PointData;" for name in names)
    times = list(map(literal, motion.times[cycles].tolist()))
    values = "\n".join(
        f"    {name}[{index}].x := {time};\n    {name}[{index}].y := {literal(position)};"
        for name, column in zip(names, np.asarray(positions).T.tolist(), strict=True)
        for index, (time, position) in enumerate(zip(times, column, strict=True), 1)
    )
    error = spline_error(motion, cycles, single=False)
    return (
        f"(* {block}: points of a time cam, x in s. A cubic spline through them that stands still at both\n"
        f"   ends is within {error:.2g} m of the motion at every cycle. *)\n"
        f"DATA_BLOCK \"{block.replace('FB_', 'DB_', 1)}_Cam\"\n{{ S7_Optimized_Access := 'TRUE' }}\n"
        f"VERSION : 0.1\nNON_RETAIN\nSTRUCT\n{arrays}\nEND_STRUCT;\nBEGIN\n{values}\nEND_DATA_BLOCK\n"
    )
