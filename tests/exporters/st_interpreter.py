"""Interpreter for a subset of IEC 61131-3 Structured Text: an oracle that knows nothing of the exporter.

One function block per text, with variables of BOOL, INT, DINT, LREAL, DWORD, one-dimensional arrays of them,
and instances of other blocks, whose texts are given (a structure is a block without statements, a function
one that is called by its own name); calls of these, assignments, IF, CASE over integers, FOR, WHILE,
expressions with the standard's precedence (third edition, table 71), and a few standard functions. It is
strict where compilers are: every type must fit, integers must not overflow, in no part of an expression,
indices must lie within bounds, inputs, constants and counters in their loops are not written, initialisers
fill their array.

The text is translated to Python once, so that many cycles can be run.
"""

import math
from functools import lru_cache

from exporters.st_grammar import GRAMMAR
from lark import Lark, Token, Tree
from lark.visitors import Interpreter

LIMITS = {"INT": (-(2**15), 2**15 - 1), "DINT": (-(2**31), 2**31 - 1), "DWORD": (0, 2**32 - 1)}
ZERO = {"BOOL": False, "INT": 0, "DINT": 0, "LREAL": 0.0, "DWORD": 0}
LITERAL = "integer literal"  # fits INT and DINT
INTEGERS = ("INT", "DINT", LITERAL)
INSTANCE = "instance"  # in place of an array's bounds
MOST_TURNS = 200_000  # of all loops in one call
TURN = ["turns = _turn(turns)"]

# name → types of the arguments ("number": LREAL or integer, all the same), type of the result, Python
FUNCTIONS = {
    "abs": (("number",), "number", "_abs({})"),
    "limit": (("number", "number", "number"), "number", "_limit({}, {}, {})"),
    "sqrt": (("LREAL",), "LREAL", "_sqrt({})"),
    "shr": (("DWORD", "INT"), "DWORD", "({} >> {})"),
    "lreal_to_dint": (("LREAL",), "DINT", "_rounded({})"),
    "dint_to_lreal": (("DINT",), "LREAL", "float({})"),
    "dint_to_dword": (("DINT",), "DWORD", "({} & 0xFFFFFFFF)"),
    "dword_to_dint": (("DWORD",), "DINT", "_signed({})"),
}


class StError(Exception):
    """The program breaks a rule of the language."""


def _check(condition, message):
    if not condition:
        raise StError(message)


def _limit(least, value, most):
    return min(max(value, least), most)


def _sqrt(value):
    _check(not value < 0.0, "SQRT of a negative number")
    return math.sqrt(value)


def _abs(value):
    return abs(value) if isinstance(value, float) else _within(abs(value), *LIMITS["DINT"], "DINT")


def _rounded(value):
    """Half to even, as IEC 60559 rounds."""
    _check(math.isfinite(value), f"{value} does not fit DINT")
    return _within(round(value), *LIMITS["DINT"], "DINT")


def _signed(bits):
    return bits - 2**32 if bits >= 2**31 else bits


def _within(value, least, most, what):
    if not least <= value <= most:
        raise StError(f"{what} does not take {value}")
    return value


def _divided(left, right):
    _check(right != 0, "division by zero")
    # Integer division truncates towards zero.
    return left / right if isinstance(left, float) else math.trunc(left / right)


def _turn(turns):
    _check(turns < MOST_TURNS, "a loop goes on and on")
    return turns + 1


RUNTIME = {
    function.__name__: function
    for function in (_abs, _limit, _sqrt, _rounded, _signed, _within, _divided, _turn)
}


def _fits(type_, expected):
    return type_ == expected or (type_ == LITERAL and expected in ("INT", "DINT"))


def _common(left, right):
    """Type of both operands."""
    _check(_fits(left, right) or _fits(right, left), f"{left} and {right} are mixed")
    return right if left == LITERAL else left


