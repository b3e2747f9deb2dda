"""From Structured Text to C99: the subset of IEC 61131-3 that planner and playback blocks are written in.

Function blocks, the last of which is the text's own and has instances of those before it: scalars of BOOL,
INT (as wide as DINT here), DINT and LREAL and one-dimensional arrays of them, assignments, IF, CASE, FOR,
WHILE, calls of instances, which are handed scalars as inputs and arrays by VAR_IN_OUT, their outputs, and
ABS, SQRT, LREAL_TO_DINT (half to even), DINT_TO_LREAL.
The C code needs no library but libm and allocates nothing; an instance is one structure. Compiled without
contraction of products and sums, it computes bit for bit what the text says.

What the standard calls an error is either refused, as are types that do not fit and loops that write their
own counter, or, where only the execution shows it, one of the `FAULTS` of checked C. There both sides of AND
and OR are evaluated, as by many controllers: one side is no guard for the other.
"""

from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from typing import Any, NamedTuple

from lark import Lark, Token, Transformer
from lark.exceptions import UnexpectedInput, VisitError

from gen_profile.support.errors import ExportError
from gen_profile_exporters.st_variables import (
    NO_BLOCK,
    StVariable,
    c_constants,
    c_initials,
    c_literal,
    c_member,
    declared,
    elements,
    refused,
    require_no_word_of_c,
)
from gen_profile_exporters.templates import FOLDER, filled, indented

FAULTS = (
    "",
    "goes beyond the end of an array",
    "repeats a loop without end",
    "divides by zero",
    "leaves the range of DINT",
    "takes the square root of a negative number",
)
WRITTEN = ("VAR", "VAR_OUTPUT", "VAR_IN_OUT")
MOST_TURNS = 200_000  # of all loops in one cycle
PART = 40  # lines beyond which a branch is a function: one of thousands compiles four times as slowly
C_TEXTS = ("operations.txt", "block.c", "block.h", "instance.c", "structure.h")
TEXTS = ("structured_text.lark", *(f"c/{name}" for name in C_TEXTS))  # files that it reads
# operator or function and the types that it takes | C | a macro in its place that checks
_ROWS = [line.split(" | ") for line in (FOLDER / "c/operations.txt").read_text("ascii").splitlines()]
_PLAIN = {tuple(taken.split()): code for taken, code, *_ in _ROWS}
_CHECKED = {tuple(taken.split()): macro for taken, _, *macros in _ROWS for macro in macros}
_GIVES = {"LREAL_TO_DINT": "DINT", "DINT_TO_LREAL": "LREAL"}  # others but comparisons what they take
_SAME = ("+", "-", "*", "/", "ABS", "SQRT")


class Translation(NamedTuple):
    """A function block in C99.

    Attributes
    ----------
    name : str
        Of the structure, and prefix of its functions ``NAME_init`` and ``NAME_step``.
    inputs, outputs : tuple of StVariable
        Arrays element by element.
    header, source : str
        `source` includes ``NAME.h``. Compiled with ``COUNT_OPERATIONS``, it adds up floating-point operations
        in ``NAME_operations``. Compiled with ``CHECKED``, it ends whatever an altered text may do, and the
        instance's ``fault_`` tells what that was, by its place in `FAULTS`.
    """

    name: str
    inputs: tuple[StVariable, ...]
    outputs: tuple[StVariable, ...]
    header: str
    source: str


class _Code(NamedTuple):
    """C code of an expression, its type, its line, and how many floating-point operations it takes."""

    text: str
    type: str
    line: int
    work: int = 0


@lru_cache(maxsize=16)  # for its proof, its FMU and its program
def translate(text: str) -> Translation:
    """Translate a function block.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    *used, own = translate_statements(text, {}, checked=True)
    if handed := [v.name for v in own.variables if v.section == "VAR_IN_OUT"]:
        raise ExportError(f"{NO_BLOCK}: nothing hands {handed[0]} to the last block of the text.")
    inputs, outputs = (
        tuple(one for v in own.variables if v.section == section for one in elements(v))
        for section in ("VAR_INPUT", "VAR_OUTPUT")
    )
    source = filled(
        "c/block.c",
        most_turns=MOST_TURNS,
        blocks="".join(filled("c/instance.c", **c_parts(block, within=True)) + "\n" for block in used),
        **c_parts(own),
    )
    header = filled(
        "c/block.h",
        name=own.name,
        structures="".join(f"{_structure(block)}\n" for block in used),
        structure=_structure(own),
    )
    return Translation(own.name, inputs, outputs, header, source)


def c_parts(block: "Statements", *, within: bool = False) -> dict[str, str]:
    """Give a block's functions and constants; of one within another their names begin with its own."""
    name, variables = block.name, block.variables
    owner = _owner(name) if within else ""
    owners = dict.fromkeys(("VAR_INPUT", "VAR_OUTPUT", "VAR"), "fb->")
    parts = (_function(f"{name}_part_{k}", name, part) for k, part in enumerate(block.parts))
    return {
        "name": name,
        "constants": "\n".join(c_constants(variables, sum(block.parts, block.body), owner)),
        "initials": indented(c_initials(variables, owners)),
        "parts": "\n".join(parts),
        "body": indented(block.body),
    }


