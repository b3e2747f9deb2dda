"""Interpreter for a subset of IEC 61131-3 Structured Text: an oracle that knows nothing of the exporter.

One function block per text, with variables of BOOL, INT, DINT, LREAL and one-dimensional arrays of them;
assignments, IF, CASE over integers, expressions with the standard's precedence (third edition, table 71), ABS
and LIMIT. It is strict where compilers are: every type must fit, integers must not overflow, indices must lie
within bounds, inputs and constants are not written, initialisers fill their array.
"""

import math

from lark import Lark, Token, Transformer, v_args

GRAMMAR = r"""
    start: "FUNCTION_BLOCK"i NAME block* statement* "END_FUNCTION_BLOCK"i

    block: SECTION CONSTANT? declaration* "END_VAR"i
    declaration: NAME ":" type [":=" initial] ";"
    type: TYPE -> scalar
        | "ARRAY"i "[" INTEGER ".." INTEGER "]" "OF"i TYPE -> array
    ?initial: literal
        | "[" literal ("," literal)* "]" -> values
    literal: [SIGN] (REAL | INTEGER | BOOLEAN)

    statement: variable ":=" expression ";" -> assign
        | "IF"i branch ("ELSIF"i branch)* ["ELSE"i body] "END_IF"i ";" -> choose
        | "CASE"i expression "OF"i label+ ["ELSE"i body] "END_CASE"i ";" -> case
    branch: expression "THEN"i body
    label: INTEGER ("," INTEGER)* ":" body
    body: statement*

    ?expression: disjunction
    ?disjunction: exclusion | disjunction "OR"i exclusion -> or_
    ?exclusion: conjunction | exclusion "XOR"i conjunction -> xor_
    ?conjunction: equality | conjunction "AND"i equality -> and_
    ?equality: comparison | equality EQUALS comparison -> binary
    ?comparison: sum | comparison ORDER sum -> binary
    ?sum: term | sum SIGN term -> binary
    ?term: unary | term FACTOR unary -> binary
    ?unary: primary | "NOT"i unary -> not_ | SIGN unary -> signed
    ?primary: REAL -> real | INTEGER -> integer | BOOLEAN -> boolean
        | "(" expression ")"
        | NAME "(" expression ("," expression)* ")" -> call
        | variable
    variable: NAME ["[" expression "]"]

    SECTION.3: /VAR_INPUT\b|VAR_OUTPUT\b|VAR\b/i
    CONSTANT.3: /CONSTANT\b/i
    TYPE.3: /BOOL\b|INT\b|DINT\b|LREAL\b/i
    BOOLEAN.3: /TRUE\b|FALSE\b/i
    REAL.2: /[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?/
    INTEGER: /[0-9]+/
    EQUALS.2: "=" | "<>"
    ORDER: "<=" | ">=" | "<" | ">"
    SIGN: "+" | "-"
    FACTOR: "*" | "/"
    NAME: /[A-Za-z](_?[A-Za-z0-9])*/
    COMMENT: /\(\*(.|\n)*?\*\)/
    %ignore COMMENT
    %ignore /[ \t\r\n]+/
"""

INTEGERS = {"INT": 2**15, "DINT": 2**31}
ZERO = {"BOOL": False, "INT": 0, "DINT": 0, "LREAL": 0.0}


class StError(Exception):
    """The program breaks a rule of the language."""


def _check(condition, message):
    if not condition:
        raise StError(message)


@v_args(inline=True)
class _Compiler(Transformer):
    """From the tree to closures over the block's variables."""

    def literal(self, sign, token):
        value = {"REAL": float, "INTEGER": int, "BOOLEAN": lambda text: text.upper() == "TRUE"}[token.type](
            token
        )
        return -value if sign == "-" else value

    def values(self, *values):
        return list(values)

    def scalar(self, type_):
        return (type_.upper(), None)

    def array(self, low, high, type_):
        return (type_.upper(), (int(low), int(high)))

    def declaration(self, name, type_, initial):
        return (str(name).lower(), type_, initial)

    def block(self, section, *rest):
        constant = bool(rest) and isinstance(rest[0], Token)
        return ("CONSTANT" if constant else section.upper(), list(rest[constant:]))

    def start(self, name, *parts):
        blocks = [part for part in parts if isinstance(part, tuple)]
        return (str(name), blocks, list(parts[len(blocks) :]))

    def real(self, token):
        return lambda _: float(token)

    def integer(self, token):
        return lambda _: int(token)

    def boolean(self, token):
        return lambda _: token.upper() == "TRUE"

    def variable(self, name, index):
        return _Variable(str(name).lower(), index)

    def call(self, name, *arguments):
        function = {"abs": _abs, "limit": _limit}.get(name.lower())
        _check(function, f"{name} is not known")
        return lambda block: function(*(argument(block) for argument in arguments))

    def not_(self, operand):
        return lambda block: not _boolean(operand(block))

    def signed(self, sign, operand):
        return lambda block: -_number(operand(block)) if sign == "-" else _number(operand(block))

    def binary(self, left, operator, right):
        return lambda block: _binary(str(operator), left(block), right(block))

    def and_(self, left, right):
        # Both sides are evaluated: the standard has no short circuit.
        return lambda block: bool(_boolean(left(block)) & _boolean(right(block)))

    def or_(self, left, right):
        return lambda block: bool(_boolean(left(block)) | _boolean(right(block)))

    def xor_(self, left, right):
        return lambda block: bool(_boolean(left(block)) ^ _boolean(right(block)))

    def assign(self, variable, expression):
        return lambda block: variable.assign(block, expression(block))

    def body(self, *statements):
        def run(block):
            for statement in statements:
                statement(block)

        return run

    def branch(self, condition, body):
        return (condition, body)

    def label(self, *parts):
        return ({int(value) for value in parts[:-1]}, parts[-1])

    def choose(self, *parts):
        *branches, otherwise = parts

        def run(block):
            for condition, body in branches:
                if _boolean(condition(block)):
                    return body(block)
            return otherwise and otherwise(block)

        return run

    def case(self, selector, *parts):
        *labels, otherwise = parts

        def run(block):
            value = selector(block)
            for values, body in labels:
                if value in values:
                    return body(block)
            return otherwise and otherwise(block)

        return run


