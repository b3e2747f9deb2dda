"""The playback block with variables in place of constants: two buffers, of which one is in use.

The block is that of constants (`structured_text`), with a handful of changes that can be undone: what is the
motion's own stands in an array of LREAL, twice; the statements take it from the buffer in use; ahead of
them stand others (``text/buffers.st``) that answer requests, and behind them some (``text/state.st``) that
show how the block stands. A buffer holds

    rows, checks, last segment, last, play on, checksum, slope, slope rate,
    room, inverse, stop jerk, start, target, least scale, mirrors, shifts of each axis,
    the table, column by column

The checksum is that of the block of constants: over the table and all other numbers, those included that
stay constants, as the cycle time. So a table for another cycle or number of axes has a wrong one here.
"""

from __future__ import annotations

import re
import zlib
from itertools import chain
from math import ceil
from pathlib import Path

import attrs

from gen_profile.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable, initialiser, ordered
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.playback.block import variable_names
from gen_profile_exporters.playback.layouts import LAYOUTS
from gen_profile_exporters.playback.table import counted_axes

INTERFACE = 1  # version of the requests
LENGTH, FIRST, WINDOW = 256, 16, 239  # of requests and replies; where their data begin, and how many at most
LEAST_CAPACITY, MOST_CAPACITY = 2048, 1 << 17
PATIENCE = 30.0  # s that a client may be silent before another one may write
REQUEST, REPLY, STATE, TABLE = "aRequest", "aReply", "aState", "aTable"

SCALARS = ("Rows", "Checks", "LastSegment", "Last", "PlayOn", "Checksum", "Slope", "SlopeRate")
PER_AXIS = ("Room", "Inverse", "StopJerk", "Start", "Target", "LeastScale", "Mirrors", "Shifts")
CHECKSUM = SCALARS.index("Checksum")
LAYOUT_NAMES = tuple(LAYOUTS)
COLUMNS = {
    "segments": (*(f"cPower{power}" for power in range(6)), "cFirst"),
    "samples": ("cPosition", "cVelocity", "cAcceleration"),
    "counts": ("cPosition", "cVelocity", "cAcceleration"),
}
STATE_HEAD = 13  # values of the state ahead of those of each axis
AXIS_STATE = ("Position", "Velocity", "Acceleration", "Gain", "Shift")
RESULTS = ("cAccepted", "cHeld", "cMoves", "cUnfit")
TRIALS = ("cUntried", "cTried", "cPassed", "cRejected")
VARIABLES = {
    "LREAL": ("fHolder", "fCalls"),
    "DINT": ("nBase", "nIdle", "nTable", "nPlace", "nCount", "nResult", "nTrial", "nQuiet", "nRuns"),
    "BOOL": ("bLoaded", "bAsked", "bSwitch", "bTrial", "bBusyBefore"),
}
NOTE = """\
    Its numbers are variables, in two buffers, which gen-profile deploy writes through aRequest and reads
    through aReply; so the peaks above are those of the motion that it was exported with. A cold start brings
    that motion back, unless the controller retains the instance.

"""

TEXT = Path(__file__).with_name("text")
_TEMPLATE, _STATE = ((TEXT / f"{name}.st").read_text("ascii") for name in ("buffers", "state"))
_OWN = re.compile(rf"\bc({'|'.join((*SCALARS, *PER_AXIS))})\b")
_TAKEN = re.compile(rf"\bt({'|'.join((*SCALARS, *PER_AXIS))})\b")
_COLUMN = re.compile(
    r"(DINT_TO_LREAL\()?\b(cPower\d|cFirst|cPosition|cVelocity|cAcceleration)\[([^\[\]]*)\](?(1)\))"
)
_PLACE = re.compile(rf"(LREAL_TO_DINT\()?{TABLE}\[nTable \+ (\d) \* tRows \+ ([^\[\]]*)\](?(1)\))")


def is_buffered(source: BlockSource) -> bool:
    """Tell whether a block's numbers are variables."""
    return any(variable.name == TABLE for variable in source.variables)


