"""Declarations of a function block, as C takes them over."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from lark import Token

from gen_profile.support.errors import ExportError

NO_BLOCK = "The text is no function block that can be executed here"
MOST_DINT = 2**31 - 1
_TYPES = {"BOOL": "bool", "DINT": "int32_t", "LREAL": "double"}
_AS = {"INT": "DINT"}  # as wide here as what it is mixed with
_LITERALS = {"REAL": "LREAL", "INTEGER": "DINT", "TRUTH": "BOOL"}
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


def refused(place: Token | int, words: str) -> ExportError:
    """Say what cannot be executed, and in which line."""
    line = place.line if isinstance(place, Token) else place
    return ExportError(f"{NO_BLOCK}: line {line}: {words}.")


def declared(tree: Any) -> dict[str, StVariable]:
    """Read all declarations of a block; by their names in lower case.

    Raises
    ------
    ExportError
        A name is declared twice or means something in C, or initial values are not of its type.
    """
    variables: dict[str, StVariable] = {}
    for section in tree.children[1:-1]:
        for name, variable in _section(section):
            if variables.setdefault(name.lower(), variable) is not variable:
                raise refused(name, f"{name} is declared twice")
    return variables


def _section(tree: Any) -> Iterator[tuple[Token, StVariable]]:
    kind, *rest = tree.children
    constant = bool(rest) and isinstance(rest[0], Token)
    section = "VAR CONSTANT" if constant else kind.upper()
    for declaration in rest[constant:]:
        name, type_, initial = declaration.children
        *bounds, scalar = type_.children
        lower, upper = (int(c_literal(bound)) for bound in bounds) if bounds else (0, -1)
        if bounds and upper < lower:
            raise refused(name, f"{name} has no elements")
        length = upper - lower + 1
        literals = [] if initial is None else initial.children if initial.data == "listed" else [initial]
        whole = initial is None or (initial.data == "listed") == bool(bounds)
        if not whole or len(literals) not in {max(1, length), max(1, length) * constant}:
            raise refused(name, f"{name} has not as many initial values as it takes")
        if _WORDS_OF_C.fullmatch(name):
            raise refused(name, f"{name} is a word of C; name it differently")
        kind = _AS.get(scalar.upper(), scalar.upper())
        values = tuple(_initial(name, kind, *literal.children) for literal in literals)
        yield name, StVariable(section, str(name), kind, length, values, lower)


def _initial(name: Token, type_: str, sign: Token | None, value: Token) -> str:
    if _LITERALS[value.type] != type_ or (sign is not None and type_ == "BOOL"):
        raise refused(value, f"{name} : {type_} cannot begin as {sign or ''}{value}")
    return (sign or "") + c_literal(value, spare=int(sign == "-"))


def c_literal(value: Token, spare: int = 0) -> str:
    """Write a literal in C: without the leading zeros of an integer, by which C counts in eights.

    Parameters
    ----------
    value : Token
    spare : int
        What may be added to the greatest DINT.

    Raises
    ------
    ExportError
        No variable holds it.
    """
    if value.type == "TRUTH":
        return value.lower()
    if value.type == "REAL" and math.isfinite(float(value)):
        return value.lower()
    digits = value.lstrip("0") or "0"
    if value.type == "INTEGER" and len(digits) <= 10 and int(digits) <= MOST_DINT + spare:
        return digits
    raise refused(value, f"no {_LITERALS[value.type]} is as great as {value}")


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
