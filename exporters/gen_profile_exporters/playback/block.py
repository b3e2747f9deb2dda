"""The playback block's template, filled in for writing and matched for reading.

The template (``text/template.st``) is portable IEC 61131-3 Structured Text. ``@name`` is a hole for a value.
``$name`` is a part that the number of axes or the layout of the table decides; alone on its line, it is whole
lines. A line that begins with ``%`` stands in blocks of several axes only. ``~`` after a name is the index of
the axis there, and nothing where there is one axis.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import islice
from pathlib import Path

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import COMMENT, TOKEN, bare
from gen_profile_exporters.playback.layouts import LAYOUTS

_TEXT = Path(__file__).with_name("text")
TEMPLATE = (_TEXT / "template.st").read_text("ascii")
CHECKSUM = (_TEXT / "checksum.st").read_text("ascii")  # lines that take the next value in
_CHECKED = {  # how the value of a constant enters the checksum
    "DINT": "fValue := DINT_TO_LREAL({});",
    "LREAL": "fValue := {};",
    "BOOL": "IF {} THEN fValue := 1.0; END_IF;",
}
_DECLARED = {"LREAL~": "$reals", "BOOL~": "$switches"}
_HOLE = re.compile(r"@(\w+)")
_LINES = re.compile(r"^\$(\w+)\n", re.MULTILINE)
_PART = re.compile(r"\$(\w+)(?:\(([^()]*)\))?")


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


def fill(values: Mapping[str, str], layout: str, axes: int) -> str:
    """Write a block: a value for every hole, by its name."""
    return _HOLE.sub(lambda hole: values[hole[1]], _program(layout, axes))


def match(text: str, layout: str, axes: int) -> dict[str, Token]:
    """Read a block: what stands in every hole, by its name.

    Raises
    ------
    ExportError
        The text differs from the template elsewhere, or one value from place to place.
    """
    program, due = _without_comments(text), _due(layout, axes)
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


def variable_names(layout: str, axes: int) -> list[str]:
    """List the block's variables in the order of their declaration."""
    return re.findall(r"^ +(\w+) : ", _program(layout, axes), re.MULTILINE)


def constants(values: Mapping[str, str], layout: str, axes: int) -> list[str]:
    """List the initial values of all constants that enter the checksum, a text for each."""
    return [
        _HOLE.sub(lambda hole: values[hole[1]], initial.replace("$axes", str(axes)))
        for _, _, initial, _ in LAYOUTS[layout]["constants"]
    ]


def constant_count(layout: str, axes: int) -> int:
    """Count them; each is counted once for every axis."""
    return len(LAYOUTS[layout]["constants"]) * axes


def layout_of(text: str) -> str:
    """Tell the layout of a block's table by what the table declares."""
    if re.search(r"\bcPower0\b", text, re.IGNORECASE):
        return "segments"
    whole = re.search(r"\bcPosition\s*:\s*ARRAY\s*\[[^\]]*\]\s*OF\s*DINT\b", text, re.IGNORECASE)
    return "counts" if whole else "samples"


@cache
def _due(layout: str, axes: int) -> list[tuple[str, str]]:
    """List the pieces of the template, each with the name of the hole that it is, if it is one."""
    pieces = TOKEN.findall(_without_comments(_program(layout, axes)))
    return [(piece, hole[1] if (hole := _HOLE.fullmatch(piece)) else "") for piece in pieces]


@cache
def _program(layout: str, axes: int) -> str:
    """Put the layout's parts in, and settle what the number of axes decides."""
    array = f"ARRAY [1..{axes}] OF " if axes > 1 else ""
    constants = LAYOUTS[layout]["constants"]
    parts = LAYOUTS[layout] | {
        "checksum": CHECKSUM,
        "constants": "".join(map(_declaration, constants)),
        "constant_count": str(constant_count(layout, axes)),
        "checked_constant": _checked(constants, axes),
        "ones": f"[{', '.join(['1.0'] * axes)}]" if axes > 1 else "1.0",
        "switches": f"{array}BOOL",
        "axes": str(axes),
        "number": "DINT" if layout == "counts" else "LREAL",
        "reals": f"{array}LREAL",
        "real": "DINT_TO_LREAL({})" if layout == "counts" else "{}",
        "row": "{} * cAxes + nAxis - 1" if axes > 1 else "{}",
        "per_axis": "{} / cAxes" if axes > 1 else "{}",
        "whole_numbers": f"{array}DINT",
    }
    text = _LINES.sub(lambda lines: parts[lines[1]], TEMPLATE)
    text = _PART.sub(lambda part: parts[part[1]].format(part[2]), text)
    lines = text.replace("~", "[nAxis]" if axes > 1 else "").splitlines(keepends=True)
    return "".join(line.replace("%", "", 1) for line in lines if axes > 1 or not line.startswith("%"))


def _declaration(constant: tuple[str, str, str, str]) -> str:
    name, type_, initial, comment = constant
    return f"    {name} : {_DECLARED.get(type_, type_)} := {initial};{comment and f' (* {comment} *)'}\n"


def _checked(constants: Sequence[tuple[str, str, str, str]], axes: int) -> str:
    """Give the checksum's value in a row behind the table: each constant, for each axis."""
    indent, count = " " * 12, len(constants)
    lines = [f"{indent}CASE nCheckRow OF"]
    if axes > 1:
        lines = [
            f"{indent}nAxis := nCheckRow / {count} + 1;",
            f"{indent}CASE nCheckRow - (nAxis - 1) * {count} OF",
        ]
    for number, (name, type_, _, _) in enumerate(constants):
        value = _CHECKED[type_.removesuffix("~")].format(name + "~" * type_.endswith("~"))
        lines.append(f"{indent}    {number}: {value}")
    return "\n".join([*lines, f"{indent}END_CASE;", ""])


def _without_comments(text: str) -> str:
    """Leave out comments, but not their line ends."""
    return COMMENT.sub(lambda comment: "\n" * comment[0].count("\n") or " ", text)
