"""Declarations of a function block, as C takes them over."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from gen_profile_exporters.st_tokens import LITERALS, StToken, refused

MOST_DINT = 2**31 - 1
_TYPES = {"BOOL": "bool", "DINT": "int32_t", "LREAL": "double"}
_AS = {"INT": "DINT"}  # as wide here as what it is mixed with
_WORDS_OF_C = re.compile(
    "auto|bool|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|"
    "long|register|restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|"
    "volatile|while"
)


class StVariable(NamedTuple):
    """A declaration: its section, name, type, length (0: a scalar) and initial values as C writes them.

    `lower` is the index of an array's first element in the text; C counts from 0.
    """

    section: str
    name: str
    type: str
    length: int
    initial: tuple[str, ...]
    lower: int = 0

    @property
    def start(self) -> float:
        """Initial value of a scalar; truth values as 0 and 1."""
        text = self.initial[0] if self.initial else "0"
        return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)


def declared(
    section: str,
    name: StToken,
    bounds: Sequence[int],
    scalar: str,
    literals: Sequence[tuple[str, StToken]],
    *,
    listed: bool,
) -> StVariable:
    """Read a declaration.

    Parameters
    ----------
    section : str
        ``VAR CONSTANT`` with constants.
    name : StToken
    bounds : sequence of int
        First and last index of an array; of a scalar none.
    scalar : str
        Type of an element.
    literals : sequence of (str, StToken)
        Signs and initial values.
    listed : bool
        Whether those stand in brackets.

    Raises
    ------
    ExportError
        The name means something in C, or initial values are not of the type, or not as many.
    """
    lower, upper = bounds or (0, -1)
    if bounds and upper < lower:
        raise refused(name, f"{name.text} has no elements")
    length = upper - lower + 1
    counts = {max(1, length), max(1, length) * (section == "VAR CONSTANT")}
    if (literals and listed != bool(bounds)) or len(literals) not in counts:
        raise refused(name, f"{name.text} has not as many initial values as it takes")
    if _WORDS_OF_C.fullmatch(name.text):
        raise refused(name, f"{name.text} is a word of C; name it differently")
    type_ = _AS.get(scalar, scalar)
    values = tuple(_initial(name, type_, sign, value) for sign, value in literals)
    return StVariable(section, name.text, type_, length, values, lower)


def _initial(name: StToken, type_: str, sign: str, value: StToken) -> str:
    if LITERALS[value.kind] != type_ or (sign and type_ == "BOOL"):
        raise refused(value, f"{name.text} : {type_} cannot begin as {sign}{value.text}")
    return sign + c_literal(value, spare=int(sign == "-"))


def c_literal(value: StToken, spare: int = 0) -> str:
    """Write a literal in C: without the leading zeros of an integer, by which C counts in eights.

    Parameters
    ----------
    value : StToken
    spare : int
        What may be added to the greatest DINT.

    Raises
    ------
    ExportError
        No variable holds it.
    """
    if value.kind == "TRUTH" or (value.kind == "REAL" and math.isfinite(float(value.text))):
        return value.text.lower()
    digits = value.text.lstrip("0") or "0"
    if value.kind == "INTEGER" and len(digits) <= 10 and int(digits) <= MOST_DINT + spare:
        return digits
    raise refused(value, f"no {LITERALS[value.kind]} is as great as {value.text}")


def c_constants(variables: Iterable[StVariable], body: list[str]) -> list[str]:
    """Declare the constants that statements use; compilers warn of others."""
    used = set(re.findall(r"\w+", "\n".join(body)))
    return [
        f"static const {c_member(v)} = {_braced(v.initial) if v.length else v.initial[0]};"
        for v in variables
        if v.section == "VAR CONSTANT" and v.name in used
    ]


def _braced(values: Iterable[str]) -> str:
    return f"{{{', '.join(values)}}}"


def c_member(variable: StVariable) -> str:
    """Declare a variable."""
    return f"{_TYPES[variable.type]} {variable.name}" + (f"[{variable.length}]" if variable.length else "")


def c_initials(variables: Iterable[StVariable], owners: Mapping[str, str]) -> list[str]:
    """Set what begins with other values than zero, in structures that stand before a section's names."""
    return [
        f"{owners[v.section]}{v.name}{f'[{number}]' if v.length else ''} = {value};"
        for v in variables
        if v.section in owners
        for number, value in enumerate(v.initial)
    ]


def elements(variable: StVariable) -> Iterator[StVariable]:
    """Take an array for its elements, which C names alike."""
    if not variable.length:
        yield variable
    for k in range(variable.length):
        name = f"{variable.name}[{k}]"
        yield variable._replace(name=name, length=0, initial=variable.initial[k : k + 1])
