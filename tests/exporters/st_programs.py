"""Random programs in the subset of Structured Text that is translated to C, and their values where known."""

import math
import random
from typing import NamedTuple

DECLARATIONS = """
VAR_INPUT
    which : DINT; x : LREAL; z : LREAL := -0.5; m : DINT; n : DINT := 010; p : BOOL; q : BOOL := TRUE;
END_VAR
VAR_OUTPUT y : LREAL; k : DINT := -1; b : BOOL; END_VAR
VAR
    v : ARRAY [0..3] OF LREAL := [1.0, -2.0E+0, 0.5, -0.0]; t : ARRAY [0..2] OF DINT := [3, -7, 08];
    s : ARRAY [0..1] OF BOOL; i : DINT; j : DINT; turns : DINT;
END_VAR
VAR CONSTANT c : LREAL := -2.5E-1; w : ARRAY [0..2] OF LREAL := [0.1, 3.0, -1.5]; e : DINT := -3; END_VAR
"""
INPUTS = {"x": "LREAL", "z": "LREAL", "m": "DINT", "n": "DINT", "p": "BOOL", "q": "BOOL"}
INITIAL = {
    "y": 0.0, "k": -1, "b": False, "v": [1.0, -2.0, 0.5, -0.0], "t": [3, -7, 8], "s": [False, False],
    "i": 0, "j": 0, "turns": 0, "c": -0.25, "w": [0.1, 3.0, -1.5], "e": -3,
}  # fmt: skip
SCALARS = {"LREAL": "xzyc", "DINT": "mnkeij", "BOOL": "pqb"}
ARRAYS = {"LREAL": {"v": 4, "w": 3}, "DINT": {"t": 3}, "BOOL": {"s": 2}}
WRITTEN = {"LREAL": "yv", "DINT": "kt", "BOOL": "bs"}
LITERALS = {
    "LREAL": ("0.0", "1.0", "2.5", "0.1", "1.0E-3", "3.0e+2", "0.5", "1.5E10", "007.25", "1.0E300"),
    "DINT": ("0", "1", "2", "3", "007", "010", "100", "65536", "2147483647"),
    "BOOL": ("TRUE", "FALSE", "true"),
}
RANKS = {"OR": 1, "AND": 2, "=": 3, "<>": 3, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6}
PREFIX, PRIMARY = 7, 8
ARITHMETIC = ("+", "-", "*", "+", "-", "*", "/")
CALLS = {"ABS": None, "SQRT": "LREAL", "LREAL_TO_DINT": "LREAL", "DINT_TO_LREAL": "DINT"}
SHOWN = {"y": 0, "k": 0, "b": 0, "v": 4, "t": 3, "s": 2, "i": 0, "j": 0, "turns": 0}
FAULT = "fault"
SPECIAL = {
    "LREAL": (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.5, 2.5, -0.5, 2147483647.5, -2147483648.4, 1e-308),
    "DINT": (0, 2**31 - 1, -(2**31), -1, 46341),
}


class Undefined(Exception):
    """The value is none that the language defines."""


class Tree(NamedTuple):
    """An expression: its operator, function, variable or literal, and how tightly it binds."""

    what: str
    parts: tuple["Tree", ...] = ()
    rank: int = PRIMARY


