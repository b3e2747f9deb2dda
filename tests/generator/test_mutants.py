"""Mutants of the planner block: changed constants."""

from generator.mutants import altered, mutants

CONSTANTS = "\tcRoom : LREAL := 0.5; (* m *)\n\tcGain : ARRAY [0..2] OF LREAL := [1.0, 2.0, 3.0];\n"


def test_each_constant_of_a_block_is_changed_by_each_factor():
    changed = [one for one in mutants(CONSTANTS) if one.way == "constant"]
    assert {(one.part, one.line) for one in changed} == {("cRoom", 0), ("cGain", 0), ("cGain", 1)}
    assert len({altered(CONSTANTS, one) for one in changed}) == 12
    assert "cRoom : LREAL := 1.0; (* m *)" in {*map(str.strip, altered(CONSTANTS, changed[3]).split("\n"))}
