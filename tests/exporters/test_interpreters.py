"""Structured Text translated to C, and the tests' interpreter: two readings of the language that agree.

Each is also held to values that follow from IEC 61131-3, or from Python's own arithmetic.
"""

import os

import pytest
from exporters.interpreters import BATCH, CYCLES, bits, compiled, differences, interpreted
from exporters.st_programs import DECLARATIONS, FAULT, INPUTS, SHOWN, draw
from st_interpreter import FunctionBlock, StError

from gen_profile.planner import execution
from gen_profile.support.errors import ExportError
from gen_profile_exporters.st_to_c import translate

COUNT = int(os.environ.get("PROGRAMS", "200"))
LAST = DECLARATIONS.count("\n") + 1  # line, of a body
GIVEN = {"which": 0} | dict(zip(INPUTS, (2.5, -0.5, 7, -2, True, False), strict=True))
LEAST = "(-2147483647 - 1)"

# x = 2.5, z = -0.5, m = 7, n = -2, p, not q
VALUES = [
    ("y := - -x;", "y", 2.5),
    ("y := x - -x;", "y", 5.0),
    ("y := + +x - - -1.0;", "y", 1.5),
    ("y := -(-x);", "y", 2.5),
    ("k := - -m;", "k", 7),
    ("k := ABS(n) + ABS(-m);", "k", 9),
    ("k := ABS(n - m) / 2;", "k", 4),
    ("k := 010 + 007;", "k", 17),
    ("k := 07 - 3 - 2;", "k", 2),
    ("k := m / n * 2;", "k", -6),
    ("k := n / m;", "k", 0),
    ("k := LREAL_TO_DINT(x) - LREAL_TO_DINT(z) + LREAL_TO_DINT(x + 1.0);", "k", 6),
    ("k := LREAL_TO_DINT(2147483647.4);", "k", 2147483647),
    ("b := NOT p OR p AND q OR NOT q;", "b", 1),
    ("b := NOT p = q;", "b", 1),
    ("b := 3.0 > x = p;", "b", 1),
    ("b := p = q = q;", "b", 1),
    ("b := (x - x) / (x - x + 1.0) <> 0.0;", "b", 0),
    ("FOR i := 3 TO 2 DO k := 9; END_FOR; k := i;", "k", 3),
    ("FOR i := 1 TO 4 DO k := k + i; END_FOR; k := 100 * i + k;", "k", 509),
    ("i := 2; FOR i := 0 TO i DO k := k + 1; END_FOR;", "k", 2),
    ("FOR i := 0 TO 1 DO FOR j := 0 TO 2 DO k := k + j; END_FOR; END_FOR;", "k", 5),
    ("CASE m OF 07: k := 1; 010: k := 2; END_CASE;", "k", 1),
    ("t[2] := 5; k := t[t[2] - 3] - t[0] + t[1];", "k", -5),
    ("y := v[0] + v[1] - w[1];", "y", -4.0),
]
FAULTS = [
    "k := m / (m - 7);",
    "y := x / (x - 2.5);",
    "y := SQRT(z);",
    "k := LREAL_TO_DINT(2147483647.5);",
    "k := LREAL_TO_DINT(1.0E300 * 1.0E300 * 0.0);",
    "k := 2147483647 + m - m;",
    f"k := -{LEAST};",
    f"k := ABS({LEAST});",
    f"k := {LEAST} / -1;",
    "k := 65536 * 65536 / 65536;",
    "k := t[n];",
    "t[3] := 1;",
    "b := (n >= 0) AND (t[n] > 0);",
    "b := p OR (t[n] > 0);",
    "FOR i := 2147483647 TO 2147483647 DO k := 1; END_FOR;",
    "WHILE p DO k := 1; END_WHILE;",
    "FOR i := 0 TO 2147483646 DO k := 1; END_FOR;",
]
REFUSED = [
    "y := 1;",
    "y := ABS(m);",
    "y := SQRT(m);",
    "k := LREAL_TO_DINT(m);",
    "y := DINT_TO_LREAL(x);",
    "k := ABS(p);",
    "y := x + m;",
    "y := -p;",
    "b := NOT m;",
    "b := m AND n;",
    "b := p + q;",
    "b := p < q;",
    "b := x;",
    "k := t[x];",
    "k := t[p];",
    "k := t;",
    "y := x[0];",
    "k := unknown;",
    "k := 2147483648;",
    "y := 1.0E400;",
    "IF m THEN k := 1; END_IF;",
    "WHILE x DO k := 1; END_WHILE;",
    "CASE x OF 1: k := 1; END_CASE;",
    "CASE p OF 1: k := 1; END_CASE;",
    "CASE m OF 1: k := 1; 2, 01: k := 2; END_CASE;",
    "FOR y := 0 TO 1 DO k := 1; END_FOR;",
    "FOR i := 0.0 TO 1.0 DO k := 1; END_FOR;",
    "FOR m := 0 TO 1 DO k := 1; END_FOR;",
    "FOR i := 0 TO 1 DO i := 3; END_FOR;",
    "FOR i := 0 TO 1 DO IF p THEN FOR I := 0 TO 1 DO k := 1; END_FOR; END_IF; END_FOR;",
    "x := 1.0;",
    "c := 1.0;",
    "w[0] := 1.0;",
    "k := m MOD n;",
]
BROKEN_DECLARATIONS = [
    "VAR a : BOOL := 1; END_VAR",
    "VAR a : BOOL := -TRUE; END_VAR",
    "VAR a : LREAL := 1; END_VAR",
    "VAR a : LREAL := 1.0E999; END_VAR",
    "VAR a : DINT := 1.5; END_VAR",
    "VAR a : DINT := 2147483648; END_VAR",
    "VAR a : DINT; A : LREAL; END_VAR",
    "VAR a : ARRAY [0..2] OF DINT := [1, 2]; END_VAR",
    "VAR a : ARRAY [0..1] OF DINT := 1; END_VAR",
    "VAR a : DINT := [1]; END_VAR",
]


