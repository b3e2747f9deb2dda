"""From Structured Text to C99: the subset of IEC 61131-3 that planner and playback blocks are written in.

One function block per text: scalars of BOOL, INT (as wide as DINT here), DINT and LREAL and one-dimensional
arrays of them, assignments, IF, CASE, FOR, WHILE, and ABS, SQRT, LREAL_TO_DINT (half to even), DINT_TO_LREAL.
The C code needs no library but libm and allocates nothing; an instance is one structure. Compiled without
contraction of products and sums, it computes bit for bit what the text says.

What the standard calls an error is either refused, as are types that do not fit and loops that write their
own counter, or, where only the execution shows it, one of the `FAULTS` of checked C. There both sides of AND
and OR are evaluated, as by many controllers: one side is no guard for the other.
"""

from collections.abc import Mapping
from typing import NamedTuple

from gen_profile.errors import ExportError
from gen_profile_exporters.st_tokens import LITERALS, NO_BLOCK, StToken, refused, tokens
from gen_profile_exporters.st_variables import (
    StVariable,
    c_constants,
    c_initials,
    c_literal,
    c_member,
    declared,
    elements,
)
from gen_profile_exporters.text_parts import filled, indented

FAULTS = (
    "",
    "goes beyond the end of an array",
    "repeats a loop without end",
    "divides by zero",
    "leaves the range of DINT",
    "takes the square root of a negative number",
)
MOST_TURNS = 200_000  # of all loops in one cycle
PART = 40  # lines beyond which a branch is a function: one of thousands compiles four times as slowly
_NUMBERS = ("LREAL", "DINT")
_PLAIN: dict[tuple[str, ...], str] = {  # C of an operator or a function, and the types that it takes
    **{(o, t, t): f"{{}} {o} {{}}" for o in ("+", "-", "*", "/", "<", "<=", ">", ">=") for t in _NUMBERS},
    **{("=", t, t): "{} == {}" for t in (*_NUMBERS, "BOOL")},
    **{("<>", t, t): "{} != {}" for t in (*_NUMBERS, "BOOL")},
    ("AND", "BOOL", "BOOL"): "{} && {}",
    ("OR", "BOOL", "BOOL"): "({}) || ({})",
    ("NOT", "BOOL"): "!{}",
    **{(sign, t): sign + "{}" for sign in "+-" for t in _NUMBERS},
    ("ABS", "LREAL"): "fabs({})",
    ("ABS", "DINT"): "(int32_t)fabs({})",
    ("SQRT", "LREAL"): "sqrt({})",
    ("LREAL_TO_DINT", "LREAL"): "(int32_t)nearbyint({})",
    ("DINT_TO_LREAL", "DINT"): "(double)({})",
}
_CHECKED = {  # macros in their place
    ("+", "DINT", "DINT"): "SUM({}, {})",
    ("-", "DINT", "DINT"): "DIFFERENCE({}, {})",
    ("*", "DINT", "DINT"): "PRODUCT({}, {})",
    ("/", "DINT", "DINT"): "QUOTIENT({}, {})",
    ("/", "LREAL", "LREAL"): "RATIO({}, {})",
    ("AND", "BOOL", "BOOL"): "BOTH({}, {})",
    ("OR", "BOOL", "BOOL"): "EITHER({}, {})",
    ("-", "DINT"): "DIFFERENCE(0, {})",
    ("ABS", "DINT"): "ROUNDED(fabs({}))",
    ("SQRT", "LREAL"): "ROOT({})",
    ("LREAL_TO_DINT", "LREAL"): "ROUNDED({})",
}
_RANKS = {
    "OR": 1,
    "AND": 2,
    "=": 3,
    "<>": 3,
    "<": 4,
    "<=": 4,
    ">": 4,
    ">=": 4,
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
}
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