def kind_of(target: Target, layout: str) -> int:
    """Hash what two blocks must have in common for one to play the other's table: layout, axes, units."""
    counted = counted_axes(target, layout)
    axes = ", ".join(f"{axis.name} {axis.unit} {axis.factor!r}" for axis in counted)
    return zlib.crc32(f"playback {layout}: {axes}".encode()) >> 1


def buffered(source: BlockSource, target: Target, capacity: int | None = None) -> BlockSource:
    """Put variables in place of a block's constants.

    Parameters
    ----------
    source : BlockSource
        With constants.
    target : Target
    capacity : int, optional
        Values that a buffer holds; with room for a longer table if not given.

    Raises
    ------
    ExportError
        The table is too long.
    """
    declared = {variable.name: variable for variable in source.variables}
    layout = _layout(declared)
    columns, axes = COLUMNS[layout], len(_split(declared["cStart"]))
    texts = _texts(declared, columns, axes)
    if capacity is None:
        capacity = max(LEAST_CAPACITY, 1 << (len(texts) + len(columns) - 1).bit_length())
    if len(texts) + len(columns) > min(capacity, MOST_CAPACITY):
        raise ExportError(
            f"export.plc_tables: {len(texts)} values do not fit a buffer of {min(capacity, MOST_CAPACITY)}; "
            'take export.plc_layout = "segments", a longer export.cycle_time, or plc_tables = "constants".'
        )
    empty = ["0.0"] * (2 * capacity - len(texts))
    constants = {name: number for names in (RESULTS, TRIALS) for number, name in enumerate(names)}
    constants |= {
        "cInterface": INTERFACE,
        "cKind": kind_of(target, layout),
        "cLayout": LAYOUT_NAMES.index(layout),
        "cCapacity": capacity,
        "cOwn": len(SCALARS) + axes * len(PER_AXIS),
        "cPatience": ceil(PATIENCE / float(declared["cCycleTime"].initial)),
    }
    window, both = f"ARRAY [0..{LENGTH - 1}] OF LREAL", f"ARRAY [0..{2 * capacity - 1}] OF LREAL"
    variables = (
        *(_taken(one) for one in source.variables if one.name not in columns),
        BlockVariable(section="VAR_INPUT", name=REQUEST, type=window, comment="of gen-profile deploy"),
        BlockVariable(section="VAR_OUTPUT", name=REPLY, type=window),
        BlockVariable(section="VAR_OUTPUT", name=STATE, type=f"ARRAY [0..{state_length(axes) - 1}] OF LREAL"),
        BlockVariable(section="VAR", name=TABLE, type=both, initial=initialiser([*texts, *empty])),
        *(
            BlockVariable(section="VAR", name=name, type=kind)
            for kind, of in VARIABLES.items()
            for name in of
        ),
        *(
            BlockVariable(section="VAR CONSTANT", name=name, type="DINT", initial=str(value))
            for name, value in constants.items()
        ),
    )
    if layout != "segments":  # its place in a buffer is there all the same
        variables = (*variables, BlockVariable(section="VAR", name="tLastSegment", type="DINT"))
    return BlockSource(
        header=source.header.replace("    nErrorId: 0 none", f"{NOTE}    nErrorId: 0 none"),
        name=source.name,
        variables=variables,
        body=_prelude(layout, axes) + _from_buffer(source.body, layout) + _shown_state(axes),
    )


def state_length(axes: int) -> int:
    """Count the values of ``aState``."""
    return STATE_HEAD + axes * len(AXIS_STATE) + 1


def buffer_texts(source: BlockSource) -> list[str]:
    """List the values of the first buffer that belong to the table in it.

    Raises
    ------
    ExportError
        They were altered so that they are none.
    """
    variables = {variable.name: variable for variable in source.variables}
    try:
        texts, rows = variables[TABLE].elements, int(float(variables[TABLE].elements[0]))
        layout = LAYOUT_NAMES[int(variables["cLayout"].initial)]
        length = int(variables["cOwn"].initial) + rows * len(COLUMNS[layout])
        if rows < 1 or length > len(texts) // 2:
            raise ValueError("sizes")
    except (KeyError, ValueError, IndexError, OverflowError) as error:
        raise ExportError("The block's buffers were altered; export it again.") from error
    return texts[:length]


