"""The playback block with variables in place of constants: two buffers, of which one is in use.

The block is that of constants (`structured_text`), with a handful of changes: what is the motion's own stands
in an array of LREAL, twice; the statements take it from the buffer in use; ahead of them stand others
(``text/requests.st``) that answer requests, and behind them some (``text/state.st``) that show how the block
stands. A buffer holds

    length, checksum, checks                           of all that it holds
    number of motions, where each begins               in a library (`library`) only
    of each motion: rows, checks, last segment, last, play on, checksum, slope, slope rate,
        room, inverse, stop jerk, start, target, least scale, mirrors, shifts of each axis,
        the table, column by column

The first checksum is over the whole buffer, with the cycle time in its own place: a table for another cycle
has a wrong one here. A motion's own is that of its block of constants, which follows from it.
"""

import re
import zlib
from collections.abc import Mapping, Sequence
from itertools import accumulate, chain
from math import ceil

import attrs
import numpy as np

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable, initialiser, parse_function_block
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.playback.block import COLUMNS, BlockShape, fill, shape_of, statements
from gen_profile_exporters.playback.table import checks_of, counted_axes
from gen_profile_exporters.playback.table_checksum import checksum
from gen_profile_exporters.templates import filled

INTERFACE = 2  # version of the requests
LENGTH, FIRST, WINDOW = 256, 16, 239  # of requests and replies; where their data begin, and how many at most
LEAST_CAPACITY, MOST_CAPACITY = 2048, 1 << 17
CLIENT_TIMEOUT = 30.0  # s that a client may be silent before another one may write
REQUEST, REPLY, STATE, TABLE = "aRequest", "aReply", "aState", "aTable"

OF_HEADER = (  # values of a block of constants that only comments tell
    *("name", "layout", "accuracy", "samples", "cycle", "kilobytes", "check_cycles", "axis_lines", "units"),
    "sha256",
)
HEAD = ("length", "checksum", "checks")
CHECKSUM = HEAD.index("checksum")
SCALARS = ("Rows", "Checks", "LastSegment", "Last", "PlayOn", "Checksum", "Slope", "SlopeRate")
PER_AXIS = ("Room", "Inverse", "StopJerk", "Start", "Target", "LeastScale", "Mirrors", "Shifts")
OF_BUFFER = ("Checks", "Checksum")  # not the motion's own: that of the whole buffer counts
WHOLE = SCALARS[:6]
PLANNER = "planner"
LAYOUT_NAMES = (*COLUMNS, PLANNER)
MOVES = "((nState = cWaiting) OR (nState = cMoving))"
LIBRARY = "nProfile"  # the input that a library has
ALTERED = "The block's buffers were altered; export it again."
STATE_HEAD = 14  # values of the state ahead of those of each axis
AXIS_STATE = ("Position", "Velocity", "Acceleration", "Gain", "Shift")
RESULTS = ("cAccepted", "cHeld", "cMoves", "cUnfit")
TRIALS = ("cUntried", "cTried", "cPassed", "cRejected")
SELECTION = (
    BlockVariable("VAR_INPUT", LIBRARY, "DINT", comment="which motion, from 0 on"),
    BlockVariable("VAR", "nSelected", "DINT", comment="it, once nothing moved"),
)
NOTE = """\
    Its numbers are variables, in two buffers, which gen-profile deploy writes through aRequest and reads
    through aReply; so the peaks above are those of the motion that it was exported with. A cold start brings
    that motion back, unless the controller retains the instance.

"""

DROPPED = ("nCheckRows", "nCheckColumn")  # of the block of constants

VARIABLES = {
    "LREAL": ("fHolder", "fCalls"),
    "DINT": (
        "nBase",
        "nIdle",
        "nMotion",
        "nTable",
        "nLength",
        "nChecks",
        "nPlace",
        "nCount",
        "nResult",
        "nTrial",
        "nQuiet",
        "nRuns",
    ),
    "BOOL": ("bLoaded", "bLoad", "bAgain", "bAsked", "bSwitch", "bTrial", "bBusyBefore"),
}
_OWN = re.compile(rf"\bc({'|'.join((*SCALARS, *PER_AXIS))})\b")
_COLUMN = re.compile(
    r"(DINT_TO_LREAL\()?\bc(Power\d|First|Position|Velocity|Acceleration)\[([^\[\]]*)\](?(1)\))"
)
_WAIT = re.compile(r"\d+ cycles after power-up")


def is_buffered(source: BlockSource) -> bool:
    """Tell whether a block's numbers are variables."""
    return any(variable.name == TABLE for variable in source.variables)


