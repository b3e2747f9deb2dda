"""Many motions in one playback block: an input selects which one it plays.

The block is that of a single motion (`structured_text`), with a handful of changes: tables of all motions
stand one after the other in the same arrays, everything else that is a motion's own becomes an array, and the
statements look these up at the motion that is selected. So every motion keeps its literals and its own
checksum, and what is known of the single block holds for the library. Reading writes the single blocks of the
numbers found, and a library of these, which must be the same.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import accumulate

import attrs

from gen_profile.motion.profile import SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable, initialiser
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.playback import buffers
from gen_profile_exporters.playback.block import COLUMNS, SAMPLED, layout_of, shape_of, statements
from gen_profile_exporters.playback.buffers import buffered, constant_sources, is_buffered, is_library
from gen_profile_exporters.playback.structured_text import (
    axis_lines,
    block_name,
    plain,
    read_table,
    table_checksum,
)
from gen_profile_exporters.playback.table import MOST_SAMPLES
from gen_profile_exporters.templates import filled

SCALARS, PER_AXIS = (tuple(f"c{name}" for name in names) for names in (buffers.SCALARS, buffers.PER_AXIS))
*POWERS, SEGMENTS = (f"c{name}" for name in COLUMNS["segments"])
TABLES = (*(f"c{name}" for name in SAMPLED), *POWERS)
ROWS, FIRST_ROW, FIRST_SEGMENT = "cRows", "cFirstRow", "cFirstSegment"

BEGINNING = ("fPosition", "fUnwrapped")  # at the start
OWN = (*SCALARS, *PER_AXIS, *TABLES, SEGMENTS, *BEGINNING)

_SCALAR = re.compile(rf"\b({'|'.join((*SCALARS, *PER_AXIS))})\b(?!\[)")
_AXIS = re.compile(rf"\b({'|'.join(PER_AXIS)})\[nAxis\]")
_TABLE = re.compile(rf"\b({'|'.join(TABLES)})\[([^\[\]]*)\]")
_SEGMENT = re.compile(rf"\b{SEGMENTS}\[([^\[\]]*)\]")

_WAIT = re.compile(r"(\d+) cycles after power-up")


@attrs.frozen(kw_only=True)
class LibraryEntry:
    """A motion to put in.

    Attributes
    ----------
    source : BlockSource
        Its playback block.
    label : str
        What it is for, a few words.
    """

    source: BlockSource
    label: str


def library_source(entries: Sequence[LibraryEntry], target: Target) -> BlockSource:
    """Write a block that plays any of several motions, which `nProfile` counts from 0.

    Parameters
    ----------
    entries : sequence of LibraryEntry
        One or more, for the same axes and cycle, in the same layout.
    target : Target
        Whose name is that of the library.

    Raises
    ------
    ExportError
        They differ in more than their motions, were altered, or are too much to compile.
    """
    variables = any(is_buffered(entry.source) for entry in entries)
    sources = [one for entry in entries for one in singles_of(entry.source, target)]
    for number, source in enumerate(sources):
        if _common(source) != _common(sources[0]):
            raise ExportError(
                f"Profile {number} ({entries[number].label}) is for other axes, units, layouts or cycles "
                "than the first one; put such profiles into libraries of their own."
            )
    rows = sum(map(_rows, sources))
    if rows > MOST_SAMPLES:
        raise ExportError(
            f"The tables of all profiles have {rows} rows, and no more than {MOST_SAMPLES} were seen to "
            "compile; split them into several libraries."
        )
    header, name = _header(entries, target), block_name(target.name)
    if variables:
        sources[0] = attrs.evolve(sources[0], header=header, name=name)
        return buffered(sources, target, library=True)
    return _assembled(sources, header, name)


def read_library(library: BlockSource, target: Target) -> tuple[SampledProfile, ...]:
    """Work out what a library's block issues for each of its motions.

    Each is taken out of the library as a block of its own, which must be one to the letter, with a checksum
    that is right.

    Raises
    ------
    ExportError
        The block is no such library, or was altered.
    """
    singles = constant_sources(library, target) if is_buffered(library) else _singles(library)
    return tuple(read_table(single.text(), target).motion() for single in singles)


def singles_of(source: BlockSource, target: Target) -> list[BlockSource]:
    """Give the block of constants of each motion that a block plays; raises as `read_library`."""
    if is_buffered(source):
        return constant_sources(source, target)
    return _singles(source) if is_library(source) else [source]


def _singles(library: BlockSource) -> list[BlockSource]:
    """Take a library's motions out, and make sure that it selects them as it should."""
    arrays = {variable.name: variable.elements for variable in library.variables if variable.array}
    layout = layout_of(library.declaration())
    try:
        numbers = range(len(arrays[FIRST_ROW]))
        singles = [buffers.constant_block(_values(arrays, number), library, layout) for number in numbers]
    except (KeyError, ValueError, IndexError, ZeroDivisionError) as error:
        raise ExportError("The block is no library of motions, or was altered; export it again.") from error
    if _assembled(singles, library.header, library.name).program() != library.program():
        raise ExportError(
            "The block does not select its motions as it should: it was altered; export it again."
        )
    return singles