def with_buffer(source: BlockSource, texts: list[str]) -> BlockSource:
    """Put other values into the first buffer, the rest of it being empty."""
    (table,) = (variable for variable in source.variables if variable.name == TABLE)
    whole = [*texts, *["0.0"] * (len(table.elements) - len(texts))]
    changed = attrs.evolve(table, initial=initialiser(whole))
    return attrs.evolve(
        source, variables=tuple(changed if one.name == TABLE else one for one in source.variables)
    )


def constant_source(source: BlockSource, target: Target) -> BlockSource:
    """Undo `buffered`: give the block of constants that plays what the first buffer holds.

    Raises
    ------
    ExportError
        The block is none that `buffered` gives.
    """
    texts = buffer_texts(source)
    try:
        variables = {variable.name: variable for variable in source.variables}
        layout = LAYOUT_NAMES[int(variables["cLayout"].initial)]
        back = _constants(source, texts, layout, len(target.axes))
        again = buffered(back, target, len(variables[TABLE].elements) // 2)
    except (KeyError, ValueError, IndexError, OverflowError, ZeroDivisionError) as error:
        raise ExportError("The block's buffers were altered; export it again.") from error
    if again.program() != source.program():
        raise ExportError(
            "The block does not take its numbers from its buffers as it should, or is for other axes: it was "
            "altered; export it again."
        )
    return back


def _layout(variables: dict[str, BlockVariable]) -> str:
    if "cPower0" in variables:
        return "segments"
    array = variables["cPosition"].array
    return "counts" if array is not None and array[2] == "DINT" else "samples"


def _texts(variables: dict[str, BlockVariable], columns: tuple[str, ...], axes: int) -> list[str]:
    """List the values of a block of constants in the order of a buffer, as literals of LREAL."""
    scalars = [variables[f"c{name}"].initial if f"c{name}" in variables else "0" for name in SCALARS]
    own = [_split(variables[f"c{name}"]) for name in PER_AXIS]
    rows = [_split(variables[name]) for name in columns]
    if "cFirst" in columns:  # of every axis alike
        rows[-1] = [text for text in rows[-1] for _ in range(axes)]
    return [_as_real(text) for text in chain(scalars, *zip(*own, strict=True), *rows)]


def _split(variable: BlockVariable) -> list[str]:
    return variable.elements if variable.array else [variable.initial]


def _as_real(text: str) -> str:
    text = {"TRUE": "1", "FALSE": "0"}.get(text, text)
    return text if "." in text else f"{text}.0"


def _taken(variable: BlockVariable) -> BlockVariable:
    """Make a variable of a constant that is the motion's own."""
    if not _OWN.fullmatch(variable.name):
        return variable
    return attrs.evolve(variable, section="VAR", name=f"t{variable.name[1:]}", initial="")


def _from_buffer(body: str, layout: str) -> str:
    """Make the statements look their numbers up in the buffer in use."""

    def place(match: re.Match[str]) -> str:
        name, index = match[2], match[3] if match[2] != "cFirst" else f"cAxes * ({match[3]})"
        text = f"{TABLE}[nTable + {COLUMNS[layout].index(name)} * cRows + {index}]"
        # one that is wanted as a real number need not fit DINT if it was altered
        return f"LREAL_TO_DINT({text})" if _is_whole(name, layout) and not match[1] else text

    return _OWN.sub(r"t\1", _COLUMN.sub(place, body))


def _to_constants(body: str, layout: str) -> str:
    """Undo `_from_buffer`."""

    def place(match: re.Match[str]) -> str:
        name, index = COLUMNS[layout][int(match[2])], match[3]
        if name == "cFirst":
            index = index.removeprefix("cAxes * (").removesuffix(")")
        text = f"{name}[{index}]"
        return f"DINT_TO_LREAL({text})" if _is_whole(name, layout) and not match[1] else text

    return _TAKEN.sub(r"c\1", _PLACE.sub(place, body))


def _is_whole(column: str, layout: str) -> bool:
    return column == "cFirst" or layout == "counts"


def _constants(source: BlockSource, texts: list[str], layout: str, axes: int) -> BlockSource:
    """Undo all changes but the header's."""
    columns = COLUMNS[layout]
    own = len(SCALARS) + axes * len(PER_AXIS)
    rows = (len(texts) - own) // len(columns)
    values = {name: [texts[number]] for number, name in enumerate(SCALARS)}
    values |= {name: texts[len(SCALARS) + k : own : len(PER_AXIS)] for k, name in enumerate(PER_AXIS)}
    back = [_given_back(one, values) for one in source.variables]
    for number, name in enumerate(columns):
        column = texts[own + number * rows : own + (number + 1) * rows]
        if name == "cFirst":
            column = column[::axes]
        of = "DINT" if _is_whole(name, layout) else "LREAL"
        initial = initialiser([_as(of, text) for text in column])
        declared = f"ARRAY [0..{len(column) - 1}] OF {of}"
        back.append(BlockVariable(section="VAR CONSTANT", name=name, type=declared, initial=initial))
    names = variable_names(layout, axes)
    back = [one for one in back if one.name in names]
    body = source.body.removeprefix(_prelude(layout, axes)).removesuffix(_shown_state(axes))
    body = _to_constants(body, layout)
    return ordered(attrs.evolve(source, variables=tuple(back), body=body), names)


def _given_back(variable: BlockVariable, values: dict[str, list[str]]) -> BlockVariable:
    if not _TAKEN.fullmatch(variable.name):
        return variable
    type_ = variable.array[2] if variable.array else variable.type
    texts = [_as(type_, text) for text in values[variable.name[1:]]]
    initial = f"[{', '.join(texts)}]" if variable.array else texts[0]
    return attrs.evolve(variable, section="VAR CONSTANT", name=f"c{variable.name[1:]}", initial=initial)


def _as(type_: str, text: str) -> str:
    if type_ == "BOOL":
        return {"0.0": "FALSE", "1.0": "TRUE"}.get(text, text)
    return text.removesuffix(".0") if type_ == "DINT" else text


def _prelude(layout: str, axes: int) -> str:
    types = dict.fromkeys(SCALARS[: CHECKSUM + 1], "LREAL_TO_DINT({})")
    lines = [
        f"t{name} := {types.get(name, '{}').format(f'{TABLE}[nBase + {number}]')};"
        for number, name in enumerate(SCALARS)
    ]
    step, indent = len(PER_AXIS), "    " * (axes > 1)
    at, index = (f" + {step} * nAxis", "[nAxis]") if axes > 1 else ("", "")
    first = len(SCALARS) - (step if axes > 1 else 0)
    own = [
        f"{indent}t{name}{index} := {TABLE}[nBase{at} + {first + number}]"
        f"{' > 0.5' if name in ('Mirrors', 'Shifts') else ''};"
        for number, name in enumerate(PER_AXIS)
    ]
    lines += ["FOR nAxis := 1 TO cAxes DO", *own, "END_FOR;"] if axes > 1 else own
    loads = "\n".join(f"    {line}" for line in lines)
    return _TEMPLATE.replace("@columns", str(len(COLUMNS[layout]))).replace("@loads", loads)


def _shown_state(axes: int) -> str:
    step = len(AXIS_STATE)
    at, index, indent = (f" + {step} * nAxis", "[nAxis]", "    ") if axes > 1 else ("", "", "")
    first = STATE_HEAD - (step if axes > 1 else 0)
    lines = [
        f"{indent}aState[{first + number}{at}] := f{name}{index};" for number, name in enumerate(AXIS_STATE)
    ]
    lines = ["FOR nAxis := 1 TO cAxes DO", *lines, "END_FOR;"] if axes > 1 else lines
    return _STATE.replace("@axes", "\n".join(lines)).replace("@last", str(state_length(axes) - 1))
