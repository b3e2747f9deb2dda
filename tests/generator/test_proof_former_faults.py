"""Histories in which a planner block failed once, by numbers that hold as long as they are drawn alike."""

import pytest
from generator.mutants import MACHINES, judged, kinds_of
from generator.planned_machines import FORMER

from gen_profile.planner.design import planner_block
from gen_profile.proof.histories import Histories
from gen_profile.proof.numbering import Numbering


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMER)
def test_a_block_obeys_where_it_once_did_not(name):
    spec = MACHINES[name]
    histories = Histories.of(spec)
    drawn = [Numbering.of(histories, count, seed).history(number) for count, seed, number in FORMER[name]]
    found = [kinds_of(spec, one) for _, one in judged(spec, planner_block(spec).text, histories, drawn)]
    assert found == [set()] * len(drawn)