class _Variable:
    def __init__(self, name, index):
        self.name, self.index = name, index

    def _position(self, block):
        bounds = block.types[self.name][1]
        _check((bounds is None) == (self.index is None), f"{self.name} is used against its type")
        if bounds is None:
            return None
        index = self.index(block)
        _check(
            type(index) is int and bounds[0] <= index <= bounds[1], f"{self.name}[{index}] is out of bounds"
        )
        return index - bounds[0]

    def __call__(self, block):
        _check(self.name in block.types, f"{self.name} is not declared")
        position = self._position(block)
        return block.values[self.name] if position is None else block.values[self.name][position]

    def assign(self, block, value):
        _check(self.name in block.types, f"{self.name} is not declared")
        _check(block.sections[self.name] in ("VAR", "VAR_OUTPUT"), f"{self.name} must not be written")
        position = self._position(block)
        value = _fitting(block.types[self.name][0], value, self.name)
        if position is None:
            block.values[self.name] = value
        else:
            block.values[self.name][position] = value


def _boolean(value):
    _check(isinstance(value, bool), f"{value!r} is no BOOL")
    return value


def _number(value):
    _check(type(value) in (int, float), f"{value!r} is no number")
    return value


def _fitting(type_, value, name):
    expected = {"BOOL": bool, "LREAL": float}.get(type_, int)
    _check(type(value) is expected, f"{name} : {type_} cannot hold {value!r}")
    if type_ in INTEGERS:
        _check(-INTEGERS[type_] <= value < INTEGERS[type_], f"{name} : {type_} overflows with {value}")
    return value


def _binary(operator, left, right):
    _check(type(left) is type(right), f"{left!r} {operator} {right!r} mixes types")
    if operator in ("=", "<>"):
        return (left == right) == (operator == "=")
    _number(left)
    match operator:
        case "<":
            return left < right
        case "<=":
            return left <= right
        case ">":
            return left > right
        case ">=":
            return left >= right
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
    _check(right != 0, "division by zero")
    # Integer division truncates towards zero.
    return left / right if isinstance(left, float) else math.trunc(left / right)


def _abs(value):
    return abs(_number(value))


def _limit(least, value, most):
    _check(type(least) is type(value) is type(most), "LIMIT mixes types")
    return min(max(_number(value), least), most)


_PARSER = Lark(GRAMMAR, parser="lalr")


class FunctionBlock:
    """An instance: `call` runs it once with the given inputs and returns its outputs, by lower-case name."""

    def __init__(self, text):
        self.name, blocks, self._statements = _Compiler().transform(_PARSER.parse(text))
        self.types, self.sections, self.values = {}, {}, {}
        for section, declarations in blocks:
            for name, type_, initial in declarations:
                _check(name not in self.types, f"{name} is declared twice")
                self.types[name], self.sections[name] = type_, section
                self.values[name] = self._initial(name, type_, initial)

    def _initial(self, name, type_, initial):
        scalar, bounds = type_
        if bounds is None:
            return _fitting(scalar, ZERO[scalar] if initial is None else initial, name)
        length = bounds[1] - bounds[0] + 1
        values = [ZERO[scalar]] * length if initial is None else initial
        _check(len(values) == length, f"{name} has {len(values)} values for {length} elements")
        return [_fitting(scalar, value, name) for value in values]

    def call(self, **inputs):
        for name, value in inputs.items():
            _check(self.sections.get(name.lower()) == "VAR_INPUT", f"{name} is no input")
            self.values[name.lower()] = _fitting(self.types[name.lower()][0], value, name)
        for statement in self._statements:
            statement(self)
        return {name: value for name, value in self.values.items() if self.sections[name] == "VAR_OUTPUT"}