def kind_of(target: Target, layout: str, *, library: bool) -> int:
    """Hash what two blocks must have in common for one to play the other's tables: layout, axes, units."""
    counted = counted_axes(target, layout)
    axes = ", ".join(
        f"{axis.name} {axis.unit} {axis.factor!r}{f' {axis.modulo!r}' if axis.modulo else ''}"
        for axis in counted
    )
    return zlib.crc32(f"playback {layout}{' library' * library}: {axes}".encode()) >> 1


def buffered(sources: Sequence[BlockSource], target: Target, *, library: bool = False) -> BlockSource:
    """Put variables in place of constants.

    Parameters
    ----------
    sources : sequence of BlockSource
        Blocks of constants that differ in their motions only: one, or those of a library.
    target : Target
    library : bool
        Whether an input selects the motion.

    Raises
    ------
    ExportError
        They are too long.
    """
    return _buffered(sources, target, None, library=library)


def _buffered(
    sources: Sequence[BlockSource], target: Target, capacity: int | None, *, library: bool
) -> BlockSource:
    constants = {variable.name: variable for variable in sources[0].variables}
    shape = shape_of(sources[0])
    layout, axes = shape.layout, shape.axes
    cycle = float(constants["cCycleTime"].initial)
    texts = _texts([_motion_texts(source, layout, axes) for source in sources], cycle, library=library)
    if capacity is None:
        capacity = max(LEAST_CAPACITY, 1 << len(texts).bit_length())
    if len(texts) > min(capacity, MOST_CAPACITY):
        raise ExportError(
            f"export.plc_tables: {len(texts)} values do not fit a buffer of {min(capacity, MOST_CAPACITY)}; "
            'take export.plc_layout = "segments", a longer export.cycle_time, or plc_tables = "constants".'
        )
    added = declared(
        texts,
        capacity,
        axes,
        VARIABLES,
        cKind=kind_of(target, layout, library=library),
        cLayout=LAYOUT_NAMES.index(layout),
        cPatience=ceil(CLIENT_TIMEOUT / cycle),
        cOwn=len(SCALARS) + axes * len(PER_AXIS),
    )
    of_constants = {*(f"c{name}" for name in (*COLUMNS[layout], *OF_BUFFER)), *DROPPED}
    taken = (_taken(one) for one in sources[0].variables if one.name not in of_constants)
    wait = f"{-(-len(texts) // int(float(texts[HEAD.index('checks')])))} cycles after power-up"
    return BlockSource(
        header=_WAIT.sub(
            wait, sources[0].header.replace("    nErrorId: 0 none", f"{NOTE}    nErrorId: 0 none")
        ),
        name=sources[0].name,
        variables=(*taken, *added, *(SELECTION if library else ())),
        body=_prelude(layout, axes, library=library)
        + _from_buffer(statements(shape, is_buffered=True, is_library=library), layout)
        + _shown_state(shape, library=library),
    )


def declared(
    texts: Sequence[str], capacity: int, axes: int, members: Mapping[str, Sequence[str]], **constants: int
) -> list[BlockVariable]:
    """Declare requests, buffers, and what belongs to them.

    Parameters
    ----------
    texts : sequence of str
        Of the first buffer.
    capacity, axes : int
    members : mapping of str to sequence of str
        Names of variables by their type.
    constants : int
        Further ones.
    """
    window, both = f"ARRAY [0..{LENGTH - 1}] OF LREAL", f"ARRAY [0..{2 * capacity - 1}] OF LREAL"
    whole = [*texts, *["0.0"] * (2 * capacity - len(texts))]
    state = f"ARRAY [0..{state_length(axes) - 1}] OF LREAL"
    numbered = {name: number for names in (RESULTS, TRIALS) for number, name in enumerate(names)}
    numbered |= {"cInterface": INTERFACE, "cCapacity": capacity, **constants}
    return [
        BlockVariable("VAR_INPUT", REQUEST, window, comment="of gen-profile deploy"),
        BlockVariable("VAR_OUTPUT", REPLY, window),
        BlockVariable("VAR_OUTPUT", STATE, state),
        BlockVariable("VAR", TABLE, both, initial=initialiser(whole)),
        *(BlockVariable("VAR", name, kind) for kind, of in members.items() for name in of),
        *(
            BlockVariable("VAR CONSTANT", name, "DINT", initial=str(value))
            for name, value in numbered.items()
        ),
    ]


def state_length(axes: int) -> int:
    """Count the values of ``aState``."""
    return STATE_HEAD + axes * len(AXIS_STATE) + 1


