"""A function block taken apart: comments, variables and body, for formats that carry them one by one."""

import re
from collections.abc import Iterable, Sequence

import attrs

from gen_profile.support.errors import ExportError

SECTIONS = ("VAR_IN_OUT", "VAR_INPUT", "VAR_OUTPUT", "VAR", "VAR CONSTANT")
VALUES_PER_LINE = 4  # of an array's initial values

_HEADER = re.compile(r"\s*(\(\*.*?\*\)\s*)*", re.DOTALL)
_NAME = re.compile(r"\s*FUNCTION_BLOCK\s+(\S+)\s", re.IGNORECASE)
_SECTION = re.compile(
    r"\s*(VAR_IN_OUT|VAR_INPUT|VAR_OUTPUT|VAR(?:\s+CONSTANT)?)\b(.*?)\bEND_VAR\b", re.DOTALL | re.IGNORECASE
)
# a comment, or a declaration with the comment behind it; no part looks beyond the next one, or a hostile
# text would be read again and again; nor is a possessive group within one that is taken out, as Python before
# 3.11.4 loses what that holds
_VARIABLE = re.compile(
    r"\(\*[^*]*+\*\)|(?<!\w)(\w++)\s*+:([^:;]*+)(?::=([^:;]*+))?;"
    r"(?:[ \t]*+\(\*((?:[^*(]++|\*(?!\))|\((?!\*))*)\*\))?"
)
_ARRAY = re.compile(r"ARRAY\s*\[\s*(\d+)\s*\.\.\s*(\d+)\s*\]\s*OF\s+(\w+)", re.IGNORECASE)
COMMENT = re.compile(r"\(\*.*?(?:\*\)|\Z)", re.DOTALL)  # one that is not closed takes the rest
_PLANNER = re.compile(r"^\s*FUNCTION_BLOCK\s+\w+_planner\s*$", re.MULTILINE | re.IGNORECASE)
_END = re.compile(r"END_FUNCTION_BLOCK\s*\Z", re.IGNORECASE)
_BLOCK_END = re.compile(r"\(\*.*?(?:\*\)|\Z)|\b(END_FUNCTION_BLOCK)\b", re.DOTALL | re.IGNORECASE)
# An array's initialiser or an index, a name or hole, a number with its sign, an operator.
TOKEN = re.compile(
    r"\[[^\[\]]*\]|@?[A-Za-z_]\w*|[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|:=|<=|>=|<>|\S", re.ASCII
)


@attrs.frozen
class BlockVariable:
    """A declaration.

    Attributes
    ----------
    section : str
        One of `SECTIONS`.
    name, type : str
    initial : str
        As Structured Text writes it; empty for none.
    comment : str
    """

    section: str
    name: str
    type: str
    initial: str = ""
    comment: str = ""

    def __str__(self) -> str:
        """Write the declaration."""
        initial = f" := {self.initial}" if self.initial else ""
        comment = f" (* {self.comment} *)" if self.comment else ""
        return f"{self.name} : {self.type}{initial};{comment}"

    @property
    def array(self) -> tuple[str, str, str] | None:
        """First and last index and type of the elements, or None."""
        match = _ARRAY.fullmatch(self.type)
        return (match[1], match[2], match[3]) if match else None

    @property
    def elements(self) -> list[str]:
        """Initial values of an array."""
        return [text.strip() for text in self.initial.strip("[] \n").split(",")] if self.initial else []

    @property
    def values(self) -> list[str]:
        """Initial values, of which a scalar has one."""
        return self.elements if self.array else [self.initial]

    @property
    def scalar_type(self) -> str:
        """Type, or that of an array's elements."""
        return self.array[2] if self.array else self.type


