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

    `lower` is the index of an array's first element in the text; C counts from 0. The type of an instance is
    the name of its block.
    """

    section: str
    name: str
    type: str
    length: int
    initial: tuple[str, ...]
    lower: int = 0

    @property
    def is_instance(self) -> bool:
        """Whether it is an instance of another block."""
        return self.type not in _TYPES

    @property
    def whole_type(self) -> str:
        """Type with an array's bounds, which have to be the same where a block is handed an array."""
        upper = self.lower + self.length - 1
        return f"{self.type}[{self.lower}..{upper}]" if self.length else self.type

    @property
    def start(self) -> float:
        """Initial value of a scalar; truth values as 0 and 1."""
        text = self.initial[0] if self.initial else "0"
        return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)


def refused(place: Token | int, words: str) -> ExportError:
    """Say what cannot be executed, and in which line."""
    line = place.line if isinstance(place, Token) else place
    return ExportError(f"{NO_BLOCK}: line {line}: {words}.")


def declared(tree: Any, blocks: Mapping[str, str] | None = None) -> dict[str, StVariable]:
    """Read all declarations of a block; by their names in lower case.

    Parameters
    ----------
    tree
        Of the block.
    blocks : mapping of str to str, optional
        Names of the blocks before it, of which it may have instances, by these in lower case.

    Raises
    ------
    ExportError
        A name is declared twice or means something in C, or initial values are not of its type.
    """
    variables: dict[str, StVariable] = {}
    for section in tree.children[1:-1]:
        for name, variable in _section(section, blocks or {}):
            if variables.setdefault(name.lower(), variable) is not variable:
                raise refused(name, f"{name} is declared twice")
    return variables


def _section(tree: Any, blocks: Mapping[str, str]) -> Iterator[tuple[Token, StVariable]]:
    kind, *rest = tree.children
    constant = bool(rest) and isinstance(rest[0], Token)
    section = "VAR CONSTANT" if constant else kind.upper()
    for declaration in rest[constant:]:
        name, type_, initial = declaration.children
        if type_.data == "instance":
            yield name, _instance(section, name, type_.children[0], initial, blocks)
            continue
        *bounds, scalar = type_.children
        if section == "VAR_IN_OUT" and (not bounds or initial is not None):
            raise refused(name, f"{name} is VAR_IN_OUT, which is an array without initial values here")
        lower, upper = (int(c_literal(bound)) for bound in bounds) if bounds else (0, -1)
        if bounds and upper < lower:
            raise refused(name, f"{name} has no elements")
        length = upper - lower + 1
        literals = [] if initial is None else initial.children if initial.data == "listed" else [initial]
        whole = initial is None or (initial.data == "listed") == bool(bounds)
        if not whole or len(literals) not in {max(1, length), max(1, length) * constant}:
            raise refused(name, f"{name} has not as many initial values as it takes")
        require_no_word_of_c(name)
        kind = _AS.get(scalar.upper(), scalar.upper())
        values = tuple(_initial(name, kind, *literal.children) for literal in literals)
        yield name, StVariable(section, str(name), kind, length, values, lower)


def _instance(
    section: str, name: Token, type_: Token, initial: object, blocks: Mapping[str, str]
) -> StVariable:
    if type_.lower() not in blocks:
        raise refused(type_, f"{type_} is neither a type nor a block that stands before this one")
    if section != "VAR" or initial is not None:
        raise refused(name, f"{name} is an instance, which is declared in VAR and has no initial values")
    require_no_word_of_c(name)
    return StVariable(section, str(name), blocks[type_.lower()], 0, ())


def require_no_word_of_c(name: Token) -> None:
    """Refuse what C would take for something else."""
    if _WORDS_OF_C.fullmatch(name):
        raise refused(name, f"{name} is a word of C; name it differently")


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


def c_constants(variables: Iterable[StVariable], body: list[str], owner: str = "") -> list[str]:
    """Declare the constants that statements use, `owner` before each name; compilers warn of others."""
    used = set(re.findall(r"\w+", "\n".join(body)))
    constants = [v._replace(name=owner + v.name) for v in variables if v.section == "VAR CONSTANT"]
    return [
        f"static const {c_member(v)} = {_braced(v.initial) if v.length else v.initial[0]};"
        for v in constants
        if v.name in used
    ]


def _braced(values: Iterable[str]) -> str:
    return f"{{{', '.join(values)}}}"


def c_member(variable: StVariable) -> str:
    """Declare a variable; what is handed over is pointed to."""
    if variable.section == "VAR_IN_OUT":
        return f"{_TYPES[variable.type]} *{variable.name}"
    if variable.is_instance:
        return f"{variable.type} {variable.name}"
    return f"{_TYPES[variable.type]} {variable.name}" + (f"[{variable.length}]" if variable.length else "")


def c_initials(variables: Iterable[StVariable], owners: Mapping[str, str]) -> list[str]:
    """Set what begins with other values than zero, in structures that stand before a section's names."""
    instances = [f"{v.type}_init(&{owners['VAR']}{v.name});" for v in variables if v.is_instance]
    return instances + [
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