class _Declarations(Interpreter):
    """Variables with section, type and initial value."""

    def __init__(self):
        self.sections, self.types, self.initial = {}, {}, {}

    def block(self, tree):
        section, *rest = tree.children
        if rest and isinstance(rest[0], Token):
            section = rest.pop(0)
        for name, type_, initial in (declaration.children for declaration in rest):
            key = name.lower()
            _check(key not in self.types, f"{name} is declared twice")
            if type_.data == "instance":
                self.sections[key], self.types[key] = section.upper(), (str(type_.children[0]), INSTANCE)
                self.initial[key] = None
                continue
            scalar = type_.children[-1].upper()
            bounds = tuple(map(int, type_.children[:-1])) or None
            self.sections[key], self.types[key] = section.upper(), (scalar, bounds)
            self.initial[key] = self._value(name, scalar, bounds, initial)

    def _value(self, name, scalar, bounds, initial):
        if bounds is None:
            _check(initial is None or initial.data == "literal", f"{name} is no array")
            return ZERO[scalar] if initial is None else _constant(scalar, initial, name)
        length = bounds[1] - bounds[0] + 1
        if initial is None:
            return [ZERO[scalar]] * length
        values = initial.children if initial.data == "values" else [initial]
        _check(
            initial.data == "values" and len(values) == length, f"{name} has {len(values)} of {length} values"
        )
        return [_constant(scalar, value, name) for value in values]


def _constant(scalar, tree, name):
    sign, token = tree.children
    kind = {"REAL": "LREAL", "INTEGER": LITERAL, "BOOLEAN": "BOOL", "BITS": "DWORD"}[token.type]
    _check(
        _fits(kind, scalar) and (sign is None or kind in ("LREAL", LITERAL)), f"{name} cannot hold {token}"
    )
    convert = {"LREAL": float, LITERAL: int, "BOOL": _truth, "DWORD": _bits}[kind]
    value = -convert(token) if sign == "-" else convert(token)
    _check(scalar != "LREAL" or math.isfinite(value), f"{name} cannot hold {token}")
    return value if scalar in ("BOOL", "LREAL") else _within(value, *LIMITS[scalar], name)


def _truth(token):
    return token.upper() == "TRUE"


def _bits(token):
    return int(token[3:], 16)


