"""Histories in which a planner block failed once, and some that are seldom drawn."""

from functools import cache

import pytest
from generator.mutants import MACHINES, judged, kinds_of
from generator.planned_machines import FORMER, SELDOM, histories_apart

from gen_profile.planner.design import planner_block
from gen_profile.proof.histories import Histories

pytestmark = pytest.mark.slow


@cache
def text_of(name):
    return planner_block(MACHINES[name]).text


def kinds_by_history(name, text, last=0):
    spec = MACHINES[name]
    histories = Histories.of(spec)
    drawn = histories_apart(name, histories)[-last:]
    return [kinds_of(spec, one) for _, one in judged(spec, text, histories, drawn)]


@pytest.mark.parametrize("name", sorted(FORMER.keys() | SELDOM))
def test_a_block_obeys_where_it_once_did_not(name):
    assert not any(kinds_by_history(name, text_of(name)))


@pytest.mark.parametrize(
    ("name", "right", "wrong", "fault"),
    [
        (
            "followed",
            "(aActualVelocity[nAxis] + aVelocity[nAxis])",
            "(aActualVelocity[1 - nAxis] + aVelocity[nAxis])",
            "nPromise tells a reason that is none",
        ),
        (
            "followed",
            "(nCommand = cCommandVelocity) AND (aShare[nAxis] <> 0.0)",
            "(nCommand = cCommandVelocity) AND (aShare[nAxis] = 0.0)",
            "bCommandAborted does not tell what became of the command",
        ),
        (
            "tight",
            "aLiveFollowed[nIndex]) <= cLiveDrift[nIndex])",
            "aLiveFollowed[nIndex]) <= 2.0 * cLiveDrift[nIndex])",
            "bPromise is set though it cannot be known",
        ),
    ],
)
def test_a_block_that_is_wrong_there_fails(name, right, wrong, fault):
    assert right in text_of(name)
    [kinds] = kinds_by_history(name, text_of(name).replace(right, wrong), last=1)
    assert fault in kinds
