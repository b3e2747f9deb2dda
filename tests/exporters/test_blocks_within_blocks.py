"""Function blocks within function blocks: what C makes of them, beside the tests' interpreter."""

import random

import numpy as np
import pytest
from lark.exceptions import LarkError
from st_interpreter import StError, block_of

from gen_profile.planner.execution import BlockInstance
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.st_to_c import translate

INNERMOST = """
FUNCTION_BLOCK Counted
VAR_INPUT fStep : LREAL := 0.5; bDown : BOOL; END_VAR
VAR_OUTPUT fCount : LREAL := -1.0; nCalls : DINT; END_VAR
VAR CONSTANT cScale : LREAL := 2.0; END_VAR
nCalls := nCalls + 1;
IF bDown THEN fCount := fCount - cScale * fStep; ELSE fCount := fCount + cScale * fStep; END_IF;
END_FUNCTION_BLOCK
"""
INNER = """
FUNCTION_BLOCK Sorted
VAR_INPUT nTerms : DINT; END_VAR
VAR_OUTPUT fGreatest : LREAL; aEnds : ARRAY [0..1] OF LREAL; nSwaps : DINT; END_VAR
VAR_IN_OUT aTerm : ARRAY [1..4] OF LREAL; aOrder : ARRAY [1..4] OF DINT; END_VAR
VAR i : DINT; j : DINT; k : DINT; fHeld : LREAL; swaps : Counted; END_VAR
VAR CONSTANT cScale : DINT := 1; END_VAR
FOR i := 1 TO nTerms - 1 DO
    FOR j := 1 TO nTerms - i DO
        IF aTerm[j] > aTerm[j + cScale] THEN
            fHeld := aTerm[j]; aTerm[j] := aTerm[j + 1]; aTerm[j + 1] := fHeld;
            k := aOrder[j]; aOrder[j] := aOrder[j + 1]; aOrder[j + 1] := k;
            swaps(fStep := fHeld, bDown := fHeld < 0.0);
        END_IF;
    END_FOR;
END_FOR;
fGreatest := aTerm[nTerms] + swaps.fCount;
nSwaps := swaps.nCalls;
aEnds[0] := aTerm[1];
aEnds[1] := aTerm[nTerms];
END_FUNCTION_BLOCK
"""
OWN = """
FUNCTION_BLOCK Own
VAR_INPUT x : LREAL; y : LREAL; n : DINT; END_VAR
VAR_OUTPUT fOne : LREAL; fTwo : LREAL; nFirst : DINT; nSwaps : DINT; fCount : LREAL; END_VAR
VAR
    one : Sorted; two : Sorted; last : Counted;
    a : ARRAY [1..4] OF LREAL := [1.0, 2.0, 3.0, 4.0]; o : ARRAY [1..4] OF DINT := [1, 2, 3, 4];
    b : ARRAY [1..4] OF LREAL;
END_VAR
VAR CONSTANT cScale : LREAL := -3.0; END_VAR
a[4] := x;
b[2] := y + one.fGreatest;
one(nTerms := n, aTerm := a, aOrder := o);
two(aOrder := o, nTerms := 3, aTerm := b);
last(bDown := one.nSwaps > two.nSwaps);
fOne := one.aEnds[n - n / 2 * 2] * cScale;
fTwo := two.fGreatest - two.aEnds[0];
nFirst := o[1];
nSwaps := one.nSwaps + two.nSwaps;
fCount := last.fCount;
END_FUNCTION_BLOCK
"""
TEXT = INNERMOST + INNER + OWN
CALL = "one(nTerms := n, aTerm := a, aOrder := o);"
REFUSED = [
    "one(nTerms := n, aTerm := a);",  # an array is missing
    "one(nTerms := n, aTerm := a, aOrder := b);",  # of another type
    "one(nTerms := x, aTerm := a, aOrder := o);",
    "one(nSwaps := n, aTerm := a, aOrder := o);",  # an output
    "one(k := n, aTerm := a, aOrder := o);",  # its own
    "other(nTerms := n, aTerm := a, aOrder := o);",
    "a(nTerms := n);",
    "fOne := one.nSwaps;",
    "fOne := one.aEnds;",
    "fOne := one;",
    "one.nTerms := 3;",
]