def _structure(block: "Statements") -> str:
    members = indented(f"{c_member(v)};" for v in block.variables if v.section != "VAR CONSTANT")
    return filled("c/structure.h", name=block.name, members=members)


class Statements(NamedTuple):
    """A function block's name, its declarations, and its statements as lines of C.

    Parts are what the lines call by ``PART(NAME_part_0)`` and so on, a part those before it.
    """

    name: str
    variables: list[StVariable]
    body: list[str]
    parts: list[list[str]]


def translate_statements(text: str, owners: Mapping[str, str], *, checked: bool = False) -> list[Statements]:
    """Translate function blocks' statements, with a macro ``AT(index, length)`` for every index.

    The last one is the text's own; those before it are called by ``CALL(NAME_step, instance)``.

    Parameters
    ----------
    text : str
    owners : mapping of str to str
        What stands before the names of a section's variables of the own block, such as ``in->``; ``fb->`` if
        not given, and in those before it.
    checked : bool
        Whether the lines use the macros by which an altered text is ended, and are divided into parts.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    blocks: dict[str, Statements] = {}
    try:
        trees: Any = _parser().parse(text).children
        for tree in trees:
            name = tree.children[0]
            require_no_word_of_c(name)
            if name.lower() in blocks:
                raise refused(name, f"{name} is declared twice")
            own = owners if tree is trees[-1] else {"VAR CONSTANT": _owner(name)}
            blocks[name.lower()] = _block(tree, blocks, own, checked=checked)
    except UnexpectedInput as error:
        place = f"line {error.line}, column {error.column}"
        raise ExportError(f"{NO_BLOCK}: {place} is not understood.") from error
    except VisitError as error:
        raise error.orig_exc from error
    except RecursionError as error:
        raise ExportError("The text is nested too deeply to be executed here.") from error
    return [*blocks.values()]


def _owner(name: str) -> str:
    """Begin the names of constants of a block within others, which may have some of the same name."""
    return f"{name}_"


def _block(
    tree: Any, blocks: Mapping[str, Statements], owners: Mapping[str, str], *, checked: bool
) -> Statements:
    name = str(tree.children[0])
    variables = declared(tree, {key: block.name for key, block in blocks.items()})
    _require_writable(tree, variables)
    translator = _Translator(name, variables, owners, checked, blocks)
    body: Any = translator.transform(tree)
    return Statements(name, list(variables.values()), body.children[-1], translator.parts)


@cache
def _parser() -> Lark:
    grammar = (FOLDER / "structured_text.lark").read_text("ascii")
    return Lark(grammar, parser="lalr", propagate_positions=False)


def _require_writable(tree: Any, variables: Mapping[str, StVariable]) -> None:
    """Refuse that inputs and constants are written, and counters within their loops."""
    for name in _written(tree):
        variable = variables.get(name.lower())
        if variable is not None and variable.section not in WRITTEN:
            raise refused(name, f"{name} is {variable.section}, which is not written")
    for argument in tree.find_data("argument"):  # a whole array is handed over to be written
        name, index = (*argument.children[1].children, None)[:2]
        variable = variables.get(str(name).lower())
        if index is None and variable and variable.length and variable.section not in WRITTEN:
            raise refused(name, f"{name} is {variable.section}, which is not written")
    for loop in tree.find_data("count"):
        counter, *_, body = loop.children
        for name in _written(body):
            if name.lower() == counter.lower():
                raise refused(name, f"{name} counts the loop around it, which must not write it")


def _written(tree: Any) -> Iterator[Token]:
    """Find the names of variables that statements write."""
    for statement in tree.find_pred(lambda one: one.data in ("assignment", "count")):
        target = statement.children[0]
        yield target if isinstance(target, Token) else target.children[0]


class _Translator(Transformer[Token, object]):
    """Expressions become `_Code`, statements lines of C."""

    def __init__(
        self,
        name: str,
        variables: dict[str, StVariable],
        owners: Mapping[str, str],
        checked: bool,
        blocks: Mapping[str, Statements],
    ) -> None:
        super().__init__(visit_tokens=False)
        self._blocks = blocks
        self._name, self._variables, self._checked = name, variables, checked
        self._owners = {"VAR CONSTANT": "", **owners}
        self._templates = _PLAIN | _CHECKED if checked else _PLAIN
        self.parts: list[list[str]] = []

    def real(self, parts):  # type: ignore[no-untyped-def]
        return _Code(c_literal(parts[0]), "LREAL", parts[0].line)

    def whole(self, parts):  # type: ignore[no-untyped-def]
        return _Code(c_literal(parts[0]), "DINT", parts[0].line)

    def truth(self, parts):  # type: ignore[no-untyped-def]
        return _Code(c_literal(parts[0]), "BOOL", parts[0].line)

    def grouped(self, parts):  # type: ignore[no-untyped-def]
        return parts[0]._replace(text=f"({parts[0].text})")

    def variable(self, parts):  # type: ignore[no-untyped-def]
        return self._place(*parts)

    def _place(self, name: Token, index: _Code | None = None) -> _Code:
        variable = self._variables.get(name.lower())
        if variable is None:
            raise refused(name, f"{name} is not declared")
        owned = self._owners.get(variable.section, "fb->") + variable.name
        return self._element(name, variable, owned, index)

    def _element(self, name: Token, variable: StVariable, owned: str, index: _Code | None) -> _Code:
        """Give a variable, or the element of an array."""
        line = name.line or 0
        if index is None:
            return _Code(owned, variable.whole_type, line)
        if not variable.length:
            raise refused(name, f"{name} is no array")
        self._require(index, "DINT", f"an index of {name}")
        text = f"{index.text} - {variable.lower}" if variable.lower else index.text
        return _Code(f"{owned}[AT({text}, {variable.length})]", variable.type, line, index.work)

    def member(self, parts):  # type: ignore[no-untyped-def]
        name, output, index = parts
        instance, members = self._instance(name)
        variable = members.get(output.lower())
        if variable is None or variable.section != "VAR_OUTPUT":
            raise refused(output, f"{name} has no output {output}")
        return self._element(output, variable, f"{instance.text}.{variable.name}", index)

    def _instance(self, name: Token) -> tuple[_Code, dict[str, StVariable]]:
        """Give an instance, and its variables by their names in lower case."""
        instance = self._place(name)
        block = self._blocks.get(instance.type.lower())
        if block is None:
            raise refused(name, f"{name} is no instance of a block")
        return instance, {variable.name.lower(): variable for variable in block.variables}

    def argument(self, parts):  # type: ignore[no-untyped-def]
        return parts

    def invoke(self, parts):  # type: ignore[no-untyped-def]
        name, *arguments = parts
        instance, members = self._instance(name)
        lines, given = [], set()
        for parameter, value in filter(None, arguments):
            variable = members.get(parameter.lower())
            taken = variable is not None and variable.section in ("VAR_INPUT", "VAR_IN_OUT")
            if variable is None or not taken or variable.name in given:
                raise refused(parameter, f"{name} takes no {parameter}, or takes it once")
            self._require(value, variable.whole_type, f"{parameter} of {name}")
            if variable.section == "VAR_INPUT" and variable.length:
                raise refused(parameter, f"{parameter} is an array, which is handed over by VAR_IN_OUT only")
            given.add(variable.name)
            lines += [*self._counted(value.work), f"{instance.text}.{variable.name} = {value.text};"]
        missing = [v.name for v in members.values() if v.section == "VAR_IN_OUT" and v.name not in given]
        if missing:
            raise refused(name, f"{name} is called without {missing[0]}")
        return [*lines, f"CALL({instance.type}_step, {instance.text});"]

    @staticmethod
    def _require(code: _Code, type_: str, what: str) -> None:
        if code.type != type_:
            raise refused(code.line, f"{what} must be {type_}, not {code.type}")

    def _counted(self, work: int) -> list[str]:
        return [f"OPERATIONS({work});"] if work and self._checked else []

    def _applied(self, operator: Token, *operands: _Code) -> _Code:
        name, types = operator.upper(), [operand.type for operand in operands]
        template = self._templates.get((name, *types))
        if template is None:
            raise refused(operator, f"{name} does not take {' and '.join(types)}")
        gives = _GIVES.get(name, types[0] if name in _SAME else "BOOL")
        texts, work = [o.text for o in operands], sum(o.work for o in operands)
        return _Code(template.format(*texts), gives, operands[0].line, work)

    def prefixed(self, parts):  # type: ignore[no-untyped-def]
        operator, operand = parts
        if operand.text.startswith(operator):  # C has -- and ++, too
            operand = operand._replace(text=f"({operand.text})")
        return self._applied(operator, operand)

    def binary(self, parts):  # type: ignore[no-untyped-def]
        left, operator, right = parts
        code = self._applied(operator, left, right)
        return code._replace(work=code.work + (left.type == "LREAL"))

    def call(self, parts):  # type: ignore[no-untyped-def]
        code = self._applied(*parts)
        return code._replace(work=code.work + ("LREAL" in (code.type, parts[1].type)))

    def assignment(self, parts):  # type: ignore[no-untyped-def]
        target, value = parts
        if target.type not in ("BOOL", "DINT", "LREAL"):
            raise refused(target.line, "what is assigned is one value, not a whole array or instance")
        self._require(value, target.type, "what is assigned here")
        return [*self._counted(target.work + value.work), f"{target.text} = {value.text};"]

    def body(self, statements):  # type: ignore[no-untyped-def]
        return [line for statement in statements for line in statement]

    def otherwise(self, parts):  # type: ignore[no-untyped-def]
        return parts[0]

    def branch(self, parts):  # type: ignore[no-untyped-def]
        return parts

    def label(self, parts):  # type: ignore[no-untyped-def]
        return parts[:-1], parts[-1]

    def choice(self, parts):  # type: ignore[no-untyped-def]
        *branches, otherwise = parts
        lines = self._counted(sum(condition.work for condition, _ in branches))
        word = "if"
        for condition, body in branches:
            self._require(condition, "BOOL", "a condition")
            lines += [f"{word} ({condition.text}) {{", *self._within(body)]
            word = "} else if"
        return [*lines, *(["} else {", *self._within(otherwise)] if otherwise else []), "}"]

    def switch(self, parts):  # type: ignore[no-untyped-def]
        selector, *labels, otherwise = parts
        self._require(selector, "DINT", "what CASE takes")
        lines, known = [*self._counted(selector.work), f"switch ({selector.text}) {{"], set()
        for numbers, body in labels:
            for number in numbers:
                if (case := c_literal(number)) in known:
                    raise refused(number, f"CASE has {case} twice")
                known.add(case)
                lines.append(f"case {case}:")
            lines += [*self._within(body), "    break;"]
        return [*lines, "default:", *self._within(otherwise or []), "    break;", "}"]

    def count(self, parts):  # type: ignore[no-untyped-def]
        name, first, last, body = parts
        counter = self._place(name)
        for code in (counter, first, last):
            self._require(code, "DINT", "what FOR counts")
        end = f"last_{name}_"  # a name that the language does not have
        goes_on = f"{counter.text} <= {end}{self._turn}"
        next_ = f"{counter.text} = SUM({counter.text}, 1)" if self._checked else f"++{counter.text}"
        return [
            *self._counted(first.work + last.work),
            "{",
            f"    const int32_t {end} = {last.text};",
            *_indented(
                [f"for ({counter.text} = {first.text}; {goes_on}; {next_}) {{", *self._within(body), "}"]
            ),
            "}",
        ]

    def repeat(self, parts):  # type: ignore[no-untyped-def]
        condition, body = parts
        self._require(condition, "BOOL", "a condition")
        counted = f"OPERATIONS({condition.work}), " if condition.work and self._checked else ""
        test = f"({counted}{condition.text}){self._turn}" if self._checked else condition.text
        return [f"while ({test}) {{", *self._within(body), "}"]

    def _within(self, body: list[str]) -> list[str]:
        """Indent a branch or a loop's body, or call it as a part."""
        if self._checked and len(body) > PART:
            self.parts.append(body)
            body = [f"PART({self._name}_part_{len(self.parts) - 1});"]
        return _indented(body)

    @property
    def _turn(self) -> str:
        return " && TURN()" if self._checked else ""


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _function(name: str, block: str, body: list[str]) -> str:
    return f"static APART void {name}({block} *fb) {{\n    BEGIN();\n{indented(body)}\n    END();\n}}\n"