class Writer:
    """Draws programs; `spoil` is the chance that a part is of another type than fits."""

    def __init__(self, seed, spoil=0.0):
        self.random, self.spoil, self.counters = random.Random(seed), spoil, []

    def tree(self, type_, depth):
        draw = self.random
        if draw.random() < self.spoil:
            type_ = draw.choice(("LREAL", "DINT", "BOOL"))
        if depth <= 0 or draw.random() < 0.2:
            return self._leaf(type_, depth)
        kind = draw.random()
        if kind < 0.2:
            return Tree(
                "NOT" if type_ == "BOOL" else draw.choice("--+"), (self.tree(type_, depth - 1),), PREFIX
            )
        if kind < 0.4 and type_ != "BOOL":
            return self._call(type_, depth)
        operands = type_
        if type_ != "BOOL":
            operator = draw.choice(ARITHMETIC)
        elif draw.random() < 0.5:
            operator = draw.choice(("AND", "OR"))
        else:
            operands = draw.choice(("LREAL", "DINT", "BOOL"))
            operator = draw.choice(("=", "<>") if operands == "BOOL" else ("=", "<>", "<", "<=", ">", ">="))
        right = self.tree(operands, depth - 1)
        if operator == "/" and draw.random() < 0.7:
            right = Tree(draw.choice(("3", "7") if type_ == "DINT" else ("0.7", "3.0")))
        return Tree(operator, (self.tree(operands, depth - 1), right), RANKS[operator])

    def _leaf(self, type_, depth):
        draw = self.random
        kind = draw.random()
        if kind < 0.3:
            return Tree(draw.choice(LITERALS[type_]))
        if kind < 0.55:
            name, length = draw.choice([*ARRAYS[type_].items()])
            index = (
                self.tree("DINT", min(depth, 2)) if draw.random() < 0.1 else Tree(str(draw.randrange(length)))
            )
            return Tree(name, (index,))
        return Tree(draw.choice(SCALARS[type_]))

    def _call(self, type_, depth):
        name = self.random.choice(
            ("ABS", "SQRT", "DINT_TO_LREAL") if type_ == "LREAL" else ("ABS", "LREAL_TO_DINT")
        )
        part = self.tree(CALLS[name] or type_, depth - 1)
        if name == "SQRT" and self.random.random() < 0.8:
            part = Tree("ABS", (part,))
        return Tree(name, (part,))

    def text(self, tree, least=0):
        """Write a tree with the parentheses that it needs where `least` binds, and some that it does not."""
        draw, (what, parts, rank) = self.random, tree
        if rank == PREFIX:
            space = " " if what == "NOT" or draw.random() < 0.5 else ""
            text = f"{what}{space}{self.text(parts[0], PREFIX)}"
        elif rank < PREFIX:
            space = draw.choice(("", " ")) if not what.isalpha() else " "
            text = f"{self.text(parts[0], rank)}{space}{what}{space}{self.text(parts[1], rank + 1)}"
        elif parts:
            text = f"{what}({self.text(parts[0])})" if what in CALLS else f"{what}[{self.text(parts[0])}]"
        else:
            text = what
        return f"({text})" if rank < least or draw.random() < 0.1 else text

    def condition(self):
        return self.text(self.tree("BOOL", 2))

    def assignment(self):
        type_ = self.random.choice(("LREAL", "DINT", "BOOL"))
        name = self.random.choice(WRITTEN[type_])
        length = ARRAYS[type_].get(name)
        target = name if length is None else f"{name}[{self.random.randrange(length)}]"
        return [f"{target} := {self.text(self.tree(type_, 3))};"]

    def statements(self, depth):
        return [line for _ in range(self.random.choice((1, 1, 2))) for line in self._statement(depth)]

    def _statement(self, depth):
        if depth == 0 or self.random.random() < 0.4:
            return self.assignment()
        return self.random.choice((self._choice, self._switch, self._count, self._repeat))(depth - 1)

    def _choice(self, depth):
        lines = [f"IF {self.condition()} THEN", *self.statements(depth)]
        for _ in range(self.random.choice((0, 0, 1, 2))):
            lines += [f"ELSIF {self.condition()} THEN", *self.statements(depth)]
        return [*lines, *self._otherwise(depth), "END_IF;"]

    def _switch(self, depth):
        numbers = self.random.sample([*map(str, range(8)), "08", "010"], 4)
        lines = [f"CASE {self.text(self.tree('DINT', 2))} OF"]
        for labels in (numbers[:1], numbers[1:]):
            lines += [f"{', '.join(labels)}:", *self.statements(depth)]
        return [*lines, *self._otherwise(depth), "END_CASE;"]

    def _otherwise(self, depth):
        return ["ELSE", *self.statements(depth)] if self.random.random() < 0.5 else []

    def _count(self, depth):
        free = [name for name in "ij" if name not in self.counters]
        if not free:
            return self.assignment()
        self.counters.append(name := self.random.choice(free))
        bounds = [self.text(self.tree("DINT", 1)) for _ in range(2)]
        if self.random.random() < 0.8:
            bounds = [str(self.random.randrange(3)), f"{self.random.randrange(5)} - 1"]
        body = self.statements(depth)
        self.counters.pop()
        return [f"FOR {name} := {bounds[0]} TO {bounds[1]} DO", *body, "END_FOR;"]

    def _repeat(self, depth):
        condition = Tree(
            "AND", (self.tree("BOOL", 2), Tree("<", (Tree("turns"), Tree("6")), RANKS["<"])), RANKS["AND"]
        )
        return [
            f"WHILE {self.text(condition)} DO",
            "turns := turns + 1;",
            *self.statements(depth),
            "END_WHILE;",
        ]

    def inputs(self):
        """Draw inputs of a cycle."""
        draw, rows = self.random, {}
        for name, type_ in INPUTS.items():
            if type_ == "BOOL":
                rows[name] = draw.random() < 0.5
            elif draw.random() < 0.15:
                rows[name] = draw.choice(SPECIAL[type_])
            else:
                rows[name] = round(draw.uniform(-9.0, 9.0), 2) if type_ == "LREAL" else draw.randint(-9, 9)
        return rows