class _Translator(Interpreter):
    """From the tree to Python: an expression to its type and code, a statement to lines."""

    def __init__(self, declarations, library):
        self.sections, self.types = declarations.sections, declarations.types
        self.library = library
        self.loops, self.counters = 0, []

    def real(self, tree):
        value = float(tree.children[0])
        _check(math.isfinite(value), f"LREAL cannot hold {tree.children[0]}")
        return "LREAL", repr(value)

    def integer(self, tree):
        return LITERAL, str(_within(int(tree.children[0]), *LIMITS["DINT"], "DINT"))

    def boolean(self, tree):
        return "BOOL", str(_truth(tree.children[0]))

    def bits(self, tree):
        return "DWORD", str(_within(_bits(tree.children[0]), *LIMITS["DWORD"], "DWORD"))

    def variable(self, tree):
        name, index = tree.children
        key = name.lower()
        _check(key in self.types, f"{name} is not declared")
        scalar, bounds = self.types[key]
        _check((bounds is None) == (index is None), f"{name} is used against its type")
        if bounds is None:
            return scalar, f"v_{key}"
        type_, code = self.visit(index)
        _check(type_ in INTEGERS, f"{name} has an index that is no integer")
        return scalar, f"v_{key}[_within({code}, {bounds[0]}, {bounds[1]}, 'index of {key}') - {bounds[0]}]"

    def member(self, tree):
        *names, index, bit = tree.children
        (type_, bounds), code = self._path(names)
        if index is not None:
            code = f"{code}[_within({self.visit(index)[1]}, {bounds[0]}, {bounds[1]}, 'index') - {bounds[0]}]"
        if bit is not None:
            _check(type_ == "DWORD", f"{type_} has no bits")
            return "BOOL", f"({code} >> {int(bit[2:])} & 1 == 1)"
        return type_ if index is not None or bounds is None else (type_, bounds), code

    def _path(self, names):
        """Type and place of a variable in an instance in an instance."""
        key = names[0].lower()
        _check(key in self.types, f"{names[0]} is not declared")
        (type_, bounds), code = self.types[key], f"v_{key}"
        for name in map(str.lower, names[1:]):
            _check(bounds is INSTANCE, f"{names[0]} has no members")
            declared = _declared(type_, self.library)
            _check(name in declared.types, f"{type_} has no {name}")
            (type_, bounds), code = declared.types[name], f"{code}['{name}']"
        return (type_, bounds), code

    def invoke(self, tree):
        names = [child for child in tree.children if isinstance(child, Token)]
        name, arguments = ".".join(names), tree.children[len(names) :]
        if names[0].lower() in self.types:
            (type_, bounds), instance = self._path(names)
            _check(bounds is INSTANCE, f"{name} cannot be called")
        else:
            type_, instance = name, f"_function('{name.lower()}')"
        declared = _declared(type_, self.library)
        given = []
        for parameter, expression in (argument.children for argument in arguments):
            due = parameter.lower()
            _check(
                declared.sections.get(due) in ("VAR_INPUT", "VAR_IN_OUT"), f"{name} has no input {parameter}"
            )
            expected, bounds = declared.types[due]
            found, code = self._whole(expression)
            _check(
                _fits(found, expected if bounds is None else (expected, bounds)),
                f"{name}: {parameter} mixes types",
            )
            given.append(f"{due}={code}")
        names = {one.partition("=")[0] for one in given}
        for key, section in declared.sections.items():
            _check(section != "VAR_IN_OUT" or key in names, f"{name}: {key} is missing")
        return [f"{instance}.call({', '.join(given)})"]

    def _whole(self, tree):
        """An expression, or a whole array or instance by its name."""
        if tree.data == "variable" and tree.children[1] is None:
            key = tree.children[0].lower()
            scalar, bounds = self.types.get(key, (None, None))
            if bounds is not None:
                return (scalar, bounds), f"v_{key}"
        return self.visit(tree)

    def call(self, tree):
        name, *arguments = tree.children
        _check(name.lower() in FUNCTIONS, f"{name} is not known")
        due, result, code = FUNCTIONS[name.lower()]
        _check(len(due) == len(arguments), f"{name} takes {len(due)} arguments")
        given = [self.visit(argument) for argument in arguments]
        generic = None
        for (type_, _), expected in zip(given, due, strict=True):
            if expected == "number":
                _check(type_ in ("LREAL", *INTEGERS), f"{name} does not take {type_}")
                generic = type_ if generic is None else _common(generic, type_)
            else:
                _check(_fits(type_, expected), f"{name} does not take {type_}")
        return generic if result == "number" else result, code.format(*(argument for _, argument in given))

    def negation(self, tree):
        ((type_, code),) = self.visit_children(tree)
        _check(type_ == "BOOL", f"NOT does not take {type_}")
        return "BOOL", f"(not {code})"

    def signed(self, tree):
        sign, (type_, code) = tree.children[0], self.visit(tree.children[1])
        _check(type_ in ("LREAL", *INTEGERS), f"{sign} does not take {type_}")
        return type_, _ranged(type_, f"({sign}{code})")

    def logic(self, tree):
        # Both sides are evaluated: the standard has no short circuit.
        (left, one), operator, (right, other) = self._operands(tree)
        _check(_common(left, right) in ("BOOL", "DWORD"), f"{operator} does not take {left}")
        return left, f"({one} { {'OR': '|', 'XOR': '^', 'AND': '&'}[operator.upper()] } {other})"

    def compare(self, tree):
        (left, one), operator, (right, other) = self._operands(tree)
        type_ = _common(left, right)
        _check(operator in ("=", "<>") or type_ != "BOOL", f"{operator} does not take BOOL")
        return "BOOL", f"({one} { {'=': '==', '<>': '!='}.get(operator, operator) } {other})"

    def arithmetic(self, tree):
        (left, one), operator, (right, other) = self._operands(tree)
        type_ = _common(left, right)
        _check(type_ in ("LREAL", *INTEGERS), f"{operator} does not take {type_}")
        code = f"_divided({one}, {other})" if operator == "/" else f"({one} {operator} {other})"
        return type_, _ranged(type_, code)

    def _operands(self, tree):
        return self.visit(tree.children[0]), tree.children[1], self.visit(tree.children[2])

    def assign(self, tree):
        name = tree.children[0].children[0].lower()
        scalar, place = self._whole(tree.children[0])
        type_, code = self._whole(tree.children[1])
        _check(self.sections[name] in ("VAR", "VAR_OUTPUT", "VAR_IN_OUT"), f"{name} must not be written")
        _check(name not in self.counters, f"{name} counts the loop around it")
        _check(_fits(type_, scalar), f"{name} : {scalar} cannot hold {type_}")
        if scalar in LIMITS:
            code = f"_within({code}, {LIMITS[scalar][0]}, {LIMITS[scalar][1]}, '{name}')"
        return [f"{place} = {code}"]

    def hand(self, tree):
        """Write an element of an instance's input."""
        instance, name, index, value = tree.children
        (type_, _), code = self._path([instance])
        declared, key = _declared(type_, self.library), name.lower()
        _check(declared.sections.get(key) == "VAR_INPUT", f"{instance} has no input {name}")
        expected, (first, last) = declared.types[key]
        (at, index), (found, value) = self.visit(index), self.visit(value)
        _check(at in INTEGERS and _fits(found, expected), f"{instance}: {name} mixes types")
        return [f"{code}.alter('{key}', _within({index}, {first}, {last}, 'index') - {first}, {value})"]

    def body(self, tree):
        return [line for statement in tree.children for line in self.visit(statement)] or ["pass"]

    def branch(self, tree):
        condition, body = tree.children
        return self._condition(condition), self.visit(body)

    def choose(self, tree):
        *branches, otherwise = tree.children
        return self._chain([self.visit(branch) for branch in branches], otherwise)

    def case(self, tree):
        selector, *labels, otherwise = tree.children
        type_, code = self.visit(selector)
        _check(type_ in INTEGERS, f"CASE does not take {type_}")
        branches, known = [], []
        for label in labels:
            values = [int(value) for value in label.children[:-1]]
            known += values
            branches.append((f"{code} in {(*values,)}", self.visit(label.children[-1])))
        _check(len({*known}) == len(known), "CASE has a value twice")
        return self._chain(branches, otherwise)

    def count(self, tree):
        name, first, last, body = tree.children
        key, variable = name.lower(), Tree("variable", [name, None])
        scalar, place = self.visit(variable)
        _check(self.sections[key] in ("VAR", "VAR_OUTPUT"), f"{name} must not be written")
        _check(key not in self.counters, f"{name} counts the loop around it")
        (start, low), (end, high) = self.visit(first), self.visit(last)
        _check(scalar in INTEGERS and _fits(start, scalar) and _fits(end, scalar), "FOR mixes types")
        self.counters.append(key)
        self.loops += 1
        most, next_ = f"last_{self.loops}", _ranged(scalar, f"({place} + 1)")
        turn = [*TURN, *self.visit(body), f"{place} = {next_}"]
        self.counters.pop()
        return [f"{most} = {high}", f"{place} = {low}", f"while {place} <= {most}:", *_indented(turn)]

    def repeat(self, tree):
        condition, body = self._condition(tree.children[0]), self.visit(tree.children[1])
        return [f"while {condition}:", *_indented([*TURN, *body])]

    def _condition(self, tree):
        type_, code = self.visit(tree)
        _check(type_ == "BOOL", f"{type_} is no condition")
        return code

    def _chain(self, branches, otherwise):
        lines = []
        for word, (condition, body) in zip(["if", *["elif"] * len(branches)], branches, strict=False):
            lines += [f"{word} {condition}:", *_indented(body)]
        return lines + (["else:", *_indented(self.visit(otherwise))] if otherwise else [])


