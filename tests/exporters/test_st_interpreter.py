"""The oracle, proved on small programs whose results are known."""

import math

import pytest
from lark.exceptions import LarkError
from st_interpreter import FunctionBlock, StError


def block(body, declarations=""):
    return FunctionBlock(
        f"""FUNCTION_BLOCK FB
        VAR_INPUT x : LREAL; n : INT; b : BOOL; END_VAR
        VAR_OUTPUT y : LREAL; m : DINT; q : BOOL; k : INT; END_VAR
        VAR CONSTANT c : LREAL := -2.5E-1; t : ARRAY [1..3] OF LREAL := [1.0, -2.0E+0, 3.5]; END_VAR
        {declarations}
        {body}
        END_FUNCTION_BLOCK"""
    )


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1.0 + 2.0 * 3.0", 7.0),
        ("(1.0 + 2.0) * 3.0", 9.0),
        ("10.0 - 4.0 - 3.0", 3.0),
        ("16.0 / 4.0 / 2.0", 2.0),
        ("-x * 2.0", -6.0),
        ("2.0 - -x", 5.0),
        ("ABS(c) + c", 0.0),
        ("LIMIT(0.0 - 1.0, x, 1.0)", 1.0),
        ("LIMIT(-1.0, -x, 1.0)", -1.0),
        ("t[1] + t[n]", 4.5),
        ("0.1 + 0.2", 0.1 + 0.2),
    ],
)
def test_real_expressions(expression, value):
    assert block(f"y := {expression};").call(x=3.0, n=3)["y"] == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("b OR FALSE AND FALSE", True),
        ("TRUE XOR b", False),
        ("NOT b = FALSE", True),
        ("NOT (x > 3.0)", True),
        ("x >= 3.0 AND x <= 3.0 AND x <> 2.0", True),
        ("n = 2 + 1", True),
        ("1 < 2 = b", True),
    ],
)
def test_boolean_expressions(expression, value):
    assert block(f"q := {expression};").call(x=3.0, n=3, b=True)["q"] is value


def test_not_a_number_fails_every_comparison():
    assert block("q := NOT (x <= 1.0);").call(x=math.nan)["q"]


def test_statements_choose_the_right_branch():
    fb = block(
        """CASE n OF 1, 2: k := 10; 3: k := 30; ELSE k := -1; END_CASE;
        IF n > 2 THEN m := m + 1; ELSIF b THEN m := m + 10; ELSE m := 0; END_IF;"""
    )
    assert [fb.call(n=n, b=b)["k"] for n, b in ((1, True), (2, True), (3, True), (4, True), (0, False))] == [
        10, 10, 30, -1, -1,
    ]  # fmt: skip
    assert fb.call(n=3)["m"] == 1
    assert fb.call(n=0, b=True)["m"] == 11


def test_missing_branches_do_nothing():
    assert block("IF b THEN k := 1; END_IF; CASE n OF 7: k := 7; END_CASE;").call()["k"] == 0


def test_variables_keep_their_values_between_calls():
    fb = block("s := s + x; y := s; a[0] := s;", "VAR s : LREAL := 0.5; a : ARRAY [0..0] OF LREAL; END_VAR")
    assert [fb.call(x=1.0)["y"], fb.call()["y"]] == [1.5, 2.5]


def test_names_and_keywords_ignore_case_and_comments_vanish():
    assert block("if B then K := 4; end_if; (* k := 5; *)").call(b=True)["k"] == 4


def test_integer_division_truncates():
    assert block("k := -7 / 2;").call()["k"] == -3


@pytest.mark.parametrize(
    "body",
    [
        "y := 1;",
        "k := 1.0;",
        "y := 1.0 + 1;",
        "q := 1;",
        "q := b AND 1;",
        "y := -b;",
        "x := 1.0;",
        "c := 1.0;",
        "y := t[0];",
        "y := t[4];",
        "y := t;",
        "y := x[1];",
        "y := unknown;",
        "unknown := 1;",
        "y := SIN(x);",
        "y := LIMIT(0, x, 1.0);",
        "y := 1.0 / 0.0;",
        "k := 32767 + 1;",
        "m := 2147483647 + 1;",
        "IF 1 THEN k := 1; END_IF;",
    ],
)
def test_broken_rules_are_errors(body):
    with pytest.raises((StError, LarkError)):
        block(body).call(x=1.0)


@pytest.mark.parametrize(
    "declaration",
    [
        "VAR a : ARRAY [0..2] OF LREAL := [1.0, 2.0]; END_VAR",
        "VAR a : ARRAY [0..1] OF LREAL := [1.0, 2]; END_VAR",
        "VAR a : LREAL := 1; END_VAR",
        "VAR x : LREAL; END_VAR",
        "VAR a : INT := 40000; END_VAR",
        "VAR a__b : INT; END_VAR",
        "VAR a_ : INT; END_VAR",
        "VAR a : LREAL := 1E-3; END_VAR",
    ],
)
def test_broken_declarations_are_errors(declaration):
    with pytest.raises((StError, LarkError)):
        block("", declaration)


PART = "FUNCTION_BLOCK PART VAR_INPUT w : DWORD; a : ARRAY [1..2] OF LREAL; END_VAR END_FUNCTION_BLOCK"
USED = """FUNCTION_BLOCK USED VAR_IN_OUT p : PART; END_VAR VAR_INPUT k : INT; END_VAR
    VAR_OUTPUT sum : LREAL; calls : INT; END_VAR
    calls := calls + 1; p(w := 16#0000000A); sum := p.a[1] + p.a[2]; END_FUNCTION_BLOCK"""


def using(body):
    declarations = "VAR p : PART; u : USED; a : ARRAY [1..2] OF LREAL := [1.0, 2.0]; END_VAR"
    outputs = "VAR_OUTPUT sum : LREAL; calls : INT; low : BOOL; high : BOOL; END_VAR"
    return FunctionBlock(f"FUNCTION_BLOCK T {declarations} {outputs} {body} END_FUNCTION_BLOCK", (PART, USED))


def test_instances_are_called_and_share_what_is_passed_in_and_out():
    body = """p(a := a); u(p := p, k := 1); USED(p := p, k := 2);
        sum := u.sum; calls := u.calls; low := p.w.%X0; high := p.w.%X1;"""
    fb = using(body)
    fb.call()
    assert fb.call() == {"sum": 3.0, "calls": 2, "low": False, "high": True}


@pytest.mark.parametrize(
    "body",
    [
        "u(k := 1.0);",
        "u(p := u);",
        "u(sum := 1.0);",
        "u(unknown := 1);",
        "p(a := 1.0);",
        "unknown(k := 1);",
        "a(k := 1);",
        "sum := u.calls;",
        "sum := u.unknown;",
        "sum := a.b;",
        "sum := p.a[3];",
        "low := u.k.%X0;",
        "u.sum := 1.0;",
        "sum := u;",
    ],
)
def test_broken_rules_of_instances_are_errors(body):
    with pytest.raises((StError, LarkError)):
        using(body).call()


def test_only_inputs_can_be_given():
    with pytest.raises(StError):
        block("").call(y=1.0)