class Program(NamedTuple):
    """Statements, the inputs of their cycles, and what the first shows where that is known otherwise."""

    seed: str
    lines: list
    rows: list
    result: tuple | str
    spoiled: bool


def draw(seed, cycles):
    """Draw a program: of every four one with parts of other types, and one whose values are known."""
    number = int(seed.rpartition("-")[2])
    spoiled = number % 4 == 3
    writer = Writer(seed, spoil=0.015 if spoiled else 0.0)
    rows = [writer.inputs() for _ in range(cycles)]
    result = ()
    if number % 4 == 1:
        trees = {
            name: writer.tree(type_, 4) for name, type_ in (("y", "LREAL"), ("k", "DINT"), ("b", "BOOL"))
        }
        lines = [f"{name} := {writer.text(tree)};" for name, tree in trees.items()]
        variables = INITIAL | rows[0]
        try:
            for name, tree in trees.items():
                variables[name] = value(tree, variables)
            parts = (variables[name] for name in SHOWN)
            result = tuple(float(v) for part in parts for v in (part if isinstance(part, list) else [part]))
        except Undefined:
            result = FAULT
    else:
        lines = [line for _ in range(2) for line in writer.statements(2)]
    return Program(seed, lines, rows, result, spoiled)


def block(name, bodies):
    """Write a function block that does one of several programs in a cycle."""
    cases = [f"{number}:\n{body}" for number, body in enumerate(bodies)]
    return "\n".join(
        [f"FUNCTION_BLOCK {name}{DECLARATIONS}CASE which OF", *cases, "END_CASE;", "END_FUNCTION_BLOCK"]
    )


def value(tree, variables):
    """Evaluate a tree as the language defines it, by Python's own arithmetic."""
    what, parts, rank = tree
    if not parts:
        if what in variables:
            return variables[what]
        if what.isalpha():
            return what.upper() == "TRUE"
        return float(what) if "." in what else int(what)
    given = [value(part, variables) for part in parts]
    if rank == PRIMARY and what not in CALLS:
        if not 0 <= given[0] < len(variables[what]):
            raise Undefined
        return variables[what][given[0]]
    return _within(_applied(what, *given))


def _within(result):
    if type(result) is int and not -(2**31) <= result < 2**31:
        raise Undefined
    return result


def _applied(what, left, right=None):
    if right is None:
        return _of_one(what, left)
    if what == "/":
        if right == 0:
            raise Undefined
        return (
            left / right
            if isinstance(left, float)
            else abs(left) // abs(right) * (1 if left * right >= 0 else -1)
        )
    return {
        "OR": lambda: left or right, "AND": lambda: left and right, "=": lambda: left == right,
        "<>": lambda: left != right, "<": lambda: left < right, "<=": lambda: left <= right,
        ">": lambda: left > right, ">=": lambda: left >= right, "+": lambda: left + right,
        "-": lambda: left - right, "*": lambda: left * right,
    }[what]()  # fmt: skip


def _of_one(what, operand):
    if what == "SQRT" and operand < 0.0:
        raise Undefined
    if what == "LREAL_TO_DINT" and not math.isfinite(operand):
        raise Undefined
    return {
        "NOT": lambda: not operand, "-": lambda: -operand, "+": lambda: operand, "ABS": lambda: abs(operand),
        "SQRT": lambda: math.sqrt(operand), "DINT_TO_LREAL": lambda: float(operand),
        "LREAL_TO_DINT": lambda: round(operand),
    }[what]()  # fmt: skip