def test_c_and_the_interpreter_do_the_same_with_blocks_within_blocks():
    in_c, oracle = BlockInstance(TEXT), block_of(TEXT)
    draw = random.Random(3)
    rows = [(draw.uniform(-5, 5), draw.uniform(-5, 5), draw.randint(2, 4)) for _ in range(200)]
    found = in_c.call(np.array(rows))
    for row, issued in zip(rows, found, strict=True):
        due = oracle.call(**dict(zip("xyn", row, strict=True)))
        assert [float(value) for value in due.values()] == issued.tolist()
    assert len(np.unique(found, axis=0)) == len(rows)


def test_each_instance_has_its_own_memory_and_an_array_is_the_caller_s():
    issued = BlockInstance(TEXT).call(np.array([[-1.0, 5.0, 4.0]] * 2))
    # 1, 2, 3, -1 take three swaps, and 0, 5, 0 one; the sorted array stays, so that -1 again takes none
    assert issued[0, 2:4].tolist() == [4.0, 4.0]
    assert issued[1, 3] > issued[0, 3]


@pytest.mark.parametrize("statement", REFUSED)
def test_both_refuse_what_no_call_takes(statement):
    text = TEXT.replace(CALL, statement)
    with pytest.raises(ExportError, match=r"^The text is no function block .*: line \d+.*\.$"):
        translate(text)
    with pytest.raises((StError, LarkError)):
        block_of(text)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("one : Sorted;", "one : Missing;", "Missing is neither a type nor a block"),
        ("two : Sorted;", "two : Own;", "Own is neither a type nor a block"),
        ("FUNCTION_BLOCK Sorted", "FUNCTION_BLOCK counted", "counted is declared twice"),
        ("VAR_INPUT x : LREAL;", "VAR_INPUT last2 : Counted; x : LREAL;", "declared in VAR"),
        ("aTerm := a, aOrder := o", "aTerm := c, aOrder := o", "c is VAR CONSTANT, which is not written"),
        ("aTerm := a, aOrder := o", "aTerm := a, aTerm := a", "takes no aTerm, or takes it once"),
        ("a[4] := x;", "a[4] := one.fHeld;", "one has no output fHeld"),
        ("a[4] := x;", "a := b;", "not a whole array"),
        ("VAR_INPUT x", "VAR_IN_OUT z : ARRAY [0..1] OF LREAL; END_VAR VAR_INPUT x", "nothing hands z"),
        ("VAR_INPUT nTerms", "VAR_IN_OUT f : LREAL; END_VAR VAR_INPUT nTerms", "f is VAR_IN_OUT"),
    ],
)  # fmt: skip
def test_what_a_declaration_or_a_call_cannot_be_is_said(old, new, words):
    constants = "VAR CONSTANT cScale : LREAL := -3.0;"
    text = TEXT.replace(constants, f"{constants} c : ARRAY [1..4] OF LREAL := [0.0, 1.0, 2.0, 3.0];")
    assert old in text
    with pytest.raises(ExportError, match=words):
        translate(text.replace(old, new))


def test_a_fault_within_an_instance_ends_the_block():
    with pytest.raises(ExportError, match="goes beyond the end of an array"):
        BlockInstance(TEXT).call(np.array([[1.0, 1.0, 5.0]]))
    with pytest.raises(StError, match="index"):
        block_of(TEXT).call(x=1.0, y=1.0, n=5)


def test_constants_of_the_same_name_are_each_block_s_own():
    source = translate(TEXT).source
    assert "static const double Counted_cScale = 2.0;" in source
    assert "static const int32_t Sorted_cScale = 1;" in source
    assert "static const double cScale = -3.0;" in source


def test_a_text_is_taken_apart_and_put_together_where_it_is_a_planner_s():
    text = TEXT.replace("FUNCTION_BLOCK Own", "(* (* END_FUNCTION_BLOCK *)\nFUNCTION_BLOCK Own_planner")
    source = parse_function_block(text)
    assert [one.name for one in source.within] == ["Counted", "Sorted"]
    assert "END_FUNCTION_BLOCK" in source.header
    again = parse_function_block(source.text())
    assert again.program() == source.program()
    assert translate(again.text()).inputs == translate(text).inputs
    altered = parse_function_block(text.replace("cScale : DINT := 1", "cScale : DINT := 2"))
    assert altered.program() != source.program()


@pytest.mark.parametrize("text", [TEXT, INNER + INNERMOST])
def test_other_texts_are_of_one_block(text):
    assert parse_function_block(text).within == ()