def translate(text: str) -> Translation:
    """Translate a function block.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    name, variables, body, parts = translate_statements(text, {}, checked=True)
    inputs, outputs = (
        tuple(one for v in variables if v.section == section for one in elements(v))
        for section in ("VAR_INPUT", "VAR_OUTPUT")
    )
    members = indented(f"{c_member(v)};" for v in variables if v.section != "VAR CONSTANT")
    initials = c_initials(variables, dict.fromkeys(("VAR_INPUT", "VAR_OUTPUT", "VAR"), "fb->"))
    source = filled(
        "c/block.c",
        name=name,
        most_turns=MOST_TURNS,
        constants="\n".join(c_constants(variables, sum(parts, body))),
        initials=indented(initials),
        parts="\n".join(_function(f"{name}_part_{k}", name, part) for k, part in enumerate(parts)),
        body=indented(body),
    )
    return Translation(name, inputs, outputs, filled("c/block.h", name=name, members=members), source)


class Statements(NamedTuple):
    """A function block's name, its declarations, and its statements as lines of C.

    Parts are what the lines call by ``PART(NAME_part_0)`` and so on, a part those before it.
    """

    name: str
    variables: list[StVariable]
    body: list[str]
    parts: list[list[str]]


def translate_statements(text: str, owners: Mapping[str, str], *, checked: bool = False) -> Statements:
    """Translate a function block's statements.

    Parameters
    ----------
    text : str
    owners : mapping of str to str
        What stands before the names of a section's variables, such as ``in->``; ``fb->`` if not given.
    checked : bool
        Whether the lines use the macros by which an altered text is ended, and are divided into parts.

    Raises
    ------
    ExportError
        It is no function block of this subset of the language.
    """
    translator = _Translator(text, owners, checked)
    try:
        name, body = translator.block()
    except RecursionError as error:
        raise ExportError("The text is nested too deeply to be executed here.") from error
    return Statements(name, list(translator.variables.values()), body, translator.parts)


class _Translator:
    """Reads tokens one by one; expressions become `_Code`, statements lines of C."""

    def __init__(self, text: str, owners: Mapping[str, str], checked: bool) -> None:
        self._text, self._tokens = text, tokens(text)
        self._token = next(self._tokens)
        self._owners, self._checked = {"VAR CONSTANT": "", **owners}, checked
        self._templates = _PLAIN | _CHECKED if checked else _PLAIN
        self._name, self._counters = "", list[str]()
        self.variables: dict[str, StVariable] = {}
        self.parts: list[list[str]] = []

    def _found(self, *kinds: str) -> StToken | None:
        """Go on if the next token is one of these; the token."""
        token = self._token
        if token.kind not in kinds:
            return None
        self._token = next(self._tokens, token)
        return token

    def _take(self, *kinds: str) -> StToken:
        token = self._found(*kinds)
        if token is None:
            _, _, line, begin = self._token
            column = begin - self._text.rfind("\n", 0, begin)
            raise ExportError(f"{NO_BLOCK}: line {line}, column {column} is not understood.")
        return token

    def block(self) -> tuple[str, list[str]]:
        """Read all; the block's name, and its statements in C."""
        self._take("FUNCTION_BLOCK")
        self._name = self._take("NAME").text
        while kind := self._found("VAR_INPUT", "VAR_OUTPUT", "VAR"):
            section = "VAR CONSTANT" if self._found("CONSTANT") else kind.kind
            while not self._found("END_VAR"):
                self._declaration(section)
        body = self._body()
        self._take("END_FUNCTION_BLOCK")
        self._take("END")
        return self._name, body

    def _declaration(self, section: str) -> None:
        name, bounds, literals, listed = self._take("NAME"), list[int](), list[tuple[str, StToken]](), False
        self._take(":")
        if self._found("ARRAY"):
            for before in ("[", ".."):
                self._take(before)
                bounds.append(int(c_literal(self._take("INTEGER"))))
            self._take("]")
            self._take("OF")
        scalar = self._take("TYPE").text.upper()
        if self._found(":="):
            listed = self._found("[") is not None
            literals.append(self._literal())
            while listed and not self._found("]"):
                self._take(",")
                literals.append(self._literal())
        self._take(";")
        variable = declared(section, name, bounds, scalar, literals, listed=listed)
        if self.variables.setdefault(name.text.lower(), variable) is not variable:
            raise refused(name, f"{name.text} is declared twice")

    def _literal(self) -> tuple[str, StToken]:
        sign = self._found("+", "-")
        return sign.text if sign else "", self._take(*LITERALS)

    def _expression(self, rank: int = 1) -> _Code:
        """Read an expression of operators that bind at least so tightly."""
        left = self._operand()
        while _RANKS.get(self._token.kind, 0) >= rank:
            operator = self._take(*_RANKS)
            right = self._expression(_RANKS[operator.kind] + 1)
            code = self._applied(operator, left, right)
            left = code._replace(work=code.work + (left.type == "LREAL"))
        return left

    def _operand(self) -> _Code:
        if operator := self._found("NOT", "+", "-"):
            operand = self._operand()
            if operand.text.startswith(operator.text):  # C has -- and ++, too
                operand = operand._replace(text=f"({operand.text})")
            return self._applied(operator, operand)
        if literal := self._found(*LITERALS):
            return _Code(c_literal(literal), LITERALS[literal.kind], literal.line)
        if function := self._found("FUNCTION"):
            given = self._grouped()
            code = self._applied(function, given)
            return code._replace(work=code.work + ("LREAL" in (code.type, given.type)))
        if self._token.kind == "(":
            code = self._grouped()
            return code._replace(text=f"({code.text})")
        return self._place(self._take("NAME"))

    def _grouped(self) -> _Code:
        self._take("(")
        code = self._expression()
        self._take(")")
        return code

    def _place(self, name: StToken) -> _Code:
        index = None
        if self._found("["):
            index = self._expression()
            self._take("]")
        variable = self.variables.get(name.text.lower())
        if variable is None:
            raise refused(name, f"{name.text} is not declared")
        if (index is None) != (variable.length == 0):
            raise refused(name, f"{name.text} is {'an array' if variable.length else 'no array'}")
        owned = self._owners.get(variable.section, "fb->") + variable.name
        if index is None:
            return _Code(owned, variable.type, name.line)
        self._require(index, "DINT", f"an index of {name.text}")
        text = f"{index.text} - {variable.lower}" if variable.lower else index.text
        place = f"AT({text}, {variable.length})" if self._checked else text
        return _Code(f"{owned}[{place}]", variable.type, name.line, index.work)

    def _written(self) -> tuple[StToken, _Code]:
        """Read a variable that is written: no input, no constant, and no counter of a loop around."""
        name = self._take("NAME")
        code = self._place(name)
        section = self.variables[name.text.lower()].section
        if section not in ("VAR", "VAR_OUTPUT"):
            raise refused(name, f"{name.text} is {section}, which is not written")
        if name.text.lower() in self._counters:
            raise refused(name, f"{name.text} counts the loop around it, which must not write it")
        return name, code

    @staticmethod
    def _require(code: _Code, type_: str, what: str) -> None:
        if code.type != type_:
            raise refused(code.line, f"{what} must be {type_}, not {code.type}")

    def _counted(self, work: int) -> list[str]:
        return [f"OPERATIONS({work});"] if work and self._checked else []

    def _applied(self, operator: StToken, *operands: _Code) -> _Code:
        name, types = operator.text.upper(), [operand.type for operand in operands]
        template = self._templates.get((name, *types))
        if template is None:
            raise refused(operator, f"{name} does not take {' and '.join(types)}")
        gives = _GIVES.get(name, types[0] if name in _SAME else "BOOL")
        texts, work = [o.text for o in operands], sum(o.work for o in operands)
        return _Code(template.format(*texts), gives, operands[0].line, work)

    def _condition(self) -> _Code:
        condition = self._expression()
        self._require(condition, "BOOL", "a condition")
        return condition

    def _body(self) -> list[str]:
        """Read statements up to a word or number that begins none."""
        lines = list[str]()
        while self._token.kind in ("NAME", "IF", "CASE", "FOR", "WHILE"):
            if self._found("IF"):
                lines += self._choice()
            elif self._found("CASE"):
                lines += self._switch()
            elif self._found("FOR"):
                lines += self._count()
            elif self._found("WHILE"):
                lines += self._repeat()
            else:
                lines += self._assignment()
            self._take(";")
        return lines

    def _assignment(self) -> list[str]:
        _, target = self._written()
        self._take(":=")
        value = self._expression()
        self._require(value, target.type, "what is assigned here")
        return [*self._counted(target.work + value.work), f"{target.text} = {value.text};"]

    def _otherwise(self) -> list[str]:
        return self._body() if self._found("ELSE") else []

    def _choice(self) -> list[str]:
        branches = list[tuple[_Code, list[str]]]()
        while not branches or self._found("ELSIF"):
            condition = self._condition()
            self._take("THEN")
            branches.append((condition, self._body()))
        otherwise = self._otherwise()
        self._take("END_IF")
        lines = self._counted(sum(condition.work for condition, _ in branches))
        word = "if"
        for condition, body in branches:
            lines += [f"{word} ({condition.text}) {{", *self._within(body)]
            word = "} else if"
        return [*lines, *(["} else {", *self._within(otherwise)] if otherwise else []), "}"]

    def _switch(self) -> list[str]:
        selector = self._expression()
        self._require(selector, "DINT", "what CASE takes")
        self._take("OF")
        labels, known = list[tuple[list[str], list[str]]](), set[str]()
        while not labels or self._token.kind == "INTEGER":
            labels.append((self._label(known), self._body()))
        otherwise = self._otherwise()
        self._take("END_CASE")
        lines = [*self._counted(selector.work), f"switch ({selector.text}) {{"]
        for cases, body in labels:
            lines += [*cases, *self._within(body), "    break;"]
        return [*lines, "default:", *self._within(otherwise), "    break;", "}"]

    def _label(self, known: set[str]) -> list[str]:
        """Read the numbers before a branch of CASE, which must not be known yet."""
        lines, after = list[str](), ","
        while after == ",":
            number = self._take("INTEGER")
            if (case := c_literal(number)) in known:
                raise refused(number, f"CASE has {case} twice")
            known.add(case)
            lines.append(f"case {case}:")
            after = self._take(",", ":").kind
        return lines

    def _count(self) -> list[str]:
        name, counter = self._written()
        self._take(":=")
        first = self._expression()
        self._take("TO")
        last = self._expression()
        self._take("DO")
        for code in (counter, first, last):
            self._require(code, "DINT", "what FOR counts")
        self._counters.append(name.text.lower())
        body = self._within(self._body())
        self._counters.pop()
        self._take("END_FOR")
        end = f"last_{name.text}_"  # a name that the language does not have
        goes_on = f"{counter.text} <= {end}{self._turn}"
        next_ = f"{counter.text} = SUM({counter.text}, 1)" if self._checked else f"++{counter.text}"
        return [
            *self._counted(first.work + last.work),
            "{",
            f"    const int32_t {end} = {last.text};",
            *_indented([f"for ({counter.text} = {first.text}; {goes_on}; {next_}) {{", *body, "}"]),
            "}",
        ]

    def _repeat(self) -> list[str]:
        condition = self._condition()
        self._take("DO")
        body = self._within(self._body())
        self._take("END_WHILE")
        counted = f"OPERATIONS({condition.work}), " if condition.work and self._checked else ""
        test = f"({counted}{condition.text}){self._turn}" if self._checked else condition.text
        return [f"while ({test}) {{", *body, "}"]

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