def buffer_texts(source: BlockSource) -> list[str]:
    """List the values of the first buffer that belong to the motions in it.

    Raises
    ------
    ExportError
        They were altered so that they are none.
    """
    try:
        (texts,) = (variable.elements for variable in source.variables if variable.name == TABLE)
        length = int(float(texts[0]))
        if not len(HEAD) < length <= len(texts) // 2:
            raise ValueError("length")
    except (ValueError, IndexError, OverflowError) as error:
        raise ExportError(ALTERED) from error
    return texts[:length]


def with_buffer(source: BlockSource, texts: list[str]) -> BlockSource:
    """Put other values into the first buffer, the rest of it being empty."""
    (table,) = (variable for variable in source.variables if variable.name == TABLE)
    whole = [*texts, *["0.0"] * (len(table.elements) - len(texts))]
    changed = attrs.evolve(table, initial=initialiser(whole))
    return attrs.evolve(
        source, variables=tuple(changed if one.name == TABLE else one for one in source.variables)
    )


def constant_sources(source: BlockSource, target: Target) -> list[BlockSource]:
    """Undo `buffered`: give the blocks of constants that play what the first buffer holds.

    Raises
    ------
    ExportError
        The block is none that `buffered` gives.
    """
    texts, library = buffer_texts(source), is_library(source)
    try:
        variables = {variable.name: variable for variable in source.variables}
        layout = LAYOUT_NAMES[int(variables["cLayout"].initial)]
        starts = [len(HEAD)]
        if library:
            count = int(float(texts[len(HEAD)]))
            starts = [int(float(text)) for text in texts[len(HEAD) + 1 :][:count]]
        parts = [texts[start:end] for start, end in zip(starts, [*starts[1:], len(texts)], strict=True)]
        axes = len(target.axes)
        back = [constant_block(_constant_values(part, layout, axes), source, layout) for part in parts]
        again = _buffered(back, target, len(variables[TABLE].elements) // 2, library=library)
    except (KeyError, ValueError, IndexError, OverflowError, ZeroDivisionError) as error:
        raise ExportError(ALTERED) from error
    if again.program() != source.program():
        raise ExportError(
            "The block does not take its numbers from its buffers as it should, or is for other axes: it was "
            "altered; export it again."
        )
    return back


def is_library(source: BlockSource) -> bool:
    """Tell whether an input selects what a block plays."""
    return any(variable.name == LIBRARY for variable in source.variables)


def _texts(motions: Sequence[list[str]], cycle: float, *, library: bool) -> list[str]:
    """List the values of a buffer, as literals of LREAL."""
    starts: list[int] = []
    if library:
        begin = len(HEAD) + 1 + len(motions)
        starts = [len(motions), *accumulate(map(len, motions[:-1]), initial=begin)]
    return with_head([*(f"{number}.0" for number in starts), *chain.from_iterable(motions)], cycle)


def with_head(content: list[str], cycle: float) -> list[str]:
    """Put length, checksum and checks before what a buffer holds, for a cycle time in s."""
    length = len(HEAD) + len(content)
    checks = checks_of(length, cycle)
    counted = np.array([length, cycle, checks, *map(float, content)])
    return [f"{number}.0" for number in (length, checksum(counted), checks)] + content


def _motion_texts(source: BlockSource, layout: str, axes: int) -> list[str]:
    """List the values of a block of constants in the order of a buffer, as literals of LREAL."""
    variables = {variable.name: variable for variable in source.variables}
    scalars = [variables[f"c{name}"].initial if f"c{name}" in variables else "0" for name in SCALARS]
    own = [variables[f"c{name}"].values for name in PER_AXIS]
    rows = [variables[f"c{name}"].values for name in COLUMNS[layout]]
    if layout == "segments":  # of every axis alike
        rows[-1] = [text for text in rows[-1] for _ in range(axes)]
    return [_as_real(text) for text in chain(scalars, *zip(*own, strict=True), *rows)]


def _as_real(text: str) -> str:
    text = {"TRUE": "1", "FALSE": "0"}.get(text, text)
    return text if "." in text else f"{text}.0"


def _constant_values(texts: list[str], layout: str, axes: int) -> dict[str, list[str]]:
    """Read a motion's numbers, by the names of constants."""
    columns, own = COLUMNS[layout], len(SCALARS) + axes * len(PER_AXIS)
    rows = (len(texts) - own) // len(columns)
    values = {name: [text.removesuffix(".0")] for name, text in zip(WHOLE, texts, strict=False)}
    values |= dict(zip(SCALARS[len(WHOLE) :], ([text] for text in texts[len(WHOLE) :]), strict=False))
    values |= {name: texts[len(SCALARS) + k : own : len(PER_AXIS)] for k, name in enumerate(PER_AXIS)}
    for name in ("Mirrors", "Shifts"):
        values[name] = [{"0.0": "FALSE", "1.0": "TRUE"}.get(text, text) for text in values[name]]
    for number, name in enumerate(columns):
        column = texts[own + number * rows : own + (number + 1) * rows]
        column = column[::axes] if name == "First" else column
        whole = _is_whole(name, layout)
        values[name] = [text.removesuffix(".0") if whole else text for text in column]
    return values


def constant_block(values: Mapping[str, Sequence[str]], like: BlockSource, layout: str) -> BlockSource:
    """Write the block of constants of a motion's numbers; what all motions share is that of another block."""
    shared = {variable.name: variable.initial for variable in like.variables}
    columns, axes, rows = COLUMNS[layout], len(values["Start"]), len(values[COLUMNS[layout][0]])
    arrays = (*columns, *(PER_AXIS if axes > 1 else ()))
    holes = {
        re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(): f"[{', '.join(of)}]" if name in arrays else of[0]
        for name, of in values.items()
    }
    holes |= {
        "row_count": holes.pop("rows"),
        "rows": f"[0..{rows - 1}]",
        "segments": f"[0..{rows // axes - 1}]",
        "cycle_time": shared["cCycleTime"],
        "start_tolerance": shared["fStartTolerance"],
        "block": like.name,
    }
    if has_modulo := "cModulo" in shared:
        holes |= {"modulo": shared["cModulo"], "modulo_low": shared["cModuloLow"]}
    shape = BlockShape(layout, axes, has_modulo=has_modulo)
    written = parse_function_block(fill(dict.fromkeys(OF_HEADER, "") | holes, shape))
    return attrs.evolve(written, header=like.header)


def _taken(variable: BlockVariable) -> BlockVariable:
    """Make a variable of a constant that is the motion's own."""
    if not _OWN.fullmatch(variable.name):
        return variable
    return attrs.evolve(variable, section="VAR", name=f"t{variable.name[1:]}", initial="")


def _from_buffer(body: str, layout: str) -> str:
    """Make the statements look their numbers up in the buffer in use."""

    def place(match: re.Match[str]) -> str:
        name, index = match[2], match[3] if match[2] != "First" else f"cAxes * ({match[3]})"
        text = f"{TABLE}[nTable + {COLUMNS[layout].index(name)} * tRows + {index}]"
        # one that is wanted as a real number need not fit DINT if it was altered
        return f"LREAL_TO_DINT({text})" if _is_whole(name, layout) and not match[1] else text

    return _OWN.sub(r"t\1", _COLUMN.sub(place, body))


def _is_whole(column: str, layout: str) -> bool:
    return column == "First" or layout == "counts"


def _prelude(layout: str, axes: int, *, library: bool) -> str:
    taken = [name for name in SCALARS if name not in OF_BUFFER]
    taken = [name for name in taken if name != "LastSegment" or layout == "segments"]
    lines = [
        f"t{name} := {'LREAL_TO_DINT({})' if name in WHOLE else '{}'};".format(
            f"{TABLE}[nMotion + {SCALARS.index(name)}]"
        )
        for name in taken
    ]
    step, indent_ = len(PER_AXIS), "    " * (axes > 1)
    at, index = (f" + {step} * nAxis", "[nAxis]") if axes > 1 else ("", "")
    first = len(SCALARS) - (step if axes > 1 else 0)
    own = [
        f"{indent_}t{name}{index} := {TABLE}[nMotion{at} + {first + number}]"
        f"{' > 0.5' if name in ('Mirrors', 'Shifts') else ''};"
        for number, name in enumerate(PER_AXIS)
    ]
    lines += ["FOR nAxis := 1 TO cAxes DO", *own, "END_FOR;"] if axes > 1 else own
    return filled(
        "playback/text/requests_motion.st", is_library=library, taken=lines, moves=MOVES, plays=MOVES
    )


def _shown_state(shape: BlockShape, *, library: bool) -> str:
    axes, step = shape.axes, len(AXIS_STATE)
    at, index, indent_ = (f" + {step} * nAxis", "[nAxis]", "    ") if axes > 1 else ("", "", "")
    first = STATE_HEAD - (step if axes > 1 else 0)
    names = ("Unwrapped" if shape.has_modulo else AXIS_STATE[0], *AXIS_STATE[1:])
    lines = [f"{indent_}aState[{first + number}{at}] := f{name}{index};" for number, name in enumerate(names)]
    lines = ["FOR nAxis := 1 TO cAxes DO", *lines, "END_FOR;"] if axes > 1 else lines
    motion = "DINT_TO_LREAL(nSelected)" if library else "0.0"
    return filled("playback/text/state.st", axes=lines, last=state_length(axes) - 1, motion=motion)
