"""The list of mutants that the proof of the planner block need not kill."""

from generator.mutants import listed, mutants


def test_mutants_that_are_listed_as_equivalent_are_those_of_the_text():
    assert {*listed()} <= {mutant.key for mutant in mutants("")}
    assert all(len(why) > 20 for why in listed().values())