def _assembled(sources: Sequence[BlockSource], header: str, name: str) -> BlockSource:
    """Put blocks together that differ in their motions only."""
    merged = [_merged(same) for same in zip(*(source.variables for source in sources), strict=True)]
    return BlockSource(
        header=header,
        name=name,
        variables=(*merged, *_selector(sources)),
        body=_selecting(statements(shape_of(sources[0]), is_library=True)),
    )


def _common(source: BlockSource) -> tuple[object, ...]:
    """Give what is to be the same in all blocks of a library."""
    return (
        source.body,
        *(
            (variable.section, variable.name, variable.scalar_type) if variable.name in OWN else variable
            for variable in source.variables
        ),
    )


def _rows(source: BlockSource) -> int:
    """Count the rows of a motion's table."""
    return next(int(variable.initial) for variable in source.variables if variable.name == ROWS)


def _merged(same: Sequence[BlockVariable]) -> BlockVariable:
    """Make one variable of those of the same name in all blocks."""
    first = same[0]
    if first.name not in OWN or first.name in BEGINNING:
        return first
    values = [text for variable in same for text in variable.values]
    return _array(first.name, first.scalar_type, values, first.comment)


def _array(name: str, type_: str, values: Sequence[str], comment: str = "") -> BlockVariable:
    return BlockVariable(
        "VAR CONSTANT",
        name,
        f"ARRAY [0..{len(values) - 1}] OF {type_}",
        initial=initialiser(values),
        comment=comment,
    )


def _selector(sources: Sequence[BlockSource]) -> list[BlockVariable]:
    """Declare what selects a motion, and where its tables begin and end."""
    last, rows = len(sources) - 1, [_rows(source) for source in sources]
    added = [
        BlockVariable("VAR_INPUT", "nProfile", "DINT", comment=f"which motion, 0 to {last}"),
        BlockVariable("VAR", "nSelected", "DINT", comment="nProfile, once nothing moved"),
        BlockVariable("VAR CONSTANT", "cProfiles", "DINT", initial=str(len(sources))),
        _array(FIRST_ROW, "DINT", _starts(rows)),
    ]
    segments = [len(v.elements) for source in sources for v in source.variables if v.name == SEGMENTS]
    return [*added, _array(FIRST_SEGMENT, "DINT", _starts(segments))] if segments else added


def _starts(lengths: Sequence[int]) -> list[str]:
    return [str(start) for start in accumulate(lengths[:-1], initial=0)]


def _selecting(body: str) -> str:
    """Make the statements look up what is the selected motion's own."""
    body = _SCALAR.sub(r"\1[nSelected]", body)
    body = _AXIS.sub(r"\1[nSelected * cAxes + nAxis - 1]", body)
    body = _TABLE.sub(rf"\1[{FIRST_ROW}[nSelected] + \2]", body)
    body = _SEGMENT.sub(rf"{SEGMENTS}[{FIRST_SEGMENT}[nSelected] + \1]", body)
    return f"{filled('playback/text/selection.st')}\n{body}"


def _values(arrays: Mapping[str, list[str]], number: int) -> dict[str, list[str]]:
    """Take a motion's numbers out of all, by the names that they have in a buffer."""
    axes = len(arrays["cStart"]) // len(arrays[FIRST_ROW])
    rows, first_row = int(arrays[ROWS][number]), int(arrays[FIRST_ROW][number])
    parts = {name: slice(number, number + 1) for name in SCALARS}
    parts |= {name: slice(number * axes, (number + 1) * axes) for name in PER_AXIS}
    parts |= {name: slice(first_row, first_row + rows) for name in TABLES}
    if SEGMENTS in arrays:
        first_segment = int(arrays[FIRST_SEGMENT][number])
        parts[SEGMENTS] = slice(first_segment, first_segment + rows // axes)
    return {name.removeprefix("c"): arrays[name][part] for name, part in parts.items() if name in arrays}


def _header(entries: Sequence[LibraryEntry], target: Target) -> str:
    """Describe the library; how to use it is what the header of a single motion says."""
    headers = [entry.source.header for entry in entries]
    _, start, use = headers[0].partition("    Call the block once")
    waits = [int(wait) for header in headers for wait in _WAIT.findall(header)]
    use = _WAIT.sub(f"{max(waits, default=0)} cycles after power-up or another nProfile", use)
    use = use.replace("the peaks above and to the stop jerk", "the motion's own peaks and stop jerk")
    use = use.removesuffix("\n").removesuffix("*)")
    listed = [line for number, entry in enumerate(entries) for line in _listed(number, entry, target)]
    values = {"name": plain(target.name), "count": len(entries), "use": f"{start}{use}"}
    return filled("playback/text/library.st", **values, listed=listed)


def _listed(number: int, entry: LibraryEntry, target: Target) -> list[str]:
    """Tell what a motion is for, how long it takes, and what it asks of each axis."""
    table = read_table(entry.source.text(), target)
    duration = f"{table.last * table.cycle_time:g} s, {table.last} cycles"
    return [
        f"    {number:6d}  {table_checksum(table):>10}  {plain(entry.label)}: {duration}",
        *(f"          {line}" for lines in axis_lines(table) for line in lines.splitlines()),
    ]