def _ranged(type_, code):
    limits = LIMITS.get("DINT" if type_ == LITERAL else type_)
    return code if limits is None else f"_within({code}, {limits[0]}, {limits[1]}, '{type_}')"


def _indented(lines):
    return [f"  {line}" for line in lines]


_PARSER = Lark(GRAMMAR, parser="lalr", maybe_placeholders=True)


@lru_cache(maxsize=64)
def _parsed(text):
    tree = _PARSER.parse(text)
    declarations = _Declarations()
    for part in tree.children[1:-1]:
        declarations.visit(part)
    return tree, declarations


def _text_of(type_, library):
    """Find a block by its name."""
    found = [text for text in library if str(_parsed(text)[0].children[0]).lower() == type_.lower()]
    _check(len(found) == 1, f"{type_} is not known")
    return found[0]


def _declared(type_, library):
    return _parsed(_text_of(type_, library))[1]


@lru_cache(maxsize=64)
def _translated(text, library):
    tree, declarations = _parsed(text)
    lines = _Translator(declarations, library).visit(tree.children[-1])
    names = ", ".join(f"v_{name}" for name in declarations.types)
    source = ["def run():", *_indented([f"global {names}" if names else "pass", "turns = 0", *lines])]
    return str(tree.children[0]), declarations, compile("\n".join(source), "<structured text>", "exec")


