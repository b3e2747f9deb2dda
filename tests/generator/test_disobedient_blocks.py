"""Blocks that disobey, each in a way of its own, fail their proof."""

import re

import attrs
import numpy as np
import pytest
from generator.mutants import judged, kinds_of
from generator.planned_machines import BAY

from gen_profile.assurance.proof.habits import Change
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.obedience import WORDS
from gen_profile.assurance.proof.orders import POSITION
from gen_profile.assurance.proof.verdict import kind_of
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec

pytestmark = pytest.mark.slow

NO_NUMBERS = ("1.0E+300 * 1.0E+300", "0.0 * (1.0E+300 * 1.0E+300)", "1.0E+200")
OWN = (
    "bExecute",
    "bVelocity",
    "bStop",
    "rOverride",
    "fTarget",
    "fVelocityLimit",
    "fVelocityCommand",
)  # what the block obeys
WRONG = {  # what a block does more before and after all that it does
    "half": ("fTarget := 0.5 * fTarget;", ""),
    "idle": ("bExecute := FALSE; bVelocity := FALSE;", ""),
    "late": ("IF bStop THEN nSince := nSince + 1; ELSE nSince := 0; END_IF; bStop := nSince > 1200;", ""),
    "done": ("", "bDone := bDone OR ((nCommand = 1) AND (ABS(fDistanceToGo) < 0.01));"),
    "fast": ("rOverride := 1.0; fVelocityLimit := 0.0;", ""),
    **{
        value: ("nSince := nSince + 1;", f"IF nSince > 500 THEN fPosition := {value}; END_IF;")
        for value in NO_NUMBERS
    },
}


@pytest.fixture(scope="module")
def shown():
    """Tell kinds of faults, history by history, of a block that does a thing wrong, or nothing.

    One block does any of it, as an input tells: to compile each would take most of the time.
    """
    spec = parse_spec(BAY)
    histories = Histories.of(spec)
    drawn = [histories.history(choices) for choices in histories.drawn(12, seed=2)]
    text = disobedient(planner_block(spec).text)

    def kinds_by_history(wrong=None, count=None):
        number = 0.0 if wrong is None else 1.0 + list(WRONG).index(wrong)
        change = Change(time=0.0, lasts=np.inf, inputs={"fWrong": number})
        given = [attrs.evolve(one, changes=(change, *one.changes)) for one in drawn[:count]]
        return [kinds_of(spec, one) for _, one in judged(spec, text, histories, given)]

    return kinds_by_history


@pytest.fixture(scope="module")
def sound(shown):
    return shown()


def disobedient(text):
    """A block that does what is wrong by a number, inputs being those of its own."""
    return around(text, WRONG.values())


def around(text, wrong, variables=""):
    """A block around which each of some ways to do wrong, before and after it, is chosen by a number."""
    at = text.rindex("\nFUNCTION_BLOCK ")  # others are within it
    head, _, body = text[at:].rpartition("END_VAR\n")
    before, after = (
        "\n".join(f"IF fWrong = {k}.0 THEN {one} END_IF;" for k, one in enumerate(parts, start=1) if one)
        for parts in zip(*wrong, strict=True)
    )
    declared, copied = f"nSince : DINT; {variables} ", ""
    for name in OWN:
        kind = "BOOL" if name[0] == "b" else "LREAL"
        declared, copied = declared + f"{name}Own : {kind}; ", copied + f"{name}Own := {name}; "
        before, body = (re.sub(rf"\b{name}\b", f"{name}Own", part) for part in (before, body))
    body = body.replace("END_FUNCTION_BLOCK", f"{after}\nEND_FUNCTION_BLOCK")
    head = head.replace("\nVAR_INPUT\n", "\nVAR_INPUT\n    fWrong : LREAL;\n", 1)
    head = head.replace("\nVAR\n", f"\nVAR\n    {declared}\n", 1)
    return f"{text[:at]}{head}END_VAR\n{copied}{before}\n{body}"


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        ("half", f"distance {POSITION}"),
        ("idle", "idle"),
        ("late", "ends"),
        ("done", "done"),
        ("fast", "fast"),
    ],
)
def test_a_block_that_disobeys_fails(shown, sound, wrong, what):
    shown_only_then = set().union(*(one - known for one, known in zip(shown(wrong), sound, strict=True)))
    assert {kind_of(WORDS[kind]) for kind in what.split()} <= shown_only_then


@pytest.mark.parametrize("value", NO_NUMBERS)
def test_a_setpoint_that_is_no_number_is_a_verdict(shown, value):
    assert shown(value, 1) == [{"a setpoint is no number"}]
