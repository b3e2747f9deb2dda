"""The playback block's template, filled in for writing and matched for reading.

The template (``text/block.st``) is portable IEC 61131-3 Structured Text, which a file for each layout of the
table extends. Statements of an axis stand in it as they do where there are several: with ``[nAxis]``.
"""

import re
from collections.abc import Callable, Mapping
from functools import cache, partial
from itertools import islice
from typing import Any

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import (
    COMMENT,
    TOKEN,
    BlockSource,
    BlockVariable,
    bare,
    declared_variables,
    parse_function_block,
)
from gen_profile_exporters.templates import filled, left_open

SAMPLED = ("Position", "Velocity", "Acceleration")
COLUMNS = {  # of each layout's table
    "segments": (*(f"Power{power}" for power in range(6)), "First"),
    "samples": SAMPLED,
    "counts": SAMPLED,
}
_HOLE = re.compile(r"@(\w+)")


@attrs.frozen
class BlockShape:
    """What decides on a block's text beside a motion's numbers.

    Attributes
    ----------
    layout : str
        Of its table.
    axes : int
    has_modulo : bool
        Whether one of them is a modulo axis.
    """

    layout: str
    axes: int
    has_modulo: bool = False


@attrs.frozen
class Token:
    """A piece of a program's text, its number among the pieces, and the program."""

    text: str
    number: int = 0
    program: str = ""

    @property
    def line(self) -> int:
        """Line on which it begins, counted from 1."""
        piece = next(islice(TOKEN.finditer(self.program), self.number, None), None)
        return 1 + self.program.count("\n", 0, piece.start() if piece else None)


def fill(values: Mapping[str, str], shape: BlockShape) -> str:
    """Write a block: a value for every hole, by its name.

    Raises
    ------
    KeyError
        One is missing, as where the values are of a file that was altered.
    """
    from jinja2 import UndefinedError  # noqa: PLC0415  # slow to import

    frame = _frame(shape) | {"constants": _constants(shape, {})}
    try:
        return filled(f"playback/text/layout_{shape.layout}.st", **frame, **values)
    except UndefinedError as error:
        raise KeyError(str(error)) from error


def match(text: str, shape: BlockShape) -> dict[str, Token]:
    """Read a block: what stands in every hole, by its name.

    Raises
    ------
    ExportError
        The text differs from the template elsewhere, or one value from place to place.
    """
    program, due = _without_comments(text), _due(shape)
    tokens, values = TOKEN.findall(program), dict[str, Token]()
    for number, (piece, (expected, hole)) in enumerate(zip(tokens, due, strict=False)):
        known = values.setdefault(hole, Token(piece, number, program)).text if hole else expected
        if piece != known and bare(piece) != bare(known):
            raise ExportError(
                f"line {Token(piece, number, program).line}: {piece[:40]!r} stands where the exported block "
                f"has {known[:40]!r}; only numbers and comments may be edited in it, export it again."
            )
    if len(tokens) != len(due):
        beyond = Token("", len(due), program).line if len(tokens) > len(due) else len(text.splitlines())
        raise ExportError(
            f"line {max(1, beyond)}: the block breaks off or goes on after its end; export it again."
        )
    return values


def statements(shape: BlockShape, *, is_buffered: bool = False, is_library: bool = False) -> str:
    """Write a block's statements, which hold no value of a motion.

    Parameters
    ----------
    shape : BlockShape
    is_buffered : bool
        Whether they check a buffer in place of the table; constants have their names all the same.
    is_library : bool
        Whether they refuse to start while ``nProfile`` counts no motion.
    """
    text = _open_program(shape, is_buffered=is_buffered, is_library=is_library)
    return parse_function_block(text).body


def variable_names(shape: BlockShape) -> list[str]:
    """List the block's variables in the order of their declaration."""
    return re.findall(r"^ +(\w+) : ", _open_program(shape), re.MULTILINE)


def constants(values: Mapping[str, str], shape: BlockShape) -> list[str]:
    """List the initial values of all constants that enter the checksum, a text for each."""
    return [one.initial for one in _constants(shape, values)]


def constant_count(shape: BlockShape) -> int:
    """Count them; each is counted once for every axis."""
    return len(_constants(shape, {})) * shape.axes


def layout_of(text: str) -> str:
    """Tell the layout of a block's table by what the table declares."""
    if re.search(r"\bcPower0\b", text, re.IGNORECASE):
        return "segments"
    whole = re.search(r"\bcPosition\s*:\s*ARRAY\s*\[[^\]]*\]\s*OF\s*DINT\b", text, re.IGNORECASE)
    return "counts" if whole else "samples"


def shape_of(source: BlockSource) -> BlockShape:
    """Tell the shape of a block by what it declares."""
    variables = {variable.name: variable for variable in source.variables}
    axes = len(variables["fScale"].values)
    return BlockShape(layout_of(source.declaration()), axes, has_modulo="cModulo" in variables)


@cache
def _due(shape: BlockShape) -> list[tuple[str, str]]:
    """List the pieces of the template, each with the name of the hole that it is, if it is one."""
    pieces = TOKEN.findall(_without_comments(_open_program(shape)))
    return [(piece, hole[1] if (hole := _HOLE.fullmatch(piece)) else "") for piece in pieces]


@cache
def _open_program(shape: BlockShape, *, is_buffered: bool = False, is_library: bool = False) -> str:
    frame = _frame(shape, is_buffered=is_buffered, is_library=is_library)
    return left_open(f"playback/text/layout_{shape.layout}.st", **frame, constants=_constants(shape, {}))


def _constants(shape: BlockShape, values: Mapping[str, str]) -> list[BlockVariable]:
    """List the constants that enter the checksum."""
    text = left_open("playback/text/constants.st", **_frame(shape), **values)
    return declared_variables("VAR CONSTANT", text)


def _frame(shape: BlockShape, *, is_buffered: bool = False, is_library: bool = False) -> dict[str, Any]:
    """Give what the shape decides."""
    layout, axes = shape.layout, shape.axes
    several = axes > 1
    array = f"ARRAY [1..{axes}] OF " if several else ""
    whole = layout == "counts"
    return {
        "has_segments": layout == "segments",
        "has_modulo": shape.has_modulo,
        "unwrapped": "fUnwrapped" if shape.has_modulo else "fPosition",
        "actual": "fActual" if shape.has_modulo else "fActPosition",
        "is_buffered": is_buffered,
        "is_library": is_library,
        "columns": len(COLUMNS[layout]),
        "axes": axes,
        "each_axis": partial(each_axis, axes),
        "number": "DINT" if whole else "LREAL",
        "real": ("DINT_TO_LREAL({})" if whole else "{}").format,
        "reals": f"{array}LREAL",
        "switches": f"{array}BOOL",
        "whole_numbers": f"{array}DINT",
        "ones": f"[{', '.join(['1.0'] * axes)}]" if several else "1.0",
        "row_of_axis": " * cAxes + nAxis - 1" if several else "",
        "by_axes": " / cAxes" if several else "",
    }


def each_axis(axes: int, caller: Callable[[], str]) -> str:
    """Repeat statements for every axis; where there is one, it has no index."""
    text = caller()
    if axes == 1:
        return text.replace("[nAxis]", "")
    margin = " " * (
        len(text) - len(text.lstrip(" ")) - 1
    )  # a column less: files stay the same, byte for byte
    return f"{margin}FOR nAxis := 1 TO cAxes DO\n{text}{margin}END_FOR;\n"


def _without_comments(text: str) -> str:
    """Leave out comments, but not their line ends."""
    return COMMENT.sub(lambda comment: "\n" * comment[0].count("\n") or " ", text)
