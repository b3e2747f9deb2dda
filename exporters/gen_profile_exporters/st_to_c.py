"""From Structured Text to C99: the subset of IEC 61131-3 that the planner block is written in.

One function block per text: scalars of BOOL, DINT and LREAL and one-dimensional arrays of them, assignments,
IF, CASE, FOR, WHILE, and ABS, SQRT, LREAL_TO_DINT, DINT_TO_LREAL. The C code needs no library but libm and
allocates nothing; an instance is one structure. Compiled without contraction of products and sums, it
computes bit for bit what the text says.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

from lark import Lark, Token, Transformer
from lark.exceptions import LarkError, UnexpectedInput

from gen_profile.errors import ExportError

_GRAMMAR = r"""
    start: "FUNCTION_BLOCK"i NAME section* body "END_FUNCTION_BLOCK"i
    section: SECTION CONSTANT? declaration* "END_VAR"i
    declaration: NAME ":" type [":=" initial] ";"
    type: TYPE | "ARRAY"i "[" INTEGER ".." INTEGER "]" "OF"i TYPE
    ?initial: literal | "[" literal ("," literal)* "]" -> listed
    literal: [SIGN] (REAL | INTEGER | TRUTH)
    body: statement*
    ?statement: variable ":=" expression ";" -> assignment
        | "IF"i branch ("ELSIF"i branch)* [otherwise] "END_IF"i ";" -> choice
        | "CASE"i expression "OF"i label+ [otherwise] "END_CASE"i ";" -> switch
        | "FOR"i NAME ":=" expression "TO"i expression "DO"i body "END_FOR"i ";" -> count
        | "WHILE"i expression "DO"i body "END_WHILE"i ";" -> repeat
    otherwise: "ELSE"i body
    branch: expression "THEN"i body
    label: INTEGER ("," INTEGER)* ":" body
    ?expression: conjunction | expression OR conjunction -> binary
    ?conjunction: equality | conjunction AND equality -> binary
    ?equality: comparison | equality EQUALS comparison -> binary
    ?comparison: sum | comparison ORDER sum -> binary
    ?sum: term | sum SIGN term -> binary
    ?term: unary | term FACTOR unary -> binary
    ?unary: primary | NOT unary -> prefixed | SIGN unary -> prefixed
    ?primary: REAL -> real | INTEGER -> whole | TRUTH -> truth
        | "(" expression ")" -> grouped
        | FUNCTION "(" expression ")" -> call
        | variable
    variable: NAME ["[" expression "]"]
    SECTION.3: /VAR_INPUT\b|VAR_OUTPUT\b|VAR\b/i
    CONSTANT.3: /CONSTANT\b/i
    TYPE.3: /BOOL\b|DINT\b|LREAL\b/i
    TRUTH.3: /TRUE\b|FALSE\b/i
    FUNCTION.3: /ABS\b|SQRT\b|LREAL_TO_DINT\b|DINT_TO_LREAL\b/i
    OR.3: /OR\b/i
    AND.3: /AND\b/i
    NOT.3: /NOT\b/i
    REAL.2: /[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?/
    INTEGER: /[0-9]+/
    EQUALS.2: "=" | "<>"
    ORDER: "<=" | ">=" | "<" | ">"
    SIGN: "+" | "-"
    FACTOR: "*" | "/"
    NAME: /[A-Za-z](_?[A-Za-z0-9])*/
    %ignore /\(\*(.|\n)*?\*\)/
    %ignore /\s+/
"""

FAULTS = (
    "",
    "goes beyond the end of an array",
    "repeats a loop without end",
    "divides by zero",
)
MOST_TURNS = 200_000  # of all loops in one cycle
_NO_BLOCK = "The text is no function block that can be executed here"
_TYPES = {"BOOL": "bool", "DINT": "int32_t", "LREAL": "double"}
_OPERATORS = {"=": "==", "<>": "!=", "AND": "&&", "OR": "||"}
_FUNCTIONS = {
    "ABS": ("fabs", "LREAL"),
    "SQRT": ("sqrt", "LREAL"),
    "LREAL_TO_DINT": ("(int32_t)nearbyint", "DINT"),
    "DINT_TO_LREAL": ("(double)", "LREAL"),
}


class StVariable(NamedTuple):
    """A declaration: its section, name, type, length (0: a scalar) and initial values as C writes them."""

    section: str
    name: str
    type: str
    length: int
    initial: tuple[str, ...]

    @property
    def start(self) -> float:
        """Initial value of a scalar; truth values as 0 and 1."""
        text = self.initial[0] if self.initial else "0"
        return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)


class Translation(NamedTuple):
    """A function block in C99.

    Attributes
    ----------
    name : str
        Of the structure, and prefix of its functions ``NAME_init`` and ``NAME_step``.
    inputs, outputs : tuple of StVariable
        All scalars.
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
    """C code of an expression, its type, and how many floating-point operations it takes."""

    text: str
    type: str
    work: int = 0


def translate(text: str) -> Translation:
    """Translate a function block.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    name, variables, body = translate_statements(text, {}, checked=True)
    inputs, outputs = (
        tuple(v for v in variables if v.section == section) for section in ("VAR_INPUT", "VAR_OUTPUT")
    )
    return Translation(name, inputs, outputs, _header(name, variables), _source(name, variables, body))


class Statements(NamedTuple):
    """A function block's name, its declarations, and its statements as lines of C."""

    name: str
    variables: list[StVariable]
    body: list[str]


def translate_statements(text: str, owners: Mapping[str, str], *, checked: bool = False) -> Statements:
    """Translate a function block's statements.

    Parameters
    ----------
    text : str
    owners : mapping of str to str
        What stands before the names of a section's variables, such as ``in->``; ``fb->`` if not given.
    checked : bool
        Whether the lines use the macros by which an altered text is ended.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    try:
        tree = _parser().parse(text)
        variables = [v for section in tree.find_data("section") for v in _declared(section)]
        translated: Any = _Translator(variables, owners, checked).transform(tree)
        name, *_, body = translated.children
    except UnexpectedInput as error:
        place = f"line {error.line}, column {error.column}"
        raise ExportError(f"{_NO_BLOCK}: {place} is not understood.") from error
    except (LarkError, KeyError) as error:
        reason = getattr(error, "orig_exc", error)
        raise ExportError(f"{_NO_BLOCK}: {reason.args[0]}.") from error
    return Statements(str(name), variables, body)


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR, parser="lalr", propagate_positions=False)


def _declared(section: Any) -> Iterator[StVariable]:
    kind, *rest = section.children
    constant = bool(rest) and isinstance(rest[0], Token)
    for declaration in rest[constant:]:
        name, type_, initial = declaration.children
        *bounds, scalar = map(str, type_.children)
        length = int(bounds[1]) - int(bounds[0]) + 1 if bounds else 0
        if bounds and int(bounds[0]) != 0:
            raise KeyError(f"{name} does not begin with index 0")
        literals = [] if initial is None else initial.children if initial.data == "listed" else [initial]
        values = tuple("".join(part.lower() for part in v.children if part is not None) for v in literals)
        yield StVariable(
            "VAR CONSTANT" if constant else kind.upper(), str(name), scalar.upper(), length, values
        )


class _Translator(Transformer[Token, object]):
    """Expressions become `_Code`, statements lines of C."""

    def __init__(self, variables: list[StVariable], owners: Mapping[str, str], checked: bool) -> None:
        super().__init__()
        self._variables = {v.name.lower(): v for v in variables}
        self._owners, self._checked = {"VAR CONSTANT": "", **owners}, checked

    def real(self, parts):  # type: ignore[no-untyped-def]
        return _Code(str(parts[0]), "LREAL")

    def whole(self, parts):  # type: ignore[no-untyped-def]
        return _Code(str(parts[0]), "DINT")

    def truth(self, parts):  # type: ignore[no-untyped-def]
        return _Code(parts[0].lower(), "BOOL")

    def grouped(self, parts):  # type: ignore[no-untyped-def]
        return _Code(f"({parts[0].text})", *parts[0][1:])

    def variable(self, parts):  # type: ignore[no-untyped-def]
        name, index = parts
        declared = self._variables.get(name.lower())
        if declared is None:
            raise KeyError(f"{name} is not declared")
        if (index is None) != (declared.length == 0):
            raise KeyError(f"{name} is {'an array' if declared.length else 'no array'}")
        element = "" if index is None else f"[{self._index(index.text, declared.length)}]"
        return _Code(f"{self._owned(declared)}{element}", declared.type)

    def _owned(self, variable: StVariable) -> str:
        return self._owners.get(variable.section, "fb->") + variable.name

    def _index(self, index: str, length: int) -> str:
        return f"AT({index}, {length})" if self._checked else index

    def _counted(self, work: int) -> list[str]:
        return [f"OPERATIONS({work});"] if work and self._checked else []

    def prefixed(self, parts):  # type: ignore[no-untyped-def]
        sign, operand = parts
        return _Code(("!" if sign.upper() == "NOT" else sign) + operand.text, *operand[1:])

    def binary(self, parts):  # type: ignore[no-untyped-def]
        left, operator, right = parts
        operator = operator.upper()
        if left.type != right.type:
            raise KeyError(f"{left.text} {operator} {right.text} mixes {left.type} and {right.type}")
        type_ = left.type if operator in "+-*/" else "BOOL"
        work = left.work + right.work + (left.type == "LREAL")
        left_text, right_text = left.text, right.text
        if operator == "/" and type_ == "DINT" and self._checked:
            return _Code(f"QUOTIENT({left_text}, {right_text})", type_, work)
        if operator == "OR":
            left_text, right_text = f"({left_text})", f"({right_text})"
        return _Code(f"{left_text} {_OPERATORS.get(operator, operator)} {right_text}", type_, work)

    def call(self, parts):  # type: ignore[no-untyped-def]
        function, type_ = _FUNCTIONS[parts[0].upper()]
        return _Code(f"{function}({parts[1].text})", type_, parts[1].work + 1)

    def assignment(self, parts):  # type: ignore[no-untyped-def]
        target, value = parts
        if target.type != value.type:
            raise KeyError(f"{target.text} takes no {value.type}")
        return [*self._counted(value.work), f"{target.text} = {value.text};"]

    def body(self, statements):  # type: ignore[no-untyped-def]
        return [line for statement in statements for line in statement]

    def otherwise(self, parts):  # type: ignore[no-untyped-def]
        return parts[0]

    def branch(self, parts):  # type: ignore[no-untyped-def]
        return parts

    def label(self, parts):  # type: ignore[no-untyped-def]
        return [str(number) for number in parts[:-1]], parts[-1]

    def choice(self, parts):  # type: ignore[no-untyped-def]
        *branches, otherwise = parts
        lines = self._counted(sum(condition.work for condition, _ in branches))
        word = "if"
        for condition, body in branches:
            lines += [f"{word} ({condition.text}) {{", *_indented(body)]
            word = "} else if"
        return [*lines, *(["} else {", *_indented(otherwise)] if otherwise else []), "}"]

    def switch(self, parts):  # type: ignore[no-untyped-def]
        selector, *labels, otherwise = parts
        lines = [f"switch ({selector.text}) {{"]
        for numbers, body in labels:
            lines += [f"case {number}:" for number in numbers] + _indented([*body, "break;"])
        return [*lines, "default:", *_indented([*(otherwise or []), "break;"]), "}"]

    def count(self, parts):  # type: ignore[no-untyped-def]
        name, first, last, body = parts
        variable = self._owned(self._variables[name.lower()])
        end = f"last_{self._variables[name.lower()].name}"  # loops within each other have other variables
        goes_on = f"{variable} <= {end}{self._turn}"
        loop = f"for ({variable} = {first.text}; {goes_on}; ++{variable}) {{"
        return [
            "{",
            f"    const int32_t {end} = {last.text};",
            *_indented([loop, *_indented(body), "}"]),
            "}",
        ]

    def repeat(self, parts):  # type: ignore[no-untyped-def]
        condition, body = parts
        test = f"({condition.text}){self._turn}" if self._checked else condition.text
        return [f"while ({test}) {{", *_indented(body), "}"]

    @property
    def _turn(self) -> str:
        return " && TURN()" if self._checked else ""


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def c_constants(variables: Iterable[StVariable], body: list[str]) -> list[str]:
    """Declare the constants that statements use; compilers warn of others."""
    used = set(re.findall(r"\w+", "\n".join(body)))
    return [
        f"static const {c_member(v)} = {c_initial(v)};"
        for v in variables
        if v.section == "VAR CONSTANT" and v.name in used
    ]


def c_member(variable: StVariable) -> str:
    """Declare a variable."""
    return f"{_TYPES[variable.type]} {variable.name}" + (f"[{variable.length}]" if variable.length else "")


def _header(name: str, variables: list[StVariable]) -> str:
    members = "\n".join(f"    {c_member(v)};" for v in variables if v.section != "VAR CONSTANT")
    return f"""\
#ifndef {name}_H
#define {name}_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {{
{members}
#ifdef CHECKED
    int32_t turns_, fault_;
#endif
}} {name};