@attrs.frozen(kw_only=True)
class BlockSource:
    """Parts of a function block.

    Attributes
    ----------
    header : str
        Comment before it.
    name : str
    variables : tuple of BlockVariable
        By section, in their order.
    body : str
        Statements.
    within : tuple of BlockSource
        The blocks that it has instances of, and theirs, each before those that use it.
    """

    header: str
    name: str
    variables: tuple[BlockVariable, ...]
    body: str
    within: tuple["BlockSource", ...] = ()

    def text(self) -> str:
        """Put it together as Structured Text."""
        others = "".join(f"{one.text()}\n" for one in self.within)
        return f"{others}{self.header}{self.declaration()}\n{self.body}END_FUNCTION_BLOCK\n"

    def program(self) -> tuple[object, ...]:
        """Give what the block does, however its text is laid out, spelled and commented."""
        variables = [(v.section, v.name.lower(), _pieces(v.type), _pieces(v.initial)) for v in self.variables]
        others = sorted((one.name.lower(), one.program()) for one in self.within)
        return others, sorted(variables), _pieces(self.body)

    def declaration(self) -> str:
        """Everything before the statements, header excepted."""
        lines = [f"FUNCTION_BLOCK {self.name}"]
        for section in SECTIONS:
            variables = [v for v in self.variables if v.section == section]
            if variables:
                lines += [section, *(f"    {v}" for v in variables), "END_VAR"]
        return "\n".join(lines) + "\n"


def parse_function_block(text: str) -> BlockSource:
    """Split Structured Text into a block's parts; of a planner block, those before it are within it.

    Raises
    ------
    ExportError
        It is no function block, or holds more than declarations where a playback block declares.
    """
    ends = [end.end() for end in _BLOCK_END.finditer(text) if end[1]]
    if len(ends) < 2 or not is_planner(text):
        return _parsed(text)
    pieces = [text[a:b] for a, b in zip([0, *ends], [*ends[:-1], len(text)], strict=False)]
    return with_blocks_within([*map(_parsed, pieces)])


def place_of_own(names: Iterable[str]) -> int:
    """Tell which of a document's blocks it is of: the first planner block, or the first of all."""
    return next((k for k, name in enumerate(names) if name.lower().endswith("_planner")), 0)


def with_blocks_within(blocks: Sequence[BlockSource]) -> BlockSource:
    """Put those before the last block into it."""
    return attrs.evolve(blocks[-1], within=tuple(blocks[:-1]))


def _parsed(text: str) -> BlockSource:
    header = _HEADER.match(text)
    name = _NAME.match(text, header.end() if header else 0)
    if name is None:
        raise ExportError("There is no FUNCTION_BLOCK; export it again.")
    variables: list[BlockVariable] = []
    at = name.end() - 1
    while section := _SECTION.match(text, at):
        kind = " ".join(section[1].upper().split())
        other = COMMENT.sub(" ", _VARIABLE.sub(" ", section[2])).split()
        if other and not is_planner(text):  # what that one does is proved, altered or not
            raise ExportError(
                f"{kind}: {other[0][:40]!r} stands beside the declarations; export the block again."
            )
        variables += declared_variables(kind, section[2])
        at = section.end()
    body = text[at:].lstrip("\n")
    if not _END.search(body):
        raise ExportError("The function block breaks off before END_FUNCTION_BLOCK; export it again.")
    return BlockSource(
        header=header[0] if header else "", name=name[1], variables=tuple(variables), body=_END.sub("", body)
    )


def initialiser(texts: Sequence[str]) -> str:
    """Write an array's initial values, a few in a line."""
    rows = [", ".join(texts[k : k + VALUES_PER_LINE]) for k in range(0, len(texts), VALUES_PER_LINE)]
    return "[\n        " + ",\n        ".join(rows) + "\n    ]"


def ordered(source: BlockSource, names: Iterable[str]) -> BlockSource:
    """Put the variables into the order of their names; others stay, last."""
    rank = {name.lower(): number for number, name in enumerate(names)}
    variables = sorted(source.variables, key=lambda variable: rank.get(variable.name.lower(), len(rank)))
    return attrs.evolve(source, variables=tuple(variables))


def declared_variables(section: str, text: str) -> list[BlockVariable]:
    """Read declarations."""
    return [
        BlockVariable(section, name, type_.strip(), initial=initial.strip(), comment=comment.strip())
        for name, type_, initial, comment in _VARIABLE.findall(text)
        if name
    ]


def _pieces(text: str) -> list[str]:
    return [bare(piece) for piece in TOKEN.findall(COMMENT.sub(" ", text))]


def bare(text: str) -> str:
    """Leave out white space and case, which mean nothing in Structured Text."""
    return "".join(text.split()).lower()


def is_planner(text: str) -> bool:
    """Whether a text is a planner block's, by the name that it has."""
    return _PLANNER.search(text) is not None