class FunctionBlock:
    """An instance: `call` runs it once with the given inputs and returns its outputs, by lower-case name.

    Texts of the blocks that it uses are given as ``library``.
    """

    def __init__(self, text, library=()):
        self.name, declarations, code = _translated(text, library)
        self.types, self.sections = declarations.types, declarations.sections
        functions = {}
        self._space = RUNTIME | {
            "_function": lambda name: (
                functions.get(name)
                or functions.setdefault(name, FunctionBlock(_text_of(name, library), library))
            )
        }
        for name, value in declarations.initial.items():
            self._space[f"v_{name}"] = list(value) if isinstance(value, list) else value
            type_, bounds = self.types[name]
            if bounds is INSTANCE and self.sections[name] != "VAR_IN_OUT":
                self._space[f"v_{name}"] = FunctionBlock(_text_of(type_, library), library)
        exec(code, self._space)
        self._outputs = [name for name, section in self.sections.items() if section == "VAR_OUTPUT"]

    def call(self, **inputs):
        for name, value in inputs.items():
            key = name.lower()
            _check(self.sections.get(key) in ("VAR_INPUT", "VAR_IN_OUT"), f"{name} is no input")
            self._space[f"v_{key}"] = self._input(key, value)
        self._space["run"]()
        return {name: self[name] for name in self._outputs}

    def __getitem__(self, name):
        value = self._space[f"v_{name.lower()}"]
        return list(value) if isinstance(value, list) else value

    def alter(self, name, index, value):
        """Change a variable, or an element of an array, as failing memory would, constant or not."""
        key = f"v_{name.lower()}"
        if index is None:
            self._space[key] = value
        else:
            self._space[key][index] = value

    def constants(self):
        """List all constant values: name, index in an array or None, and the value."""
        for name in (name for name, section in self.sections.items() if section == "CONSTANT"):
            whole = self[name]
            elements = enumerate(whole) if isinstance(whole, list) else [(None, whole)]
            yield from ((name, index, value) for index, value in elements)

    def _input(self, name, value):
        scalar, bounds = self.types[name]
        if bounds is None:
            return _given(scalar, value, name)
        if bounds is INSTANCE:
            _check(value.name.lower() == scalar.lower(), f"{name} is no {value.name}")
            return value
        _check(len(value) == bounds[1] - bounds[0] + 1, f"{name} takes another number of values")
        if self.sections[name] == "VAR_IN_OUT":  # the array itself
            return value
        return [_given(scalar, item, name) for item in value]


def block_of(text):
    """An instance of the last block of a text, which has the blocks before it within it."""
    *library, own = [f"{one}END_FUNCTION_BLOCK\n" for one in text.split("END_FUNCTION_BLOCK")[:-1]]
    return FunctionBlock(own, tuple(library))


def _given(scalar, value, name):
    expected = {"BOOL": bool, "LREAL": float}.get(scalar, int)
    _check(type(value) is expected, f"{name} : {scalar} cannot hold {value!r}")
    return value if scalar in ("BOOL", "LREAL") else _within(value, *LIMITS[scalar], name)