/* Once, before all else. */
static void {name}_init({name} *fb);

/* Once in every cycle, the inputs set; then read the outputs. */
static void {name}_step({name} *fb);

#endif
"""


def _source(name: str, variables: list[StVariable], body: list[str]) -> str:
    constants = c_constants(variables, body)
    initials = [
        f"    fb->{v.name} = {v.initial[0]};" for v in variables if v.section != "VAR CONSTANT" and v.initial
    ]
    return "\n".join(
        [
            "/* Compile without contraction of products and sums (-ffp-contract=off). */",
            f'#include "{name}.h"',
            "#include <math.h>",
            "#include <string.h>",
            "",
            "#ifdef COUNT_OPERATIONS",
            f"long {name}_operations;",
            f"#define OPERATIONS(number) ({name}_operations += (number))",
            "#else",
            "#define OPERATIONS(number) ((void)0)",
            "#endif",
            *_checks(name).splitlines(),
            "",
            *constants,
            "",
            f"static void {name}_init({name} *fb) {{",
            "    memset(fb, 0, sizeof *fb);",
            *initials,
            "}",
            "",
            f"static void {name}_step({name} *fb) {{",
            "    BEGIN();",
            *_indented(body),
            "}",
            "",
        ]
    )


def _checks(name: str) -> str:
    return f"""\
#ifdef CHECKED
#define BEGIN() (fb->turns_ = 0)
#define AT(index, length) within(fb, index, length)
#define TURN() turn(fb)
#define QUOTIENT(dividend, divisor) quotient(fb, dividend, divisor)
static inline int32_t within({name} *fb, int32_t index, int32_t length)
{{
    if (index >= 0 && index < length)
        return index;
    fb->fault_ = 1;
    return 0;
}}
static inline bool turn({name} *fb)
{{
    if (++fb->turns_ > {MOST_TURNS})
        fb->fault_ = 2;
    return fb->fault_ == 0;
}}
static inline int32_t quotient({name} *fb, int32_t dividend, int32_t divisor)
{{
    if (divisor == 0)
        fb->fault_ = 3;
    return divisor == 0 ? 0 : (int32_t)((int64_t)dividend / divisor);
}}
#else
#define BEGIN() ((void)0)
#define AT(index, length) (index)
#define TURN() true
#define QUOTIENT(dividend, divisor) ((dividend) / (divisor))
#endif"""


def c_initial(variable: StVariable) -> str:
    """Write its initial value; it has one."""
    return f"{{{', '.join(variable.initial)}}}" if variable.length else variable.initial[0]