def text_of(body, number=0):
    return f"FUNCTION_BLOCK P{number}{DECLARATIONS}{body} END_FUNCTION_BLOCK"


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    """What each body shows at first, all compiled at once."""
    bodies = [*(body for body, *_ in VALUES), *FAULTS]
    run = compiled(
        [translate(text_of(body, k)) for k, body in enumerate(bodies)], tmp_path_factory.mktemp("c")
    )
    return {body: run(k, [GIVEN] * CYCLES)[0] for k, body in enumerate(bodies)}


@pytest.mark.slow
@pytest.mark.parametrize(("body", "name", "value"), VALUES)
def test_both_know_the_value(in_c, body, name, value):
    assert in_c[body][[*SHOWN].index(name)] == value
    assert bits(in_c[body]) == bits(interpreted(text_of(body), [GIVEN])[0])


@pytest.mark.slow
@pytest.mark.parametrize("body", FAULTS)
def test_both_end_where_the_language_defines_no_value(in_c, body):
    assert in_c[body] == interpreted(text_of(body), [GIVEN])[0] == FAULT


@pytest.mark.parametrize("body", REFUSED)
def test_both_refuse_what_the_language_does_not_have(body):
    with pytest.raises(ExportError, match=rf"^The text is no function block .*: line {LAST}[:,].*\.$"):
        translate(text_of(body))
    assert interpreted(text_of(body), [GIVEN]) == "refused"


@pytest.mark.parametrize("declaration", BROKEN_DECLARATIONS)
def test_both_refuse_declarations_that_do_not_fit(declaration):
    text = f"FUNCTION_BLOCK x {declaration} END_FUNCTION_BLOCK"
    with pytest.raises(ExportError, match=r": line 1: .*\.$"):
        translate(text)
    with pytest.raises(StError):
        FunctionBlock(text)


@pytest.mark.parametrize(
    ("declaration", "words"),
    [
        ("VAR CONSTANT a : LREAL; END_VAR", "a has not as many initial values as it takes"),
        ("VAR_OUTPUT a : ARRAY [2..1] OF LREAL; END_VAR", "a has no elements"),
        ("VAR double : LREAL; END_VAR", "double is a word of C; name it differently"),
    ],
)
def test_what_c_cannot_take_is_refused(declaration, words):
    with pytest.raises(ExportError, match=words):
        translate(f"FUNCTION_BLOCK x {declaration} END_FUNCTION_BLOCK")


def test_a_number_of_any_length_is_refused_and_leading_zeros_count_for_nothing():
    with pytest.raises(ExportError, match="no DINT is as great as 9999"):
        translate(text_of(f"k := {'9' * 5000};"))
    assert translate(text_of(f"k := {'0' * 5000}7;")) == translate(text_of("k := 7;"))


def test_a_translation_is_kept_until_what_makes_it_changes(tmp_path, monkeypatch):
    text, made = text_of("k := 7;"), []
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(tmp_path))
    monkeypatch.setattr(execution, "translate", lambda one: made.append(one) or translate(one))
    for translator, count in ((execution._translator(), 1), (execution._translator(), 1), ((b"new",), 2)):
        monkeypatch.setattr(execution, "_translator", lambda known=translator: known)
        execution.translated.cache_clear()
        assert execution.translated(text) == translate(text)
        assert len(made) == count


def test_nesting_without_end_is_refused_in_a_sentence():
    with pytest.raises(ExportError, match="nested too deeply"):
        translate(text_of(f"y := {'(' * 3000}x{')' * 3000};"))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, COUNT, BATCH))
def test_random_programs_do_the_same(first):
    ends, found = differences([draw(f"suite-{k}", CYCLES) for k in range(first, min(COUNT, first + BATCH))])
    assert not found
    assert min(ends.values()) > 10 and len(ends) == 3
